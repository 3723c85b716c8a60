"""Conversions of arrays, datasets and iterators of frames."""

from __future__ import annotations

import json
import math
import os
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from operator import methodcaller
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _wavesplat
from ._file import MEMORY
from ._progress import Progress, reporting

SAMPLES = {"u1": "u8", "i1": "i8", "u2": "u16", "i2": "i16", "u4": "u32", "i4": "i32"} | {
    "f2": "f16",
    "f4": "f32",
    "f8": "f64",
}
"""The library's names of types of samples."""


def convert(
    source: Any,
    path: str | PathLike[str],
    *,
    tolerance: float | dict[str, float] | None = None,
    max_error: float | dict[str, float] | None = None,
    bound: str = "pointwise",
    floor: float = 0.0,
    range: tuple[float, float] | None = None,
    missing: str | float | None = None,
    clip: bool = False,
    variable: str | None = None,
    axes: str | None = None,
    times: Any = None,
    time_unit: str | None = None,
    spacing: tuple[float, float, float] | None = None,
    origin: tuple[float, float, float] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    window: int = 32,
    chain: int = 8,
    shard: tuple[int, int] | None = None,
    block: int | None = None,
    level: int = 3,
    memory: int = MEMORY,
    progress: Progress = False,
) -> dict[str, Any]:
    """Converts frames into a coefficient file, a window at a time: memory stays bounded, whatever the size of the source.

    The file has the same bytes as one that ``wavesplat convert`` makes of the same samples with the same settings. Ctrl-C
    leaves the finished windows in ``path`` + ".part"; ``resume=True`` continues there.

    Args:
        source: An array of shape (time, z, y, x) or (time, y, x): numpy's, Dask's, Zarr's or another that can be sliced;
            an iterable of frames (z, y, x) or (y, x); or a DataArray or Dataset of xarray, of which coordinates, attributes
            and times are kept.
        path: The ``.wspl`` file to write. For a Dataset with several variables, "%n" in it stands for the name of each.
        tolerance: The error allowed for each sample, as a share of the range of values; 0 keeps every bit. 0.01 by default.
            A dict gives one for each variable.
        max_error: The error allowed in the unit of the samples, instead.
        bound: What is limited: "pointwise", every sample; "rms", the root mean square of each voxel in each window;
            "relative", every sample by its own size.
        floor: For "relative": smaller samples may have the error of a sample of this size.
        range: The range of values that ``tolerance`` refers to; by default that of the frames so far.
        missing: "mask" keeps NaN and infinities as they are, "error" refuses them, and a number means "missing" as well. By
            default they are kept if the source says that some may be missing, and refused otherwise.
        clip: Whether decoded samples are kept within the extremes of the source.
        variable: Which variable of a Dataset; all that have three axes by default.
        axes: What each axis of a Dataset's variable counts, slowest first, in letters of "tzyx" ("c" for another); by
            default that follows from names, attributes and order.
        times: The time of each frame, for arrays: ascending numbers, or numpy's datetimes.
        time_unit: The unit of ``times``, perhaps since a date: "hours since 2000-01-01".
        spacing: The distance of voxels along x, y and z, for arrays.
        origin: The place of the first voxel along x, y and z, for arrays.
        resume: Whether to continue an unfinished conversion. Nothing is done if the file is complete already.
        overwrite: Whether to replace a file of this name.
        window: Frames that are coded together.
        chain: Windows in a row that may share how they are coded; shards are runs of these.
        shard: (I, N) converts the I-th of N shards of a Dataset, from 1, for `wavesplat.merge`. It needs ``range`` or
            ``max_error``, since a shard does not know the range of all frames.
        block: Voxels a side of a block; as many as suit the window by default.
        level: Level of zstd, 1 to 19.
        memory: Bytes that the conversion may take.
        progress: Whether to show progress, or a function of (done, all).

    Returns:
        The report of the conversion, as ``wavesplat convert --json`` prints it; one for each variable if there are several.

    Raises:
        ValueError: A setting is wrong, the file exists already, or the source has several variables and one name.
        InputError: Samples are missing, or frames differ in shape or type.

    """
    request: dict[str, Any] = {
        "bound": _bound(bound, floor),
        "range": None if range is None else [_finite("range", end) for end in (range[0], range[1])],
        **_missing(missing),
        "clip": clip,
        "window": window,
        "chain": chain,
        "block": block,
        "level": level,
        "memory": memory,
    }
    given = Conversion(request, os.fspath(path), resume, overwrite, Allowed(tolerance, max_error))
    if _is_of_xarray(source):
        from ._dataset import convert_dataset

        for name, extra in {"times": times, "time_unit": time_unit, "spacing": spacing, "origin": origin}.items():
            if extra is not None:
                raise ValueError(f"{name}: a Dataset has coordinates of its own; change those with assign_coords")
        request["shard"] = _shard(shard, range is not None or max_error is not None)
        return convert_dataset(source, given, variable=variable, axes=axes, progress=progress)
    if variable is not None or axes is not None or shard is not None:
        raise ValueError("variable, axes and shard are for a Dataset: an array is (time, z, y, x)")
    times, time_unit = _numbers(times, time_unit)
    frames = Frames.of(source, memory)
    layout = {
        "dims": frames.dims,
        "sample": frames.sample,
        "spacing": spacing,
        "origin": origin,
        "times": times,
        "time_unit": time_unit,
    }
    conversion = given.of_variable(None)
    with reporting(progress, "convert") as report:
        return told(*_wavesplat.convert_frames(frames.parts, layout, conversion, report))


