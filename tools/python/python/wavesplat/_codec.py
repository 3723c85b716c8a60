"""The codec of Zarr arrays: chunks as bare streams (section 13 of the format)."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
from zarr.abc.codec import ArrayBytesCodec
from zarr.core.array_spec import ArraySpec
from zarr.core.buffer import Buffer, NDBuffer

from . import _wavesplat
from ._convert import Allowed, settings_of
from ._frames import bytes_of, sample_of

_Array = npt.NDArray[Any]

_AXES = "tzyx"
_USUAL_AXES = {1: "t", 2: "yx", 3: "tyx"}


@dataclass(frozen=True, kw_only=True)
class WavesplatCodec(ArrayBytesCodec):
    """Stores the chunks of a Zarr array (version 3) by wavesplat: ``zarr.create_array(..., serializer=WavesplatCodec(...))``.

    Chunks of 32 or more frames of 64^3 or more voxels are nearly as small as one file.
    """

    tolerance: float | None = None
    """The error allowed, as a share of the range of values in a chunk, or of ``range``; 0 keeps every bit."""
    max_error: float | None = None
    """The error allowed in the unit of the samples, instead."""
    bound: str = "pointwise"
    """What is limited, as `wavesplat.convert` says; so for ``floor``, ``keep`` and ``level``."""
    floor: float = 0.0
    range: tuple[float, float] | None = None
    """The range of values that ``tolerance`` refers to."""
    missing: str | float | None = None
    """A number that means "missing", besides NaN, infinities and the fill value of the array, unless that is 0; these are
    kept as they are. "error" refuses them."""
    keep: str = ""
    axes: str | None = None
    """A letter for each axis of the array, slowest first: t, z, y and x, and c for others. By default those of
    "...tzyx", "tyx", "yx" or "t"."""
    level: int = 3

    is_fixed_size = False

    def __post_init__(self) -> None:  # noqa: D105
        if self.tolerance is None and self.max_error is None:
            raise ValueError("WavesplatCodec: takes tolerance or max_error; 0 keeps every bit")
        self._request(None)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> WavesplatCodec:  # noqa: D102
        given = data.get("configuration", {})
        unknown = sorted(given.keys() - {field.name for field in fields(cls)})
        if unknown:
            raise ValueError(f"wavesplat: unknown in the codec's configuration: {', '.join(unknown)}")
        return cls(**given | {"range": tuple(given["range"]) if given.get("range") else None})

    def to_dict(self) -> dict[str, Any]:  # noqa: D102
        usual = {field.name: field.default for field in fields(self)}
        given = {name: value for name, value in asdict(self).items() if value != usual[name]}
        return {"name": "wavesplat", "configuration": given}

    def validate(self, *, shape: tuple[int, ...], dtype: Any, chunk_grid: Any) -> None:  # noqa: D102
        sample_of(dtype.to_native_dtype())
        self._letters(len(shape))

    def compute_encoded_size(self, input_byte_length: int, chunk_spec: ArraySpec) -> int:  # noqa: D102
        raise NotImplementedError

    async def _encode_single(self, chunk_array: NDBuffer, chunk_spec: ArraySpec) -> Buffer:
        stored = await asyncio.to_thread(self._encoded, chunk_array.as_numpy_array(), chunk_spec.fill_value)
        return chunk_spec.prototype.buffer.from_bytes(stored)

    async def _decode_single(self, chunk_bytes: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        samples = np.full(chunk_spec.shape, chunk_spec.fill_value, chunk_spec.dtype.to_native_dtype())
        await asyncio.to_thread(self._decode_into, samples, chunk_bytes.to_bytes())
        return chunk_spec.prototype.nd_buffer.from_numpy_array(samples)

    def _request(self, fill: Any) -> str:
        """The library's request."""
        is_told = self.missing is not None or fill is None or not fill
        missing = self.missing if is_told else float(fill)
        settings = settings_of(self.bound, self.floor, self.range, missing, self.keep, self.level)
        masked = {} if missing == "error" else {"missing": "mask"}
        return json.dumps(settings | Allowed(self.tolerance, self.max_error).of_variable(None) | masked)

    def _letters(self, axes: int) -> str:
        """A letter for each of the axes."""
        letters = self.axes or _USUAL_AXES.get(axes, "c" * (axes - len(_AXES)) + _AXES)
        repeated = any(letters.count(letter) > 1 for letter in _AXES)
        if len(letters) != axes or set(letters) - set(_AXES + "c") or repeated:
            raise ValueError(
                f'axes: takes a letter of "tzyxc" for each axis of the array, which has {axes}, not {letters!r}'
            )
        return letters

    def _runs(self, samples: _Array) -> Iterator[_Array]:
        """The samples as (time, z, y, x), for each place along other axes."""
        letters = self._letters(samples.ndim)
        others = [axis for axis, letter in enumerate(letters) if letter == "c"]
        own = [letters.index(letter) for letter in _AXES if letter in letters]
        arranged = samples.transpose(others + own)
        absent = tuple(axis for axis, letter in enumerate(_AXES) if letter not in letters)
        for place in np.ndindex(*arranged.shape[: len(others)]):
            yield np.expand_dims(arranged[(*place, ...)], absent)  # a view, of a single sample too

    def _encoded(self, samples: _Array, fill: Any) -> bytes:
        request, filled = self._request(fill), np.asarray(fill, samples.dtype)
        return b"".join(_stream(_without_end(run, filled), request) for run in self._runs(samples))

    def _decode_into(self, samples: _Array, stored: bytes) -> None:
        sample, at = sample_of(samples.dtype), 0
        for run in self._runs(samples):
            found, (x, y, z, frames), read = _wavesplat.decode(stored[at:], run.shape[::-1], sample)
            values = found.view(_little_endian(sample)).reshape(frames, z, y, x)
            run[:frames, :z, :y, :x] = values
            at += read
        if at != len(stored):
            raise _wavesplat.DamagedError(f"a chunk: {len(stored) - at} bytes too many")


def _stream(run: _Array, request: str) -> bytes:
    frames, z, y, x = run.shape
    return _wavesplat.encode(bytes_of(run), [x, y, z], sample_of(run.dtype), request)


def _without_end(run: _Array, fill: _Array) -> _Array:
    """Leaves out samples at the far ends that are the fill value: those beyond the array, above all."""
    is_other = _bits(run) != _bits(fill)
    for axis in range(run.ndim):
        along = is_other.any(axis=tuple(other for other in range(run.ndim) if other != axis))
        end = max(int(np.flatnonzero(along)[-1]) + 1 if along.any() else 1, 1)
        run = run.take(np.arange(end), axis=axis) if end < run.shape[axis] else run
    return run


def _bits(samples: _Array) -> _Array:
    return np.ascontiguousarray(samples).view(f"u{samples.dtype.itemsize}")


def _little_endian(sample: str) -> np.dtype[Any]:
    return np.dtype(f"<{sample[0]}{int(sample[1:]) // 8}")
