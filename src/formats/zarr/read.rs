//! Zarr stores of versions 2 and 3 as [`ArrayFile`].

use super::files::FilesystemStore;
use super::layout::{DIMENSIONS, metadata_file};
use super::ome::{Coordinates, Multiscales, Resolutions};
use crate::arrays::describe::numbers;
use crate::arrays::opener::ReadConfig;
use crate::arrays::{ArrayArchive, ArrayFile, Attribute, Attributes, Variable};
use crate::shared::links::{is_lost, lost};
use serde_json::Value;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use wavesplat_core::base::description::{self, NumberType};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::{OpenOptions, Parsed};
use zarrs::array::{Array, ArrayBytes, ArrayMetadata, ArrayShardedExt, ArraySubset, DataType, data_type};
use zarrs::group::Group;

const MOST_DEPTH: usize = 16;

/// Opens a folder and lists its arrays.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    let metadata = metadata_file(path).ok_or_else(|| Error::input(path, "is no Zarr store"))?;
    refuse_lost(path, 0)?;
    let resolutions = if options.variable.is_some() { Resolutions::All } else { Resolutions::Finest };
    let open = move |path: &Path, _: ReadConfig| open_folder(path, resolutions);
    ArrayArchive::open("Zarr", path, Some(&metadata), Arc::new(open), options)
}

/// An error if a store has a link to a file that is not there: its samples would be taken as never written.
fn refuse_lost(folder: &Path, depth: usize) -> Result<()> {
    let failed = |e| Error::io(folder, "listing", e);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let kind = entry.file_type().map_err(failed)?;
        if kind.is_symlink() && is_lost(&entry.path()) {
            return Err(lost(&entry.path()));
        }
        let is_folder = kind.is_dir() || kind.is_symlink() && entry.path().is_dir();
        if is_folder && depth < MOST_DEPTH {
            refuse_lost(&entry.path(), depth + 1)?;
        }
    }
    Ok(())
}

fn open_folder(path: &Path, resolutions: Resolutions) -> Result<Box<dyn ArrayFile>> {
    let store = FilesystemStore::new(path);
    let store = Arc::new(store.map_err(|e| Error::input(path, format!("is no Zarr store: {e}")))?);
    Ok(Box::new(ZarrArrayFile { store, resolutions, listed: OnceLock::new() }))
}

struct ZarrArrayFile {
    store: Arc<FilesystemStore>,
    resolutions: Resolutions,
    /// All arrays, and the coordinates that OME-Zarr says in its attributes.
    listed: OnceLock<Parsed<(Vec<Variable>, Coordinates)>>,
}

impl ZarrArrayFile {
    fn list(&self) -> Parsed<(Vec<Variable>, Coordinates)> {
        let (mut all, mut coordinates) = (Vec::new(), Coordinates::new());
        if let Ok(array) = Array::open(self.store.clone(), "/") {
            return Ok((vec![variable(&array)], coordinates));
        }
        let root =
            Group::open(self.store.clone(), "/").map_err(|e| format!("is no Zarr store that can be read: {e}"))?;
        let mut images = Vec::new();
        add(&root, 0, &mut all, &mut images)?;
        for image in &images {
            image.apply(self.resolutions, &mut all, &mut coordinates);
        }
        Ok((all, coordinates))
    }

    /// The attributes of coordinates that no array has.
    fn described_coordinate(&self, path: &str) -> Vec<description::Attribute> {
        let listed = self.listed().ok().and_then(|(all, _)| all.iter().find(|array| array.path == path));
        let text = |(name, value): (&String, &Attribute)| match value {
            Attribute::Text(text) => {
                Some(description::Attribute { name: name.clone(), value: description::Values::text(text) })
            }
            Attribute::Texts(_) | Attribute::Numbers(_) => None,
        };
        listed.map(|array| array.attributes.iter().filter_map(text).collect()).unwrap_or_default()
    }

    fn listed(&self) -> Parsed<&(Vec<Variable>, Coordinates)> {
        self.listed.get_or_init(|| self.list()).as_ref().map_err(Clone::clone)
    }

