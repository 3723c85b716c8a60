"""NetCDF by xarray: a file for each day, whose times count from that day on, in several calendars."""

from pathlib import Path

import cftime
import xarray

from .case import FRAMES, NAME, UNITS, Case, axes, by, frames

# Calendar, the first day, the format of the files.
DAYS = [
    ("standard", (2000, 2, 27), "NETCDF4"),
    ("noleap", (2000, 2, 27), "NETCDF3_CLASSIC"),
    ("360_day", (2000, 2, 28), "NETCDF3_CLASSIC"),
]
HOUR = 6


def daily(folder: Path) -> list:
    return [calendar(folder, *days) for days in DAYS]


def calendar(folder: Path, name: str, first: tuple, form: str) -> Case:
    path = folder / f"daily_{name}"
    path.mkdir()
    times = xarray.date_range(
        start=cftime.datetime(*first, HOUR, calendar=name), periods=FRAMES, freq="D", calendar=name, use_cftime=True
    )
    for t, time in enumerate(times):
        coordinates = {"time": [time]} | {axis: (axis, at, {"units": "m", "axis": axis.upper()}) for axis, at in zip("xyz", axes())}
        data = xarray.DataArray(frames("i16")[t : t + 1], coordinates, ("time", "z", "y", "x"), NAME, {"units": UNITS})
        since = f"days since {time.year:04d}-{time.month:02d}-{time.day:02d}"
        encoding = {"time": {"units": since, "calendar": name, "dtype": "f8"}}
        data.to_dataset().to_netcdf(path / f"day_{t}.nc", format=form, encoding=encoding)
    since_first = [86400 * t + 3600.0 * HOUR for t in range(FRAMES)]
    note = f"a file for each day, of times since that day, in the calendar {name}; here in seconds since the first day"
    more = {"dates": [time.strftime("%Y-%m-%d %H:%M") for time in times]}
    return Case(f"daily_{name}", by("xarray"), note, "i16", times=tuple(since_first), units=UNITS, more=more)
