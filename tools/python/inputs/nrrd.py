"""NRRD by pynrrd, and headers of text over numpy's bytes."""

import gzip
import re
from pathlib import Path

import nrrd
import numpy as np

from .case import DIMS, FRAMES, MAY, ORIGIN, SPACING, STEP, TIMES, Case, Refused, by, frame, frames

FOLDER = "nrrd"
PYNRRD, TEXT = by("pynrrd"), "text and " + by("numpy")
DIRECTIONS = np.diag(SPACING)
SPACE = {"space dimension": 3, "space directions": DIRECTIONS, "space origin": np.array(ORIGIN)}
WHOLE = {
    "space dimension": 3,
    "space directions": np.vstack([DIRECTIONS, [np.nan] * 3]),
    "space origin": np.array(ORIGIN),
    "kinds": ["domain"] * 3 + ["time"],
    "spacings": [np.nan] * 3 + [STEP],
}


def write(folder: Path) -> list:
    return [
        *types(folder),
        *encodings(folder),
        *whole(folder),
        *time_first(folder),
        *placed(folder),
        series(folder),
        *by_text(folder),
        *refused(folder),
    ]


def save(path: Path, samples: np.ndarray, header: dict, **settings) -> None:
    """Writes samples, slowest axis first."""
    settings = {"compression_level": 9, "index_order": "C"} | settings
    nrrd.write(str(path), samples, header, **settings)
    without_date = re.sub(rb"# on [0-9 :-]{19}\(", rb"# on 2000-01-01 00:00:00(", path.read_bytes(), count=1)
    path.write_bytes(without_date)


def types(folder: Path) -> list:
    kinds = ("u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64")
    for sample in kinds:
        save(folder / f"{sample}.nrrd", frame(sample), SPACE | {"encoding": "raw"})
    return [Case(f"{s}.nrrd", PYNRRD, "raw, with space directions and origin", s, frames=1) for s in kinds]


def encodings(folder: Path) -> list:
    kinds = [
        ("gzip.nrrd", "gzip", "as pynrrd writes by default"),
        ("bzip2.nrrd", "bzip2", "bzip2"),
        ("ascii.nrrd", "ascii", "text"),
        ("detached.nhdr", "raw", "samples in a .raw"),
        ("detached_gzip.nhdr", "gzip", "samples in a .raw.gz"),
    ]
    seldom = {"bzip2", "ascii"}
    for name, encoding, _ in kinds:
        save(folder / name, frame(), SPACE | {"encoding": encoding})
    save(folder / "big_endian.nrrd", frame("f32", order=">"), SPACE | {"encoding": "raw"})
    return [
        *(Case(name, PYNRRD, note, frames=1, more=MAY if kind in seldom else {}) for name, kind, note in kinds),
        Case("big_endian.nrrd", PYNRRD, "endian: big", frames=1),
    ]


def whole(folder: Path) -> list:
    save(folder / "4d.nrrd", frames(), WHOLE | {"encoding": "raw"})
    save(folder / "4d_gzip.nrrd", frames(), WHOLE | {"encoding": "gzip"})
    list_ = {name: value for name, value in WHOLE.items() if name != "spacings"}
    save(folder / "4d_list.nrrd", frames(), list_ | {"kinds": ["domain"] * 3 + ["list"], "encoding": "raw"})
    return [
        Case("4d.nrrd", PYNRRD, "kinds: domain domain domain time; spacings: nan nan nan 0.5", times=TIMES),
        Case("4d_gzip.nrrd", PYNRRD, "the same, compressed", times=TIMES),
        Case("4d_list.nrrd", PYNRRD, "kinds: domain domain domain list, without times"),
    ]


def time_first(folder: Path) -> list:
    """Frames vary fastest, as in what 3D Slicer writes of sequences."""
    header = {
        "space": "left-posterior-superior",
        "space directions": np.vstack([[np.nan] * 3, DIRECTIONS]),
        "space origin": np.array(ORIGIN),
    }
    samples = np.ascontiguousarray(np.moveaxis(frames("i16"), 0, -1))
    for kind, encoding in (("list", "gzip"), ("time", "raw")):
        settings = {"kinds": [kind] + ["domain"] * 3, "encoding": encoding}
        save(folder / f"4d_{kind}_first.nrrd", samples, header | settings)
    return [
        Case("4d_list_first.nrrd", PYNRRD, "kinds: list domain domain domain, gzip", "i16", more=MAY),
        Case("4d_time_first.nrrd", PYNRRD, "kinds: time domain domain domain, raw", "i16", more=MAY),
    ]


