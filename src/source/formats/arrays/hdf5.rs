//! HDF5 files, as [`super::ArrayFile`].

use super::describe::numbers;
use super::scales::Scales;
use super::{ArrayFile, Attribute, Attributes, ReadConfig, Variable};
use crate::base::description::{self, NumberType};
use crate::base::error::{Error, Result};
use crate::base::mapped::FileBytes;
use crate::base::sample::SampleType;
use crate::base::stored::StoredType;
use crate::source::Parsed;
use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::group::Group;
use hdf5_reader::storage::{DynStorage, Storage, StorageBuffer};
use hdf5_reader::{ByteOrder, Dataset, Datatype, H5Type, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};
use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Groups within groups that are looked at, and all objects.
const MOST_DEPTH: usize = 16;
const MOST_OBJECTS: usize = 100_000;

/// Opens a file.
pub(super) fn open(path: &Path, how: ReadConfig) -> Result<Box<dyn ArrayFile>> {
    let file = FileBytes::open(path, how.access)?;
    let file = Hdf5File::from_storage_with_options(storage(file), options(how));
    let file = file.map_err(|e| Error::input(path, format!("is no HDF5 file that can be read: {e}")))?;
    Ok(Box::new(Hdf5ArrayFile(file)))
}

/// The bytes of a file for the reader.
pub(super) fn storage(file: FileBytes) -> DynStorage {
    Arc::new(Bytes(file))
}