    /// The coordinates of this path that no array has.
    fn coordinate(&self, path: &str) -> Option<&[f64]> {
        self.listed().ok()?.1.get(path).map(Vec::as_slice)
    }
}

impl ArrayFile for ZarrArrayFile {
    fn variables(&self) -> Parsed<Vec<Variable>> {
        Ok(self.listed()?.0.clone())
    }

    fn read(&self, path: &str, ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        let array = Array::open(self.store.clone(), path).map_err(|e| e.to_string())?;
        let ranges: Vec<_> = ranges.iter().map(|r| r.start as u64..r.end as u64).collect();
        bytes(&array, ty, &ArraySubset::new_with_ranges(&ranges))
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let one = |(name, value): (&String, &Value)| {
            Some(description::Attribute { name: name.clone(), value: described(value)? })
        };
        match path {
            "" => Group::open(self.store.clone(), "/")
                .map(|group| group.attributes().iter().filter_map(one).collect())
                .unwrap_or_default(),
            path if self.coordinate(path).is_some() => self.described_coordinate(path),
            path => Array::open(self.store.clone(), path)
                .map(|array| array.attributes().iter().filter_map(one).collect())
                .unwrap_or_default(),
        }
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        if let Some(values) = self.coordinate(path) {
            return Ok(description::Values::floats(values));
        }
        let array = Array::open(self.store.clone(), path).map_err(|e| e.to_string())?;
        let (number, stored) = (number_type(array.data_type())?, stored_type(array.data_type())?);
        Ok(numbers(number, &bytes(&array, stored, &array.subset_all())?))
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        if self.coordinate(path).is_some() {
            return Ok(NumberType::F64);
        }
        number_type(Array::open(self.store.clone(), path).map_err(|e| e.to_string())?.data_type())
    }
}

/// The numbers of a part of an array, little-endian.
fn bytes(array: &Array<FilesystemStore>, ty: StoredType, part: &ArraySubset) -> Parsed<Vec<u8>> {
    let bytes = array.retrieve_array_subset::<ArrayBytes<'_>>(part).map_err(|e| e.to_string())?;
    let mut bytes = bytes.into_fixed().map_err(|e| e.to_string())?.into_owned();
    if cfg!(target_endian = "big") {
        ty.swap_endian(&mut bytes);
    }
    Ok(bytes)
}

/// An attribute as JSON says it, with the narrowest usual type; None of other values.
fn described(value: &Value) -> Option<description::Values> {
    let integers = |all: &[Value]| all.iter().map(Value::as_i64).collect::<Option<Vec<i64>>>();
    let floats = |all: &[Value]| {
        let bytes = |number: f64| number.to_le_bytes();
        all.iter().map(|value| value.as_f64().map(bytes)).collect::<Option<Vec<_>>>()
    };
    let all = value.as_array().map_or(std::slice::from_ref(value), Vec::as_slice);
    if all.iter().all(Value::is_string) {
        let text = |value: &Value| value.as_str().map(String::from);
        return all.iter().map(text).collect::<Option<_>>().map(description::Values::Texts);
    }
    match integers(all) {
        Some(integers) => {
            Some(numbers(NumberType::I64, &integers.into_iter().map(i64::to_le_bytes).collect::<Vec<_>>().concat()))
        }
        None => floats(all).map(|floats| numbers(NumberType::F64, &floats.concat())),
    }
}

fn number_type(ty: &DataType) -> Parsed<NumberType> {
    stored_type(ty)?.number().ok_or_else(|| ty.to_string())
}

fn add(
    group: &Group<FilesystemStore>,
    depth: usize,
    all: &mut Vec<Variable>,
    images: &mut Vec<Multiscales>,
) -> Parsed<()> {
    if depth > MOST_DEPTH {
        return Ok(());
    }
    images.extend(Multiscales::read(group.path().as_str(), group.attributes())?);
    for node in group.child_paths().map_err(|e| e.to_string())? {
        let store = group.storage();
        match Array::open(store.clone(), node.as_str()) {
            Ok(array) => all.push(variable(&array)),
            Err(e) => match Group::open(store, node.as_str()) {
                Ok(group) => add(&group, depth + 1, all, images)?,
                Err(_) => all.push(unread(node.as_str(), e.to_string())),
            },
        }
    }
    Ok(())
}

