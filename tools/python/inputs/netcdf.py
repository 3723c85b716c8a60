"""NetCDF by netCDF4 and xarray, with the CF convention."""

from pathlib import Path

import netCDF4
import numpy as np

from . import netcdf_kinds
from .case import DIMS, FRAMES, MISSING, NAME, ORIGIN, SPACING, TIMES, UNITS, Case, Refused, axes, by, frames, without
from .netcdf_daily import daily
from .netcdf_xarray import era5

FOLDER = "netcdf"
NETCDF = by("netCDF4")
CLASSIC = "NETCDF3_CLASSIC"
SINCE = "seconds since 2000-01-01 00:00:00"
CHUNKED = {"chunksizes": (2, 2, 3, 4), "zlib": True, "shuffle": True}
KNOWN = {"units": UNITS, "times": TIMES}
METRES = {name: {"axis": name.upper(), "units": "m"} for name in "xyz"}
METRES["z"]["positive"] = "up"
LON = {"standard_name": "longitude", "units": "degrees_east", "axis": "X"}
LAT = {"standard_name": "latitude", "units": "degrees_north", "axis": "Y"}


def write(folder: Path) -> list:
    return [
        *formats(folder),
        classic_model(folder),
        *records(folder),
        hours(folder),
        *packed(folder),
        *filled(folder),
        *flipped(folder),
        maps(folder),
        *several(folder),
        extra_dimension(folder),
        bounds(folder),
        in_group(folder),
        series(folder),
        *daily(folder),
        era5(folder),
        *netcdf_kinds.write(folder),
        *refused(folder),
    ]


def coordinate(file, name: str, values, attributes: dict, unlimited: bool = False) -> None:
    file.createDimension(name, None if unlimited else len(values))
    variable = file.createVariable(name, "f8", (name,), **({"chunksizes": (len(values),)} if four(file) else {}))
    variable.setncatts(attributes)
    variable[:] = values


def four(file) -> bool:
    return file.data_model.startswith("NETCDF4")


def grid(file, since: str = SINCE, unlimited: bool = True, times=TIMES) -> None:
    """Coordinates along time, z, y, x."""
    file.Conventions = "CF-1.8"
    coordinate(file, "time", times, {"units": since, "calendar": "standard", "axis": "T"}, unlimited)
    for name, values in reversed(list(zip("xyz", axes()))):
        coordinate(file, name, values, METRES[name])


def lengths(file) -> None:
    """Dimensions z, y, x without coordinates."""
    for name, length in zip("zyx", DIMS[::-1]):
        file.createDimension(name, length)


def variable(file, samples, dims=("time", "z", "y", "x"), name: str = NAME, **settings):
    """A variable of the samples as they are: nothing is packed on the way."""
    found = file.createVariable(name, samples.dtype, dims, **settings)
    found.set_auto_maskandscale(False)
    found.units = UNITS
    found[:] = samples
    return found


def formats(folder: Path) -> list:
    kinds = [
        ("cdf1", CLASSIC, "f32", {}, "CDF-1, unlimited time"),
        ("cdf2", "NETCDF3_64BIT_OFFSET", "f64", {}, "CDF-2, unlimited time"),
        ("cdf5", "NETCDF3_64BIT_DATA", "u16", {}, "CDF-5, unlimited time"),
        ("netcdf4", "NETCDF4", "f32", CHUNKED, "HDF5, compressed chunks"),
    ]
    for name, format_, sample, settings, _ in kinds:
        with netCDF4.Dataset(folder / f"{name}.nc", "w", format=format_) as file:
            grid(file)
            variable(file, frames(sample), **settings)
    return [Case(f"{name}.nc", NETCDF, note, sample, **KNOWN) for name, _, sample, _, note in kinds]


def classic_model(folder: Path) -> Case:
    """Without coordinates along z, y, x, each of which takes 4 KiB in HDF5."""
    with netCDF4.Dataset(folder / "netcdf4_classic.nc", "w", format="NETCDF4_CLASSIC") as file:
        coordinate(file, "time", TIMES, {"units": SINCE}, True)
        lengths(file)
        variable(file, frames("i16"), chunksizes=(1, 3, 5, 7))
    note = "HDF5 with the classic model, unlimited time; no coordinates along z, y, x"
    return Case("netcdf4_classic.nc", NETCDF, note, "i16", spacing=None, origin=None, **KNOWN)


