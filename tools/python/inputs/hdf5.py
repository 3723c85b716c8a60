"""HDF5 by h5py: what simulations write without a convention, and openPMD."""

from pathlib import Path

import h5py
import numpy as np

from . import hdf5_kinds
from .case import FRAMES, NAME, ORIGIN, SPACING, STEP, TIMES, UNITS, Case, Refused, axes, by, frame, frames
from .hdf5_kinds import group

FOLDER = "hdf5"
H5PY = by("h5py")
CHUNKS = (2, 2, 3, 4)
SHUFFLED = {"compression": "gzip", "shuffle": True}
SMALL = ("v110", "v110")  # forms of groups, headers and indices of chunks that take less room
BARE = {"spacing": None, "origin": None}
# Name, type of samples, byte order, settings of the dataset, what is special.
STORED = [
    ("contiguous", "f32", "<", {}, "contiguous"),
    ("big_endian", "f32", ">", {}, "contiguous, big-endian"),
    ("chunked", "f32", "<", {"chunks": CHUNKS}, "chunks that fit into no axis, not compressed"),
    ("gzip", "f32", "<", {"chunks": CHUNKS} | SHUFFLED, "chunks, shuffle, gzip"),
]
# The same, in the forms since HDF5 1.10.
NEWER = [
    ("scale_offset", "i16", "<", {"chunks": CHUNKS, "scaleoffset": 0}, "the scale-offset filter"),
    ("gzip_alone", "f64", "<", {"chunks": CHUNKS, "compression": "gzip"}, "fixed array of chunks, gzip alone"),
    ("fletcher32", "i16", "<", {"chunks": CHUNKS, "fletcher32": True}, "fixed array of chunks, with checksums"),
    ("all_filters", "u16", "<", {"chunks": CHUNKS, "fletcher32": True} | SHUFFLED, "shuffle, gzip and checksums"),
    ("growing", "u8", "<", {"chunks": (1, 3, 5, 7), "maxshape": (None, 3, 5, 7)}, "extensible array of chunks"),
    ("growing_twice", "u8", "<", {"chunks": (1, 3, 5, 7), "maxshape": (None, None, 5, 7)}, "new tree of chunks"),
    ("one_chunk", "f32", "<", {"chunks": (4, 3, 5, 7)} | SHUFFLED, "a single chunk"),
    ("big_endian_gzip", "i32", ">", {"chunks": CHUNKS} | SHUFFLED, "fixed array of chunks, big-endian"),
    ("i8", "i8", "<", {}, "contiguous"),
    ("u32", "u32", "<", {}, "contiguous"),
    ("f16", "f16", "<", {}, "contiguous"),
]
REFUSED = [
    ("lzf", "f4", {"chunks": CHUNKS[1:], "compression": "lzf"}, "the lzf filter"),
    ("complex", "c8", {}, "a compound type: complex numbers"),
]


def write(folder: Path) -> list:
    return [
        *stored(folder),
        latest(folder),
        single(folder),
        *several(folder),
        *other_axes(folder),
        scales(folder),
        *times_beside(folder),
        groups(folder),
        openpmd(folder),
        series(folder),
        missing_chunk(folder),
        *hdf5_kinds.write(folder),
        *refused(folder),
    ]


def stored(folder: Path) -> list:
    for forms, kinds in (("earliest", STORED), (SMALL, NEWER)):
        for name, sample, order, settings, _ in kinds:
            with h5py.File(folder / f"{name}.h5", "w", libver=forms) as file:
                file.create_dataset(NAME, data=frames(sample, order), **settings)
    return [Case(f"{name}.h5", H5PY, note, s, **BARE) for name, s, _, _, note in STORED + NEWER]


def latest(folder: Path) -> Case:
    """New forms of superblock, headers and chunk index."""
    with h5py.File(folder / "latest.h5", "w", libver="latest") as file:
        file.create_dataset(NAME, data=frames(), chunks=CHUNKS, **SHUFFLED)
    return Case("latest.h5", H5PY, 'libver="latest": superblock 3, fixed array of chunks', **BARE)


