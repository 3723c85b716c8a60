"""Zarr as xarray writes it: coordinates beside the field, the CF convention in attributes."""

from pathlib import Path

import numpy as np
import xarray

from .case import FRAMES, MISSING, NAME, TIMES, UNITS, Case, axes, by, frames, without

XARRAY = by("xarray")
FILL = -32767


def by_xarray(folder: Path) -> list:
    known = {"times": TIMES, "units": UNITS}
    note = "version {}, consolidated, with coordinates time, z, y, x"
    for version in (2, 3):
        dataset(frames()).to_zarr(folder / f"v{version}_xarray.zarr", zarr_format=version, encoding=encoding())
    packed = {"dtype": "i2", "scale_factor": 0.25, "add_offset": -3.0, "_FillValue": FILL}
    whole = dataset(without(frames("f64"), np.nan))
    whole.to_zarr(folder / "v2_xarray_packed.zarr", zarr_format=2, consolidated=False, encoding=encoding(packed))
    packed_note = "version 2, i16 with scale_factor 0.25, add_offset -3; fill_value -32767 stands for _FillValue"
    either = {"sample_may_be": ["f64"]}
    return [
        *(Case(f"v{v}_xarray.zarr", XARRAY, note.format(v), **known) for v in (2, 3)),
        Case("v2_xarray_packed.zarr", XARRAY, packed_note, "f32", missing=MISSING, more=either, **known),
    ]


def dataset(samples: np.ndarray) -> xarray.Dataset:
    x, y, z = axes()
    first = np.datetime64("2000-01-01", "ns")
    coordinates = {
        "time": first + np.arange(FRAMES) * np.timedelta64(500, "ms"),
        "z": ("z", z, {"units": "m", "axis": "Z", "positive": "up"}),
        "y": ("y", y, {"units": "m", "axis": "Y"}),
        "x": ("x", x, {"units": "m", "axis": "X"}),
    }
    return xarray.Dataset({NAME: (("time", "z", "y", "x"), samples, {"units": UNITS})}, coordinates)


def encoding(field: dict | None = None) -> dict:
    time = {"units": "seconds since 2000-01-01", "dtype": "f8"}
    return {NAME: {"chunks": (2, 3, 5, 7)} | (field or {}), "time": time}
