//! Zarr: stores of versions 2 and 3 are read, those of version 2 written.

#[cfg(feature = "zarr")]
mod files;
mod layout;
#[cfg(feature = "zarr")]
mod ome;
#[cfg(feature = "zarr")]
mod read;
mod store;
#[cfg(all(test, feature = "zarr"))]
mod tests;
mod write;

pub(crate) use layout::metadata_file;

use super::format::{Format, Reader};
use super::writer::{Axes, OutputFiles, Writer};

/// A folder.
pub(crate) static FORMAT: Format = Format {
    name: "Zarr",
    extensions: &["zarr"],
    starts: &[],
    reader: READER,
    writers: &[Writer {
        name: "zarr",
        place: 11,
        label: Some("Zarr"),
        files: OutputFiles::Folder(write::create),
        axes: Axes::Source,
        has_coordinates: true,
        ..Writer::PLAIN
    }],
};

#[cfg(feature = "zarr")]
const READER: Reader = Reader::Arrays(Ok(read::open));
#[cfg(not(feature = "zarr"))]
const READER: Reader = Reader::Arrays(Err("zarr"));
