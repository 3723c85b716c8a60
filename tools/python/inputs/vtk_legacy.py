"""VTK's legacy files by VTK itself."""

from pathlib import Path

import vtk

from .case import FRAMES, MAY, NAME, Case, Refused, by, frame
from .vtk_image import image

FOLDER = "vtk"
VTK = by("vtk")


def write(folder: Path) -> list:
    return [
        *types(folder),
        text(folder),
        cells(folder),
        *several(folder),
        old_version(folder),
        series(folder),
        *refused(folder),
    ]


def save(path: Path, data, binary: bool = True, version: int = 0) -> None:
    writer = vtk.vtkStructuredPointsWriter() if data.IsA("vtkImageData") else vtk.vtkDataSetWriter()
    writer.SetFileName(str(path))
    writer.SetHeader("density of a small field")
    writer.SetFileType(2 if binary else 1)
    if version:
        writer.SetFileVersion(version)
    writer.SetInputData(data)
    writer.Write()


def types(folder: Path) -> list:
    kinds = ("u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64")
    for sample in kinds:
        save(folder / f"binary_{sample}.vtk", image({NAME: frame(sample)}))
    return [Case(f"binary_{s}.vtk", VTK, "BINARY (big-endian)", s, frames=1) for s in kinds]


def text(folder: Path) -> Case:
    save(folder / "ascii.vtk", image({NAME: frame()}), binary=False)
    return Case("ascii.vtk", VTK, "ASCII", frames=1, more=MAY)


def cells(folder: Path) -> Case:
    save(folder / "cells.vtk", image({NAME: frame()}, cells=True))
    return Case("cells.vtk", VTK, "CELL_DATA: DIMENSIONS 8 6 4; origin is that of the first cell's centre", frames=1)


def several(folder: Path) -> list:
    arrays = {"other": frame() + 1000, NAME: frame(), "third": frame("i16")}
    save(folder / "several.vtk", image(arrays, active="other"))
    note = "SCALARS other (density + 1000), then FIELD with density and third"
    return [
        Case("several.vtk", VTK, note, variable=NAME, frames=1),
        Case("several.vtk", VTK, note, "i16", variable="third", frames=1),
    ]


def old_version(folder: Path) -> Case:
    save(folder / "version_4_2.vtk", image({NAME: frame()}), version=42)
    return Case("version_4_2.vtk", VTK, "DataFile Version 4.2 instead of 5.1", frames=1)


def series(folder: Path) -> Case:
    (folder / "series").mkdir()
    for t in range(FRAMES):
        save(folder / f"series/density_{t}.vtk", image({NAME: frame("f32", t)}))
    return Case("series/density_*.vtk", VTK, "a file for each frame, by a pattern")


def refused(folder: Path) -> list:
    grid = vtk.vtkRectilinearGrid()
    grid.SetDimensions(2, 2, 2)
    save(folder / "refused_rectilinear.vtk", grid)
    save(folder / "i64.vtk", image({NAME: frame("i32").astype("i8")}))
    return [
        Refused("refused_rectilinear.vtk", VTK, "DATASET RECTILINEAR_GRID"),
        Case("i64.vtk", VTK, "SCALARS density long: 64 bits", "i32", frames=1),
    ]
