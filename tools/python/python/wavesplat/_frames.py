"""Frames of arrays and iterators as bytes of the types that files hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _wavesplat
from ._axes import checked, others, volumes

SAMPLES = {"u1": "u8", "i1": "i8", "u2": "u16", "i2": "i16", "u4": "u32", "i4": "i32"} | {
    "f2": "f16",
    "f4": "f32",
    "f8": "f64",
}
"""The library's names of types of samples."""

_NARROWED = {"i8": "i4", "u8": "u4", "b1": "u1"}
"""Types that become others, if the numbers fit."""


@dataclass(frozen=True)
class Frames:
    """Frames as parts of bytes, one after another."""

    dims: list[int]
    """Voxels along x, y and z; then frames, if their number is known."""
    name: str
    """What messages call the frames."""
    sample: str
    parts: Iterator[npt.NDArray[np.uint8]]

    @classmethod
    def of(cls, source: Any, memory: int, missing: Any, axes: str | None = None) -> Frames:
        """Those of an array, or of an iterable of frames. ``missing`` says what masked samples become."""
        if hasattr(source, "shape") and hasattr(source, "dtype") and hasattr(source, "__getitem__"):
            return cls._of_array(source if axes is None else _in_order(source, axes), memory, missing)
        if axes is not None:
            raise ValueError("axes: is for an array or a Dataset; frames of an iterable are (z, y, x) or (y, x)")
        if isinstance(source, (str, bytes, PathLike)):
            raise ValueError("source: takes arrays, not the name of a file; open it, say by xarray.open_dataset")
        if not isinstance(source, Iterable):
            raise ValueError(f"source: takes an array, a dataset or an iterable of frames, not {type(source).__name__}")
        return cls._of_iterable(source, missing)

    @classmethod
    def _of_array(cls, array: Any, memory: int, missing: Any) -> Frames:
        shape = tuple(int(n) for n in array.shape)
        if len(shape) not in (3, 4) or 0 in shape:
            raise ValueError(f"source: takes an array (time, z, y, x) or (time, y, x), not one of shape {shape}")
        frames, *voxels = shape
        dtype = _dtype(array)
        sample = sample_of(dtype)
        together = frames_together(shape, dtype.itemsize, _chunk(array), memory)
        each = ((start, array[start : start + together]) for start in range(0, frames, together))
        parts = (_Part(start, part, missing).bytes((*shape[1:],), dtype) for start, part in each)
        return cls([*_three(voxels), frames], "source, the array", sample, parts)

    @classmethod
    def _of_iterable(cls, frames: Iterable[Any], missing: Any) -> Frames:
        iterator = iter(frames)
        first = next(iterator, None)
        if first is None:
            raise _wavesplat.InputError("source: is empty")
        like = _array(first)
        if like.ndim not in (2, 3) or 0 in like.shape:
            raise ValueError(f"source: frames are arrays (z, y, x) or (y, x), not of shape {like.shape}")
        each = enumerate(chain([first], iterator))
        sample = sample_of(like.dtype)
        parts = (_Part(n, _array(frame)[None], missing).bytes(like.shape, like.dtype) for n, frame in each)
        return cls(_three(list(like.shape)), "source, the frames", sample, parts)


def _in_order(array: Any, letters: str) -> Any:
    """An array with these axes as (time, z, y, x)."""
    shape, letters = array.shape, checked(letters, len(array.shape))
    if letters in ("tzyx", "tyx"):
        return array
    for axis in others(letters):
        if shape[axis] != 1:
            each = ", ".join(["n" if at == axis else ":" for at in range(len(shape))])
            raise ValueError(
                f"axes: axis {axis} counts no frames and no voxels, and has {shape[axis]} items; convert each to a file "
                f"of its own, array[{each}]"
            )
    if not hasattr(array, "__array_function__"):
        name = type(array).__name__
        raise ValueError(f"axes: {name} cannot be transposed; give numpy.asarray(...) or dask.array.from_array(...)")
    return next(volumes(array, letters))


