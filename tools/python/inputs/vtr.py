"""VTK's rectilinear grids by VTK itself."""

from pathlib import Path

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

from .case import DIMS, FRAMES, NAME, SPACING, TIMES, Case, Refused, axes, by, frame
from .vti import APPENDED, ASCII, BINARY, save
from .vtk_image import with_time

FOLDER = "vtr"
VTK, TEXT = by("vtk"), "text around files of " + by("vtk")
WRITER = vtk.vtkXMLRectilinearGridWriter
ENCODINGS = [
    ("default", APPENDED, "ZLib", {}, "as the writer is made: appended, base64, zlib"),
    ("raw", APPENDED, "None", {"EncodeAppendedData": 0}, "appended, raw, not compressed"),
    ("inline_big_endian", BINARY, "None", {"ByteOrder": 0}, "inline, base64, not compressed; big-endian"),
    ("ascii", ASCII, "None", {}, "text"),
]
PLACES = dict(zip("XYZ", axes()))


def grid(samples: np.ndarray, places: dict = PLACES, cells: bool = False) -> vtk.vtkRectilinearGrid:
    """A grid with an array [z, y, x]."""
    found = vtk.vtkRectilinearGrid()
    found.SetDimensions([len(places[axis]) for axis in "XYZ"])
    for axis in "XYZ":
        along = numpy_to_vtk(np.ascontiguousarray(places[axis]), deep=True)
        along.SetName(axis.lower())
        getattr(found, f"Set{axis}Coordinates")(along)
    array = numpy_to_vtk(np.ascontiguousarray(samples).ravel(), deep=True)
    array.SetName(NAME)
    (found.GetCellData() if cells else found.GetPointData()).SetScalars(array)
    return found


def write(folder: Path) -> list:
    return [*encodings(folder), *places(folder), parallel(folder), lists(folder), refused(folder)]


def encodings(folder: Path) -> list:
    for name, mode, compressor, settings, _ in ENCODINGS:
        save(folder / f"{name}.vtr", grid(frame()), mode, compressor, kind=WRITER, **settings)
    return [Case(f"{name}.vtr", VTK, note, frames=1) for name, *_, note in ENCODINGS]


def places(folder: Path) -> list:
    uneven = PLACES | {"Z": np.array([100.0, 101.0, 104.0], "f4")}
    ends = {axis: PLACES[axis][0] + step * (np.arange(n + 1) - 0.5) for axis, step, n in zip("XYZ", SPACING, DIMS)}
    save(folder / "uneven.vtr", grid(frame("i16"), uneven), kind=WRITER)
    save(folder / "descending.vtr", grid(frame()[::-1], PLACES | {"Z": PLACES["Z"][::-1]}), kind=WRITER)
    save(folder / "cells.vtr", with_time(grid(frame(), ends, cells=True), 0.5), kind=WRITER)
    return [
        Case("uneven.vtr", VTK, "z is 100, 101, 104: the mean step is 2", "i16", frames=1),
        Case("descending.vtr", VTK, "z descends", frames=1),
        Case("cells.vtr", VTK, "CellData; origin is that of the first cell's centre", frames=1, times=(0.5,)),
    ]


def parallel(folder: Path) -> Case:
    whole, pieces = "0 6 0 4 0 2", ("0 3 0 4 0 2", "3 6 0 4 0 2")
    for i, extent in enumerate(pieces):
        part = vtk.vtkExtractRectilinearGrid()
        part.SetInputData(grid(frame()))
        part.SetVOI(*map(int, extent.split()))
        part.Update()
        found = part.GetOutput()
        for axis in "XYZ":
            getattr(found, f"Get{axis}Coordinates")().SetName(axis.lower())
        save(folder / f"parallel_{i}.vtr", found, kind=WRITER)
    rows = [f'<Piece Extent="{extent}" Source="parallel_{i}.vtr"/>' for i, extent in enumerate(pieces)]
    text = (
        '<VTKFile type="PRectilinearGrid" version="0.1" byte_order="LittleEndian">'
        f'<PRectilinearGrid WholeExtent="{whole}" GhostLevel="0">'
        f'<PPointData Scalars="{NAME}"><PDataArray type="Float32" Name="{NAME}"/></PPointData>'
        '<PCoordinates><PDataArray type="Float64" Name="x"/><PDataArray type="Float64" Name="y"/>'
        '<PDataArray type="Float64" Name="z"/></PCoordinates>'
        f"{''.join(rows)}</PRectilinearGrid></VTKFile>"
    )
    (folder / "parallel.pvtr").write_text(text)
    return Case("parallel.pvtr", TEXT, "two pieces in two files, which share a plane of points", frames=1)


def lists(folder: Path) -> Case:
    (folder / "series").mkdir()
    rows = []
    for t in range(FRAMES):
        save(folder / f"series/density_{t}.vtr", grid(frame("f32", t)), kind=WRITER)
        rows.append(f'<DataSet timestep="{TIMES[t]}" file="series/density_{t}.vtr"/>')
    text = f'<VTKFile type="Collection" version="0.1"><Collection>{"".join(rows)}</Collection></VTKFile>'
    (folder / "series.pvd").write_text(text)
    return Case("series.pvd", TEXT, "ParaView's collection with times", times=TIMES)


def refused(folder: Path) -> Refused:
    back = PLACES | {"Y": np.array([10.0, 11.0, 10.5, 13.0, 14.0])}
    save(folder / "refused_back.vtr", grid(frame(), back), kind=WRITER)
    return Refused("refused_back.vtr", VTK, "coordinates along y go forth and back")
