//! HDF5 files as [`ArrayFile`].

use super::attributes::described_all;
use super::listing::Listed;
use super::numbers::{StoredBytes, check_form, joined, number_type, sized};
use crate::arrays::describe::numbers;
use crate::arrays::hdf5_storage::{check_lengths, reason, storage};
use crate::arrays::opener::ReadConfig;
use crate::arrays::{ArrayArchive, ArrayFile, Attributes, Variable, attributes};
use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::{Dataset, Hdf5File, SliceInfo, SliceInfoElem};
use std::cell::OnceCell;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use wavesplat_core::base::description::{self, NumberType};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::{OpenOptions, Parsed};

/// Opens a file and lists its arrays. A file that the NetCDF library wrote counts as NetCDF.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    let archive = ArrayArchive::open("HDF5", path, Some(path), Arc::new(open_file), options)?;
    match archive.is_of_netcdf() {
        #[cfg(feature = "netcdf")]
        true => crate::netcdf::open(path, options),
        #[cfg(not(feature = "netcdf"))]
        true => Err(crate::netcdf::FORMAT.not_built_in(path, "netcdf")),
        false => Ok(archive),
    }
}

fn open_file(path: &Path, how: ReadConfig) -> Result<Box<dyn ArrayFile>> {
    let file = FileBytes::open(path, how.access)?;
    let file = Hdf5File::from_storage_with_options(storage(file), options(how));
    let file = file.map_err(|e| Error::input(path, format!("is no HDF5 file that can be read: {e}")))?;
    Ok(Box::new(Hdf5ArrayFile { file, listed: OnceCell::new() }))
}

fn options(how: ReadConfig) -> hdf5_reader::OpenOptions {
    // Every chunk is read once, so none is kept.
    hdf5_reader::OpenOptions::default().with_chunk_cache_bytes(0).with_max_chunk_bytes(how.memory)
}

struct Hdf5ArrayFile {
    file: Hdf5File,
    listed: OnceCell<Parsed<Listed>>,
}

impl Hdf5ArrayFile {
    fn listed(&self) -> Parsed<&Listed> {
        self.listed.get_or_init(|| Listed::read(&self.file)).as_ref().map_err(Clone::clone)
    }

    /// An array whose numbers are in a form that is known.
    fn dataset(&self, path: &str) -> Parsed<Dataset> {
        let dataset = self.file.dataset(path).map_err(|e| reason(&e))?;
        check_lengths(&dataset)?;
        check_form(&dataset)?;
        Ok(dataset)
    }
}

impl ArrayFile for Hdf5ArrayFile {
    fn variables(&self) -> Parsed<Vec<Variable>> {
        self.listed().map(|listed| listed.variables.clone())
    }

    fn elsewhere(&self) -> Vec<String> {
        self.listed().map(|listed| listed.elsewhere.clone()).unwrap_or_default()
    }

    fn read(&self, path: &str, ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        let dataset = self.dataset(path)?;
        slice(&dataset, ty, ranges).map_err(|e| reason(&e))
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let attributes = match path {
            "" => self.file.root_group().and_then(|group| group.attributes()).unwrap_or_default(),
            path => self.file.dataset(path).map(|dataset| dataset.attributes()).unwrap_or_default(),
        };
        described_all(&attributes)
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        let dataset = self.dataset(path)?;
        if let Ok(texts) = dataset.read_strings() {
            return Ok(description::Values::Texts(texts));
        }
        let ty = number_type(dataset.dtype())?;
        raw(&dataset, ty).map(|bytes| numbers(ty, &bytes)).map_err(|e| format!("{path}: {}", reason(&e)))
    }

    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let Ok(dataset) = self.file.dataset(path) else { return Vec::new() };
        let most = dataset.max_dims().unwrap_or_default();
        (0..most.len()).filter(|axis| most[*axis] == u64::MAX).collect()
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        number_type(self.file.dataset(path).map_err(|e| e.to_string())?.dtype())
    }

    fn group(&self, path: &str) -> Attributes {
        let group = self.file.group(path).and_then(|group| group.attributes());
        group.map(|all| attributes(&described_all(&all))).unwrap_or_default()
    }
}

/// All numbers of an array, as they are stored, but with the least significant byte first.
fn raw(dataset: &Dataset, ty: NumberType) -> std::result::Result<Vec<u8>, Hdf5Error> {
    Ok(sized!(ty.size(), |N| joined(dataset.read_array::<StoredBytes<N>>()?)))
}

fn slice(dataset: &Dataset, ty: StoredType, ranges: &[Range<usize>]) -> std::result::Result<Vec<u8>, Hdf5Error> {
    let selected = |r: &Range<usize>| SliceInfoElem::Slice { start: r.start as u64, end: r.end as u64, step: 1 };
    let slice = SliceInfo { selections: ranges.iter().map(selected).collect() };
    Ok(sized!(ty.size(), |N| joined(dataset.read_slice_parallel::<StoredBytes<N>>(&slice)?)))
}
