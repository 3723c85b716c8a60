"""Conversions of DataArrays and Datasets. Coordinates and attributes are encoded as xarray encodes them for NetCDF."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from . import _wavesplat
from ._convert import Appending, Conversion
from ._frames import _chunk, frames_together, little_endian
from ._progress import Progress, reporting
from ._reports import told

NAME = "%n"
"""What stands for the name of a variable in the name of a file."""

_VALID = ("valid_range", "valid_min", "valid_max")
_PACKED = ("scale_factor", "add_offset")

_OF_STORAGE = ("units", "calendar", "dtype")
"""Encodings of coordinates that say how dates become numbers. Others say how a file stored them."""


def convert_dataset(
    source: xr.DataArray | xr.Dataset,
    conversion: Conversion,
    *,
    variable: str | None,
    axes: str | None,
    progress: Progress,
) -> dict[str, Any]:
    """Converts a variable, or each of several to a file of its own."""
    dataset = _dataset(source)
    names = _names(dataset, variable)
    for name in names:
        conversion.allowed.of_variable(name)  # so that none is written if one lacks an entry

    def one(name: str, path: str) -> dict[str, Any]:
        settings = replace(conversion, path=path).of_variable(name)
        work = _Work("convert", _wavesplat.convert_arrays, settings, conversion.request["memory"])
        return work.on(dataset, name, axes, progress)

    return _each(names, conversion.path, one)


def append_dataset(
    source: xr.DataArray | xr.Dataset,
    appending: Appending,
    *,
    variable: str | None,
    axes: str | None,
    progress: Progress,
) -> dict[str, Any]:
    """Adds the frames of a variable to a file, or those of each of several to a file of its own."""
    dataset = _dataset(source)
    names = _names(dataset, variable)
    for name in names:
        _wavesplat.File(appending.path.replace(NAME, name))  # so that none is changed if one is not there

    def one(name: str, path: str) -> dict[str, Any]:
        settings = vars(replace(appending, path=path))
        work = _Work("append", _wavesplat.append_arrays, settings, appending.memory)
        return work.on(dataset, name, axes, progress)

    return _each(names, appending.path, one)


def _each(names: list[str], path: str, one: Callable[[str, str], dict[str, Any]]) -> dict[str, Any]:
    """Does something with the file of one variable, or with that of each."""
    if NAME in path:
        return {name: one(name, path.replace(NAME, name)) for name in names}
    if len(names) != 1:
        found = ", ".join(names) or "none"
        raise ValueError(
            f"a file holds one variable with three axes or more, and the dataset has {found}: name one as "
            f"variable=..., or give each a file of its own, as in 'run_{NAME}.wspl'"
        )
    return one(names[0], path)


def _dataset(source: xr.DataArray | xr.Dataset) -> xr.Dataset:
    if isinstance(source, xr.DataArray):
        return source.to_dataset(name="data" if source.name is None else str(source.name))
    if not isinstance(source, xr.Dataset):
        what = "; convert the to_dataset() of each group" if type(source).__name__ == "DataTree" else ""
        raise ValueError(f"source: takes a DataArray or a Dataset, not {type(source).__name__}{what}")
    return source


def _names(dataset: xr.Dataset, variable: str | None) -> list[str]:
    """The variable that is meant, or all that can be frames."""
    return [variable] if variable is not None else _volumes(dataset)


def _volumes(dataset: xr.Dataset) -> list[str]:
    """The variables that can be frames."""
    found = [name for name, array in dataset.data_vars.items() if array.ndim >= 3 and array.dtype.kind in "fiub"]
    return [_checked(name) for name in found]


def _checked(name: Hashable) -> str:
    """A name that a file can have: a slash would separate groups."""
    if not isinstance(name, str):
        raise ValueError(f"source: names are texts, not {name!r}; give another one by rename")
    if "/" in name:
        raise ValueError(f"source: the name {name!r} has a slash, which separates groups; give another one by rename")
    return name


@dataclass(frozen=True)
class _Work:
    """What the native half does with a variable: it converts it, or adds its frames to a file."""

    name: str
    do: Callable[..., tuple[str | None, list[str]]]
    settings: dict[str, Any]
    memory: int

    def on(self, dataset: xr.Dataset, name: str, axes: str | None, progress: Progress) -> dict[str, Any]:
        """Gives it a variable. Returns the report."""
        if name not in dataset.data_vars:
            raise ValueError(
                f"variable: there is no {name!r}; the dataset has {', '.join(map(str, dataset.data_vars))}"
            )
        dtype = dataset[name].dtype
        if dtype.kind not in "fiub":
            raise ValueError(
                f"variable: {name!r} has values of type {dtype}, which are no samples; convert them by astype"
            )
        encoded, attrs = _encoded(dataset, name)
        unlimited = set(dataset.encoding.get("unlimited_dims", ()))
        arrays = [_described(key, var, unlimited, self.memory, key == name) for key, var in encoded.items()]

        def read(array: str, ranges: Sequence[tuple[int, int]]) -> npt.NDArray[np.uint8]:
            part = encoded[array][tuple(slice(start, stop) for start, stop in ranges)]
            return little_endian(np.asarray(part.values)).reshape(-1).view(np.uint8)

        chosen = {"source": f"dataset ({name})", "variable": name, "axes": axes}
        with reporting(progress, f"{self.name} {name}") as report:
            return told(*self.do(arrays, _attributes(attrs), read, chosen, self.settings, report))


def _encoded(dataset: xr.Dataset, name: str) -> tuple[dict[str, xr.Variable], dict[Hashable, Any]]:
    """The variables that a NetCDF file of this variable would have. Lazy arrays stay lazy."""
    kept = [key for key, array in dataset.data_vars.items() if key == name or array.ndim < 3]  # such as bounds of axes
    alone = dataset[kept].copy()  # not the data
    if any(of in dataset[name].encoding for of in _PACKED):  # valid ranges count the numbers that were stored
        alone[name].attrs = {of: value for of, value in alone[name].attrs.items() if of not in _VALID}
    for key, var in alone.variables.items():
        encoding = {} if key == name else {of: var.encoding[of] for of in _OF_STORAGE if of in var.encoding}
        alone[key].encoding = encoding if _is_date(var) else {}
    variables, attrs = xr.conventions.encode_dataset_coordinates(alone)
    ordered = [key for key in dataset.variables if key in variables]  # as in a file of the whole dataset
    for key in {*ordered, *alone.dims}:
        _checked(str(key))
    encoded = {str(key): xr.conventions.encode_cf_variable(variables[key], name=key) for key in ordered}
    return encoded, attrs


def _is_date(variable: Any) -> bool:
    return variable.dtype.kind in "mMO"


def _described(key: str, variable: xr.Variable, unlimited: set[Any], memory: int, is_samples: bool) -> dict[str, Any]:
    """An array as the native half takes it."""
    lengths = zip(variable.dims, variable.shape, strict=True)
    is_small = variable.ndim <= 1 or variable.dtype.kind in "OUS"
    return {
        "name": key,
        "dtype": variable.dtype.name,
        "dimensions": [(str(dim), int(length), dim in unlimited) for dim, length in lengths],
        "chunk": _chunks(variable, memory) if is_samples else None,
        "attributes": _attributes(variable.attrs),
        "is_decoded": is_samples and not any(name in variable.attrs for name in _PACKED),
        "values": _values(variable.values) if is_small and not is_samples else None,
    }


_SHARE = 128
"""The part of the memory that a chunk may have, so that frames are not decoded twice."""


def _chunks(variable: xr.Variable, memory: int) -> list[int] | None:
    """Pieces of the samples that are computed together, as large as the memory allows."""
    chunk = _chunk(variable.data) if variable.chunks is not None else None
    if chunk is None:
        return None
    along = [min(n, length) for n, length in zip(chunk, variable.shape, strict=True)]
    together = frames_together(tuple(along), variable.dtype.itemsize, (along[0],), memory * 8 // _SHARE)
    along[0] = min(along[0], together)
    for axis in range(1, len(along)):
        size = int(np.prod(along, dtype=np.int64)) * variable.dtype.itemsize
        while size > memory // _SHARE and along[axis] > 1:
            along[axis] = (along[axis] + 1) // 2
            size = int(np.prod(along, dtype=np.int64)) * variable.dtype.itemsize
    return along


def _attributes(attributes: Any) -> list[tuple[str, Any]]:
    """Attributes as the native half takes them, with the fill value first, as in NetCDF files. Values that are no texts and
    no numbers are left out.
    """
    ordered = sorted(attributes.items(), key=lambda item: item[0] != "_FillValue")
    encoded = ((str(name), _values(np.atleast_1d(np.asarray(value)))) for name, value in ordered)
    return [(name, value) for name, value in encoded if value is not None]


def _values(array: npt.NDArray[Any]) -> Any:
    """Texts as a list, numbers as (bytes, name of their type); None for others."""
    if array.dtype.kind == "S":
        return [text.decode(errors="replace") for text in array.reshape(-1).tolist()]
    if array.dtype.kind in "UO":
        texts = array.reshape(-1).tolist()
        return texts if all(isinstance(text, str) for text in texts) else None
    if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8 or array.dtype == np.float16:
        return None
    return little_endian(array).reshape(-1).view(np.uint8), array.dtype.name
