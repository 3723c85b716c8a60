"""MetaImage: by ITK, by VTK, and headers of text over numpy's bytes."""

from pathlib import Path

import SimpleITK as sitk
import vtk

from .case import DIMS, FRAMES, MAY, NAME, ORIGIN, SPACING, STEP, TIMES, Case, Refused, by, frame, frames
from .vtk_image import image

FOLDER = "metaimage"
TYPES = ("u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64")
ITK, VTK, TEXT = by("SimpleITK"), by("vtk"), "text and " + by("numpy")
WORDS = {"u8": "MET_UCHAR", "i16": "MET_SHORT", "u16": "MET_USHORT", "f32": "MET_FLOAT"}


def write(folder: Path) -> list:
    return [
        *types(folder),
        *by_itk(folder),
        *by_vtk(folder),
        by_itk_whole(folder, "itk_4d.mha", "four dimensions, time last", False),
        by_itk_whole(folder, "itk_4d_compressed.mha", "four dimensions, time last, one zlib stream", True),
        by_itk_series(folder),
        *by_text(folder),
        *refused(folder),
    ]


def itk(samples, spacing=SPACING, origin=ORIGIN) -> sitk.Image:
    found = sitk.GetImageFromArray(samples, isVector=False)
    found.SetSpacing(spacing)
    found.SetOrigin(origin)
    return found


def types(folder: Path) -> list:
    for sample in TYPES:
        sitk.WriteImage(itk(frame(sample)), folder / f"itk_{sample}.mha")
    return [Case(f"itk_{s}.mha", ITK, "local, raw", s, frames=1) for s in TYPES]


def by_itk(folder: Path) -> list:
    kinds = [
        ("itk_compressed.mha", True, "local, one zlib stream"),
        ("itk_detached.mhd", False, "samples in a .raw"),
        ("itk_detached_compressed.mhd", True, "samples in a .zraw"),
    ]
    for name, compressed, _ in kinds:
        sitk.WriteImage(itk(frame()), folder / name, compressed)
    return [Case(name, ITK, note, frames=1) for name, _, note in kinds]


def by_itk_whole(folder: Path, name: str, note: str, compressed: bool) -> Case:
    sitk.WriteImage(itk(frames(), (*SPACING, STEP), (*ORIGIN, 0.0)), folder / name, compressed)
    return Case(name, ITK, note, times=TIMES)


def by_itk_series(folder: Path) -> Case:
    (folder / "itk_series").mkdir()
    for t in range(FRAMES):
        sitk.WriteImage(itk(frame("i16", t)), folder / f"itk_series/step_{t:03}.mha", t % 2 == 1)
    return Case("itk_series", ITK, "a folder of frames; every second one is compressed", "i16")


def by_vtk(folder: Path) -> list:
    kinds = [
        ("vtk.mhd", "f32", False, "samples in a .raw"),
        ("vtk_compressed.mhd", "f32", True, "samples in a .zraw, as is the default"),
        ("vtk_i16.mha", "i16", False, "local, raw"),
        ("vtk_u16_compressed.mha", "u16", True, "local, one zlib stream"),
    ]
    for name, sample, compressed, _ in kinds:
        writer = vtk.vtkMetaImageWriter()
        writer.SetFileName(str(folder / name))
        writer.SetCompression(compressed)
        writer.SetInputData(image({NAME: frame(sample)}))
        writer.Write()
    return [Case(name, VTK, note, sample, frames=1) for name, sample, _, note in kinds]


def header(sample: str, data: str, whole: bool = False, extra: str = "") -> bytes:
    """A header without comments; `whole`: with time as the fourth dimension."""

    def join(triple: tuple, last: float) -> str:
        return " ".join(str(v) for v in (*triple, last)[: 3 + whole])

    return (
        f"ObjectType = Image\nNDims = {3 + whole}\n{extra}"
        f"DimSize = {join(DIMS, FRAMES)}\nElementSpacing = {join(SPACING, STEP)}\n"
        f"Offset = {join(ORIGIN, 0)}\nElementType = {WORDS[sample]}\nElementDataFile = {data}\n"
    ).encode()


def by_text(folder: Path) -> list:
    msb = "BinaryData = True\nBinaryDataByteOrderMSB = True\n"
    (folder / "big_endian.mha").write_bytes(header("i16", "LOCAL", extra=msb) + frame("i16", order=">").tobytes())
    size = "BinaryData = True\nElementByteOrderMSB = False\nHeaderSize = 11\n"
    (folder / "header_size.mhd").write_bytes(header("f32", "header_size.dat", extra=size))
    (folder / "header_size.dat").write_bytes(b"eleven here" + frame().tobytes())
    from_end = "BinaryData = True\nElementByteOrderMSB = False\nHeaderSize = -1\n"
    (folder / "header_size_from_end.mhd").write_bytes(header("f32", "header_size.dat", extra=from_end))
    return [
        Case("big_endian.mha", TEXT, "BinaryDataByteOrderMSB = True", "i16", frames=1),
        Case("header_size.mhd", TEXT, "HeaderSize = 11: bytes before the samples", frames=1),
        Case("header_size_from_end.mhd", TEXT, "HeaderSize = -1: the samples are the end of the file", frames=1),
        *lists(folder),
    ]


def lists(folder: Path) -> list:
    (folder / "parts").mkdir()
    for t in range(FRAMES):
        (folder / f"parts/volume_{t:03}.raw").write_bytes(frame("f32", t).tobytes())
    for z, plane in enumerate(frame()):
        (folder / f"parts/slice_{z:03}.raw").write_bytes(plane.tobytes())
    volumes = "".join(f"parts/volume_{t:03}.raw\n" for t in range(FRAMES)).encode()
    slices = "".join(f"parts/slice_{z:03}.raw\n" for z in range(DIMS[2])).encode()
    (folder / "list_of_volumes.mhd").write_bytes(header("f32", "LIST 3", True) + volumes)
    (folder / "list_of_slices.mhd").write_bytes(header("f32", "LIST") + slices)
    (folder / "pattern_of_volumes.mhd").write_bytes(header("f32", "parts/volume_%03d.raw 0 3 1", True))
    (folder / "pattern_of_slices.mhd").write_bytes(header("f32", "parts/slice_%03d.raw 0 2 1"))
    return [
        Case("list_of_volumes.mhd", TEXT, "LIST 3: four dimensions, a file for each three of them", times=TIMES),
        Case("list_of_slices.mhd", TEXT, "LIST: a file for each slice along z", frames=1, more=MAY),
        Case("pattern_of_volumes.mhd", TEXT, "volume_%03d.raw 0 3 1: a file for each frame", times=TIMES),
        Case("pattern_of_slices.mhd", TEXT, "slice_%03d.raw 0 2 1: a file for each slice along z", frames=1, more=MAY),
    ]


def refused(folder: Path) -> list:
    sitk.WriteImage(itk(frame("i32").astype("i8")), folder / "i64.mha")
    colours = sitk.Compose([itk(frame("u8"))] * 3)
    sitk.WriteImage(colours, folder / "refused_channels.mha")
    ascii_ = "BinaryData = False\n"
    text = " ".join(str(v) for v in frame("i16").ravel()).encode()
    (folder / "refused_ascii.mha").write_bytes(header("i16", "LOCAL", extra=ascii_) + text + b"\n")
    return [
        Case("i64.mha", ITK, "MET_LONG_LONG", "i32", frames=1),
        Refused("refused_channels.mha", ITK, "ElementNumberOfChannels = 3"),
        Refused("refused_ascii.mha", TEXT, "BinaryData = False: samples as text"),
    ]