def placed(folder: Path) -> list:
    save(folder / "spacings.nrrd", frame(), {"spacings": list(SPACING), "encoding": "raw"})
    mins = {"spacings": list(SPACING), "axis mins": list(ORIGIN), "encoding": "raw"}
    save(folder / "axis_mins.nrrd", frame(), mins)
    save(folder / "bare.nrrd", frame(), {"encoding": "raw"})
    return [
        Case("spacings.nrrd", PYNRRD, "spacings alone", frames=1, origin=None),
        Case("axis_mins.nrrd", PYNRRD, "spacings and axis mins", frames=1),
        Case("bare.nrrd", PYNRRD, "sizes alone", frames=1, spacing=None, origin=None),
    ]


def series(folder: Path) -> Case:
    (folder / "series").mkdir()
    for t, samples in enumerate(frames("u16")):
        save(folder / f"series/density_{t}.nrrd", samples, SPACE | {"encoding": "gzip" if t % 2 else "raw"})
    return Case("series", PYNRRD, "a folder of frames; every second one is compressed", "u16")


def header(whole: bool, encoding: str, data: str) -> bytes:
    sizes = " ".join(str(n) for n in (*DIMS, FRAMES)[: 3 + whole])
    spacings = " ".join(str(n) for n in (*SPACING, STEP)[: 3 + whole])
    return (
        f"NRRD0004\ntype: float\ndimension: {3 + whole}\nsizes: {sizes}\nendian: little\n"
        f"encoding: {encoding}\nspacings: {spacings}\ndata file: {data}\n"
    ).encode()


def names(pattern: str, count: int) -> bytes:
    return "".join(f"parts/{pattern.format(i)}\n" for i in range(count)).encode()


def by_text(folder: Path) -> list:
    (folder / "parts").mkdir()
    for t, samples in enumerate(frames()):
        (folder / f"parts/volume_{t}.raw").write_bytes(samples.tobytes())
        (folder / f"parts/volume_{t}.raw.gz").write_bytes(gzip.compress(samples.tobytes(), mtime=0))
    for z, plane in enumerate(frame()):
        (folder / f"parts/slice_{z}.raw").write_bytes(plane.tobytes())
    (folder / "list.nhdr").write_bytes(header(True, "raw", "LIST") + names("volume_{}.raw", FRAMES))
    (folder / "list_gzip.nhdr").write_bytes(header(True, "gzip", "LIST") + names("volume_{}.raw.gz", FRAMES))
    (folder / "list_of_slices.nhdr").write_bytes(header(False, "raw", "LIST 2") + names("slice_{}.raw", DIMS[2]))
    (folder / "pattern.nhdr").write_bytes(header(True, "raw", "parts/volume_%d.raw 0 3 1"))
    (folder / "pattern_gzip.nhdr").write_bytes(header(True, "gzip", "parts/volume_%d.raw.gz 0 3 1"))
    return [
        Case("list.nhdr", TEXT, "data file: LIST, a file for each frame", origin=None, times=TIMES),
        Case("list_gzip.nhdr", TEXT, "data file: LIST, a .raw.gz for each frame", origin=None, times=TIMES),
        Case("list_of_slices.nhdr", TEXT, "data file: LIST 2, a file for each slice", frames=1, origin=None, more=MAY),
        Case("pattern.nhdr", TEXT, "data file: volume_%d.raw 0 3 1", origin=None, times=TIMES),
        Case("pattern_gzip.nhdr", TEXT, "data file: volume_%d.raw.gz 0 3 1", origin=None, times=TIMES),
    ]


def refused(folder: Path) -> list:
    vector = np.stack([frame(), frame() + 1000, frame() + 2000], axis=-1)
    kinds = {"kinds": ["vector"] + ["domain"] * 3, "encoding": "raw"}
    save(folder / "refused_vector.nrrd", vector, kinds)
    save(folder / "i64.nrrd", frame("i32").astype("i8"), {"encoding": "raw"})
    return [
        Refused("refused_vector.nrrd", PYNRRD, "kinds: vector domain domain domain; three components"),
        Case("i64.nrrd", PYNRRD, "type: int64", "i32", frames=1, spacing=None, origin=None),
    ]