/// An array that cannot be read, and why.
fn unread(path: &str, why: String) -> Variable {
    let (lengths, dims) = (Vec::new(), Vec::new());
    Variable {
        path: path.into(),
        sample: Err(why),
        lengths,
        dims,
        scales: Vec::new(),
        chunk: None,
        attributes: Attributes::new(),
    }
}

fn variable(array: &Array<FilesystemStore>) -> Variable {
    let length = |n: &u64| usize::try_from(*n).unwrap_or(usize::MAX);
    let lengths: Vec<usize> = array.shape().iter().map(length).collect();
    let of_shard = array.effective_subchunk_shape();
    let first = vec![0; lengths.len()];
    let chunk = of_shard.or_else(|| array.chunk_shape(&first).ok());
    let chunk = chunk.map(|chunk| chunk.iter().map(|n| length(&n.get())).collect());
    let mut variable = Variable {
        path: array.path().as_str().into(),
        sample: stored_type(array.data_type()),
        dims: vec![String::new(); lengths.len()],
        lengths,
        scales: Vec::new(),
        chunk,
        attributes: attributes(array),
    };
    let of_version_2 = variable.attributes.remove(DIMENSIONS);
    let of_version_3 = array.dimension_names().clone().unwrap_or_default().into_iter().map(Option::unwrap_or_default);
    let names = match of_version_2 {
        Some(Attribute::Texts(names)) => names,
        Some(Attribute::Text(name)) => vec![name],
        _ => of_version_3.collect(),
    };
    variable.dims.iter_mut().zip(names).for_each(|(dim, name)| *dim = name);
    variable
}

/// The attributes of an array. In version 2, xarray stores the value of missing samples only as the array's fill value.
fn attributes(array: &Array<FilesystemStore>) -> Attributes {
    let mut found: Attributes =
        array.attributes().iter().filter_map(|(name, value)| Some((name.clone(), attribute(value)?))).collect();
    if let ArrayMetadata::V2(metadata) = array.metadata()
        && found.contains_key(DIMENSIONS)
        && !found.contains_key("_FillValue")
        && let Some(value) = serde_json::to_value(&metadata.fill_value).ok().as_ref().and_then(attribute)
    {
        found.insert("_FillValue".into(), value);
    }
    found
}

/// A value from JSON. Values that are neither texts nor numbers are left out.
fn attribute(value: &Value) -> Option<Attribute> {
    let number = |value: &Value| match value.as_str() {
        Some("NaN") => Some(f64::NAN),
        _ => value.as_f64(),
    };
    Some(match value {
        Value::Array(all) if all.iter().all(Value::is_string) => {
            Attribute::Texts(all.iter().filter_map(|text| Some(text.as_str()?.to_string())).collect())
        }
        Value::Array(all) => Attribute::Numbers(all.iter().map(number).collect::<Option<_>>()?),
        value => match number(value) {
            Some(number) => Attribute::Numbers(vec![number]),
            None => Attribute::Text(value.as_str()?.into()),
        },
    })
}

fn stored_type(ty: &DataType) -> Parsed<StoredType> {
    let types = [
        (data_type::uint8(), StoredType::U8),
        (data_type::int8(), StoredType::I8),
        (data_type::uint16(), StoredType::U16),
        (data_type::int16(), StoredType::I16),
        (data_type::uint32(), StoredType::U32),
        (data_type::int32(), StoredType::I32),
        (data_type::uint64(), StoredType::U64),
        (data_type::int64(), StoredType::I64),
        (data_type::float16(), StoredType::F16),
        (data_type::float32(), StoredType::F32),
        (data_type::float64(), StoredType::F64),
    ];
    types.into_iter().find(|(known, _)| known == ty).map(|(_, stored)| stored).ok_or_else(|| ty.to_string())
}
