"""What an index asks for along each axis, and how to read no more than that."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from types import EllipsisType
from typing import Any

import numpy as np
import numpy.typing as npt

Items = npt.NDArray[np.int64]
"""Indices along an axis, in the order that is asked for."""


@dataclass(frozen=True)
class Selection:
    """The items along each axis, and whether an axis is dropped since a number was given."""

    items: list[Items]
    dropped: list[bool]
    new: list[int]
    """Places of new axes in the result."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape with all axes."""
        return tuple(len(items) for items in self.items)

    def finish(self, samples: npt.NDArray[Any]) -> Any:
        """Drops axes of single numbers, and adds new ones. A single sample becomes a number, as in numpy."""
        result = samples[tuple(0 if dropped else slice(None) for dropped in self.dropped)]
        for axis in self.new:
            result = np.expand_dims(result, axis)
        return result[()] if result.ndim == 0 else result


def select(key: Any, shape: Sequence[int], *, outer: bool = False) -> Selection:
    """What a key asks for, as numpy reads it. Arrays apply to their axes one by one; without ``outer`` there may be one."""
    keys = _expanded(key if isinstance(key, tuple) else (key,), len(shape))
    items: list[Items] = []
    dropped: list[bool] = []
    new: list[int] = []
    arrays = 0
    for part in keys:
        if part is None:
            new.append(sum(not d for d in dropped) + len(new))
            continue
        axis = len(items)
        found, drops = _along(part, shape[axis], axis)
        arrays += not isinstance(part, slice) and not drops
        items.append(found)
        dropped.append(drops)
    if arrays > 1 and not outer:
        raise IndexError("several arrays of indices: use .oindex[...], which takes every combination of them")
    return Selection(items, dropped, new)


def box_of(items: Sequence[Items]) -> tuple[list[int], list[int]]:
    """Where a box of these items along z, y and x starts and stops along x, y and z."""
    for name, along in zip("zyx", items, strict=True):
        if len(along) == 0 or np.any(np.diff(along) != 1):
            raise ValueError(
                f"{name}: takes voxels that follow each other, at least one; lod= of open() takes every n-th"
            )
    x_first = items[::-1]
    return [int(along[0]) for along in x_first], [int(along[-1]) + 1 for along in x_first]


def _expanded(keys: tuple[Any, ...], axes: int) -> list[slice | Any]:
    """The key with a slice for every axis that it does not name."""
    named = sum(part is not None and part is not Ellipsis for part in keys)
    if named > axes:
        raise IndexError(f"too many indices: there are {axes} axes (time, z, y, x), but {named} were given")
    if sum(part is Ellipsis for part in keys) > 1:
        raise IndexError("an index can have one ellipsis ('...')")
    rest = [slice(None)] * (axes - named)
    at = next((at for at, part in enumerate(keys) if isinstance(part, EllipsisType)), len(keys))
    return [*keys[:at], *rest, *keys[at + 1 :]]


def _along(part: Any, length: int, axis: int) -> tuple[Items, bool]:
    """The items that a part of a key asks for, and whether it is one number."""
    if isinstance(part, slice):
        return np.arange(*part.indices(length), dtype=np.int64), False
    array = np.asarray(part)
    if array.dtype == bool:
        if array.shape != (length,):
            raise IndexError(f"a mask along axis {axis} has {length} items, not the shape {array.shape}")
        return np.flatnonzero(array).astype(np.int64), False
    if array.size == 0:
        array = array.astype(np.int64)
    if not np.issubdtype(array.dtype, np.integer) or array.ndim > 1:
        raise IndexError("an index is a whole number, a slice, '...', None, or a list of whole numbers or of booleans")
    items = np.atleast_1d(array).astype(np.int64)
    wrong = items[(items < -length) | (items >= length)]
    if len(wrong):
        raise IndexError(f"index {wrong[0]} is out of bounds for axis {axis} with size {length}")
    return np.where(items < 0, items + length, items), array.ndim == 0


