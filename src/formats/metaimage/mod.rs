//! MetaImage, with its samples in the same file (`.mha`) or in others (`.mhd`): axes x y z or x y z t.

mod data;
mod header;
mod layout;
mod read;
#[cfg(test)]
mod tests;
mod write;

use super::format::{Choices, Format, Reader};
use super::writer::{Axes, Writer};

pub(crate) static FORMAT: Format = Format {
    name: layout::NAME,
    extensions: &["mha", "mhd"],
    starts: &[],
    reader: Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::Components),
    writers: &[Writer {
        name: "mha",
        place: 9,
        label: Some(layout::NAME),
        axes: Axes::Lattice,
        has_times: false,
        before: |contents, samples, out| write::write_header(contents, samples.ty, out),
        ..Writer::PLAIN
    }],
};
