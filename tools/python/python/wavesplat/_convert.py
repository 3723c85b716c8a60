"""Conversions of arrays, datasets and iterators of frames."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from . import _wavesplat
from ._arguments import MEMORY, located, number, pair, text, three, whole
from ._frames import Frames
from ._progress import Progress, reporting
from ._reports import told
from ._times import Times


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
    keep: str = "",
    variable: str | None = None,
    axes: str | None = None,
    times: Any = None,
    time_unit: str | None = None,
    spacing: tuple[float, float, float] | None = None,
    origin: tuple[float, float, float] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    best_for: str | None = None,
    window: int | None = None,
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
        source: An array of shape (time, z, y, x) or (time, y, x), or as ``axes`` says: numpy's, Dask's, Zarr's, netCDF4's or
            another that can be sliced; an iterable of frames (z, y, x) or (y, x); or a DataArray or Dataset of xarray, of
            which coordinates, attributes and times are kept. Integers of 64 bits must fit into 32, and booleans become 0
            and 1.
        path: The ``.wspl`` file to write. For a Dataset with several variables, "%n" in it stands for the name of each.
        tolerance: The error allowed for each sample, as a share of the range of values; 0 keeps every bit. 0.01 by default.
            A dict gives one for each variable.
        max_error: The error allowed in the unit of the samples, instead.
        bound: What is limited: "pointwise", every sample; "rms", the root mean square of each voxel in each window;
            "relative", every sample by its own size.
        floor: For "relative": smaller samples may have the error of a sample of this size.
        range: The range of values that ``tolerance`` refers to; by default that of the frames so far.
        missing: "mask" keeps NaN and infinities as they are, "error" refuses them, and a number means "missing" as well. By
            default they are kept if the source says that some may be missing, and refused otherwise. Masked samples become
            NaN by "mask", or that number.
        keep: What samples keep besides the bound, as words with spaces between them: "range", none is beyond the extremes of
            its window; "sign", none changes its sign; "side=0.5,2", each stays below, at or above these values, so that their
            isosurfaces have the same pieces and holes; "sum", sums of each block and frame are those of the source;
            "difference=E", changes from frame to frame are off by at most E; "gradient=E" and "laplacian=E", the same for
            derivatives in space; "curl=E" and "divergence=E", the same if every component of the vector is converted with it;
            "relative=S@F", samples of magnitude F or more are off by at most S times their magnitude.
        variable: Which variable of a Dataset; all that have three axes by default.
        axes: What each axis of an array or of a Dataset's variable counts, slowest first, in letters of "tzyx" ("c" for
            another, of length 1). By default arrays are "tzyx" or "tyx", and for a Dataset that follows from names,
            attributes and order. To convert an ensemble, convert each member to a file of its own.
        times: The time of each frame, for arrays: ascending numbers, dates or lengths of time, of numpy, cftime or Python.
        time_unit: The unit of ``times``, perhaps since a date: "hours since 2000-01-01".
        spacing: The distance of voxels along x, y and z, for arrays.
        origin: The place of the first voxel along x, y and z, for arrays.
        resume: Whether to continue an unfinished conversion. Nothing is done if the file is complete already.
        overwrite: Whether to replace a file of this name.
        best_for: What the file is made best for, by ``window`` and ``block`` where they are not given: "series" of single
            voxels, single frames and their "pictures", or "size"; by default all of these.
        window: Frames that are coded together; by default 32, and up to 1024 for at most 256 voxels.
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
    request = settings_of(bound, floor, range, missing, keep, level) | {
        "best_for": _best_for(best_for),
        "window": None if window is None else whole("window", window),
        "chain": whole("chain", chain),
        "block": None if block is None else whole("block", block),
        "memory": whole("memory", memory),
    }
    variable, axes = text("variable", variable), text("axes", axes)
    given = Conversion(request, located(path), bool(resume), bool(overwrite), Allowed(tolerance, max_error))
    if _is_of_xarray(source):
        from ._dataset import convert_dataset

        for name, extra in {"times": times, "time_unit": time_unit, "spacing": spacing, "origin": origin}.items():
            if extra is not None:
                raise ValueError(f"{name}: a Dataset has coordinates of its own; change those with assign_coords")
        request["shard"] = _shard(shard, range is not None or max_error is not None)
        return convert_dataset(source, given, variable=variable, axes=axes, progress=progress)
    if variable is not None or shard is not None:
        raise ValueError("variable and shard are for a Dataset")
    when = Times.of(times, text("time_unit", time_unit))
    frames = Frames.of(source, memory, missing, axes)
    layout = _layout(frames, when, three("spacing", spacing), three("origin", origin))
    conversion = given.of_variable(None)
    with reporting(progress, "convert") as report:
        return told(*_wavesplat.convert_frames(frames.parts, layout, conversion, report))


def append(
    source: Any,
    path: str | PathLike[str],
    *,
    variable: str | None = None,
    axes: str | None = None,
    times: Any = None,
    time_unit: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    memory: int = MEMORY,
    progress: Progress = False,
) -> dict[str, Any]:
    """Adds later frames to a coefficient file, with the settings of its conversion, in windows after the existing ones.

    Full windows are the same as if all frames had been converted at once. The work is done on a copy, which replaces the file
    when it is complete: programs that read the old file are not disturbed, and an interrupted run loses nothing.

    Args:
        source: The frames, as for `convert`.
        path: The ``.wspl`` file. For a Dataset with several variables, "%n" in it stands for the name of each.
        variable: Which variable of a Dataset; the only one that has three axes by default.
        axes: As for `convert`.
        times: The time of each frame, for arrays: needed if the file has times. Dates go on the file's clock.
        time_unit: The unit of ``times``, perhaps since a date.
        resume: Whether to continue an unfinished run of this function.
        overwrite: Whether to discard what an earlier run left unfinished, and to add frames that are not later ones.
            Without times, arrays are not compared with the frames that the file has.
        memory: Bytes that the conversion may take.
        progress: Whether to show progress, or a function of (done, all).

    Returns:
        The report, as ``wavesplat append --json`` prints it; one for each variable if there are several.

    Raises:
        ValueError: A setting is wrong, or an earlier run was not finished.
        InputError: The frames do not fit the file, it has them already, or only one of both has times.

    """
    appending = Appending(located(path), whole("memory", memory), bool(resume), bool(overwrite))
    if _is_of_xarray(source):
        from ._dataset import append_dataset

        if times is not None or time_unit is not None:
            raise ValueError("times: a Dataset has coordinates of its own; change those with assign_coords")
        name, letters = text("variable", variable), text("axes", axes)
        return append_dataset(source, appending, variable=name, axes=letters, progress=progress)
    if variable is not None:
        raise ValueError("variable is for a Dataset")
    frames = Frames.of(source, memory, _missing_of(appending.path), text("axes", axes))
    layout = _layout(frames, Times.of(times, text("time_unit", time_unit)), None, None)
    with reporting(progress, "append") as report:
        return told(*_wavesplat.append_frames(frames.parts, layout, vars(appending), report))


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
        if isinstance(shards, (str, bytes, PathLike)):
            raise TypeError("shards: takes a list of files, not one")
        names = [located(shard) for shard in shards]
        found: dict[str, Any] = json.loads(_wavesplat.merge(names, located(path), resume, overwrite, report))
    return found


def _missing_of(path: str) -> str | float | None:
    """What a file does with missing samples, as `convert` takes it."""
    file = _wavesplat.File(path)
    return file.missing_value if file.missing_value is not None else file.setting("missing")


def _layout(frames: Frames, when: Times, spacing: Any, origin: Any) -> dict[str, Any]:
    """The meaning and the positions of frames, as the native half takes them."""
    return {
        "dims": frames.dims,
        "name": frames.name,
        "sample": frames.sample,
        "spacing": spacing,
        "origin": origin,
        "times": when.numbers,
        "time_unit": when.unit,
        "calendar": when.calendar,
    }


def settings_of(
    bound: str,
    floor: float,
    range: tuple[float, float] | None,
    missing: str | float | None,
    keep: str,
    level: int,
) -> dict[str, Any]:
    """Those fields of the library's ``ConvertRequest`` that conversions of whole archives and of chunks share."""
    return {
        "bound": _bound(bound, floor),
        "range": None if range is None else [_finite("range", end) for end in pair("range", "(LO, HI)", range)],
        **_missing(missing),
        "keep": text("keep", keep),
        "level": whole("level", level),
    }


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
class Appending:
    """A file that frames are added to."""

    path: str
    memory: int
    resume: bool
    overwrite: bool


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
        return {"request": json.dumps(request), "path": self.path, "resume": self.resume, "overwrite": self.overwrite}


