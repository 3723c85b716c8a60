"""NetCDF as xarray and climate archives write it."""

from pathlib import Path

import numpy as np
import xarray

from .case import FRAMES, NAME, UNITS, Case, axes, by, frames

XARRAY = by("xarray")


def era5(folder: Path) -> Case:
    """A field on pressure levels with the names and attributes of ERA5 as downloaded since 2024."""
    x, y, _ = axes()
    first = np.datetime64("2000-01-01", "ns")
    falls = {"stored_direction": "decreasing"}
    level = {"units": "hPa", "positive": "down", "standard_name": "air_pressure"} | falls
    latitude = {"units": "degrees_north", "standard_name": "latitude"} | falls
    coordinates = {
        "valid_time": first + np.arange(FRAMES) * np.timedelta64(3600, "s"),
        "pressure_level": ("pressure_level", [1000.0, 850.0, 500.0], level),
        "latitude": ("latitude", y[::-1], latitude),
        "longitude": ("longitude", x, {"units": "degrees_east", "standard_name": "longitude"}),
        "number": ((), 0),
        "expver": ("valid_time", np.array(["0001"] * FRAMES, "S4")),
    }
    attributes = {"units": UNITS, "GRIB_missingValue": 3.4028234663852886e38}
    samples = np.ascontiguousarray(frames()[:, :, ::-1])
    dims = ("valid_time", "pressure_level", "latitude", "longitude")
    whole = xarray.Dataset({NAME: (dims, samples, attributes)}, coordinates, {"Conventions": "CF-1.7"})
    encoding = {
        NAME: {"zlib": True, "shuffle": True, "chunksizes": (2, 3, 5, 7)},
        "valid_time": {"units": "seconds since 1970-01-01", "dtype": "i8"},
    }
    whole.to_netcdf(folder / "era5.nc", engine="netcdf4", encoding=encoding)
    times = tuple(946684800.0 + 3600 * t for t in range(FRAMES))
    note = "valid_time in seconds since 1970; levels 1000, 850, 500 hPa go up; latitude descends; also number, expver"
    uneven = {"spacing": None, "origin": None, "more": {"flipped": ["y"]}}
    return Case("era5.nc", XARRAY, note, times=times, units=UNITS, **uneven)