def merge(
    shards: Iterable[str | PathLike[str]],
    path: str | PathLike[str],
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress = False,
) -> dict[str, Any]:
    """Joins shards, in any order, to the file that one conversion would make, byte for byte.

    Args:
        shards: The files that ``convert(..., shard=(I, N))`` made.
        path: The ``.wspl`` file to write.
        resume: Whether to continue an unfinished merge.
        overwrite: Whether to replace a file of this name.
        progress: Whether to show progress, or a function of (done, all).

    Returns:
        The report, as ``wavesplat merge --json`` prints it.

    Raises:
        ValueError: Shards are missing, given twice, of another archive or made otherwise; the message names them.
        DamagedError: A shard is damaged.

    """
    with reporting(progress, "merge") as report:
        names = [os.fspath(shard) for shard in shards]
        found: dict[str, Any] = json.loads(_wavesplat.merge(names, os.fspath(path), resume, overwrite, report))
    return found


@dataclass(frozen=True)
class Allowed:
    """The error allowed, perhaps for each variable."""

    tolerance: float | dict[str, float] | None
    max_error: float | dict[str, float] | None

    def of_variable(self, variable: str | None) -> dict[str, Any]:
        """The error allowed for a variable, as the library's request has it."""
        if self.tolerance is not None and self.max_error is not None:
            raise ValueError("tolerance is a share of a range, and max_error is in the samples' unit; give one")
        tolerance = _of_variable("tolerance", self.tolerance, variable)
        error = _of_variable("max_error", self.max_error, variable)
        return {
            "tolerance": None if tolerance is None else _number(tolerance),
            "max_error": None if error is None else _finite("max_error", error),
        }


@dataclass(frozen=True)
class Conversion:
    """What is asked of a conversion, and where it goes."""

    request: dict[str, Any]
    """The library's ``ConvertRequest``, without the error allowed."""
    path: str
    resume: bool
    overwrite: bool
    allowed: Allowed

    def of_variable(self, variable: str | None) -> dict[str, Any]:
        """The conversion of a variable, as the native half takes it."""
        request = self.request | self.allowed.of_variable(variable)
        words = json.dumps(request, default=methodcaller("item"))  # of numbers that are numpy's
        return {"request": words, "path": self.path, "resume": self.resume, "overwrite": self.overwrite}


def _number(number: Any) -> float | str:
    """A number for JSON, which has no NaN."""
    number = float(number)
    return number if math.isfinite(number) else repr(number)


def _finite(name: str, number: Any) -> float:
    if not math.isfinite(number):
        raise ValueError(f"{name}: takes finite numbers")
    return float(number)


def _bound(bound: str, floor: float) -> Any:
    if bound not in ("pointwise", "rms", "relative"):
        raise ValueError(f"bound: 'pointwise', 'rms' or 'relative', not \"{bound}\"")
    return {"relative": {"floor": _finite("floor", floor)}} if bound == "relative" else bound


def _missing(missing: str | float | None) -> dict[str, Any]:
    """What to do with missing samples, and the value that means "missing"."""
    if isinstance(missing, (int, float)) and not isinstance(missing, bool):
        return {"missing_value": _number(missing)}
    if missing not in ("mask", "error", None):
        raise ValueError(f"missing: 'error' or 'mask', not \"{missing}\"")
    return {"missing": missing}


def _shard(shard: tuple[int, int] | None, knows_range: bool) -> str | None:
    """A shard in the library's words."""
    if shard is None:
        return None
    number, count = shard
    if not 1 <= number <= count:
        raise ValueError(f"shard: takes (I, N), the I-th of N, from (1, {count}) to ({count}, {count})")
    if not knows_range:
        raise ValueError("shard: needs range=... or max_error=..., since a shard does not know all frames")
    return f"{number}/{count}"


def _of_variable(name: str, given: float | dict[str, float] | None, variable: str | None) -> float | None:
    if not isinstance(given, dict):
        return None if given is None else float(given)
    if variable not in given:
        raise ValueError(f"{name}: has no entry for {variable or 'an array without a name'}; it has {', '.join(given)}")
    return float(given[variable])


def told(report: str | None, notes: list[str]) -> dict[str, Any]:
    """The report of a conversion. Warns of what is worth knowing."""
    for note in notes:
        warnings.warn(note, stacklevel=_caller())
    return json.loads(report) if report is not None else {}


