//! The bytes of a file for the crates that read HDF5, and messages about files that they cannot read.

use hdf5_reader::Dataset;
use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::storage::{DynStorage, Storage, StorageBuffer};
use std::sync::Arc;
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::source::Parsed;

/// The bytes of a file for the reader.
pub(crate) fn storage(file: FileBytes) -> DynStorage {
    Arc::new(Bytes(file))
}

struct Bytes(FileBytes);

impl Storage for Bytes {
    fn len(&self) -> u64 {
        self.0.len()
    }

    fn read_range(&self, offset: u64, len: usize) -> std::result::Result<StorageBuffer, Hdf5Error> {
        let available = self.0.len().saturating_sub(offset);
        if len as u64 > available {
            return Err(Hdf5Error::UnexpectedEof { offset, needed: len as u64, available });
        }
        let mut bytes = vec![0; len];
        self.0.read_at(offset, &mut bytes)?;
        Ok(StorageBuffer::from_vec(bytes))
    }
}

/// Plugin filters that files are often written with, by their registered numbers.
const PLUGIN_FILTERS: [(u16, &str); 9] = [
    (305, "LZO"),
    (307, "BZIP2"),
    (32000, "LZF"),
    (32001, "Blosc"),
    (32008, "Bitshuffle"),
    (32013, "ZFP"),
    (32015, "Zstandard"),
    (32017, "SZ"),
    (32026, "Blosc2"),
];

/// Why something cannot be read. A filter that is not supported is named, with the command that rewrites the file
/// without it.
pub(crate) fn reason(error: &Hdf5Error) -> String {
    let filter = match error {
        Hdf5Error::UnsupportedFilter(filter) => filter,
        Hdf5Error::Context { path, source } => return format!("{path}: {}", reason(source)),
        Hdf5Error::UnsupportedLayoutClass(3) => return "a virtual dataset, whose samples are in other files".into(),
        error => return error.to_string(),
    };
    let Some(id) = filter.strip_prefix("filter id ") else { return error.to_string() };
    let known = PLUGIN_FILTERS.iter().find(|(known, _)| id.parse() == Ok(*known));
    let name = known.map_or_else(|| format!("filter {id}"), |(_, name)| format!("filter {name} ({id})"));
    format!("{name} is not supported; rewrite the file where HDF5 has that filter: h5repack -f GZIP=4 IN OUT")
}

/// An error for an array that is longer along an axis than it may become: libhdf5 refuses it, too.
pub(crate) fn check_lengths(dataset: &Dataset) -> Parsed<()> {
    let (lengths, most) = (dataset.shape(), dataset.max_dims().unwrap_or_default());
    if lengths.iter().zip(most).all(|(length, most)| length <= most) {
        return Ok(());
    }
    Err(format!("is damaged: its sizes {lengths:?} are above the largest that it may have, {most:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_are_refused_by_name_with_the_command_that_removes_them() {
        let refused = |id: &str| reason(&Hdf5Error::UnsupportedFilter(format!("filter id {id}")));
        assert!(refused("32013").starts_with("filter ZFP (32013) is not supported"));
        assert!(refused("999").starts_with("filter 999 is not supported"));
        assert!(refused("999").ends_with("h5repack -f GZIP=4 IN OUT"));
        let other = Hdf5Error::UnsupportedFilter("scaleoffset float E-scale".into());
        assert_eq!(reason(&other), other.to_string());
    }
}