def records(folder: Path) -> list:
    """Where CDF-1 puts the samples of frames, and how it pads them."""
    with netCDF4.Dataset(folder / "fixed_time.nc", "w", format=CLASSIC) as file:
        grid(file, unlimited=False)
        variable(file, frames())
    with netCDF4.Dataset(folder / "padded_records.nc", "w", format=CLASSIC) as file:
        grid(file)
        variable(file, frames("i8"))
    with netCDF4.Dataset(folder / "one_record_variable.nc", "w", format=CLASSIC) as file:
        file.createDimension("time", None)
        lengths(file)
        variable(file, frames("i8"))
    bare = {"spacing": None, "origin": None, "units": UNITS}
    return [
        Case("fixed_time.nc", NETCDF, "CDF-1, no unlimited dimension", **KNOWN),
        Case("padded_records.nc", NETCDF, "CDF-1, frames of 105 bytes are padded to 108", "i8", **KNOWN),
        Case("one_record_variable.nc", NETCDF, "CDF-1, a single record variable is not padded", "i8", **bare),
    ]


def hours(folder: Path) -> Case:
    with netCDF4.Dataset(folder / "hours.nc", "w", format=CLASSIC) as file:
        grid(file, since="hours since 1900-01-01")
        variable(file, frames("i16"))
    note = "times 0, 0.5, 1, 1.5 hours since 1900-01-01; here in seconds"
    return Case("hours.nc", NETCDF, note, "i16", units=UNITS, times=tuple(3600 * t for t in TIMES))


def packed(folder: Path) -> list:
    kinds = [
        ("packed_i16", "i16", "f32", -32767, "f4", {}),
        ("packed_i16_f64", "i16", "f32", -32767, "f8", {"sample_may_be": ["f64"]}),
        ("packed_i32", "i32", "f64", -2147483647, "f8", {}),
    ]
    for name, sample, _, fill, attribute, _ in kinds:
        with netCDF4.Dataset(folder / f"{name}.nc", "w", format=CLASSIC) as file:
            grid(file)
            found = variable(file, without(frames(sample), fill), fill_value=fill)
            found.scale_factor, found.add_offset = np.dtype(attribute).type(0.25), np.dtype(attribute).type(-3)
    note = "scale_factor 0.25 and add_offset -3 ({} bits), _FillValue {}"
    may = {"missing": MISSING, **KNOWN}
    return [
        *(
            Case(f"{name}.nc", NETCDF, f"{stored}, {note.format(8 * int(kind[1]), fill)}", sample, more=more, **may)
            for name, stored, sample, fill, kind, more in kinds
        ),
        unsigned(folder),
    ]


def unsigned(folder: Path) -> Case:
    """Bytes of 148 to 255, which CDF-1 can only call signed."""
    with netCDF4.Dataset(folder / "packed_unsigned.nc", "w", format=CLASSIC) as file:
        grid(file)
        found = variable(file, (frames("u8") + np.uint8(148)).view("i1"))
        found.setncatts({"_Unsigned": "true", "scale_factor": np.float32(0.25), "add_offset": np.float32(-40)})
    return Case("packed_unsigned.nc", NETCDF, 'i8 with _Unsigned = "true", scale_factor 0.25, add_offset -40', **KNOWN)


def filled(folder: Path) -> list:
    kinds = [
        ("fill_nan", {"fill_value": np.float32("nan")}, np.nan, {}, "_FillValue NaN"),
        ("fill_1e20", {"fill_value": np.float32(1e20)}, 1e20, {}, "_FillValue 1e20"),
        ("missing_value", {}, -999, {"missing_value": np.float32(-999)}, "missing_value -999, no _FillValue"),
    ]
    for name, settings, value, attributes, _ in kinds:
        with netCDF4.Dataset(folder / f"{name}.nc", "w", format=CLASSIC) as file:
            grid(file)
            variable(file, without(frames(), value), **settings).setncatts(attributes)
    return [Case(f"{name}.nc", NETCDF, note, missing=MISSING, **KNOWN) for name, *_, note in kinds]


def flipped(folder: Path) -> list:
    """Axes that are stored from the highest to the lowest."""
    x, y, z = axes()
    with netCDF4.Dataset(folder / "latitude_descends.nc", "w", format=CLASSIC) as file:
        coordinate(file, "time", TIMES, {"units": SINCE}, True)
        coordinate(file, "height", z, METRES["z"])
        coordinate(file, "lat", y[::-1], LAT)
        coordinate(file, "lon", x, LON)
        variable(file, frames()[:, :, ::-1], ("time", "height", "lat", "lon"))
    with netCDF4.Dataset(folder / "pressure.nc", "w", format=CLASSIC) as file:
        coordinate(file, "time", TIMES, {"units": SINCE}, True)
        coordinate(file, "plev", [500.0, 850.0, 1000.0], {"units": "hPa", "positive": "down", "axis": "Z"})
        coordinate(file, "lat", y, LAT)
        coordinate(file, "lon", x, LON)
        variable(file, frames()[:, ::-1], ("time", "plev", "lat", "lon"))
    pressure = "levels 500, 850, 1000 hPa, positive down, not evenly spaced; z goes up, from 1000 hPa"
    descends = "lat is stored from 14 down to 10; height is in other units than lon, whose spacing its planes take"
    apart = {"spacing": (*SPACING[:2], SPACING[0]), "origin": (*ORIGIN[:2], 0.0), "more": {"flipped": ["y"]}}
    uneven = {"spacing": None, "origin": None, "more": {"flipped": ["z"]}}
    return [
        Case("latitude_descends.nc", NETCDF, descends, **KNOWN, **apart),
        Case("pressure.nc", NETCDF, pressure, **KNOWN, **uneven),
    ]