def single(folder: Path) -> Case:
    with h5py.File(folder / "single.h5", "w", libver=SMALL) as file:
        group(file, "fields")[NAME] = frame()
    return Case("single.h5", H5PY, "one dataset, of three dimensions, in a group", frames=1, **BARE)


def several(folder: Path) -> list:
    with h5py.File(folder / "several.h5", "w") as file:
        file["other"] = frames("u8") + 100
        file[NAME] = frames("i16")
        file["names"] = np.bytes_("two fields")
    note = "two datasets, density and other (density + 100), and a text"
    return [
        Case("several.h5", H5PY, note, "i16", variable=NAME, **BARE),
        Refused("several.h5", H5PY, note + "; no variable is named"),
    ]


def other_axes(folder: Path) -> list:
    with h5py.File(folder / "axes_xyzt.h5", "w") as file:
        file[NAME] = np.ascontiguousarray(frames().T)
    with h5py.File(folder / "axes_txyz.h5", "w", libver=SMALL) as file:
        data = np.ascontiguousarray(frames("i16").transpose(0, 3, 2, 1))
        file.create_dataset(NAME, data=data, chunks=(2, 4, 3, 2), compression="gzip")
    return [
        Case("axes_xyzt.h5", H5PY, "shape 7 5 3 4: frames vary fastest", more={"axes": "xyzt"}, **BARE),
        Case("axes_txyz.h5", H5PY, "shape 4 7 5 3: z varies fastest", "i16", more={"axes": "txyz"}, **BARE),
    ]


def scales(folder: Path) -> Case:
    with h5py.File(folder / "scales.h5", "w", libver=SMALL) as file:
        data = file.create_dataset(NAME, data=frames())
        data.attrs["units"] = UNITS
        coordinates = zip("tzyx", [np.array(TIMES), *axes()[::-1]])
        for at, (name, values) in enumerate(coordinates):
            file[name] = values
            file[name].make_scale(name)
            data.dims[at].attach_scale(file[name])
            data.dims[at].label = name
    may = {"may_lack": ["spacing", "origin", "times", "units"]}
    return Case("scales.h5", H5PY, "dimension scales and labels t, z, y, x", times=TIMES, units=UNITS, more=may)


def times_beside(folder: Path) -> list:
    """Times that no label ties to the frames."""
    with h5py.File(folder / "times.h5", "w", libver=SMALL) as file:  # as py-pde writes its storage
        file.create_dataset("data", data=frames(), maxshape=(None, 3, 5, 7), chunks=(1, 3, 5, 7))
        file.create_dataset("times", data=TIMES, maxshape=(None,), chunks=(FRAMES,))
    with h5py.File(folder / "times_scale.h5", "w", libver=SMALL) as file:
        file["when"] = np.array(TIMES) * 1000
        file["when"].attrs["units"] = "ms"
        file["when"].make_scale()
        file[NAME] = frames("i16")
        file[NAME].dims[0].attach_scale(file["when"])
    with h5py.File(folder / "times_differ.h5", "w", libver=SMALL) as file:
        group(file, "run")[NAME] = frames("i16")
        file["run/timesteps"] = np.arange(FRAMES)
        file["Time"] = TIMES
    with h5py.File(folder / "times_groups.h5", "w", libver=SMALL) as file:
        for t in range(FRAMES):
            group(file, f"step_{t}")[NAME] = frame("i16", t)
        file["t"] = TIMES
        file["t"].attrs["units"] = "s"
    return [
        Case("times.h5", H5PY, "data, and times beside it, as py-pde writes them", times=TIMES, **BARE),
        Case("times_scale.h5", H5PY, "a dimension scale of times in ms, without a label", "i16", times=TIMES, **BARE),
        Case("times_differ.h5", H5PY, "timesteps in the group, and another Time in the root", "i16", **BARE),
        Case(
            "times_groups.h5", H5PY, "a group for each step, and t in the root", "i16",
            variable=f"step_%T/{NAME}", times=TIMES, **BARE,
        ),
    ]


