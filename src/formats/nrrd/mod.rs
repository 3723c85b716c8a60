//! NRRD, attached (`.nrrd`) or with its samples elsewhere (`.nhdr`), raw or in gzip: three axes of space, perhaps one
//! of frames and one of components, in any order.

mod axes;
mod data;
mod files;
mod header;
mod layout;
mod read;
#[cfg(test)]
mod tests;
mod write;

use super::format::{Choices, Format, Reader};
use super::writer::{Axes, OutputFiles, Writer};

pub(crate) static FORMAT: Format = Format {
    name: layout::NAME,
    extensions: &["nrrd", "nhdr"],
    starts: &[layout::MAGIC],
    reader: Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::Components),
    writers: &[
        Writer {
            name: "nrrd",
            place: 2,
            before: |contents, samples, out| write::write_header(contents, samples.ty, None, out),
            ..PLAIN
        },
        Writer {
            name: "nhdr",
            place: 3,
            files: OutputFiles::WithHeader {
                extension: "raw",
                write: |contents, ty, data, out| write::write_header(contents, ty, Some(data), out),
            },
            ..PLAIN
        },
    ],
};

/// x y z t, or x y z for one frame.
const PLAIN: Writer = Writer { label: Some(layout::NAME), axes: Axes::Lattice, has_times: false, ..Writer::PLAIN };