def _number(value: float) -> float | str:
    """A number for JSON, which has no NaN."""
    return value if math.isfinite(value) else repr(value)


def _finite(name: str, value: Any) -> float:
    if not math.isfinite(number(name, value)):
        raise ValueError(f"{name}: takes finite numbers")
    return float(value)


def _best_for(best_for: str | None) -> str | None:
    if text("best_for", best_for) not in (None, "series", "pictures", "size"):
        raise ValueError(f"best_for: 'series', 'pictures' or 'size', not {best_for!r}")
    return best_for


def _bound(bound: str, floor: float) -> Any:
    if bound not in ("pointwise", "rms", "relative"):
        raise ValueError(f"bound: 'pointwise', 'rms' or 'relative', not \"{bound}\"")
    return {"relative": {"floor": _finite("floor", floor)}} if bound == "relative" else bound


def _missing(missing: str | float | None) -> dict[str, Any]:
    """What to do with missing samples, and the value that means "missing"."""
    if isinstance(missing, (int, float, np.number)) and not isinstance(missing, bool):
        return {"missing_value": _number(float(missing))}
    if missing not in ("mask", "error", None):
        raise ValueError(f"missing: 'error' or 'mask', not \"{missing}\"")
    return {"missing": missing}


def _shard(shard: tuple[int, int] | None, knows_range: bool) -> str | None:
    """A shard in the library's words."""
    if shard is None:
        return None
    index, count = (whole("shard", part) for part in pair("shard", "(I, N)", shard))
    if not 1 <= index <= count:
        raise ValueError(f"shard: takes (I, N), the I-th of N, from (1, {count}) to ({count}, {count})")
    if not knows_range:
        raise ValueError("shard: needs range=... or max_error=..., since a shard does not know all frames")
    return f"{index}/{count}"


def _of_variable(name: str, given: float | dict[str, float] | None, variable: str | None) -> float | None:
    if not isinstance(given, dict):
        return None if given is None else number(name, given)
    if variable not in given:
        raise ValueError(f"{name}: has no entry for {variable or 'an array without a name'}; it has {', '.join(given)}")
    return number(name, given[variable])


def _is_of_xarray(source: Any) -> bool:
    return type(source).__module__.split(".")[0] == "xarray"
