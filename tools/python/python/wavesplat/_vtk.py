"""Frames as the data sets of VTK have them: for ParaView and PyVista."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

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


def uneven(file: File) -> list[npt.NDArray[np.float64]] | None:
    """The places of voxels along x, y and z, which ascend, if distances differ along one of them: a depth is negative."""
    places = [_places(file, axis) for axis in range(3)]
    return None if all(map(_is_even, places)) else places


def _places(file: File, axis: int) -> npt.NDArray[np.float64]:
    count, own = file.shape[3 - axis], file.coords.get(file.dims[3 - axis])
    if own is not None and own.shape == (count,) and own.dtype.kind in "fiu":
        up = own.astype(np.float64) if own[0] <= own[-1] else -own.astype(np.float64)
        if (np.diff(up) > 0).all():
            return up
    return file.origin[axis] + file.spacing[axis] * np.arange(count, dtype=np.float64)


def _is_even(places: npt.NDArray[np.float64]) -> bool:
    steps = np.diff(places)
    return len(steps) < 2 or bool(np.ptp(steps) <= 1e-3 * np.abs(steps).mean())


def to_pyvista(file: File, frame: int, box: Box) -> Any:
    """A box of a frame as a data set of PyVista."""
    import pyvista

    parts = [range(*along.indices(length)) for along, length in zip(box, file.shape[1:], strict=True)]
    if any(part.step != 1 or len(part) == 0 for part in parts):
        raise ValueError("to_pyvista: takes slices of at least one voxel, without steps")
    corner, counts = [part.start for part in parts[::-1]], [len(part) for part in parts[::-1]]
    places = uneven(file)
    if places is None:
        origin = [at + step * n for at, step, n in zip(file.origin, file.spacing, corner, strict=True)]
        grid = pyvista.ImageData(dimensions=counts, spacing=file.spacing, origin=origin)
    else:
        grid = pyvista.RectilinearGrid(*(p[at : at + n] for p, at, n in zip(places, corner, counts, strict=True)))
    for called, samples in arrays(file, frame, box):
        grid.point_data[called] = samples
    return grid
