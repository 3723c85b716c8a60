//! HDF5 files as [`ArrayFile`].

use super::scales::Scales;
use crate::arrays::describe::numbers;
use crate::arrays::hdf5_storage::{reason, storage};
use crate::arrays::opener::ReadConfig;
use crate::arrays::{ArrayArchive, ArrayFile, Attributes, Variable, attributes};
use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::group::Group;
use hdf5_reader::{ByteOrder, Dataset, Datatype, H5Type, Hdf5File, SliceInfo, SliceInfoElem};
use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use wavesplat_core::base::description::{self, NumberType};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::{OpenOptions, Parsed};

/// Groups within groups that are looked at, and all objects.
const MOST_DEPTH: usize = 16;
const MOST_OBJECTS: usize = 100_000;

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
    Ok(Box::new(Hdf5ArrayFile(file)))
}

fn options(how: ReadConfig) -> hdf5_reader::OpenOptions {
    // Every chunk is read once, so none is kept.
    hdf5_reader::OpenOptions::default().with_chunk_cache_bytes(0).with_max_chunk_bytes(how.memory)
}

/// Runs an expression for numbers of a size in bytes.
macro_rules! sized {
    ($size:expr, |$n:ident| $run:expr) => {
        match $size {
            1 => {
                const $n: usize = 1;
                $run
            }
            2 => {
                const $n: usize = 2;
                $run
            }
            4 => {
                const $n: usize = 4;
                $run
            }
            _ => {
                const $n: usize = 8;
                $run
            }
        }
    };
}

struct Hdf5ArrayFile(Hdf5File);

impl ArrayFile for Hdf5ArrayFile {
    fn variables(&self) -> Parsed<Vec<Variable>> {
        let mut listing = Listing::default();
        listing.add(&self.0.root_group().map_err(|e| e.to_string())?, "", 0)?;
        listing.scales.name(&mut listing.variables);
        Ok(listing.variables)
    }

    fn read(&self, path: &str, ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        let dataset = self.0.dataset(path).map_err(|e| e.to_string())?;
        slice(&dataset, ty, ranges).map_err(|e| reason(&e))
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let attributes = match path {
            "" => self.0.root_group().and_then(|group| group.attributes()).unwrap_or_default(),
            path => self.0.dataset(path).map(|dataset| dataset.attributes()).unwrap_or_default(),
        };
        described_all(&attributes)
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        let dataset = self.0.dataset(path).map_err(|e| e.to_string())?;
        if let Ok(texts) = dataset.read_strings() {
            return Ok(description::Values::Texts(texts));
        }
        let ty = number_type(dataset.dtype())?;
        raw(&dataset, ty).map(|bytes| numbers(ty, &bytes)).map_err(|e| format!("{path}: {}", reason(&e)))
    }

    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let Ok(dataset) = self.0.dataset(path) else { return Vec::new() };
        let most = dataset.max_dims().unwrap_or_default();
        (0..most.len()).filter(|axis| most[*axis] == u64::MAX).collect()
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        number_type(self.0.dataset(path).map_err(|e| e.to_string())?.dtype())
    }

    fn group(&self, path: &str) -> Attributes {
        let group = self.0.group(path).and_then(|group| group.attributes());
        group.map(|all| attributes(&described_all(&all))).unwrap_or_default()
    }
}

/// All arrays of a file.
#[derive(Default)]
struct Listing {
    variables: Vec<Variable>,
    scales: Scales,
    /// Addresses of groups that were looked at: links may lead in circles.
    seen: HashSet<u64>,
}

impl Listing {
    fn add(&mut self, group: &Group, path: &str, depth: usize) -> Parsed<()> {
        if depth > MOST_DEPTH || !self.seen.insert(group.address()) {
            return Ok(());
        }
        if self.seen.len() + self.variables.len() > MOST_OBJECTS {
            return Err(format!("has more than {MOST_OBJECTS} objects"));
        }
        let (groups, arrays) = group.members().map_err(|e| format!("group {path}/: {e}"))?;
        for array in arrays {
            self.scales.add(&array, group.offset_size());
            self.variables.push(variable(&array, format!("{path}/{}", array.name())));
        }
        groups.iter().try_for_each(|group| self.add(group, &format!("{path}/{}", group.name()), depth + 1))
    }
}

fn variable(dataset: &Dataset, path: String) -> Variable {
    let lengths: Vec<usize> = dataset.shape().iter().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect();
    let sample = stored_type(dataset.dtype());
    let chunk = dataset.chunks().filter(|c| c.len() == lengths.len());
    let chunk = chunk.map(|c| c.into_iter().map(|n| n as usize).collect());
    let mut dims = vec![String::new(); lengths.len()];
    if let Ok(labels) = dataset.attribute("DIMENSION_LABELS").and_then(|labels| labels.read_strings()) {
        dims.iter_mut().zip(labels).for_each(|(dim, label)| *dim = label);
    }
    Variable { path, sample, lengths, dims, chunk, attributes: attributes(&described_all(&dataset.attributes())) }
}

