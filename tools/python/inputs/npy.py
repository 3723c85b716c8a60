"""NPY by NumPy: every version, byte order, order of axes and type; and headers that no reader takes."""

from pathlib import Path

import numpy as np

from .case import Case, Refused, by, frame, frames

FOLDER = "npy"
NUMPY = by("numpy")
BARE = {"spacing": None, "origin": None}
TYPES = ("u8", "i8", "u16", "i16", "u32", "i32", "f16", "f32", "f64")


def write(folder: Path) -> list:
    return [*types(folder), *orders(folder), *versions(folder), series(folder), *refused(folder)]


def save(path: Path, samples: np.ndarray, version: tuple[int, int] | None = None) -> None:
    with path.open("wb") as file:
        np.lib.format.write_array(file, samples, version=version, allow_pickle=True)


def types(folder: Path) -> list:
    for sample in TYPES:
        save(folder / f"{sample}.npy", frames(sample))
    return [Case(f"{sample}.npy", NUMPY, "t, z, y, x", sample, **BARE) for sample in TYPES]


def orders(folder: Path) -> list:
    save(folder / "one_frame.npy", frame())
    save(folder / "i64.npy", frame("i32").astype("i8"))
    save(folder / "big_endian.npy", frames("i16", order=">"))
    save(folder / "fortran.npy", np.asfortranarray(frames("u16")))
    save(folder / "fortran_big_endian.npy", np.asfortranarray(frames("f64", order=">")))
    return [
        Case("one_frame.npy", NUMPY, "z, y, x", frames=1, **BARE),
        Case("i64.npy", NUMPY, "int64", "i32", frames=1, **BARE),
        Case("big_endian.npy", NUMPY, "big-endian", "i16", **BARE),
        Case("fortran.npy", NUMPY, "Fortran order", "u16", **BARE),
        Case("fortran_big_endian.npy", NUMPY, "Fortran order, big-endian", "f64", **BARE),
    ]


def versions(folder: Path) -> list:
    for major in (2, 3):
        save(folder / f"version_{major}.npy", frames(), (major, 0))
    return [Case(f"version_{major}.npy", NUMPY, f"version {major}.0", **BARE) for major in (2, 3)]


def series(folder: Path) -> Case:
    (folder / "series").mkdir()
    for t, samples in enumerate(frames("u16")):
        save(folder / f"series/density_{t}.npy", samples)
    return Case("series", NUMPY, "a folder of frames", "u16", **BARE)


def refused(folder: Path) -> list:
    fields = np.zeros((2, 2, 2), dtype=[("Dichte, é", "<f4"), ("[v']", "<i2", (3,))])
    kinds = [
        ("refused_bool.npy", frame("u8") > 3, "bool"),
        ("refused_complex.npy", frame().astype("c8"), "complex64"),
        ("refused_text.npy", np.full((2, 2, 2), "abc"), "text"),
        ("refused_objects.npy", np.full((2, 2, 2), None), "pickled objects"),
        ("refused_fields.npy", fields, "a structured type, with names of fields in version 3.0"),
        ("refused_plane.npy", frame()[0], "two dimensions"),
        ("refused_scalar.npy", frame()[0, 0, 0], "no dimension"),
    ]
    for name, samples, _ in kinds:
        save(folder / name, np.asarray(samples))
    return [Refused(name, NUMPY, note) for name, _, note in kinds]