def groups(folder: Path) -> Case:
    with h5py.File(folder / "groups.h5", "w", libver=SMALL) as file:
        for t in range(FRAMES):
            group(file, f"data/{10 * t}/fields")["E"] = frame("f32", t)
    note = "a group for each step: 0, 10, 20, 30"
    return Case("groups.h5", H5PY, note, variable="data/%T/fields/E", **BARE)


def openpmd(folder: Path) -> Case:
    """The attributes that openPMD 1.1.0 asks for in groupBased files."""
    with h5py.File(folder / "openpmd.h5", "w", libver=SMALL) as file:
        root = {
            "openPMD": "1.1.0",
            "openPMDextension": np.uint32(0),
            "basePath": "/data/%T/",
            "meshesPath": "fields/",
            "iterationEncoding": "groupBased",
            "iterationFormat": "/data/%T/",
        }
        file.attrs.update({k: np.bytes_(v) if isinstance(v, str) else v for k, v in root.items()})
        for t, number in enumerate((0, 50, 100, 150)):
            fields = group(file, f"data/{number}/fields")
            fields.parent.attrs.update({"time": TIMES[t], "dt": STEP / 50, "timeUnitSI": 1.0})
            fields.create_dataset(NAME, data=frame("f32", t)).attrs.update(mesh())
    may = {"may_lack": ["spacing", "origin", "times"]}
    note = "openPMD 1.1.0, groupBased: iterations 0, 50, 100, 150, by number; spacing and origin in order z, y, x"
    return Case("openpmd.h5", H5PY, note, variable=f"data/%T/fields/{NAME}", times=TIMES, more=may)


def mesh() -> dict:
    return {
        "geometry": np.bytes_("cartesian"),
        "dataOrder": np.bytes_("C"),
        "axisLabels": np.array([b"z", b"y", b"x"]),
        "gridSpacing": np.array(SPACING[::-1]),
        "gridGlobalOffset": np.array(ORIGIN[::-1]),
        "gridUnitSI": 1.0,
        "position": np.zeros(3),
        "unitDimension": np.array([-3.0, 1, 0, 0, 0, 0, 0]),
        "unitSI": 1.0,
        "timeOffset": 0.0,
    }


def series(folder: Path) -> Case:
    (folder / "steps").mkdir()
    for t in range(FRAMES):
        with h5py.File(folder / f"steps/density_{t}.h5", "w", libver=SMALL) as file:
            file[NAME] = frame("i16", t)
    return Case("steps/density_*.h5", H5PY, "a file for each frame, by a pattern", "i16", **BARE)


def missing_chunk(folder: Path) -> Case:
    """A chunk that was never written holds the fill value."""
    with h5py.File(folder / "missing_chunk.h5", "w", libver=SMALL) as file:
        data = file.create_dataset(NAME, (FRAMES, 3, 5, 7), "<f4", chunks=CHUNKS, fillvalue=np.nan)
        data[:2] = frames()[:2]
        data[2:, :2] = frames()[2:, :2]
    missing = [[t, x, y, 2] for t in (2, 3) for y in range(5) for x in range(7)]
    return Case("missing_chunk.h5", H5PY, "chunks never written; the fill value is NaN", missing=missing, **BARE)


def refused(folder: Path) -> list:
    for name, kind, settings, _ in REFUSED:
        with h5py.File(folder / f"refused_{name}.h5", "w", libver=SMALL) as file:
            file.create_dataset(NAME, data=frame("i32").astype(kind), **settings)
    with h5py.File(folder / "i64.h5", "w", libver=SMALL) as file:
        file.create_dataset(NAME, data=frame("i32").astype("i8"))
    return [
        Case("i64.h5", H5PY, "integers of 64 bits", "i32", frames=1, **BARE),
        *(Refused(f"refused_{name}.h5", H5PY, note) for name, *_, note in REFUSED),
    ]
