"""VTK's XML images by VTK itself, and the lists of them that ParaView writes."""

import json
from pathlib import Path

import numpy as np
import vtk

from .case import FRAMES, MAY, NAME, TIMES, Case, Refused, by, frame
from .vtk_image import Source, image, with_time

FOLDER = "vti"
VTK, TEXT = by("vtk"), "text around files of " + by("vtk")
APPENDED, ASCII, BINARY = "Appended", "Ascii", "Binary"
# Name, mode, compressor, other settings of the writer, what is special.
ENCODINGS = [
    ("default", APPENDED, "ZLib", {}, "as the writer is made: appended, base64, zlib"),
    ("appended_raw_zlib", APPENDED, "ZLib", {"EncodeAppendedData": 0}, "appended, raw, zlib"),
    ("appended_raw", APPENDED, "None", {"EncodeAppendedData": 0}, "appended, raw, not compressed"),
    ("appended_base64", APPENDED, "None", {}, "appended, base64, not compressed"),
    ("inline_zlib", BINARY, "ZLib", {}, "inline, base64, zlib"),
    ("inline", BINARY, "None", {}, "inline, base64, not compressed"),
    ("ascii", ASCII, "None", {}, "text"),
    ("lz4", APPENDED, "LZ4", {"EncodeAppendedData": 0}, "appended, raw, lz4"),
    ("lzma", APPENDED, "LZMA", {"EncodeAppendedData": 0}, "appended, raw, lzma"),
    ("header_u64", APPENDED, "ZLib", {"HeaderType": 64}, "appended, base64, zlib; lengths of 64 bits"),
    ("header_u32", APPENDED, "ZLib", {"HeaderType": 32}, "appended, base64, zlib; lengths of 32 bits"),
    ("big_endian", APPENDED, "ZLib", {"ByteOrder": 0}, "appended, base64, zlib; big-endian"),
    ("big_endian_raw", APPENDED, "None", {"ByteOrder": 0, "EncodeAppendedData": 0}, "appended, raw; big-endian"),
    ("blocks", APPENDED, "ZLib", {"BlockSize": 128}, "appended, base64, zlib in several blocks of 128 bytes"),
]


def write(folder: Path) -> list:
    return [
        *encodings(folder),
        *types(folder),
        *arrays(folder),
        pieces(folder),
        *lists(folder),
        integers(folder),
    ]


def save(path: Path, data, mode=APPENDED, compressor="ZLib", kind=vtk.vtkXMLImageDataWriter, **settings) -> None:
    writer = kind()
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    for name, value in settings.items():
        getattr(writer, f"Set{name}")(value)
    if data.IsA("vtkAlgorithm"):
        writer.SetInputConnection(data.GetOutputPort())
    else:
        writer.SetInputData(data)
    writer.Write()


def encodings(folder: Path) -> list:
    for name, mode, compressor, settings, _ in ENCODINGS:
        save(folder / f"{name}.vti", image({NAME: frame()}), mode, compressor, **settings)
    seldom = {"LZ4", "LZMA"}
    return [
        Case(f"{name}.vti", VTK, note, frames=1, more=MAY if compressor in seldom else {})
        for name, _, compressor, _, note in ENCODINGS
    ]


def types(folder: Path) -> list:
    kinds = ("u8", "i8", "u16", "i16", "u32", "i32", "f64")
    for sample in kinds:
        save(folder / f"{sample}.vti", image({NAME: frame(sample)}))
    return [Case(f"{s}.vti", VTK, "as the writer is made", s, frames=1) for s in kinds]


def arrays(folder: Path) -> list:
    density = frame()
    save(folder / "several.vti", image({"other": density + 1000, NAME: density}, active=None))
    save(folder / "active.vti", image({"other": density + 1000, NAME: density}, active=NAME))
    save(folder / "cells.vti", image({NAME: density}, cells=True))
    velocity = np.stack([density, density + 1000, density + 2000], axis=-1)
    save(folder / "vector.vti", image({"velocity": velocity}, active=None))
    save(folder / "time.vti", with_time(image({NAME: density}), 0.5))
    several = "two arrays, other (density + 1000) first, none active"
    vector = "three components: density, density + 1000, density + 2000; the values are those of the first"
    return [
        Case("several.vti", VTK, several, variable=NAME, frames=1),
        Refused("several.vti", VTK, several + "; no variable is named"),
        Case("active.vti", VTK, "two arrays, the second one is Scalars", frames=1),
        Case("cells.vti", VTK, "CellData; origin is that of the first cell's centre", frames=1),
        Case("vector.vti", VTK, vector, variable="velocity", frames=1, more={"components": 3} | MAY),
        Case("time.vti", VTK, "FieldData has TimeValue 0.5", frames=1, times=(0.5,)),
    ]


def pieces(folder: Path) -> Case:
    save(folder / "pieces.vti", Source(), NumberOfPieces=2)
    return Case("pieces.vti", VTK, "two pieces in one file, which share a plane of points", frames=1, more=MAY)


def lists(folder: Path) -> list:
    (folder / "series").mkdir()
    for t in range(FRAMES):
        save(folder / f"series/density_{t}.vti", image({NAME: frame("f32", t)}))
    names = [f"density_{t}.vti" for t in range(FRAMES)]
    listed = {"file-series-version": "1.0", "files": [{"name": n, "time": t} for n, t in zip(names, TIMES)]}
    (folder / "series/density.vti.series").write_text(json.dumps(listed, indent=2) + "\n")
    sets = "".join(
        f'    <DataSet timestep="{t}" group="" part="0" file="series/{n}"/>\n' for n, t in zip(names, TIMES)
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
    (folder / "series.pvd").write_text(f"{head}  <Collection>\n{sets}  </Collection>\n</VTKFile>\n")
    return [
        Case("series/density_*.vti", VTK, "a file for each frame, by a pattern"),
        Case("series/density.vti.series", TEXT, "ParaView's list of files and times", times=TIMES),
        Case("series.pvd", TEXT, "ParaView's collection with times", times=TIMES),
        parallel(folder),
    ]


def parallel(folder: Path) -> Case:
    settings = {"NumberOfPieces": 2, "EndPiece": 1}
    save(folder / "parallel.pvti", Source(), kind=vtk.vtkXMLPImageDataWriter, **settings)
    return Case("parallel.pvti", VTK, "two pieces in two files, which share a plane of points", frames=1, more=MAY)


def integers(folder: Path) -> Case:
    save(folder / "i64.vti", image({NAME: frame("i32").astype("i8")}))
    return Case("i64.vti", VTK, "Int64", "i32", frames=1)
