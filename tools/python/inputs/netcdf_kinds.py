"""NetCDF by netCDF4: times under other names, variables called as axes, and MINC."""

from pathlib import Path

import netCDF4
import numpy as np

from .case import DIMS, FRAMES, NAME, TIMES, UNITS, Case, Refused, axes, by, frame, frames

NETCDF = by("netCDF4")
CLASSIC = "NETCDF3_CLASSIC"
SINCE = "seconds since 2000-01-01 00:00:00"
WRF = ("Time", "bottom_top", "south_north", "west_east")
BARE = {"spacing": None, "origin": None, "units": UNITS}


def write(folder: Path) -> list:
    return [*auxiliary_times(folder), *named_as_axes(folder), *coordinates(folder), minc(folder)]


def dimensions(file, names) -> None:
    for name, length in zip(names, (FRAMES, *DIMS[::-1])):
        file.createDimension(name, length)


def samples(file, dims, name: str = NAME, sample: str = "i16", **attributes):
    found = file.createVariable(name, np.dtype(f"i{int(sample[1:]) // 8}"), dims)
    found.set_auto_maskandscale(False)
    found.setncatts({"units": UNITS, **attributes})
    found[:] = frames(sample)


def times(file, name: str, dims, values=TIMES, **attributes) -> None:
    found = file.createVariable(name, "f8", dims)
    found.setncatts({"units": SINCE, **attributes})
    found[:] = values


def auxiliary_times(folder: Path) -> list:
    """As WRF and NEMO write them, and one that could be either."""
    with netCDF4.Dataset(folder / "wrf_xtime.nc", "w", format=CLASSIC) as file:
        dimensions(file, WRF)
        samples(file, WRF, coordinates="XLONG XLAT XTIME")
        times(file, "XTIME", ("Time",))
    with netCDF4.Dataset(folder / "wrf_dates.nc", "w", format="NETCDF4_CLASSIC") as file:
        dimensions(file, WRF)
        file.createDimension("DateStrLen", 19)
        samples(file, WRF)
        dates = file.createVariable("Times", "S1", ("Time", "DateStrLen"))
        for t in range(FRAMES):
            dates[t] = np.array(list(f"2000-01-31_23:59:5{6 + t}"), "S1")
    nemo = ("record", "deptht", "y", "x")
    with netCDF4.Dataset(folder / "nemo_centred.nc", "w", format=CLASSIC) as file:
        dimensions(file, nemo)
        samples(file, nemo, coordinates="time_centered deptht nav_lat nav_lon")
        times(file, "time_centered", ("record",), standard_name="time")
        times(file, "time_instant", ("record",), np.array(TIMES) + 0.25, standard_name="time")
        times(file, "began", ("record",), np.array(TIMES) - 9, standard_name="forecast_reference_time")
    with netCDF4.Dataset(folder / "two_times.nc", "w", format=CLASSIC) as file:
        dimensions(file, nemo)
        samples(file, nemo)
        times(file, "first", ("record",))
        times(file, "second", ("record",), np.array(TIMES) + 1)
    return [
        Case("wrf_xtime.nc", NETCDF, "WRF: XTIME along Time, named by coordinates", "i16", times=TIMES, **BARE),
        Case("wrf_dates.nc", NETCDF, "WRF: dates in Times alone", "i16", times=(0.0, 1.0, 2.0, 3.0), **BARE),
        Case("nemo_centred.nc", NETCDF, "NEMO: one of two times is named by coordinates", "i16", times=TIMES, **BARE),
        Case("two_times.nc", NETCDF, "two times, and nothing says which", "i16", **BARE),
    ]


def named_as_axes(folder: Path) -> list:
    for name, form in (("named_as_axis.nc", CLASSIC), ("named_as_axis_4.nc", "NETCDF4")):
        with netCDF4.Dataset(folder / name, "w", format=form) as file:
            dimensions(file, ("time", "z", "y", "x"))
            times(file, "time", ("time",))
            samples(file, ("time", "z", "y", "x"), "z")
    known = {"variable": "z", "times": TIMES, **BARE}
    return [
        Case("named_as_axis.nc", NETCDF, "CDF-1: the variable z has an axis z", "i16", **known),
        Case("named_as_axis_4.nc", NETCDF, "HDF5: the variable z has an axis z", "i16", **known),
    ]


def coordinates(folder: Path) -> list:
    """Coordinates over time and other axes, and over all axes of space, as those of ROMS and of forecasts."""
    with netCDF4.Dataset(folder / "coordinates.nc", "w", format=CLASSIC) as file:
        dimensions(file, ("time", "z", "y", "x"))
        times(file, "time", ("time",))
        for name, places in zip("xyz", axes()):
            file.createVariable(name, "f8", (name,))[:] = places
            file[name].units = "m"
        samples(file, ("time", "z", "y", "x"), coordinates="valid z_rho zeta")
        file.createVariable("valid", "f8", ("time", "z"))[:] = np.arange(FRAMES * 3).reshape(FRAMES, 3)
        file.createVariable("z_rho", "f4", ("z", "y", "x"))[:] = frame("f32")
        file.createVariable("zeta", "f4", ("time", "y", "x"))[:] = frames("f32")[:, 0]
    note = "coordinates over (time, z), (z, y, x) and (time, y, x)"
    return [Case("coordinates.nc", NETCDF, note, "i16", variable=NAME, units=UNITS, times=TIMES)]


def minc(folder: Path) -> Refused:
    with netCDF4.Dataset(folder / "refused_minc1.nc", "w", format=CLASSIC) as file:
        spaces = ("zspace", "yspace", "xspace")
        dimensions(file, ("time", *spaces))
        for name, values in (("image-max", np.arange(3) + 10.0), ("image-min", np.arange(3.0))):
            file.createVariable(name, "f8", ("zspace",))[:] = values
        image = file.createVariable("image", "i1", spaces)
        image.set_auto_maskandscale(False)
        image.setncatts({"signtype": "unsigned", "valid_range": np.array([0.0, 255.0])})
        image[:] = frame("u8").view("i1")
    return Refused("refused_minc1.nc", NETCDF, "MINC 1: unsigned bytes, slices scaled by image-max and image-min")