def _three(voxels: list[int]) -> list[int]:
    """Voxels along x, y and z."""
    return [*reversed(voxels), *[1] * (3 - len(voxels))]


def _dtype(array: Any) -> np.dtype[Any]:
    """The type of the samples that slices have: netCDF4 scales them, and other libraries have types of their own."""
    is_numpys = isinstance(array.dtype, np.dtype) and type(array).__module__.split(".")[0] != "netCDF4"
    return array.dtype if is_numpys else _array(array[:1]).dtype


def _array(given: Any) -> npt.NDArray[Any]:
    """An array, perhaps with a mask. Arrays on other devices come by ``get()``, and those of other libraries by DLPack."""
    if isinstance(given, np.ma.MaskedArray):
        return given
    if callable(getattr(given, "get", None)):
        given = given.get()
    if not hasattr(given, "__array__") and hasattr(given, "__dlpack__"):
        return np.from_dlpack(given)
    return np.asarray(given)


def _key(dtype: np.dtype[Any]) -> str:
    return f"{dtype.kind}{dtype.itemsize}"


def sample_of(dtype: np.dtype[Any]) -> str:
    """The library's name of a type of samples."""
    known = SAMPLES.get(_NARROWED.get(_key(dtype), _key(dtype)))
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


@dataclass(frozen=True)
class _Part:
    """Some frames, the first of them with the number ``start``."""

    start: int
    frames: Any
    missing: Any

    def bytes(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> npt.NDArray[np.uint8]:
        """Their bytes, x fastest. ``shape`` and ``dtype`` are those of the frames before."""
        array = _array(self._unmasked())
        if (array.shape[1:], array.dtype) != (shape, dtype):
            what = f"frame {self.start} is {array.dtype} of shape {array.shape[1:]}"
            raise _wavesplat.InputError(f"source: {what}, but the first one is {dtype} of shape {shape}")
        return little_endian(self._narrowed(array)).reshape(-1).view(np.uint8)

    def _unmasked(self) -> Any:
        """The frames without a mask. Masked samples become what is missing."""
        frames = self.frames.compute() if hasattr(self.frames, "compute") else self.frames  # Dask's may have a mask
        if not isinstance(frames, np.ma.MaskedArray):
            return frames
        mask = np.asarray(np.ma.getmask(frames))
        if not mask.any():
            return frames.data
        is_float = frames.dtype.kind == "f"
        if self.missing == "mask" and is_float:
            return frames.filled(np.nan)
        if self.missing not in ("mask", "error", None):
            return frames.filled(self.missing)
        advice = "missing='mask' keeps them as NaN" if is_float else "missing=N stores them as the number N"
        other = "; or convert what array.filled(...) gives"
        raise ValueError(f"source: frame {self.start + _first(mask)} has masked samples; {advice}{other}")

    def _narrowed(self, array: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Integers of 64 bits in 32, and booleans as numbers."""
        narrow = _NARROWED.get(_key(array.dtype))
        if narrow is None:
            return array
        narrowed = array.astype(narrow)
        unfit = np.asarray(narrowed != array)
        if not unfit.any():
            return narrowed
        what = f"frame {self.start + _first(unfit)} has {array[unfit][0]}, which does not fit into {narrowed.dtype}"
        raise _wavesplat.InputError(f"source: {what}; convert the samples by astype('float64')")


def bytes_of(frames: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """The bytes of an array of frames, x fastest, as the type that files hold."""
    return _Part(0, frames, None).bytes(frames.shape[1:], frames.dtype)


def _first(found: npt.NDArray[np.bool_]) -> int:
    """The first frame with something found."""
    return int(np.argmax(found.reshape(len(found), -1).any(axis=1)))


def little_endian(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same numbers, contiguous, in the byte order of files."""
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
