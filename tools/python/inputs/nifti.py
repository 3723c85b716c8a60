"""NIfTI by nibabel."""

import gzip
from pathlib import Path

import nibabel
import numpy as np

from .case import MAY, ORIGIN, SPACING, STEP, TIMES, Case, Refused, by, frame, frames

FOLDER = "nifti"
NIBABEL = by("nibabel")
TYPES = ("u8", "i8", "u16", "i16", "u32", "i32", "f32", "f64")


def write(folder: Path) -> list:
    return [
        *types(folder),
        *whole(folder),
        *packed(folder),
        *placed(folder),
        series(folder),
        *refused(folder),
    ]


def affine(spacing=SPACING, origin=ORIGIN) -> np.ndarray:
    found = np.diag([*spacing, 1.0])
    found[:3, 3] = origin
    return found


def make(samples, kind=nibabel.Nifti1Image, order="<", place=affine(), time="sec", step=STEP):
    """An image of samples [t, z, y, x] or [z, y, x]."""
    header = kind.header_class(endianness=order)
    header.set_data_dtype(samples.dtype.newbyteorder(order))
    found = kind(samples.T, place, header)
    found.header.set_xyzt_units("mm", time)
    if samples.ndim == 4:
        found.header["pixdim"][4] = step
    return found


def compress(path: Path, found) -> None:
    """Without the time of day that gzip would note."""
    path.write_bytes(gzip.compress(found.to_bytes(), mtime=0))


def types(folder: Path) -> list:
    for sample in TYPES:
        make(frame(sample)).to_filename(folder / f"{sample}.nii")
    return [Case(f"{s}.nii", NIBABEL, "NIfTI-1, three dimensions", s, frames=1) for s in TYPES]


def whole(folder: Path) -> list:
    samples = frames()
    make(samples).to_filename(folder / "4d.nii")
    compress(folder / "4d.nii.gz", make(samples))
    compress(folder / "4d_i16.nii.gz", make(frames("i16")))
    make(samples, nibabel.Nifti2Image).to_filename(folder / "4d_nifti2.nii")
    compress(folder / "4d_nifti2.nii.gz", make(samples, nibabel.Nifti2Image))
    make(samples, nibabel.Nifti1Pair).to_filename(folder / "pair.hdr")
    make(samples, order=">").to_filename(folder / "4d_big_endian.nii")
    make(samples, nibabel.Nifti2Image, ">").to_filename(folder / "4d_nifti2_big_endian.nii")
    make(samples, time="msec", step=500).to_filename(folder / "4d_msec.nii")
    return [
        Case("4d.nii", NIBABEL, "NIfTI-1, pixdim[4] = 0.5 s", times=TIMES),
        Case("4d.nii.gz", NIBABEL, "compressed; pixdim[4] = 0.5 s", times=TIMES),
        Case("4d_i16.nii.gz", NIBABEL, "compressed; pixdim[4] = 0.5 s", "i16", times=TIMES),
        Case("4d_nifti2.nii", NIBABEL, "NIfTI-2, pixdim[4] = 0.5 s", times=TIMES),
        Case("4d_nifti2.nii.gz", NIBABEL, "NIfTI-2, compressed; pixdim[4] = 0.5 s", times=TIMES),
        Case("pair.hdr", NIBABEL, "samples in pair.img", times=TIMES),
        Case("4d_big_endian.nii", NIBABEL, "NIfTI-1, big-endian", times=TIMES),
        Case("4d_nifti2_big_endian.nii", NIBABEL, "NIfTI-2, big-endian", times=TIMES),
        Case("4d_msec.nii", NIBABEL, "pixdim[4] = 500 ms", times=TIMES),
    ]


def packed(folder: Path) -> list:
    """Whole numbers that stand for n / 4 - 3."""
    for sample in ("i16", "i32"):
        found = make(frames(sample))
        found.header.set_slope_inter(0.25, -3.0)
        found.to_filename(folder / f"packed_{sample}.nii")
    found = make(frames("u8"))
    found.header.set_slope_inter(1.0, 0.0)
    found.to_filename(folder / "slope_1.nii")
    return [
        Case("packed_i16.nii", NIBABEL, "i16 with scl_slope 0.25 and scl_inter -3", "f32", times=TIMES),
        Case("packed_i32.nii", NIBABEL, "i32 with scl_slope 0.25 and scl_inter -3", "f64", times=TIMES),
        Case("slope_1.nii", NIBABEL, "scl_slope 1 and scl_inter 0: nothing to unpack", "u8", times=TIMES),
    ]


def placed(folder: Path) -> list:
    """Other ways to say where the voxels are."""
    found = make(frame())
    found.set_sform(None, 0)
    found.set_qform(affine(), 1)
    found.to_filename(folder / "qform.nii")
    make(frame(), place=None).to_filename(folder / "nowhere.nii")
    last = ORIGIN[0] + SPACING[0] * (frame().shape[2] - 1)
    left = affine((-SPACING[0], *SPACING[1:]), (last, *ORIGIN[1:]))
    make(np.ascontiguousarray(frame()[..., ::-1]), place=left).to_filename(folder / "x_descends.nii")
    x_descends = "the affine's x descends (stored right to left); values are as if flipped to ascend"
    return [
        Case("qform.nii", NIBABEL, "qform alone; sform_code is 0", frames=1),
        Case("nowhere.nii", NIBABEL, "neither qform nor sform; pixdim is 1", frames=1, spacing=(1, 1, 1), origin=None),
        Case("x_descends.nii", NIBABEL, x_descends, frames=1, more={"flipped": ["x"]} | MAY),
    ]


def series(folder: Path) -> Case:
    (folder / "series").mkdir()
    for t, samples in enumerate(frames("i16")):
        compress(folder / f"series/density_{t}.nii.gz", make(samples))
    return Case("series", NIBABEL, "a folder of compressed frames", "i16")


def refused(folder: Path) -> list:
    vector = np.stack([frames("u8")] * 3)
    make(vector).to_filename(folder / "refused_vector.nii")
    make(frame("i32").astype("c8")).to_filename(folder / "refused_complex.nii")
    turned = affine()
    turned[:3, :3] = turned[:3, :3] @ np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    make(frame(), place=turned).to_filename(folder / "oblique.nii")
    oblique = "turned by an angle about z: spacing and origin along x, y, z are not what the file says"
    return [
        Refused("refused_vector.nii", NIBABEL, "five dimensions: three components"),
        Refused("refused_complex.nii", NIBABEL, "complex64"),
        Case("oblique.nii", NIBABEL, oblique, frames=1, spacing=None, origin=None, more=MAY),
    ]
