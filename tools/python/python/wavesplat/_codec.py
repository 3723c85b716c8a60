"""The codec of Zarr arrays."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
from zarr.abc.codec import ArrayBytesCodec
from zarr.core.array_spec import ArraySpec
from zarr.core.buffer import Buffer, NDBuffer

from ._chunks import Chunks
from ._frames import sample_of

NAME = "wavesplat"


class WavesplatCodec(Chunks, ArrayBytesCodec):
    """Stores the chunks of a Zarr array (version 3) by wavesplat, with the error that ``tolerance`` or ``max_error`` allows.

    ``zarr.create_array(..., serializer=WavesplatCodec(max_error=0.05), compressors=None)``. Chunks of 32 or more frames of
    64^3 or more voxels are nearly as small as one file.
    """

    is_fixed_size = False

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> WavesplatCodec:  # noqa: D102
        if data.get("name") != NAME:
            raise ValueError(f"a codec named {data.get('name')!r} instead of {NAME!r}")
        codec = cls.of(data.get("configuration"))
        assert isinstance(codec, cls)
        return codec

    def to_dict(self) -> dict[str, Any]:  # noqa: D102
        return {"name": NAME, "configuration": self.configuration()}

    def validate(self, *, shape: tuple[int, ...], dtype: Any, chunk_grid: Any) -> None:  # noqa: D102
        sample_of(dtype.to_native_dtype())
        self.letters(len(shape))

    def compute_encoded_size(self, input_byte_length: int, chunk_spec: ArraySpec) -> int:  # noqa: D102
        raise NotImplementedError

    async def _encode_single(self, chunk_array: NDBuffer, chunk_spec: ArraySpec) -> Buffer:
        samples = chunk_array.as_numpy_array().reshape(chunk_spec.shape)  # some filters flatten it
        stored = await asyncio.to_thread(self.encoded, samples, chunk_spec.fill_value)
        return chunk_spec.prototype.buffer.from_bytes(stored)

    async def _decode_single(self, chunk_bytes: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        samples = np.full(chunk_spec.shape, chunk_spec.fill_value, chunk_spec.dtype.to_native_dtype())
        await asyncio.to_thread(self.decode_into, samples, chunk_bytes.to_bytes())
        return chunk_spec.prototype.nd_buffer.from_numpy_array(samples)
