"""TIFF by tifffile: plain stacks, ImageJ's and those of the Open Microscopy Environment."""

from pathlib import Path

import numpy as np
import SimpleITK as sitk
import tifffile

from .case import FRAMES, NAME, STEP, Case, Refused, by, frame, frames

FOLDER = "tiff"
TIFFFILE, ITK = by("tifffile"), by("SimpleITK")
BARE = {"spacing": None, "origin": None}
PLACED = {"spacing": (0.5, 0.5, 2.0), "origin": None, "times": tuple(STEP * t for t in range(FRAMES))}
OME = {
    "PhysicalSizeX": 0.5,
    "PhysicalSizeXUnit": "µm",
    "PhysicalSizeY": 500,
    "PhysicalSizeYUnit": "nm",
    "PhysicalSizeZ": 2,
    "PhysicalSizeZUnit": "µm",
    "TimeIncrement": STEP,
    "TimeIncrementUnit": "s",
}
# Name, type of samples, settings of the writer, what is special.
STACKS = [
    ("u8", "u8", {}, "pages along z"),
    ("i16_big_endian", "i16", {"byteorder": ">"}, "pages along z, big-endian"),
    ("u16_bigtiff", "u16", {"bigtiff": True}, "BigTIFF"),
    ("f16", "f16", {}, "half floats"),
    ("f32_strips", "f32", {"rowsperstrip": 2}, "strips of two rows"),
    ("f32_tiles", "f32", {"tile": (16, 16)}, "tiles"),
    ("f64_deflate", "f64", {"compression": "zlib"}, "deflate"),
    ("i32_deflate", "i32", {"compression": "zlib", "predictor": True}, "deflate with differences"),
    ("i64", "i32", {"dtype": "i8"}, "integers of 64 bits"),
]


def write(folder: Path) -> list:
    return [*stacks(folder), *by_itk(folder), series(folder), *imagej(folder), *ome(folder), *refused(folder)]


def stacks(folder: Path) -> list:
    for name, sample, settings, _ in STACKS:
        settings = dict(settings)
        samples = frame(sample).astype(settings.pop("dtype", frame(sample).dtype))
        settings = {"byteorder": "<"} | settings
        big = settings.pop("bigtiff", False)
        with tifffile.TiffWriter(folder / f"{name}.tif", byteorder=settings.pop("byteorder"), bigtiff=big) as file:
            for page in samples:
                file.write(page, photometric="minisblack", contiguous=False, metadata=None, **settings)
    return [Case(f"{name}.tif", TIFFFILE, note, sample, frames=1, **BARE) for name, sample, _, note in STACKS]


def by_itk(folder: Path) -> list:
    for compressor in ("LZW", "PackBits"):
        writer = sitk.ImageFileWriter()
        writer.SetFileName(str(folder / f"itk_{compressor.lower()}.tif"))
        writer.UseCompressionOn()
        writer.SetCompressor(compressor)
        writer.Execute(sitk.GetImageFromArray(frame("u16")))
    return [
        Case("itk_lzw.tif", ITK, "LZW", "u16", frames=1, **BARE),
        Case("itk_packbits.tif", ITK, "PackBits", "u16", frames=1, **BARE),
    ]


def series(folder: Path) -> Case:
    (folder / "series").mkdir()
    for t in range(FRAMES):
        tifffile.imwrite(folder / f"series/{NAME}_{t}.tif", frame("u16", t), photometric="minisblack")
    return Case("series", TIFFFILE, "a folder of stacks, one for each frame", "u16", **BARE)


def imagej(folder: Path) -> list:
    said = {"unit": "um", "spacing": 2.0, "finterval": STEP}
    settings = {"imagej": True, "resolution": (2.0, 2.0)}
    tifffile.imwrite(folder / "imagej.tif", frames(), metadata=said | {"axes": "TZYX"}, **settings)
    two = np.stack([frames("u16"), frames("u16") + 1000], axis=2)
    tifffile.imwrite(folder / "imagej_channels.tif", two, metadata=said | {"axes": "TZCYX"}, **settings)
    note = "ImageJ, two channels, of which the second is 1000 more"
    channels = {"variable": "samples", "more": {"components": 2}}
    return [
        Case("imagej.tif", TIFFFILE, "ImageJ, planes and frames", **PLACED),
        Case("imagej_channels.tif", TIFFFILE, note, "u16", **channels, **PLACED),
        Refused("imagej_channels.tif", TIFFFILE, note + "; none is named"),
    ]


def ome(folder: Path) -> list:
    names = ["all.ome.tif", "order.ome.tif", "channels.ome.tif"]
    two = np.stack([frames("i16"), frames("i16") + 1000], axis=1)
    arrays = [(frames(), "TZYX"), (frames().swapaxes(0, 1), "ZTYX"), (two, "TCZYX")]
    for name, (samples, axes) in zip(names, arrays):
        settings = {"ome": True, "photometric": "minisblack", "contiguous": False}
        tifffile.imwrite(folder / name, np.ascontiguousarray(samples), metadata=OME | {"axes": axes}, **settings)
    channels = {"variable": "samples", "more": {"components": 2}}
    return [
        Case(names[0], TIFFFILE, "OME-TIFF, order XYZTC or as good", **PLACED),
        Case(names[1], TIFFFILE, "OME-TIFF, frames faster than planes", **PLACED),
        Case(names[2], TIFFFILE, "OME-TIFF, two channels", "i16", **channels, **PLACED),
    ]


def refused(folder: Path) -> list:
    colours = np.stack([frame("u8")] * 3, axis=-1)
    tifffile.imwrite(folder / "refused_rgb.tif", colours, photometric="rgb")
    with tifffile.TiffWriter(folder / "refused_sizes.tif") as file:
        for page in (frame()[0], frame()[0, 1:]):
            file.write(page, photometric="minisblack", metadata=None)
    palette = np.zeros((3, 256), "u2")
    tifffile.imwrite(folder / "refused_palette.tif", frame("u8")[0], photometric="palette", colormap=palette)
    return [
        Refused("refused_rgb.tif", TIFFFILE, "colours"),
        Refused("refused_sizes.tif", TIFFFILE, "pages of different sizes"),
        Refused("refused_palette.tif", TIFFFILE, "a palette of colours"),
    ]