def _caller() -> int:
    """How far up the caller of this package is, for warnings."""
    folder = os.path.dirname(__file__)
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == folder:
        frame, level = frame.f_back, level + 1
    return level


def _is_of_xarray(source: Any) -> bool:
    return type(source).__module__.split(".")[0] == "xarray"


def _numbers(times: Any, unit: str | None) -> tuple[list[float] | None, str | None]:
    """Times as numbers. Datetimes count seconds since the first of them."""
    if times is None:
        return None, unit
    times = np.asarray(times)
    if np.issubdtype(times.dtype, np.datetime64):
        since = times.reshape(-1)[0].astype("datetime64[s]")
        unit = f"seconds since {str(since).replace('T', ' ')}"
        times = (times - since) / np.timedelta64(1, "s")
    return [float(time) for time in times], unit


@dataclass(frozen=True)
class Frames:
    """Frames as parts of bytes, one after another."""

    dims: list[int]
    """Voxels along x, y and z; then frames, if their number is known."""
    sample: str
    parts: Iterator[npt.NDArray[np.uint8]]

    @classmethod
    def of(cls, source: Any, memory: int) -> Frames:
        """Those of an array, or of an iterable of frames."""
        if hasattr(source, "shape") and hasattr(source, "dtype") and hasattr(source, "__getitem__"):
            return cls._of_array(source, memory)
        if isinstance(source, (str, bytes, PathLike)):
            raise ValueError("source: takes arrays, not the name of a file; open it, say by xarray.open_dataset")
        if not isinstance(source, Iterable):
            raise ValueError(f"source: takes an array, a dataset or an iterable of frames, not {type(source).__name__}")
        return cls._of_iterable(source)

    @classmethod
    def _of_array(cls, array: Any, memory: int) -> Frames:
        shape = tuple(int(n) for n in array.shape)
        if len(shape) not in (3, 4) or 0 in shape:
            raise ValueError(f"source: takes an array (time, z, y, x) or (time, y, x), not one of shape {shape}")
        frames, *voxels = shape
        together = frames_together(shape, np.dtype(array.dtype).itemsize, _chunk(array), memory)
        starts = range(0, frames, together)
        parts = (_bytes(array[start : start + together], None) for start in starts)
        return cls([*_three(voxels), frames], _sample(array.dtype), parts)

    @classmethod
    def _of_iterable(cls, frames: Iterable[Any]) -> Frames:
        iterator = iter(frames)
        first = next(iterator, None)
        if first is None:
            raise _wavesplat.InputError("source: is empty")
        first = np.asarray(first)
        if first.ndim not in (2, 3):
            raise ValueError(f"source: frames are arrays (z, y, x) or (y, x), not of shape {first.shape}")
        parts = (_bytes(frame, first) for frame in chain([first], iterator))
        return cls(_three(list(first.shape)), _sample(first.dtype), parts)


def _three(voxels: list[int]) -> list[int]:
    """Voxels along x, y and z."""
    return [*reversed(voxels), *[1] * (3 - len(voxels))]


def _sample(dtype: Any) -> str:
    dtype = np.dtype(dtype)
    known = SAMPLES.get(f"{dtype.kind}{dtype.itemsize}")
    if known is None:
        raise ValueError(f"source: samples of type {dtype} are not supported; convert them by astype('float32')")
    return known


def _chunk(array: Any) -> tuple[int, ...] | None:
    """Lengths of the pieces that an array is made of: Dask's or Zarr's."""
    chunk = getattr(array, "chunksize", None) or getattr(array, "chunks", None)
    if not isinstance(chunk, tuple) or not all(isinstance(n, (int, np.integer)) for n in chunk):
        return None
    return tuple(int(n) for n in chunk)


_COPIES = 8
"""The part of the memory that frames which are taken together may have: they are there several times while they are made."""


def frames_together(shape: tuple[int, ...], itemsize: int, chunk: tuple[int, ...] | None, memory: int) -> int:
    """How many frames are best taken together: whole chunks, as far as the memory allows; at least one."""
    frame = int(np.prod(shape[1:], dtype=np.int64)) * itemsize
    most = max(memory // _COPIES // max(frame, 1), 1)
    along = chunk[0] if chunk else 1
    return max(most // along * along, min(along, most), 1)


def _bytes(frames: Any, like: npt.NDArray[Any] | None) -> npt.NDArray[np.uint8]:
    """The bytes of frames, x fastest."""
    if isinstance(frames, np.ma.MaskedArray):
        raise ValueError("source: masked arrays are ambiguous; convert array.filled(np.nan) with missing='mask'")
    array = np.asarray(frames)
    if like is not None and (array.shape, array.dtype) != (like.shape, like.dtype):
        what = f"a frame is {array.dtype} of shape {array.shape}"
        raise _wavesplat.InputError(f"source: {what}, but the first one is {like.dtype} of shape {like.shape}")
    return little_endian(array).reshape(-1).view(np.uint8)


def little_endian(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same numbers, contiguous, in the byte order of files."""
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