@dataclass(frozen=True)
class _Run:
    """Indices that are read together along an axis: from ``start`` to ``stop``."""

    start: int
    stop: int
    places: Items
    """Where their values go in the result."""
    items: Items
    """Which values these are, counted from ``start``."""

    @property
    def is_whole(self) -> bool:
        """Whether every value is asked for once."""
        return np.array_equal(self.items, np.arange(self.stop - self.start))


def _runs(items: Items, joins: Callable[[int, int], bool]) -> list[_Run]:
    """Ascending runs, each of items that ``joins`` joins to the one before."""
    order = np.argsort(items, kind="stable")
    ascending = items[order]
    cuts = [at for at in range(1, len(ascending)) if not joins(int(ascending[at - 1]), int(ascending[at]))]
    bounds = [0, *cuts, len(ascending)]
    pairs = zip(bounds[:-1], bounds[1:], strict=True)
    return [
        _Run(int(part[0]), int(part[-1]) + 1, order[lo:hi], part - part[0])
        for lo, hi in pairs
        for part in (ascending[lo:hi],)
    ]


Read = Callable[[list[int], tuple[list[int], list[int]], npt.NDArray[Any]], None]
"""Reads some ascending frames of a box (starts and stops along z, y, x) into an array (frames, z, y, x)."""


def read_into(
    out: npt.NDArray[Any],
    items: Sequence[Items],
    read: Read,
    *,
    blocks: Sequence[int],
    windows: Sequence[int],
    memory: int,
) -> None:
    """Fills ``out`` with every combination of items (time, z, y, x), and reads only the blocks that these are in."""
    if out.size == 0:
        return
    spatial = [_runs(along, _same_or_next(edge)) for along, edge in zip(items[1:], blocks, strict=True)]
    for box in product(*spatial):
        start, stop = [run.start for run in box], [run.stop for run in box]
        size = [run.stop - run.start for run in box]
        frame_bytes = int(np.prod(size)) * out.itemsize
        for frames, places in _frames(items[0], windows, max(memory // max(frame_bytes, 1), 1)):
            target = _box_of(out, places, box)
            if target is not None and all(run.is_whole for run in box):
                read(frames, (start, stop), target)
                continue
            samples = np.empty((len(frames), *size), out.dtype)
            read(frames, (start, stop), samples)
            picked = samples[:, box[0].items][:, :, box[1].items][:, :, :, box[2].items]
            out[np.ix_(places, *(run.places for run in box))] = picked


def _same_or_next(edge: int) -> Callable[[int, int], bool]:
    return lambda before, after: after // edge <= before // edge + 1


def _frames(items: Items, windows: Sequence[int], most: int) -> Iterator[tuple[list[int], Items]]:
    """Ascending frames that are read together, and their places; at most ``most`` unless a window has more."""
    ends = np.cumsum(windows)
    order = np.argsort(items, kind="stable")
    at = 0
    while at < len(order):
        end = min(at + most, len(order))
        if end < len(order):  # whole windows, so that none is decoded twice
            window = np.searchsorted(ends, items[order[end]], side="right")
            first = int(np.searchsorted(items[order], ends[window - 1] if window else 0))
            end = first if first > at else end
        part = order[at:end]
        yield [int(frame) for frame in items[part]], part
        at = end


def _box_of(out: npt.NDArray[Any], places: Items, box: Sequence[_Run]) -> npt.NDArray[Any] | None:
    """The part of ``out`` for these places if it is contiguous, so that it can be read without a copy."""
    all_places = [places, *(run.places for run in box)]
    if any(np.any(np.diff(along) != 1) for along in all_places):
        return None
    part: npt.NDArray[Any] = out[tuple(slice(int(along[0]), int(along[-1]) + 1) for along in all_places)]
    return part if part.flags.c_contiguous else None