def maps(folder: Path) -> Case:
    flat = (*DIMS[:2], 1)
    with netCDF4.Dataset(folder / "maps.nc", "w", format=CLASSIC) as file:
        coordinate(file, "time", TIMES, {"units": SINCE}, True)
        coordinate(file, "lat", axes()[1], LAT)
        coordinate(file, "lon", axes()[0], LON)
        variable(file, frames(dims=flat)[:, 0], ("time", "lat", "lon"))
    place = {"spacing": (*SPACING[:2], SPACING[0]), "origin": (*ORIGIN[:2], 0.0), "more": {"may_lack": ["spacing", "origin"]}}
    return Case("maps.nc", NETCDF, "time, lat, lon: z has one plane", dims=flat, **place, **KNOWN)


def several(folder: Path) -> list:
    with netCDF4.Dataset(folder / "several.nc", "w", format=CLASSIC) as file:
        grid(file)
        variable(file, frames("i16") + np.int16(1000), name="other")
        variable(file, frames("i8"))
    note = "two record variables, other (density + 1000) and density, take turns frame by frame"
    return [
        Case("several.nc", NETCDF, note, "i8", variable=NAME, **KNOWN),
        Refused("several.nc", NETCDF, note + "; no variable is named"),
    ]


def extra_dimension(folder: Path) -> Case:
    with netCDF4.Dataset(folder / "extra_dimension.nc", "w", format=CLASSIC) as file:
        grid(file)
        coordinate(file, "member", [0.0], {"standard_name": "realization"})
        variable(file, frames("i16")[:, None], ("time", "member", "z", "y", "x"))
    return Case("extra_dimension.nc", NETCDF, "time, member, z, y, x: one member", "i16", **KNOWN)


def bounds(folder: Path) -> Case:
    """What goes with a field by convention, and is none."""
    with netCDF4.Dataset(folder / "bounds.nc", "w", format=CLASSIC) as file:
        grid(file)
        file.createDimension("bnds", 2)
        file["time"].bounds = "time_bnds"
        file.createVariable("time_bnds", "f8", ("time", "bnds"))[:] = [[t, t + 0.5] for t in TIMES]
        file.createVariable("crs", "i4").grid_mapping_name = "transverse_mercator"
        file.createVariable("lat", "f8", ("y", "x"))[:] = np.zeros(DIMS[1::-1])
        variable(file, frames("i16")).setncatts({"grid_mapping": "crs", "coordinates": "lat"})
    note = "also time_bnds, crs and a two-dimensional lat: density is the only field"
    return Case("bounds.nc", NETCDF, note, "i16", **KNOWN)


def in_group(folder: Path) -> Case:
    with netCDF4.Dataset(folder / "group.nc", "w", format="NETCDF4") as file:
        file.createDimension("time", FRAMES)
        lengths(file)
        variable(file.createGroup("forecast"), frames("u8"))
    note = "in a group; its dimensions are outside it, and have no coordinates"
    bare = {"spacing": None, "origin": None, "units": UNITS}
    return Case("group.nc", NETCDF, note, "u8", variable=f"forecast/{NAME}", **bare)


def series(folder: Path) -> Case:
    (folder / "steps").mkdir()
    for t in range(FRAMES):
        with netCDF4.Dataset(folder / f"steps/density_{t}.nc", "w", format=CLASSIC) as file:
            grid(file, times=TIMES[t : t + 1])
            variable(file, frames("i16")[t : t + 1])
    return Case("steps/density_*.nc", NETCDF, "a file for each frame, by a pattern", "i16", **KNOWN)


def refused(folder: Path) -> list:
    with netCDF4.Dataset(folder / "i64.nc", "w", format="NETCDF3_64BIT_DATA") as file:
        lengths(file)
        variable(file, frames("i32").astype("i8")[0], ("z", "y", "x"))
    with netCDF4.Dataset(folder / "refused_text.nc", "w", format=CLASSIC) as file:
        file.createDimension("letters", 7)
        file.createVariable("name", "S1", ("letters",))[:] = netCDF4.stringtochar(np.array([NAME[:7]], "S7"))[0]
    return [
        Case("i64.nc", NETCDF, "CDF-5 with integers of 64 bits", "i32", frames=1, units=UNITS, spacing=None, origin=None),
        Refused("refused_text.nc", NETCDF, "no field at all: letters"),
    ]
