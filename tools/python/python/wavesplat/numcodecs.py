"""A codec of numcodecs, for ClimateBenchPress and others: ``numcodecs.get_codec({"id": "wavesplat", "max_error": 0.05})``."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numcodecs.abc import Codec
from numcodecs.compat import ndarray_copy

from . import _wavesplat
from ._chunks import Chunks
from ._frames import sample_of

_LENGTH = 4  # bytes of the length of what says shape and type


class Wavesplat(Codec):  # type: ignore[misc]
    """Stores arrays by wavesplat, with the error that ``tolerance`` or ``max_error`` allows. Settings are those of
    `wavesplat.zarr.WavesplatCodec`.
    """

    codec_id = "wavesplat"

    def __init__(self, **settings: Any) -> None:
        """By settings."""
        self._chunks = Chunks.of(settings)

    def get_config(self) -> dict[str, Any]:  # noqa: D102
        return {"id": self.codec_id, **self._chunks.configuration()}

    def __repr__(self) -> str:  # noqa: D105
        settings = ", ".join(f"{name}={value!r}" for name, value in self._chunks.configuration().items())
        return f"Wavesplat({settings})"

    def encode(self, buf: Any) -> bytes:  # noqa: D102
        samples = np.asarray(buf)
        sample_of(samples.dtype)
        about = json.dumps({"shape": samples.shape, "dtype": samples.dtype.newbyteorder("<").str}).encode()
        return len(about).to_bytes(_LENGTH, "little") + about + self._chunks.encoded(samples)

    def decode(self, buf: Any, out: Any = None) -> Any:  # noqa: D102
        stored = bytes(buf)
        end = _LENGTH + int.from_bytes(stored[:_LENGTH], "little")
        try:
            about = json.loads(stored[_LENGTH:end])
            samples = np.empty(about["shape"], about["dtype"])
            sample_of(samples.dtype)
        except (KeyError, MemoryError, RecursionError, TypeError, ValueError) as why:
            raise _wavesplat.DamagedError(f"a chunk: its shape and type cannot be read: {why}") from None
        try:
            self._chunks.decode_into(samples, stored[end:], is_whole=True)
        except _wavesplat.InputError as why:
            raise _wavesplat.DamagedError(str(why)) from None
        return samples if out is None else ndarray_copy(samples, out)