fn options(how: ReadConfig) -> OpenOptions {
    // Every chunk is read once, so none is kept.
    OpenOptions::default().with_chunk_cache_bytes(0).with_max_chunk_bytes(how.memory)
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

    fn numbers(&self, path: &str) -> Parsed<Vec<f64>> {
        let dataset = self.0.dataset(path).map_err(|e| e.to_string())?;
        let numbers = dataset.read_array::<AnyNumber>().map_err(|e| format!("{path}: {}", reason(&e)))?;
        Ok(numbers.into_iter().map(|number| number.0).collect())
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let attributes = match path {
            "" => self.0.root_group().and_then(|group| group.attributes()).unwrap_or_default(),
            path => self.0.dataset(path).map(|dataset| dataset.attributes()).unwrap_or_default(),
        };
        let one =
            |a: &hdf5_reader::Attribute| Some(description::Attribute { name: a.name.clone(), value: described(a)? });
        attributes.iter().filter_map(one).collect()
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        let dataset = self.0.dataset(path).map_err(|e| e.to_string())?;
        if let Ok(texts) = dataset.read_strings() {
            return Ok(description::Values::Texts(texts));
        }
        let ty = number_type(dataset.dtype())?;
        raw(&dataset, ty).map(|bytes| numbers(ty, &bytes)).map_err(|e| reason(&e))
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
        group.map(|all| attributes(&all)).unwrap_or_default()
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
pub(super) fn reason(error: &Hdf5Error) -> String {
    let Hdf5Error::UnsupportedFilter(filter) = error else { return error.to_string() };
    let Some(id) = filter.strip_prefix("filter id ") else { return error.to_string() };
    let known = PLUGIN_FILTERS.iter().find(|(known, _)| id.parse() == Ok(*known));
    let name = known.map_or_else(|| format!("filter {id}"), |(_, name)| format!("filter {name} ({id})"));
    format!("{name} is not supported; rewrite the file where HDF5 has that filter: h5repack -f GZIP=4 IN OUT")
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
    Variable { path, sample, lengths, dims, chunk, attributes: attributes(&dataset.attributes()) }
}

/// The attributes of an object; those that are neither texts nor numbers are left out.
fn attributes(all: &[hdf5_reader::Attribute]) -> Attributes {
    let value = |attribute: &hdf5_reader::Attribute| match &attribute.datatype {
        Datatype::FixedPoint { .. } | Datatype::FloatingPoint { .. } => {
            let numbers =
                attribute.read_1d::<AnyNumber>().or_else(|_| attribute.read_scalar::<AnyNumber>().map(|n| vec![n]));
            Some(Attribute::Numbers(numbers.ok()?.into_iter().map(|number| number.0).collect()))
        }
        Datatype::String { .. } | Datatype::VarLen { .. } => match attribute.read_strings().ok()? {
            texts if attribute.shape.is_empty() || texts.len() == 1 => texts.into_iter().next().map(Attribute::Text),
            texts => Some(Attribute::Texts(texts)),
        },
        _ => None,
    };
    all.iter().filter_map(|a| Some((a.name.clone(), value(a)?))).collect()
}

/// An attribute's value with its type; None of types that users define.
fn described(attribute: &hdf5_reader::Attribute) -> Option<description::Values> {
    let Ok(ty) = number_type(&attribute.datatype) else {
        return attribute.read_strings().ok().map(description::Values::Texts);
    };
    macro_rules! read {
        ($n:expr) => {{
            let all = attribute.read_1d::<StoredBytes<$n>>();
            let all = all.or_else(|_| attribute.read_scalar::<StoredBytes<$n>>().map(|number| vec![number])).ok()?;
            numbers(ty, &all.into_iter().flat_map(|stored| stored.0).collect::<Vec<u8>>())
        }};
    }
    Some(match ty.size() {
        1 => read!(1),
        2 => read!(2),
        4 => read!(4),
        _ => read!(8),
    })
}

/// All numbers of an array, as they are stored, but with the least significant byte first.
fn raw(dataset: &Dataset, ty: NumberType) -> std::result::Result<Vec<u8>, Hdf5Error> {
    macro_rules! read {
        ($n:expr) => {
            dataset.read_array::<StoredBytes<$n>>()?.into_iter().flat_map(|stored| stored.0).collect()
        };
    }
    Ok(match ty.size() {
        1 => read!(1),
        2 => read!(2),
        4 => read!(4),
        _ => read!(8),
    })
}

fn number_type(ty: &Datatype) -> Parsed<NumberType> {
    Ok(match *ty {
        Datatype::FixedPoint { size: 1, signed: false, .. } => NumberType::U8,
        Datatype::FixedPoint { size: 1, signed: true, .. } => NumberType::I8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => NumberType::U16,
        Datatype::FixedPoint { size: 2, signed: true, .. } => NumberType::I16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => NumberType::U32,
        Datatype::FixedPoint { size: 4, signed: true, .. } => NumberType::I32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => NumberType::U64,
        Datatype::FixedPoint { size: 8, signed: true, .. } => NumberType::I64,
        Datatype::FloatingPoint { size: 4, .. } => NumberType::F32,
        Datatype::FloatingPoint { size: 8, .. } => NumberType::F64,
        ref other => return Err(format!("{} is not kept", kind(other))),
    })
}

fn stored_type(ty: &Datatype) -> Parsed<StoredType> {
    Ok(StoredType::Sample(match *ty {
        Datatype::FixedPoint { size: 1, signed: false, .. } => SampleType::U8,
        Datatype::FixedPoint { size: 1, signed: true, .. } => SampleType::I8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => SampleType::U16,
        Datatype::FixedPoint { size: 2, signed: true, .. } => SampleType::I16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => SampleType::U32,
        Datatype::FixedPoint { size: 4, signed: true, .. } => SampleType::I32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => return Ok(StoredType::U64),
        Datatype::FixedPoint { size: 8, signed: true, .. } => return Ok(StoredType::I64),
        Datatype::FloatingPoint { size: 2, .. } => SampleType::F16,
        Datatype::FloatingPoint { size: 4, .. } => SampleType::F32,
        Datatype::FloatingPoint { size: 8, .. } => SampleType::F64,
        Datatype::FixedPoint { size, .. } => return Err(format!("integer of {size} bytes")),
        Datatype::FloatingPoint { size, .. } => return Err(format!("float of {size} bytes")),
        Datatype::String { .. } => return Err("text".into()),
        Datatype::Compound { .. } => return Err("compound".into()),
        ref other => return Err(kind(other)),
    }))
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
    let of = |r: &Range<usize>| SliceInfoElem::Slice { start: r.start as u64, end: r.end as u64, step: 1 };
    let slice = SliceInfo { selections: ranges.iter().map(of).collect() };
    macro_rules! read {
        ($n:expr) => {
            dataset.read_slice_parallel::<StoredBytes<$n>>(&slice)?.into_iter().flat_map(|stored| stored.0).collect()
        };
    }
    Ok(match ty.size() {
        1 => read!(1),
        2 => read!(2),
        4 => read!(4),
        _ => read!(8),
    })
}

/// A number of any type.
#[derive(Debug, Clone, Copy)]
struct AnyNumber(f64);

impl H5Type for AnyNumber {
    fn hdf5_type() -> Datatype {
        f64::hdf5_type()
    }

    fn from_bytes(bytes: &[u8], ty: &Datatype) -> std::result::Result<Self, Hdf5Error> {
        let number = match *ty {
            Datatype::FixedPoint { size: 1, signed: false, .. } => u8::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 1, signed: true, .. } => i8::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 2, signed: false, .. } => u16::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 2, signed: true, .. } => i16::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 4, signed: false, .. } => u32::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 4, signed: true, .. } => i32::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 8, signed: false, .. } => u64::from_bytes(bytes, ty)? as f64,
            Datatype::FixedPoint { size: 8, signed: true, .. } => i64::from_bytes(bytes, ty)? as f64,
            Datatype::FloatingPoint { size: 4, .. } => f32::from_bytes(bytes, ty)? as f64,
            Datatype::FloatingPoint { size: 8, .. } => f64::from_bytes(bytes, ty)?,
            _ => return Err(Hdf5Error::InvalidData(format!("{} is no number", kind(ty)))),
        };
        Ok(Self(number))
    }

    fn element_size(ty: &Datatype) -> usize {
        match ty {
            Datatype::FixedPoint { size, .. } | Datatype::FloatingPoint { size, .. } => usize::from(*size),
            _ => 8,
        }
    }
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
