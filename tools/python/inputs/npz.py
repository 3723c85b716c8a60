"""NPZ by NumPy: zip archives of arrays, as they are or compressed."""

import zipfile
from pathlib import Path

import numpy as np

from .case import FRAMES, NAME, Case, Refused, by, frame, frames

FOLDER = "npz"
NUMPY = by("numpy")
BARE = {"spacing": None, "origin": None}
STEPS = {f"{NAME}_{t}": frame("f32", t) for t in range(FRAMES)}


def write(folder: Path) -> list:
    return [*whole(folder), *steps(folder), *several(folder), *refused(folder)]


def whole(folder: Path) -> list:
    np.savez(folder / "all.npz", **{NAME: frames("u16")})
    np.savez_compressed(folder / "all_compressed.npz", **{NAME: frames("f64", order=">")})
    fortran = np.asfortranarray(frames("i16"))
    np.savez(folder / "fortran.npz", **{NAME: fortran})
    np.savez_compressed(folder / "fortran_compressed.npz", **{NAME: fortran})
    np.savez(folder / "i64.npz", **{NAME: frames("i32").astype("i8")})
    return [
        Case("all.npz", NUMPY, "one array of all frames", "u16", **BARE),
        Case("all_compressed.npz", NUMPY, "one array of all frames, compressed, big-endian", "f64", **BARE),
        Case("fortran.npz", NUMPY, "Fortran order", "i16", **BARE),
        Case("fortran_compressed.npz", NUMPY, "Fortran order, compressed", "i16", **BARE),
        Case("i64.npz", NUMPY, "int64", "i32", **BARE),
    ]


def steps(folder: Path) -> list:
    np.savez(folder / "steps.npz", **STEPS)
    np.savez_compressed(folder / "steps_compressed.npz", **STEPS)
    np.savez(folder / "unnamed.npz", *STEPS.values())
    np.savez(folder / "one.npz", frame())
    return [
        Case("steps.npz", NUMPY, "an array for each frame", **BARE),
        Case("steps_compressed.npz", NUMPY, "an array for each frame, compressed", **BARE),
        Case("unnamed.npz", NUMPY, "arrays without names, one for each frame", **BARE),
        Case("one.npz", NUMPY, "one frame", frames=1, **BARE),
    ]


def several(folder: Path) -> list:
    np.savez(folder / "several.npz", time=np.arange(FRAMES), other=frames() + 1000, **STEPS)
    note = "times, an array of all frames, and an array for each frame"
    return [
        Case("several.npz", NUMPY, note, variable=NAME, **BARE),
        Case("several.npz", NUMPY, note, variable=f"{NAME}_0", frames=1, **BARE),
        Refused("several.npz", NUMPY, note + "; no variable is named"),
    ]


def refused(folder: Path) -> list:
    np.savez(folder / "refused_plane.npz", **{NAME: frame()[0]})
    np.savez(folder / "steps_with_gap.npz", **{name: a for name, a in STEPS.items() if name[-1] != "1"})
    (folder / "steps_with_gap.npz").rename(folder / "refused_gap.npz")
    with zipfile.ZipFile(folder / "refused_bzip2.npz", "w", zipfile.ZIP_BZIP2) as archive:
        with archive.open(f"{NAME}.npy", "w") as file:
            np.save(file, frame())
    return [
        Refused("refused_plane.npz", NUMPY, "two dimensions"),
        Refused("refused_gap.npz", NUMPY, "frames 0, 2, 3"),
        Refused("refused_bzip2.npz", by("numpy") + " in Python's zipfile", "bzip2"),
    ]
