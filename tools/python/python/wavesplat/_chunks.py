"""Chunks of arrays as bare streams (section 13 of the format), for codecs of other packages."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _wavesplat
from ._arguments import number, pair, text, whole
from ._axes import AXES, checked, volumes
from ._convert import Allowed, settings_of
from ._frames import bytes_of, sample_of

Array = npt.NDArray[Any]

_USUAL_AXES = {0: "", 1: "x", 2: "yx", 3: "tyx"}


@dataclass(frozen=True, kw_only=True)
class Chunks:
    """How chunks are stored. They are read by any settings with the same axes."""

    tolerance: float | None = None
    """The error allowed, as a share of the range of values in a chunk, or of ``range``; 0 keeps every bit."""
    max_error: float | None = None
    """The error allowed in the unit of the samples, instead."""
    bound: str = "pointwise"
    """What is limited, as `wavesplat.convert` says; so for ``floor``, ``keep`` and ``level``."""
    floor: float = 0.0
    range: tuple[float, float] | None = None
    """The range of values that ``tolerance`` refers to."""
    missing: str | float = "mask"
    """NaN and infinities are kept as they are, and so is the fill value of the array unless it is 0. A number is one more
    such value where the fill value is 0 or NaN. "error" refuses NaN and infinities, and takes other values as they are."""
    keep: str = ""
    axes: str | None = None
    """A letter for each axis of the array, slowest first: t, z, y and x, and c for others. By default those of
    "...tzyx", "tyx", "yx" or "x"."""
    level: int = 3

    def __post_init__(self) -> None:
        """Numbers and texts as JSON has them, and a check of all."""
        if self.tolerance is None and self.max_error is None:
            raise ValueError("tolerance: give this or max_error; 0 keeps every bit")
        if not 0 <= number("floor", self.floor) <= sys.float_info.max:
            raise ValueError(f"floor: takes 0 or more, not {self.floor}")
        plain: dict[str, Any] = {"floor": number("floor", self.floor), "level": whole("level", self.level)}
        for name, most in ("tolerance", 1.0), ("max_error", sys.float_info.max):
            given = getattr(self, name)
            plain[name] = None if given is None else number(name, given)
            if given is not None and not 0 <= plain[name] <= most:
                raise ValueError(f"{name}: takes 0 to {most:.4g}, not {given}")
        if self.range is not None:
            plain["range"] = tuple(number("range", end) for end in pair("range", "(LO, HI)", self.range))
        if not isinstance(self.missing, str):
            value = number("missing", self.missing)
            plain["missing"] = value if math.isfinite(value) else "mask"
        plain["keep"] = text("keep", self.keep) or ""
        if self.axes is not None:
            self.letters(len(text("axes", self.axes) or ""))
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        _wavesplat.check(self._request(None))

    @classmethod
    def of(cls, given: Any) -> Chunks:
        """The settings of a configuration; unknown ones are refused."""
        given = given or {}
        unknown = sorted(given.keys() - {field.name for field in fields(cls)})
        if unknown:
            raise ValueError(f"wavesplat: unknown in the codec's configuration: {', '.join(unknown)}")
        return cls(**given)

    def configuration(self) -> dict[str, Any]:
        """The settings that are not the usual ones."""
        usual = {field.name: field.default for field in fields(self)}
        return {name: value for name, value in asdict(self).items() if value != usual[name]}

    def _request(self, fill: Any) -> str:
        """The library's request."""
        settings = settings_of(self.bound, self.floor, self.range, self._missing(fill), self.keep, self.level)
        masked = {} if self.missing == "error" else {"missing": "mask"}
        return json.dumps(settings | Allowed(self.tolerance, self.max_error).of_variable(None) | masked)

    def _missing(self, fill: Any) -> str | float:
        """The value that is kept besides NaN and infinities, if there is one: a file has one such value at most."""
        if self.missing == "error" or fill is None or not fill or np.isnan(fill):
            return self.missing
        if self.missing != "mask" and not _is_same(self.missing, np.asarray(fill)):
            raise ValueError(
                f"missing: is {self.missing}, but the fill value of the array is {fill}; let both be the same"
            )
        return float(fill)

    def letters(self, axes: int) -> str:
        """A letter for each of the axes."""
        usual = _USUAL_AXES.get(axes, "c" * (axes - len(AXES)) + AXES)
        return checked(usual if self.axes is None else self.axes, axes)

    def _runs(self, samples: Array) -> Iterator[Array]:
        """The samples as (time, z, y, x), for each place along other axes."""
        return volumes(samples, self.letters(samples.ndim))

    def encoded(self, samples: Array, fill: Any = None) -> bytes:
        """The streams of a chunk of an array with a fill value, if it has one."""
        request = self._request(fill)
        if samples.size == 0:
            return b""
        return b"".join(_stream(_without_end(run, fill), request) for run in self._runs(samples))

    def decode_into(self, samples: Array, stored: bytes, *, is_whole: bool = False) -> None:
        """Reads a chunk. What the streams leave out stays as it is, unless all must be there."""
        sample, at = sample_of(samples.dtype), 0
        for run in self._runs(samples) if samples.size else ():
            found, (x, y, z, frames), at = _wavesplat.decode(stored, at, run.shape[::-1], sample)
            if is_whole and (x, y, z, frames) != run.shape[::-1]:
                raise _wavesplat.DamagedError(f"a chunk: has {frames, z, y, x} samples instead of {run.shape}")
            run[:frames, :z, :y, :x] = found.view(_little_endian(sample)).reshape(frames, z, y, x)
        if at != len(stored):
            raise _wavesplat.DamagedError(f"a chunk: {len(stored) - at} bytes too many")


def _is_same(missing: Any, fill: Array) -> bool:
    """Whether a number is the fill value, as the samples have it."""
    with np.errstate(over="ignore"):
        return missing == float(fill) or (fill.dtype.kind == "f" and fill == fill.dtype.type(missing))


def _stream(run: Array, request: str) -> bytes:
    frames, z, y, x = run.shape
    return _wavesplat.encode(bytes_of(run), [x, y, z], sample_of(run.dtype), request)


def _without_end(run: Array, fill: Any) -> Array:
    """Leaves out samples at the far ends that are the fill value: those beyond the array, above all."""
    if fill is None:
        return run
    is_other = _bits(run) != _bits(np.asarray(fill, run.dtype))
    along = (is_other.any(axis=tuple(range(axis)) + tuple(range(axis + 1, run.ndim))) for axis in range(run.ndim))
    ends = (int(np.flatnonzero(one)[-1]) + 1 if one.any() else 1 for one in along)
    return run[tuple(slice(end) for end in ends)]


def _bits(samples: Array) -> Array:
    return np.ascontiguousarray(samples).view(f"u{samples.dtype.itemsize}")


def _little_endian(sample: str) -> np.dtype[Any]:
    return np.dtype(f"<{sample[0]}{int(sample[1:]) // 8}")
