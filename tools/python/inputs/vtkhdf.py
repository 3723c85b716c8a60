"""VTKHDF: by h5py as VTK's specification says, and by VTK's own writer."""

from pathlib import Path

import h5py
import numpy as np
import vtk

from .case import DIMS, FRAMES, NAME, ORIGIN, SPACING, TIMES, Case, by, frame, frames
from .vtk_image import Source, image

FOLDER = "vtkhdf"
VTK, H5PY = by("vtk"), by("h5py")
SMALL = ("v110", "v110")  # forms of groups and headers that take less room


def write(folder: Path) -> list:
    return [
        single(folder),
        temporal(folder),
        compressed(folder),
        offsets(folder),
        cells(folder),
        several(folder),
        *by_vtk(folder),
    ]


def group(file: h5py.File, cells: bool = False, version=(2, 0)) -> h5py.Group:
    """The root of an image, with everything but arrays."""
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array(version, "i8")
    root.attrs["Type"] = np.bytes_("ImageData")
    root.attrs["WholeExtent"] = np.array([b for n in DIMS for b in (0, n - 1 + cells)], "i8")
    root.attrs["Origin"] = np.array([o - s / 2 * cells for o, s in zip(ORIGIN, SPACING)])
    root.attrs["Spacing"] = np.array(SPACING)
    root.attrs["Direction"] = np.eye(3).ravel()
    root.create_group("PointData")
    root.create_group("CellData")
    return root


def steps(root: h5py.Group, order=range(FRAMES), data: str = "PointData") -> None:
    """The times, and where in its array each one's samples are."""
    found = root.create_group("Steps")
    found.attrs["NSteps"] = np.int64(FRAMES)
    found["Values"] = np.array(TIMES)
    found.create_group(f"{data}Offsets")[NAME] = np.array(list(order), "i8")


def single(folder: Path) -> Case:
    with h5py.File(folder / "single.vtkhdf", "w", libver=SMALL) as file:
        root = group(file, version=(1, 0))
        root["PointData"][NAME] = frame()
        root["PointData"].attrs["Scalars"] = np.bytes_(NAME)
    return Case("single.vtkhdf", H5PY, "version 1.0, no Steps", frames=1)


def temporal(folder: Path) -> Case:
    with h5py.File(folder / "temporal.vtkhdf", "w") as file:
        root = group(file)
        root["PointData"][NAME] = frames()
        steps(root)
    return Case("temporal.vtkhdf", H5PY, "Steps; one array of all frames", times=TIMES)


def compressed(folder: Path) -> Case:
    with h5py.File(folder / "temporal_chunked.hdf", "w", libver=SMALL) as file:
        root = group(file, version=(2, 2))
        data = {"chunks": (1, *DIMS[::-1]), "maxshape": (None, *DIMS[::-1]), "compression": "gzip"}
        root["PointData"].create_dataset(NAME, data=frames("f64"), **data)
        steps(root)
    return Case("temporal_chunked.hdf", H5PY, "Steps; a gzip chunk for each frame; named .hdf", "f64", times=TIMES)


def offsets(folder: Path) -> Case:
    with h5py.File(folder / "temporal_offsets.vtkhdf", "w", libver=SMALL) as file:
        root = group(file)
        root["PointData"][NAME] = frames()[::-1]
        steps(root, reversed(range(FRAMES)))
    return Case("temporal_offsets.vtkhdf", H5PY, "stored last to first; PointDataOffsets says so", times=TIMES)


def cells(folder: Path) -> Case:
    with h5py.File(folder / "temporal_cells.vtkhdf", "w", libver=SMALL) as file:
        root = group(file, cells=True)
        root["CellData"][NAME] = frames("u8")
        steps(root, data="CellData")
    return Case("temporal_cells.vtkhdf", H5PY, "CellData; origin is that of the first cell's centre", "u8", times=TIMES)


def several(folder: Path) -> Case:
    with h5py.File(folder / "several.vtkhdf", "w", libver=SMALL) as file:
        root = group(file)
        root["PointData"]["other"] = frames() + 1000
        root["PointData"][NAME] = frames()
        steps(root)
        root["Steps/PointDataOffsets/other"] = np.arange(FRAMES)
    return Case("several.vtkhdf", H5PY, "also an array other (density + 1000)", variable=NAME, times=TIMES)


def by_vtk(folder: Path) -> list:
    save(folder / "vtk_single.vtkhdf", image({NAME: frame()}))
    save(folder / "vtk_temporal.vtkhdf", Source(times=True))
    return [
        Case("vtk_single.vtkhdf", VTK, "by vtkHDFWriter", frames=1),
        Case("vtk_temporal.vtkhdf", VTK, "by vtkHDFWriter", times=TIMES),
    ]


def save(path: Path, data) -> None:
    writer = vtk.vtkHDFWriter()
    writer.SetFileName(str(path))
    writer.SetWriteAllTimeSteps(True)
    writer.SetChunkSize(FRAMES)
    if data.IsA("vtkAlgorithm"):
        writer.SetInputConnection(data.GetOutputPort())
    else:
        writer.SetInputData(data)
    writer.Write()
