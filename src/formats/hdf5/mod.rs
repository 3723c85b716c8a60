//! HDF5, and in it VTKHDF and openPMD. A file that the NetCDF library wrote is a NetCDF file, whatever its name is.

#[cfg(feature = "hdf5")]
mod numbers;
#[cfg(feature = "hdf5")]
mod attributes;
#[cfg(feature = "hdf5")]
mod links;
#[cfg(feature = "hdf5")]
mod scales;
#[cfg(feature = "hdf5")]
mod listing;
#[cfg(feature = "hdf5")]
mod read;

use super::format::{Format, Reader};

pub(crate) static FORMAT: Format =
    Format { starts: &[b"\x89HDF\r\n\x1a\n"], ..Format::new("HDF5", &["h5", "hdf5", "hdf", "he5", "vtkhdf"], READER) };

#[cfg(feature = "hdf5")]
const READER: Reader = Reader::Arrays(Ok(read::open));
#[cfg(not(feature = "hdf5"))]
const READER: Reader = Reader::Arrays(Err("hdf5"));
