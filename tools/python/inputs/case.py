"""What every archive holds, and how the manifest tells of one."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np

DIMS = (7, 5, 3)
FRAMES = 4
SPACING = (0.5, 1.0, 2.0)
ORIGIN = (-1.0, 10.0, 100.0)
STEP = 0.5
TIMES = tuple(STEP * t for t in range(FRAMES))
NAME = "density"
UNITS = "kg m-3"
MAY = {"may_refuse": True}  # read right, or refused in words that help

# Places, t x y z, of samples that are missing in the cases that have such.
MISSING = [(0, 0, 0, 0), (1, 6, 4, 2), (3, 3, 2, 1)]
def dtype(sample: str, order: str = "<") -> np.dtype:
    return np.dtype(f"{order}{sample[0]}{int(sample[1:]) // 8}")


def numbers(t: int, dims=DIMS) -> np.ndarray:
    """i + t in frame t, [z, y, x]."""
    return np.arange(np.prod(dims), dtype="i8").reshape(dims[::-1]) + t


def frame(sample: str = "f32", t: int = 0, order: str = "<", dims=DIMS) -> np.ndarray:
    """Samples of frame t, [z, y, x]."""
    whole = numbers(t, dims)
    return (whole / 4 - 3 if sample[0] == "f" else whole).astype(dtype(sample, order))


def frames(sample: str = "f32", order: str = "<", dims=DIMS) -> np.ndarray:
    """Samples of all frames, [t, z, y, x]."""
    return np.stack([frame(sample, t, order, dims) for t in range(FRAMES)])


def without(samples: np.ndarray, value: float) -> np.ndarray:
    """The samples [t, z, y, x] with a value where they are missing."""
    for t, x, y, z in MISSING:
        samples[t, z, y, x] = value
    return samples


def axes() -> list[np.ndarray]:
    """Coordinates along x, y, z."""
    return [o + s * np.arange(n) for o, s, n in zip(ORIGIN, SPACING, DIMS)]


def by(package: str) -> str:
    return f"{package} {version(package)}"


def fresh(folder: Path, name: str) -> Path:
    """An empty folder of that name."""
    path = folder / name
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(parents=True)
    return path


@dataclass
class Case:
    """One input; `path` is what a user would name."""

    path: str
    by: str
    note: str
    sample: str = "f32"
    variable: str | None = None
    frames: int = FRAMES
    dims: tuple = DIMS
    spacing: tuple | None = SPACING
    origin: tuple | None = ORIGIN
    times: tuple = ()
    units: str | None = None
    missing: list = field(default_factory=list)
    more: dict = field(default_factory=dict)

    def record(self) -> dict:
        found = dict(vars(self))
        more, by_, note = found.pop("more"), found.pop("by"), found.pop("note")
        found["values"] = "float" if self.sample[0] == "f" else "integer"
        return found | more | {"by": by_, "note": note}


@dataclass
class Refused:
    """One input that no reader can take as it stands."""

    path: str
    by: str
    note: str
    variable: str | None = None

    def record(self) -> dict:
        return {"path": self.path, "variable": self.variable, "refused": True, "by": self.by, "note": self.note}
