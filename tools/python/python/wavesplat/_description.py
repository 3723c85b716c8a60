"""What a file keeps of its source: names of axes, coordinates and attributes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._file import File

ROLES = ("t", "z", "y", "x")
"""What the four axes of a file count."""


def array(values: Any) -> npt.NDArray[Any] | None:
    """The values of a variable; None for the times of the frames, which the file has elsewhere."""
    if isinstance(values, str):
        return None
    if isinstance(values, list):
        return np.array(values, dtype=object)
    data, dtype = values
    if dtype == "S1":
        return np.asarray(data).view("S1")
    found: npt.NDArray[Any] = np.asarray(data).view(np.dtype(dtype).newbyteorder("<"))
    return found


def attribute(values: Any) -> Any:
    """The value of an attribute: a text, a number, or a list or an array of them."""
    found = array(values)
    if found is None or found.size != 1:
        return found.tolist() if found is not None and found.dtype == object else found
    return found[0] if found.dtype == object else found.reshape(-1)[0]


def attributes(described: dict[str, Any]) -> dict[str, Any]:
    """Attributes by their names."""
    return {name: attribute(value) for name, value in described.items()}


@dataclass(frozen=True)
class SourceAxis:
    """An axis of the samples' array in the source."""

    name: str
    role: str
    """"t", "z", "y" or "x", or "single" for an axis of length 1 that counts nothing."""
    reversed: bool


@dataclass(frozen=True)
class Axes:
    """The axes of the source, and what they are called."""

    source: tuple[SourceAxis, ...]
    attributes: dict[str, Any]

    @classmethod
    def of(cls, file: File) -> Axes:
        """Those of a file. A file that keeps none has time, z, y and x."""
        described = file.description
        if described is None:
            return cls(tuple(SourceAxis(name, role, False) for name, role in zip(_PLAIN, ROLES, strict=True)), {})
        dimensions = described["dimensions"]
        axes = tuple(SourceAxis(dimensions[at][0], role, turned) for at, role, turned in described["axes"])
        return cls(_named(axes), attributes(described["attributes"]))

    @property
    def names(self) -> tuple[str, str, str, str]:
        """The names of time, z, y and x. An axis that the source lacks has its plain name."""
        by_role = {axis.role: axis.name for axis in self.source}
        t, z, y, x = (by_role.get(role, plain) for role, plain in zip(ROLES, _PLAIN, strict=True))
        return t, z, y, x


_PLAIN = ("time", "z", "y", "x")


def _named(axes: tuple[SourceAxis, ...]) -> tuple[SourceAxis, ...]:
    """Axes with names of their own, also those that have none in the source."""
    plain = dict(zip(ROLES, _PLAIN, strict=True))
    taken: set[str] = set()
    named = []
    for n, axis in enumerate(axes):
        name = axis.name if axis.name and axis.name not in taken else plain.get(axis.role, f"axis_{n}")
        name = name if name not in taken else f"axis_{n}"
        taken.add(name)
        named.append(SourceAxis(name, axis.role, axis.reversed))
    return tuple(named)


def coordinates(file: File) -> dict[str, npt.NDArray[Any]]:
    """The coordinates of each axis of a file that has some, in the file's order."""
    found = {}
    for axis in file._axes.source:
        along = along_axis(file, axis)
        if along is not None:
            found[axis.name] = along[::-1] if axis.reversed else along
    for n, (role, name) in enumerate(zip("zyx", file.dims[1:], strict=True)):
        if name not in found and all(axis.role != role for axis in file._axes.source) and _is_placed(file, 2 - n):
            found[name] = regular(file, 2 - n)
    if len(file.times) and file.dims[0] not in found:
        found[file.dims[0]] = file.times
    return found


def along_axis(file: File, axis: SourceAxis) -> npt.NDArray[Any] | None:
    """The coordinates of an axis in the order of the source: its own, the times of frames, or those of a grid."""
    listed = _listed(file)
    if axis.name in listed:
        values, packing = listed[axis.name]
        own = array(values)
        return file.times if own is None else _unpacked(own[kept(file, axis, len(own))], packing)
    if axis.role == "t":
        return file.times if len(file.times) else None
    is_placed = not any(other.name in listed for other in file._axes.source if other.role in ("z", "y", "x"))
    if axis.role in ("z", "y", "x") and is_placed:  # otherwise the source only numbers the voxels of this axis
        along = "xyz".index(axis.role)
        if _is_placed(file, along):
            line = regular(file, along)
            return line[::-1] if axis.reversed else line
    return None


def _listed(file: File) -> dict[str, tuple[Any, dict[str, Any]]]:
    """The values and the attributes of coordinates that the source has, by the name of their axis."""
    described = file.description or {"variables": [], "dimensions": []}
    names = [name for name, *_ in described["dimensions"]]
    own = (listed for listed in described["variables"] if [names[at] for at in listed[1]] == [listed[0]])
    return {name: (values, attributes(attrs)) for name, _, values, attrs in own}


def _unpacked(stored: npt.NDArray[Any], attrs: dict[str, Any]) -> npt.NDArray[Any]:
    """Coordinates, which may be stored as integers."""
    given = {name: np.ravel(attrs.get(name, "")) for name in ("scale_factor", "add_offset")}
    numbers = {name: float(value[0]) for name, value in given.items() if value.dtype.kind in "fiu"}
    return stored * numbers.get("scale_factor", 1.0) + numbers.get("add_offset", 0.0) if numbers else stored


def kept(file: File, axis: SourceAxis, length: int) -> slice:
    """The items along an axis of the source, with so many items, that a level of detail has: every n-th from the low end."""
    step = 2**file.lod if axis.role in ("z", "y", "x") else 1
    return slice((length - 1) % step, None, step) if axis.reversed else slice(0, None, step)


def _is_placed(file: File, along: int) -> bool:
    """Whether a grid says where voxels are, and does not only number them."""
    return (file._file.origin[along], file._file.spacing[along]) != (0.0, float(2**file.lod))


def regular(file: File, along: int) -> npt.NDArray[np.float64]:
    """Places in equal steps; axis 0 is x."""
    return file._file.origin[along] + file._file.spacing[along] * np.arange(file._file.dims[along], dtype=np.float64)
