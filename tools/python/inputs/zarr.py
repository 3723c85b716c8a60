"""Zarr, versions 2 and 3, by zarr-python and xarray."""

from pathlib import Path

import numpy as np
import zarr
from numcodecs import Blosc, Delta, GZip, LZ4, Zlib, Zstd
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, TransposeCodec, ZstdCodec

from .case import NAME, Case, Refused, by, frames
from .zarr_xarray import by_xarray

FOLDER = "zarr"
ZARR = by("zarr")
CHUNKS, HALF = (2, 2, 3, 4), (2, 3, 5, 7)
DIMENSIONS = ["time", "z", "y", "x"]
BARE = {"spacing": None, "origin": None}
BLOSC = BloscCodec(cname="lz4", shuffle="shuffle", typesize=8)
SHARDED = {"chunks": (1, 2, 3, 4), "shards": (2, 4, 6, 8), "compressors": ZstdCodec()}
# Name, type of samples, byte order, settings of the array, what is special.
SECOND = [
    ("v2_zlib", "f32", "<", {"chunks": CHUNKS, "compressors": Zlib(6)}, "zlib; chunks that fit into no axis"),
    ("v2_blosc", "f64", "<", {"compressors": Blosc("lz4", 5, Blosc.SHUFFLE)}, "blosc with lz4 and shuffle"),
    ("v2_blosc_zstd", "i16", "<", {"compressors": Blosc("zstd", 5, Blosc.BITSHUFFLE)}, "blosc, zstd and bitshuffle"),
    ("v2_zstd", "u16", "<", {"compressors": Zstd(3)}, "zstd"),
    ("v2_gzip", "u8", "<", {"compressors": GZip(6)}, "gzip"),
    ("v2_raw", "i32", "<", {"compressors": None, "fill_value": 0}, "not compressed; fill_value 0, and a sample is 0"),
    ("v2_big_endian", "f32", ">", {"compressors": None}, "not compressed, big-endian"),
    ("v2_fortran", "i8", "<", {"order": "F", "compressors": Zlib(6)}, 'order "F" within chunks'),
    ("v2_folders", "u32", "<", {"chunk_key_encoding": {"name": "v2", "separator": "/"}}, 'dimension_separator "/"'),
]
THIRD = [
    ("v3_zstd", "f32", {"chunks": CHUNKS, "compressors": ZstdCodec()}, "zstd; chunks that fit into no axis"),
    ("v3_gzip", "i16", {"compressors": GzipCodec()}, "gzip"),
    ("v3_blosc", "f64", {"compressors": BLOSC}, "blosc with lz4 and shuffle"),
    ("v3_raw", "u8", {"compressors": None}, "not compressed"),
    ("v3_big_endian", "f32", {"compressors": None, "serializer": BytesCodec(endian="big")}, "raw, big-endian"),
    ("v3_sharded", "f32", SHARDED, "shards of several chunks, zstd"),
    ("v3_flat_keys", "f16", {"chunk_key_encoding": {"name": "v2", "separator": "."}}, "chunk keys as in version 2"),
    ("v3_transposed", "i32", {"filters": TransposeCodec(order=(3, 2, 1, 0))}, "transpose codec"),
]
REFUSED = [
    ("v2_delta", 2, "i4", {"filters": Delta("<i4")}, "version 2, the delta filter"),
    ("v2_lz4", 2, "i4", {"compressors": LZ4()}, "version 2, lz4 without blosc"),
    ("v3_complex", 3, "c8", {}, "version 3, complex numbers"),
]


def write(folder: Path) -> list:
    return [
        *second(folder),
        *third(folder),
        *several(folder),
        *missing_chunk(folder),
        *by_xarray(folder),
        *refused(folder),
    ]


def save(path: Path, samples: np.ndarray, version: int, **settings) -> None:
    settings = {"chunks": HALF} | settings
    if version == 3:
        settings["dimension_names"] = DIMENSIONS
    else:
        settings = {"fill_value": None, "attributes": {"_ARRAY_DIMENSIONS": DIMENSIONS}} | settings
    zarr.create_array(path, data=samples, zarr_format=version, **settings)
    forget_time(path)


def forget_time(path: Path) -> None:
    """Takes the time of day out of chunks that are gzip files."""
    for chunk in (p for p in path.rglob("*") if p.is_file() and p.read_bytes()[:2] == b"\x1f\x8b"):
        whole = chunk.read_bytes()
        chunk.write_bytes(whole[:4] + bytes(4) + whole[8:])


def second(folder: Path) -> list:
    for name, sample, order, settings, _ in SECOND:
        save(folder / f"{name}.zarr", frames(sample, order), 2, **settings)
    return [Case(f"{name}.zarr", ZARR, "version 2, " + note, s, **BARE) for name, s, _, _, note in SECOND]


def third(folder: Path) -> list:
    for name, sample, settings, _ in THIRD:
        save(folder / f"{name}.zarr", frames(sample), 3, **settings)
    return [Case(f"{name}.zarr", ZARR, "version 3, " + note, sample, **BARE) for name, sample, _, note in THIRD]


def several(folder: Path) -> list:
    cases = []
    for version in (2, 3):
        name = f"v{version}_several.zarr"
        for group in (folder / name, folder / name / "fields"):
            zarr.create_group(group, zarr_format=version)
        save(folder / name / "fields" / NAME, frames("i16"), version)
        save(folder / name / "other", frames("u8") + 100, version)
        note = f"version {version}, a group: other (density + 100), and fields/density"
        cases.append(Case(name, ZARR, note, "i16", variable=f"fields/{NAME}", **BARE))
        cases.append(Refused(name, ZARR, note + "; no variable is named"))
    return cases


def missing_chunk(folder: Path) -> list:
    """The last chunk is not there: its samples are the fill value."""
    missing = [[t, x, y, 2] for t in (2, 3) for y in (3, 4) for x in (4, 5, 6)]
    for version, last in ((2, "1.1.1.1"), (3, "c/1/1/1/1")):
        path = folder / f"v{version}_missing_chunk.zarr"
        save(path, frames(), version, chunks=CHUNKS, fill_value=np.nan)
        (path / last).unlink()
    note = "the last chunk is not there; fill value NaN"
    return [
        Case(f"v{v}_missing_chunk.zarr", ZARR, f"version {v}, {note}", missing=missing, **BARE) for v in (2, 3)
    ]


def refused(folder: Path) -> list:
    for name, version, kind, settings, _ in REFUSED:
        save(folder / f"refused_{name}.zarr", frames("i32").astype(kind), version, **settings)
    save(folder / "v2_i64.zarr", frames("i32").astype("i8"), 2)
    return [
        Case("v2_i64.zarr", ZARR, "version 2, integers of 64 bits", "i32", **BARE),
        *(Refused(f"refused_{name}.zarr", ZARR, note) for name, *_, note in REFUSED),
    ]
