"""Coefficient files as read-only Zarr groups, ``wavesplat.zarr.open("run.wspl")``; and a codec of Zarr arrays."""

from __future__ import annotations

import asyncio
import base64
import itertools
import struct
import warnings
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt
import xarray as xr
import zarr
from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import MemoryStore

from ._codec import WavesplatCodec
from ._file import File
from ._file import open as open_file
from ._objects import Place
from .xarray import variables_of

__all__ = ["CoefficientStore", "WavesplatCodec", "open"]


def open(path: Place, **options: Any) -> zarr.Group:
    """The group of a coefficient file: its samples, coordinates and attributes. Chunks are decoded when they are read.

    Args:
        path: As `wavesplat.open` takes it.
        options: ``lod``, ``cache_dir`` and ``cache`` of `wavesplat.open`.

    """
    return zarr.open_group(CoefficientStore(open_file(path, **options)), mode="r")


class CoefficientStore(Store):
    """An open file as a read-only Zarr store, for what opens stores, such as ``xarray.open_zarr``.

    Closing it closes the file. A chunk has the samples of a block in a window, which are decoded together. Along an axis that
    the file holds in reverse, such as a latitude that descends, it has those of two blocks.
    """

    supports_writes = False
    supports_deletes = False
    supports_listing = True

    def __init__(self, file: File) -> None:
        """Of an open file."""
        super().__init__(read_only=True)
        self._file = file
        self._samples: dict[str, _Chunked] = {}
        self._others = MemoryStore()  # descriptions, and the chunks of variables beside the samples
        variables, attributes = variables_of(file)
        group = zarr.create_group(self._others, attributes=_plain(attributes))
        for name, variable in variables.items():
            self._add(group, _free(name, group), variable)

    def _add(self, group: zarr.Group, name: str, variable: xr.Variable) -> None:
        attributes = _plain(variable.attrs, variable.dtype)
        settings: dict[str, Any] = {"dimension_names": variable.dims, "compressors": None, "filters": None}
        preferred = variable.encoding.get("preferred_chunks")
        if preferred is None:
            values = variable.values
            dtype = "string" if values.dtype.kind in "OU" else values.dtype
            settings |= {"shape": values.shape, "chunks": values.shape, "dtype": dtype, "attributes": attributes}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Zarr has no final name for letters
                group.create_array(name, **settings)[...] = values.astype(str) if dtype == "string" else values
            return
        chunks = tuple(max(preferred[dim]) for dim in variable.dims)
        self._samples[name] = _Chunked(variable, chunks)
        fill = variable.attrs.get("_FillValue", 0)
        settings |= {"shape": variable.shape, "chunks": chunks, "dtype": variable.dtype, "attributes": attributes}
        group.create_array(name, fill_value=fill, **settings)

    def __eq__(self, other: object) -> bool:  # noqa: D105
        return isinstance(other, CoefficientStore) and self._file.__reduce__() == other._file.__reduce__()

    def __reduce__(self) -> tuple[Any, ...]:  # noqa: D105
        return CoefficientStore, (self._file,)

    def close(self) -> None:
        """Closes the file."""
        super().close()
        self._file.close()

    def __repr__(self) -> str:  # noqa: D105
        return f"<CoefficientStore of {self._file!r}>"

    def _chunk(self, key: str) -> tuple[_Chunked, tuple[int, ...]] | None:
        """The samples and the number of a chunk."""
        name, _, place = key.partition("/c/")
        samples = self._samples.get(name)
        if samples is None or not place:
            return None
        at = samples.number(place)
        return None if at is None else (samples, at)

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
        return await asyncio.gather(*(self.get(key, prototype, part) for key, part in key_ranges))

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
        name, *place = prefix.strip("/").split("/")
        if place[:1] != ["c"]:
            async for key in self._others.list_dir(prefix):
                yield key
        samples = self._samples.get(name)
        for key in samples.folder(place) if samples else ():
            yield key

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

    def number(self, place: str) -> tuple[int, ...] | None:
        """The number of a chunk along each axis; None if a place is not that of one."""
        at = tuple(int(along) for along in place.split("/") if along.isdecimal())
        is_one = len(at) == len(self.chunks) and all(n < count for n, count in zip(at, self.counts(), strict=True))
        return at if is_one and "/".join(map(str, at)) == place else None

    def folder(self, place: list[str]) -> Iterable[str]:
        """What is in a folder of chunks, and their own folder."""
        if not place:
            return ["c"]
        counts = self.counts()
        is_there = place[0] == "c" and len(place) <= len(counts)
        is_there = is_there and all(along in map(str, range(n)) for along, n in zip(place[1:], counts, strict=False))
        return map(str, range(counts[len(place) - 1])) if is_there else []

    def numbers(self) -> Iterable[tuple[int, ...]]:
        return itertools.product(*map(range, self.counts()))

    def read(self, at: tuple[int, ...]) -> bytes:
        """The samples of a chunk. Chunks have the same size: beyond the array, samples are 0."""
        part = tuple(slice(n * along, (n + 1) * along) for n, along in zip(at, self.chunks, strict=True))
        samples: npt.NDArray[Any] = self.variable[part].values
        rest = [(0, along - length) for along, length in zip(self.chunks, samples.shape, strict=True)]
        return (np.pad(samples, rest) if any(n for _, n in rest) else samples).tobytes()


def _part(data: bytes, wanted: ByteRequest | None) -> bytes:
    match wanted:
        case RangeByteRequest(start, end):
            return data[start:end]
        case OffsetByteRequest(offset):
            return data[offset:]
        case SuffixByteRequest(suffix):
            return data[-suffix:] if suffix else b""
    return data


def _free(name: str, group: zarr.Group) -> str:
    """A name for an array: without letters that part folders, none of Zarr's own, and not taken."""
    name = name.replace("/", "_").replace("\\", "_")
    name = f"_{name}" if name in ("", ".", "..", "zarr.json") else name
    while name in group:
        name += "_"
    return name


def _plain(attributes: dict[str, Any], dtype: np.dtype[Any] | None = None) -> dict[str, Any]:
    """Attributes as JSON has them; ``_FillValue`` of an array as xarray reads it from a store, if it can."""
    plain = {
        name: value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for name, value in attributes.items()
    }
    if dtype is None or "_FillValue" not in plain:
        return plain
    fill = plain.pop("_FillValue")
    if not isinstance(fill, int | float):
        return plain
    if dtype.kind == "f":
        plain["_FillValue"] = base64.standard_b64encode(struct.pack("<d", fill)).decode()
    elif dtype.kind in "iu" and float(fill).is_integer():
        plain["_FillValue"] = int(fill)
    return plain
