"""Coefficient files in xarray: ``xr.open_dataset("run.wspl")`` and, once this is imported, ``ds.to_wavesplat(...)``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from ._convert import convert
from ._description import ROLES, along_axis, array, attributes, kept
from ._file import File, anywhere, open

_COLOURS = ("red", "green", "blue")


class _Samples(BackendArray):
    """The samples of a file in the axes of its source."""

    def __init__(self, file: File, channel: int = 0) -> None:
        self.file, self.channel, self.dtype = file, channel, file.dtype
        self.axes = file._axes.source
        self.shape = tuple(_length(file, axis.role) for axis in self.axes)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> npt.NDArray[Any]:
        """Samples by a number, slice or array along each axis of the source."""
        items = [np.arange(length)[part] for part, length in zip(key, self.shape, strict=True)]
        turned = {
            axis.role: self.shape[n] - 1 - items[n] if axis.reversed else items[n] for n, axis in enumerate(self.axes)
        }
        by_role = [np.atleast_1d(turned.get(role, np.array([0]))) for role in ROLES]
        samples = self.file.read(*by_role, channel=self.channel)
        own = [ROLES.index(axis.role) for axis in self.axes if axis.role in ROLES]
        samples = samples.transpose([*own, *(n for n in range(len(ROLES)) if n not in own)])
        samples = samples.reshape([np.size(along) for along in items])
        found: npt.NDArray[Any] = samples[tuple(slice(None) if np.ndim(along) else 0 for along in items)]
        return found


def _length(file: File, role: str) -> int:
    return file.shape[ROLES.index(role)] if role in ROLES else 1


class WavesplatBackend(BackendEntrypoint):
    """Opens coefficient files lazily, with the coordinates, times and attributes of their source."""

    description = "Open coefficient files (.wspl) of wavesplat"
    url = "https://docs.rs/wavesplat"
    supports_groups: ClassVar[bool] = True  # of which a file has one
    open_dataset_parameters: ClassVar[tuple[str, ...]] = (
        "filename_or_obj",
        "drop_variables",
        "mask_and_scale",
        "decode_times",
        "decode_timedelta",
        "decode_coords",
        "use_cftime",
        "concat_characters",
        "lod",
        "cache_dir",
    )

    def open_dataset(
        self,
        filename_or_obj: Any,
        *,
        drop_variables: str | Iterable[str] | None = None,
        mask_and_scale: bool = True,
        decode_times: Any = True,
        decode_timedelta: Any = None,
        decode_coords: Any = True,
        use_cftime: bool | None = None,
        concat_characters: bool = True,
        lod: int = 0,
        cache_dir: str | os.PathLike[str] | None = None,
    ) -> xr.Dataset:
        """The dataset of a file or an address; with ``lod``, every 2**lod-th voxel along each axis."""
        file = open(filename_or_obj, lod=lod, cache_dir=cache_dir)
        variables, attrs = variables_of(file)
        dropped = {drop_variables} if isinstance(drop_variables, str) else set(drop_variables or ())
        variables = {name: var for name, var in variables.items() if name not in dropped}
        given: dict[str, Any] = {} if use_cftime is None else {"use_cftime": use_cftime}
        dataset: xr.Dataset = xr.conventions.decode_cf(
            xr.Dataset(variables, attrs=attrs),
            mask_and_scale=mask_and_scale,
            decode_times=decode_times,
            decode_timedelta=decode_timedelta,
            decode_coords=decode_coords,
            concat_characters=concat_characters,
            **given,
        )
        dataset.encoding["source"] = file.path if file._object is not None else anywhere(file.path)
        return dataset

    def open_groups_as_dict(self, filename_or_obj: Any, **options: Any) -> dict[str, xr.Dataset]:
        """The one group of a file."""
        return {"/": self.open_dataset(filename_or_obj, **options)}

    def open_datatree(self, filename_or_obj: Any, **options: Any) -> xr.DataTree:
        """A tree of one node."""
        return xr.DataTree.from_dict(self.open_groups_as_dict(filename_or_obj, **options))

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Whether a name ends like one of a coefficient file."""
        return isinstance(filename_or_obj, (str, os.PathLike)) and os.fspath(filename_or_obj).split("?")[0].endswith(
            ".wspl"
        )


