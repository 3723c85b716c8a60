//! NIfTI, versions 1 and 2: `.nii`, the pair `.hdr` and `.img`, each as it is or in gzip. Axes x y z, x y z t, and with
//! several components x y z t v.

mod header;
mod layout;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub(crate) use header::is_nifti;
pub(crate) use read::header_of;

use super::format::{Choices, Format, Reader};
use super::writer::{Axes, Writer};

pub(crate) static FORMAT: Format = Format {
    name: "NIfTI",
    extensions: &["nii", "nii.gz", "hdr", "hdr.gz"],
    starts: &[], // the length of the header, in either byte order
    reader: Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::Components),
    writers: &[PLAIN, Writer { name: "nii.gz", place: 8, gzip: true, ..PLAIN }],
};

/// One file: x y z t, or x y z for one frame.
const PLAIN: Writer = Writer {
    name: "nii",
    place: 7,
    label: Some("NIfTI"),
    axes: Axes::Lattice,
    is_big_endian: write::is_big_endian,
    has_times: false,
    before: |contents, samples, out| write::write_header(contents, samples.ty, out),
    ..Writer::PLAIN
};
