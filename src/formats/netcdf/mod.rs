//! NetCDF: classic files and version 4 are read, classic ones written.

mod layout;
#[cfg(feature = "netcdf")]
mod read;
mod write;

#[cfg(feature = "netcdf")]
pub(crate) use read::open;

use super::format::{Format, Reader};
use super::writer::{Axes, Writer};

pub(crate) static FORMAT: Format = Format {
    name: "NetCDF",
    extensions: &["nc", "nc3", "nc4", "cdf", "netcdf"],
    starts: &[layout::MAGIC],
    reader: READER,
    writers: &[Writer {
        name: "nc",
        place: 6,
        label: Some("NetCDF"),
        axes: Axes::Source,
        is_big_endian: |_| true,
        has_coordinates: true,
        before: |contents, samples, out| write::write_header(contents, samples.ty, out),
        after: |contents, samples| write::padding(contents, samples.ty),
        ..Writer::PLAIN
    }],
};

#[cfg(feature = "netcdf")]
const READER: Reader = Reader::Arrays(Ok(read::open));
#[cfg(not(feature = "netcdf"))]
const READER: Reader = Reader::Arrays(Err("netcdf"));