def variables_of(file: File) -> tuple[dict[str, xr.Variable], dict[str, Any]]:
    """The variables that a file stands for, as its source encoded them, and global attributes."""
    described = file.description
    if described is None:
        samples = _samples(file, set())
        return {**samples, **_coordinates(file, set(samples))}, {}
    others = dict(_kept(file, described))
    samples = _samples(file, set(others))
    others = {name: variable for name, variable in others.items() if name not in samples}
    return {**samples, **others, **_coordinates(file, {*samples, *others})}, attributes(described["global"])


def _kept(file: File, described: dict[str, Any]) -> Iterator[tuple[str, xr.Variable]]:
    """The variables beside the samples, thinned as a level of detail thins the samples."""
    axes = {axis.name: axis for axis in file._axes.source}
    for name, along, values, attrs in described["variables"]:
        data = array(values)
        data = _typed(file.times, values) if data is None else data
        dims = [described["dimensions"][at][0] for at in along]
        shape = [described["dimensions"][at][1] for at in along]
        pairs = zip(dims, shape, strict=True)
        thinned = tuple(kept(file, axes[dim], length) if dim in axes else slice(None) for dim, length in pairs)
        yield name, xr.Variable(dims, data.reshape(shape)[thinned], attributes(attrs))


def _typed(times: npt.NDArray[np.float64], dtype: str) -> npt.NDArray[Any]:
    """Times in the type that they had."""
    typed = times.astype(dtype)
    return typed if np.array_equal(typed, times) else times


def _samples(file: File, others: set[str]) -> dict[str, xr.Variable]:
    """The samples, or those of each colour. Dimensions and other variables keep their names."""
    base = (file.variable or "data").split("[")[0]
    dims = [axis.name for axis in file._axes.source]
    while base in others or base in dims:
        base = f"values_{base}"
    names = (base,) if file.channels == 1 else _COLOURS
    attrs = dict(file.attrs)
    if file.unit is not None:
        attrs.setdefault("units", file.unit)
    if file.missing_value is not None:
        attrs["_FillValue"] = file.dtype.type(file.missing_value)
    found = {}
    for channel, name in enumerate(names):
        lazy = indexing.LazilyIndexedArray(_Samples(file, channel))
        variable = xr.Variable(dims, lazy, attrs)
        variable.encoding["preferred_chunks"] = _chunks(file)
        found[name] = variable
    return found


def _chunks(file: File) -> dict[str, tuple[int, ...]]:
    """Windows and blocks along the axes of the source."""
    by_role = dict(zip(ROLES, file.chunks, strict=True))
    chunks = {axis.name: by_role.get(axis.role, (1,)) for axis in file._axes.source}
    return {axis.name: chunks[axis.name][:: -1 if axis.reversed else 1] for axis in file._axes.source}


def _coordinates(file: File, taken: set[str]) -> dict[str, xr.Variable]:
    """Coordinates of axes that have no variable in the source."""
    found = {}
    for axis in file._axes.source:
        if axis.name in taken:
            continue
        along = along_axis(file, axis)
        if along is not None:
            unit = {"units": file.time_unit, "calendar": file.calendar} if axis.role == "t" else {}
            found[axis.name] = xr.Variable(axis.name, along, {name: value for name, value in unit.items() if value})
    return found


@xr.register_dataset_accessor("to_wavesplat")  # type: ignore[no-untyped-call]
@xr.register_dataarray_accessor("to_wavesplat")  # type: ignore[no-untyped-call]
class ToWavesplat:
    """``ds.to_wavesplat("run.wspl", tolerance=1e-3)``: see `wavesplat.convert`."""

    def __init__(self, of: xr.Dataset | xr.DataArray) -> None:
        """Of a Dataset or a DataArray."""
        self._of = of

    def __call__(self, path: str | os.PathLike[str], **settings: Any) -> dict[str, Any]:
        """Writes a coefficient file; settings are those of `wavesplat.convert`."""
        return convert(self._of, path, **settings)
