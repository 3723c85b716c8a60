"""Frames and the places of voxels, for programs that show volumes: ParaView, PyVista and napari."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ._arguments import whole
from ._file import File

_COLOURS = ("red", "green", "blue")

Box = tuple[slice, slice, slice]
"""Voxels along z, y and x."""


def arrays(file: File, frame: int, box: Box) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """The names and the samples of each channel, x fastest. Missing samples are NaN where the type has it."""
    for channel in range(file.channels):
        samples = file.read(frame, *box, channel=channel)
        if samples.dtype == np.float16:
            samples = samples.astype(np.float32)  # VTK has no halves
        if samples.dtype.kind == "f" and file.missing_value is not None:
            samples[samples == file.missing_value] = np.nan
        yield name(file) + (f" {_COLOURS[channel]}" if file.channels > 1 else ""), samples.reshape(-1)


def name(file: File) -> str:
    """What the samples are called."""
    return file.variable or "samples"


def times(file: File) -> npt.NDArray[np.float64]:
    """The time of each frame; its number if the file has no times."""
    return file.times if len(file.times) else np.arange(file.shape[0], dtype=np.float64)


Places = list[npt.NDArray[np.float64]]
"""Where voxels are along x, y and z. They ascend: a depth is negative."""


def places(file: File) -> Places:
    """Where the voxels of a file are."""
    return [_along(file, axis) for axis in range(3)]


def is_even(where: Places) -> bool:
    """Whether distances are the same along each axis."""
    steps = [np.diff(along) for along in where]
    return all(len(own) < 2 or np.ptp(own) <= 1e-3 * own.mean() for own in steps)


def corner(where: Places) -> list[float]:
    """The place of the first voxel."""
    return [float(along[0]) for along in where]


def distances(file: File, where: Places) -> list[float]:
    """The distance of voxels along each axis, if it is the same."""
    return [_distance(along, usual) for along, usual in zip(where, file.spacing, strict=True)]


def _distance(along: npt.NDArray[np.float64], usual: float) -> float:
    if len(along) < 2:
        return usual
    step = float(along[-1] - along[0]) / (len(along) - 1)
    return usual if abs(step - usual) <= 1e-9 * step else step


def _along(file: File, axis: int) -> npt.NDArray[np.float64]:
    count, own = file.shape[3 - axis], file.coords.get(file.dims[3 - axis])
    if own is not None and own.shape == (count,) and own.dtype.kind in "fiu":
        up = own.astype(np.float64) if own[0] <= own[-1] else -own.astype(np.float64)
        if (np.diff(up) > 0).all():
            return up
    return file.origin[axis] + file.spacing[axis] * np.arange(count, dtype=np.float64)


def to_pyvista(file: File, frame: int, box: Box) -> Any:
    """A box of a frame as a data set of PyVista."""
    import pyvista

    if any(not isinstance(along, slice) or along.step not in (None, 1) for along in box):
        raise ValueError("to_pyvista: takes slices of voxels, without steps")
    where = [along[part] for along, part in zip(places(file), box[::-1], strict=True)]
    if any(len(along) == 0 for along in where):
        raise ValueError("to_pyvista: takes at least one voxel along each axis")
    grid = pyvista.RectilinearGrid(*where)
    if is_even(where):
        counts = [len(along) for along in where]
        grid = pyvista.ImageData(dimensions=counts, spacing=distances(file, where), origin=corner(where))
    for called, samples in arrays(file, whole("frame", frame), box):
        grid.point_data[called] = samples
    return grid
