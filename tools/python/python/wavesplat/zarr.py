"""Coefficient files as read-only Zarr groups: ``wavesplat.zarr.open("run.wspl")``."""

from __future__ import annotations

import asyncio
import base64
import itertools
import struct
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass
from os import PathLike
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt
import xarray as xr
import zarr
from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import MemoryStore

from ._file import File
from ._file import open as open_file
from .xarray import variables_of


def open(path: str | PathLike[str], **options: Any) -> zarr.Group:
    """The group of a coefficient file: its samples, coordinates and attributes. Chunks are decoded when they are read.

    Args:
        path: As `wavesplat.open` takes it.
        options: ``lod``, ``cache_dir`` and ``cache`` of `wavesplat.open`.

    """
    return zarr.open_group(CoefficientStore(open_file(path, **options)), mode="r")


class CoefficientStore(Store):
    """An open file as a read-only Zarr store, for what opens stores, such as ``xarray.open_zarr``.

    A chunk has the samples of a block in a window, which are decoded together.
    """

    supports_writes = False
    supports_deletes = False
    supports_listing = True

    def __init__(self, file: File) -> None:
        """Of an open file."""
        super().__init__(read_only=True)
        self._file = file
        self._samples: dict[str, _Chunked] = {}
        self._others = MemoryStore()  # descriptions, and the chunks of small variables
        variables, attributes = variables_of(file)
        group = zarr.create_group(self._others, attributes=_plain(attributes))
        for name, variable in variables.items():
            self._add(group, name, variable)

    def _add(self, group: zarr.Group, name: str, variable: xr.Variable) -> None:
        preferred = variable.encoding.get("preferred_chunks")
        settings: dict[str, Any] = {
            "name": name,
            "dimension_names": variable.dims,
            "attributes": _plain(variable.attrs),
        }
        if preferred is None:
            values = variable.values
            values = values.astype(str) if values.dtype == object else values
            group.create_array(data=values, chunks=values.shape or "auto", compressors=None, filters=None, **settings)
            return
        chunks = tuple(max(preferred[dim]) for dim in variable.dims)
        self._samples[name] = _Chunked(variable, chunks)
        fill = variable.attrs.get("_FillValue", 0)
        group.create_array(
            shape=variable.shape,
            dtype=variable.dtype,
            chunks=chunks,
            compressors=None,
            filters=None,
            fill_value=fill,
            **settings,
        )

    def __eq__(self, other: object) -> bool:  # noqa: D105
        return isinstance(other, CoefficientStore) and self._file.path == other._file.path

    def __reduce__(self) -> tuple[Any, ...]:  # noqa: D105
        return CoefficientStore, (self._file,)

    def __repr__(self) -> str:  # noqa: D105
        return f"<CoefficientStore of {self._file!r}>"

    def _chunk(self, key: str) -> tuple[_Chunked, tuple[int, ...]] | None:
        """The samples and the number of a chunk."""
        name, _, place = key.partition("/c/")
        samples = self._samples.get(name)
        if samples is None or not place:
            return None
        try:
            at = tuple(int(number) for number in place.split("/"))
        except ValueError:
            return None
        return (samples, at) if samples.has(at) else None

    async def get(  # noqa: D102
        self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        chunk = self._chunk(key)
        if chunk is None:
            return await self._others.get(key, prototype, byte_range)
        samples, at = chunk
        data = await asyncio.to_thread(samples.read, at)
        return prototype.buffer.from_bytes(_part(data, byte_range))

    async def get_partial_values(  # noqa: D102
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    async def exists(self, key: str) -> bool:  # noqa: D102
        return self._chunk(key) is not None or await self._others.exists(key)

    async def list(self) -> AsyncIterator[str]:  # noqa: D102
        async for key in self._others.list():
            yield key
        for name, samples in self._samples.items():
            for at in samples.numbers():
                yield f"{name}/c/{'/'.join(map(str, at))}"

    async def list_prefix(self, prefix: str) -> AsyncIterator[str]:  # noqa: D102
        async for key in self.list():
            if key.startswith(prefix):
                yield key

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:  # noqa: D102
        folder = prefix.rstrip("/") + "/" if prefix else ""
        found = set()
        async for key in self.list_prefix(folder):
            name = key[len(folder) :].split("/")[0]
            if name not in found:
                found.add(name)
                yield name

    async def set(self, key: str, value: Buffer) -> NoReturn:  # noqa: D102
        self._refuse()

    async def delete(self, key: str) -> NoReturn:  # noqa: D102
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ValueError(f"{self._file.path}: a coefficient file is not written by Zarr; `convert` makes another one")


@dataclass(frozen=True)
class _Chunked:
    """Samples by chunks."""

    variable: xr.Variable
    chunks: tuple[int, ...]

    def counts(self) -> list[int]:
        return [-(-length // along) for length, along in zip(self.variable.shape, self.chunks, strict=True)]

    def has(self, at: tuple[int, ...]) -> bool:
        counts = self.counts()
        return len(at) == len(counts) and all(0 <= n < count for n, count in zip(at, counts, strict=True))

    def numbers(self) -> Iterable[tuple[int, ...]]:
        return itertools.product(*map(range, self.counts()))

    def read(self, at: tuple[int, ...]) -> bytes:
        """The samples of a chunk. Chunks have the same size: beyond the array, samples are 0."""
        part = tuple(slice(n * along, (n + 1) * along) for n, along in zip(at, self.chunks, strict=True))
        samples: npt.NDArray[Any] = self.variable[part].values
        whole = [(0, along - length) for along, length in zip(self.chunks, samples.shape, strict=True)]
        return np.pad(samples, whole).tobytes()


def _part(data: bytes, wanted: ByteRequest | None) -> bytes:
    match wanted:
        case RangeByteRequest(start, end):
            return data[start:end]
        case OffsetByteRequest(offset):
            return data[offset:]
        case SuffixByteRequest(suffix):
            return data[-suffix:] if suffix else b""
    return data


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes as JSON has them; ``_FillValue`` as xarray reads it."""
    plain = {
        name: value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for name, value in attributes.items()
    }
    if isinstance(plain.get("_FillValue"), float):
        plain["_FillValue"] = base64.standard_b64encode(struct.pack("<d", plain["_FillValue"])).decode()
    return plain