/// The attributes of an object; those of types that users define are left out.
fn described_all(all: &[hdf5_reader::Attribute]) -> Vec<description::Attribute> {
    let one = |a: &hdf5_reader::Attribute| Some(description::Attribute { name: a.name.clone(), value: described(a)? });
    all.iter().filter_map(one).collect()
}

/// An attribute's value with its type; None of types that users define.
fn described(attribute: &hdf5_reader::Attribute) -> Option<description::Values> {
    let Ok(ty) = number_type(&attribute.datatype) else {
        return attribute.read_strings().ok().map(description::Values::Texts);
    };
    Some(sized!(ty.size(), |N| {
        let all = attribute.read_1d::<StoredBytes<N>>();
        let all = all.or_else(|_| attribute.read_scalar::<StoredBytes<N>>().map(|number| vec![number])).ok()?;
        numbers(ty, &joined(all))
    }))
}

/// All numbers of an array, as they are stored, but with the least significant byte first.
fn raw(dataset: &Dataset, ty: NumberType) -> std::result::Result<Vec<u8>, Hdf5Error> {
    Ok(sized!(ty.size(), |N| joined(dataset.read_array::<StoredBytes<N>>()?)))
}

fn number_type(ty: &Datatype) -> Parsed<NumberType> {
    stored_type(ty)?.number().ok_or_else(|| format!("{} is not kept", kind(ty)))
}

fn stored_type(ty: &Datatype) -> Parsed<StoredType> {
    Ok(match *ty {
        Datatype::FixedPoint { size: 1, signed: false, .. } => StoredType::U8,
        Datatype::FixedPoint { size: 1, signed: true, .. } => StoredType::I8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => StoredType::U16,
        Datatype::FixedPoint { size: 2, signed: true, .. } => StoredType::I16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => StoredType::U32,
        Datatype::FixedPoint { size: 4, signed: true, .. } => StoredType::I32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => StoredType::U64,
        Datatype::FixedPoint { size: 8, signed: true, .. } => StoredType::I64,
        Datatype::FloatingPoint { size: 2, .. } => StoredType::F16,
        Datatype::FloatingPoint { size: 4, .. } => StoredType::F32,
        Datatype::FloatingPoint { size: 8, .. } => StoredType::F64,
        Datatype::FixedPoint { size, .. } => return Err(format!("integer of {size} bytes")),
        Datatype::FloatingPoint { size, .. } => return Err(format!("float of {size} bytes")),
        Datatype::String { .. } => return Err("text".into()),
        Datatype::Compound { .. } => return Err("compound".into()),
        ref other => return Err(kind(other)),
    })
}

/// The first word of a type's description.
fn kind(ty: &Datatype) -> String {
    format!("{ty:?}").split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_lowercase()
}

/// The stored bytes of a sample, with the least significant one first.
#[derive(Debug, Clone, Copy)]
struct StoredBytes<const N: usize>([u8; N]);

impl<const N: usize> H5Type for StoredBytes<N> {
    fn hdf5_type() -> Datatype {
        Datatype::FixedPoint { size: N as u8, signed: false, byte_order: ByteOrder::LittleEndian }
    }

    fn from_bytes(bytes: &[u8], ty: &Datatype) -> std::result::Result<Self, Hdf5Error> {
        let mut stored = [0; N];
        stored.copy_from_slice(bytes.get(..N).ok_or_else(|| Hdf5Error::InvalidData("a sample is cut short".into()))?);
        if byte_order(ty) == ByteOrder::BigEndian {
            stored.reverse();
        }
        Ok(Self(stored))
    }

    fn element_size(_ty: &Datatype) -> usize {
        N
    }
}

fn byte_order(ty: &Datatype) -> ByteOrder {
    match ty {
        Datatype::FixedPoint { byte_order, .. } | Datatype::FloatingPoint { byte_order, .. } => *byte_order,
        _ => ByteOrder::LittleEndian,
    }
}

fn slice(dataset: &Dataset, ty: StoredType, ranges: &[Range<usize>]) -> std::result::Result<Vec<u8>, Hdf5Error> {
    let selected = |r: &Range<usize>| SliceInfoElem::Slice { start: r.start as u64, end: r.end as u64, step: 1 };
    let slice = SliceInfo { selections: ranges.iter().map(selected).collect() };
    Ok(sized!(ty.size(), |N| joined(dataset.read_slice_parallel::<StoredBytes<N>>(&slice)?)))
}

/// The bytes of numbers, one after another.
fn joined<const N: usize>(numbers: impl IntoIterator<Item = StoredBytes<N>>) -> Vec<u8> {
    numbers.into_iter().flat_map(|stored| stored.0).collect()
}
