"""Times of frames as numbers with a unit: from numbers, dates and lengths of time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, timedelta, timezone
from typing import Any

import numpy as np
import numpy.typing as npt

_UNITS = {
    ("s", "sec", "secs", "second", "seconds"): np.timedelta64(1, "s"),
    ("min", "mins", "minute", "minutes"): np.timedelta64(1, "m"),
    ("h", "hr", "hrs", "hour", "hours"): np.timedelta64(1, "h"),
    ("d", "day", "days"): np.timedelta64(1, "D"),
    ("ms", "millisecond", "milliseconds"): np.timedelta64(1, "ms"),
    ("us", "microsecond", "microseconds"): np.timedelta64(1, "us"),
}
"""Units of lengths of time."""

_FIRST_GREGORIAN = np.datetime64("1582-10-15")


@dataclass(frozen=True)
class Times:
    """The time of each frame."""

    numbers: list[float] | None
    unit: str | None
    calendar: str | None = None

    @classmethod
    def of(cls, times: Any, unit: str | None) -> Times:
        """Dates count seconds since the first of them, and lengths of time seconds or ``unit``."""
        if times is None:
            return cls(None, unit)
        array = _array(times)
        if array.dtype.kind in "mM" and np.isnat(array).any():
            raise ValueError(f"times: frame {int(np.argmax(np.isnat(array)))} has none (NaT)")
        if array.dtype.kind == "m":
            return cls._of_lengths(array, unit)
        is_date = array.dtype.kind == "M" or (array.size > 0 and hasattr(array[0], "calendar"))
        if is_date and unit is not None:
            raise ValueError(f"time_unit: times are dates, which count from the first of them; leave out {unit!r}")
        if array.dtype.kind == "M":
            return cls._of_dates(array)
        return (
            cls._of_cftime(array) if is_date else cls([_number(n, time) for n, time in enumerate(array.tolist())], unit)
        )

    @classmethod
    def _of_dates(cls, dates: npt.NDArray[Any]) -> Times:
        since = dates[0].astype("datetime64[s]")
        unit = f"seconds since {str(since).replace('T', ' ')}"
        calendar = "proleptic_gregorian" if dates.min() < _FIRST_GREGORIAN else None
        return cls(((dates - since) / np.timedelta64(1, "s")).tolist(), unit, calendar)

    @classmethod
    def _of_cftime(cls, dates: npt.NDArray[Any]) -> Times:
        calendar, since = dates[0].calendar, dates[0].replace(microsecond=0)
        if any(getattr(each, "calendar", None) != calendar for each in dates):
            raise ValueError("times: dates of several calendars")
        unit = f"seconds since {since.strftime('%Y-%m-%d %H:%M:%S').strip()}"
        seconds = [(each - since).total_seconds() for each in dates]
        return cls(seconds, unit, None if calendar in ("standard", "gregorian") else calendar)

    @classmethod
    def _of_lengths(cls, lengths: npt.NDArray[Any], unit: str | None) -> Times:
        word = (unit or "s").split()[0]
        found = next((length for words, length in _UNITS.items() if word in words), None)
        if found is None:
            raise ValueError(f"time_unit: lengths of time cannot be numbers in {unit!r}; give 's', 'h' or 'days'")
        return cls((lengths / found).tolist(), unit or "s")


def _array(times: Any) -> npt.NDArray[Any]:
    """Times as an array of one axis: datetime64, timedelta64, numbers, or dates of cftime."""
    if isinstance(times, (str, bytes)) or not isinstance(times, Iterable):
        raise TypeError(f"times: takes one for each frame: numbers, dates or lengths of time, not {times!r}")
    array = np.asarray(times if hasattr(times, "__array__") else list(times))
    if array.ndim != 1:
        raise ValueError(f"times: takes one for each frame, not an array of shape {array.shape}")
    if array.dtype.kind != "O" or array.size == 0:
        return array
    if all(isinstance(time, date) for time in array):
        return np.array([_in_utc(time) for time in array], "datetime64[us]")
    if all(isinstance(time, timedelta) for time in array):
        return array.astype("timedelta64[us]")
    return array


def _in_utc(time: date) -> date:
    """A date without a time zone."""
    is_zoned = isinstance(time, datetime) and time.tzinfo is not None
    return time.astimezone(timezone.utc).replace(tzinfo=None) if is_zoned else time  # type: ignore[attr-defined]


def _number(frame: int, time: Any) -> float:
    try:
        return float(time)
    except (TypeError, ValueError):
        what = f"times: takes numbers, dates or lengths of time, but frame {frame} has {time!r}"
        raise TypeError(what) from None
