//! NetCDF files, classic and version 4, as [`ArrayFile`].

use super::layout::FILL;
use crate::arrays::describe::numbers;
use crate::arrays::hdf5_storage::{self, check_lengths, storage};
use crate::arrays::in_place::InPlace;
use crate::arrays::opener::ReadConfig;
use crate::arrays::{ArrayArchive, ArrayFile, Attribute, Attributes, Variable};
use hdf5_reader::{Dataset, Hdf5File};
use netcdf_reader::classic::data::compute_record_stride;
use netcdf_reader::error::Error as NcError;
use netcdf_reader::{
    NcAttrValue, NcAttribute, NcFile, NcGroup, NcOpenOptions, NcSliceInfo, NcSliceInfoElem, NcType, NcVariable,
};
use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use wavesplat_core::base::description::{self, NumberType};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::{OpenOptions, Parsed};

/// The NetCDF library's default fill value of floats.
const UNWRITTEN: f64 = 9.969_209_968_386_869e36;

/// What the NetCDF library puts before the name of a variable that is called as a dimension of others.
const NO_COORDINATE: &str = "_nc4_non_coord_";

/// Opens a file and lists its arrays.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    ArrayArchive::open("NetCDF", path, Some(path), Arc::new(open_file), options)
}

fn open_file(path: &Path, how: ReadConfig) -> Result<Box<dyn ArrayFile>> {
    let storage = storage(FileBytes::open(path, how.access)?);
    let options = NcOpenOptions { chunk_cache_bytes: 0, max_chunk_bytes: how.memory, ..NcOpenOptions::default() };
    let file = NcFile::from_storage_with_options(storage.clone(), options);
    let file = file.map_err(|e| Error::input(path, format!("is no NetCDF file that can be read: {e}")))?;
    let hdf5 = if file.as_classic().is_some() { None } else { Hdf5File::from_storage(storage).ok() };
    Ok(Box::new(NetCdfArrayFile { file, hdf5 }))
}

/// Why something cannot be read.
fn reason(error: &NcError) -> String {
    match error {
        NcError::Hdf5(error) => hdf5_storage::reason(error),
        error => error.to_string(),
    }
}

struct NetCdfArrayFile {
    file: NcFile,
    /// The same file, of version 4: it knows of chunks.
    hdf5: Option<Hdf5File>,
}

impl ArrayFile for NetCdfArrayFile {
    fn variables(&self) -> Parsed<Vec<Variable>> {
        self.check()?;
        let mut all = Vec::new();
        self.add(self.file.root_group().map_err(|e| reason(&e))?, "", &mut all);
        Ok(all)
    }

    fn read(&self, path: &str, _: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        // The stored type. Its bytes are the same if the samples are declared unsigned.
        let stored = stored_type(self.found(path)?.dtype(), false)?;
        let selected = |r: &Range<usize>| NcSliceInfoElem::Slice { start: r.start as u64, end: r.end as u64, step: 1 };
        let slice = NcSliceInfo { selections: ranges.iter().map(selected).collect() };
        self.bytes(path, stored, Some(&slice))
    }

    fn in_place(&self, path: &str) -> Option<InPlace> {
        let all = &self.file.as_classic()?.root_group().variables;
        let variable = all.iter().find(|variable| variable.name == path)?;
        let record = variable.is_record_var.then(|| compute_record_stride(all).ok());
        let record = match record {
            Some(bytes) => Some(bytes?),
            None => None,
        };
        Some(InPlace { start: variable.data_offset, record, big_endian: true })
    }

    fn numbers(&self, path: &str) -> Parsed<Vec<f64>> {
        let numbers =
            self.file.read_variable_as_f64(&self.stored(path)).map_err(|e| format!("{path}: {}", reason(&e)))?;
        Ok(numbers.into_iter().collect())
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let of_file = || self.file.global_attributes().unwrap_or_default();
        let of_variable = || self.found(path).map(NcVariable::attributes).unwrap_or_default();
        let all = if path.is_empty() { of_file() } else { of_variable() };
        let one = |a: &NcAttribute| Some(description::Attribute { name: a.name.clone(), value: described(&a.value)? });
        all.iter().filter_map(one).collect()
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        let variable = self.found(path)?;
        if *variable.dtype() == NcType::String {
            return self
                .file
                .read_variable_as_strings(&self.stored(path))
                .map(description::Values::Texts)
                .map_err(|e| reason(&e));
        }
        let bytes = match variable.dtype() {
            NcType::Char => self.file.read_variable_raw_bytes(&self.stored(path)).map_err(|e| reason(&e))?,
            ty => self.bytes(path, stored_type(ty, false)?, None)?,
        };
        Ok(numbers(number_type(variable.dtype())?, &bytes))
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        number_type(self.found(path)?.dtype())
    }

    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let Ok(variable) = self.found(path) else { return Vec::new() };
        let dimensions = variable.dimensions();
        (0..dimensions.len()).filter(|axis| dimensions[*axis].is_unlimited).collect()
    }

    fn is_unlimited(&self, dimension: &str) -> bool {
        let dimensions = self.file.dimensions().unwrap_or_default();
        dimensions.iter().any(|known| known.name == dimension && known.is_unlimited)
    }
}

impl NetCdfArrayFile {
    /// An error for arrays that are longer than they may be.
    fn check(&self) -> Parsed<()> {
        let Some(hdf5) = &self.hdf5 else { return Ok(()) };
        let mut groups = vec![hdf5.root_group().map_err(|e| hdf5_storage::reason(&e))?];
        let mut seen = HashSet::new();
        while let Some(group) = groups.pop() {
            if seen.insert(group.address()) {
                let (inner, arrays) = group.members().map_err(|e| hdf5_storage::reason(&e))?;
                let sound = |array: &Dataset| check_lengths(array).map_err(|e| format!("{}: {e}", array.name()));
                arrays.iter().try_for_each(sound)?;
                groups.extend(inner);
            }
        }
        Ok(())
    }

    fn found(&self, path: &str) -> Parsed<&NcVariable> {
        self.file.variable(&self.stored(path)).map_err(|e| e.to_string())
    }

    /// The path of a variable in the file, in which one that is named as another's dimension has a prefix.
    fn stored(&self, path: &str) -> String {
        let (group, name) = path.rsplit_once('/').map_or(("", path), |(group, _)| path.split_at(group.len() + 1));
        match self.hdf5.is_none() || self.file.variable(path).is_ok() {
            true => path.into(),
            false => format!("{group}{NO_COORDINATE}{name}"),
        }
    }

    /// The numbers of an array, or of a part of it, as they are stored.
    fn bytes(&self, path: &str, ty: StoredType, slice: Option<&NcSliceInfo>) -> Parsed<Vec<u8>> {
        let path = &self.stored(path);
        macro_rules! read {
            ($ty:ty) => {{
                let numbers = match slice {
                    Some(slice) => self.file.read_variable_slice_parallel::<$ty>(path, slice),
                    None => self.file.read_variable::<$ty>(path),
                };
                numbers.map_err(|e| reason(&e))?.into_iter().flat_map(<$ty>::to_le_bytes).collect()
            }};
        }
        Ok(match ty {
            StoredType::U8 => read!(u8),
            StoredType::I8 => read!(i8),
            StoredType::U16 => read!(u16),
            StoredType::I16 => read!(i16),
            StoredType::U32 => read!(u32),
            StoredType::I32 => read!(i32),
            StoredType::U64 => read!(u64),
            StoredType::I64 => read!(i64),
            StoredType::F32 => read!(f32),
            StoredType::F64 => read!(f64),
            StoredType::F16 => return Err("NetCDF has no half floats".into()),
        })
    }

    fn add(&self, group: &NcGroup, path: &str, all: &mut Vec<Variable>) {
        for variable in &group.variables {
            let name = variable.name();
            let name = name.strip_prefix(NO_COORDINATE).filter(|_| self.hdf5.is_some()).unwrap_or(name);
            all.push(self.variable(variable, format!("{path}{name}")));
        }
        for group in &group.groups {
            self.add(group, &format!("{path}{}/", group.name), all);
        }
    }

    fn variable(&self, found: &NcVariable, path: String) -> Variable {
        let dims = found.dimensions();
        let chunk = self.hdf5.as_ref().and_then(|file| file.dataset(&self.stored(&path)).ok()?.chunks());
        let chunk = chunk.filter(|chunk| chunk.len() == dims.len());
        let mut attributes = attributes(found);
        let unsigned = attributes.get("_Unsigned") == Some(&Attribute::Text("true".into()));
        let sample = stored_type(found.dtype(), unsigned);
        if let (true, Ok(sample)) = (unsigned, &sample) {
            let turn = 2_f64.powi(8 * sample.size() as i32);
            for name in [FILL, "missing_value", "valid_range", "valid_min", "valid_max"] {
                if let Some(Attribute::Numbers(numbers)) = attributes.get_mut(name) {
                    numbers.iter_mut().filter(|n| **n < 0.0).for_each(|n| *n += turn);
                }
            }
        }
        if matches!(sample, Ok(StoredType::F32 | StoredType::F64)) && !attributes.contains_key(FILL) {
            attributes.insert(FILL.into(), Attribute::Numbers(vec![UNWRITTEN]));
        }
        Variable {
            sample,
            lengths: dims.iter().map(|dim| usize::try_from(dim.size).unwrap_or(usize::MAX)).collect(),
            dims: dims.iter().map(|dim| dim.name.clone()).collect(),
            scales: Vec::new(),
            chunk: chunk.map(|chunk| chunk.into_iter().map(|n| n as usize).collect()),
            attributes,
            path,
        }
    }
}

fn attributes(variable: &NcVariable) -> Attributes {
    let value = |value: &NcAttrValue| match value.as_string() {
        Some(text) => Some(Attribute::Text(text)),
        None => value.as_f64_vec().map(Attribute::Numbers),
    };
    variable.attributes().iter().filter_map(|a| Some((a.name.clone(), value(&a.value)?))).collect()
}

/// An attribute's value with its type; None of types that users define.
fn described(value: &NcAttrValue) -> Option<description::Values> {
    macro_rules! of {
        ($ty:ident, $numbers:expr) => {{
            let bytes: Vec<u8> = $numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            numbers(NumberType::$ty, &bytes)
        }};
    }
    Some(match value {
        NcAttrValue::Chars(text) => description::Values::text(text),
        NcAttrValue::Strings(texts) => description::Values::Texts(texts.clone()),
        NcAttrValue::Bytes(numbers) => of!(I8, numbers),
        NcAttrValue::UBytes(numbers) => of!(U8, numbers),
        NcAttrValue::Shorts(numbers) => of!(I16, numbers),
        NcAttrValue::UShorts(numbers) => of!(U16, numbers),
        NcAttrValue::Ints(numbers) => of!(I32, numbers),
        NcAttrValue::UInts(numbers) => of!(U32, numbers),
        NcAttrValue::Int64s(numbers) => of!(I64, numbers),
        NcAttrValue::UInt64s(numbers) => of!(U64, numbers),
        NcAttrValue::Floats(numbers) => of!(F32, numbers),
        NcAttrValue::Doubles(numbers) => of!(F64, numbers),
        NcAttrValue::UserDefined { .. } => return None,
    })
}

fn number_type(ty: &NcType) -> Parsed<NumberType> {
    let kept = match ty {
        NcType::Char => Some(NumberType::Char),
        ty => stored_type(ty, false).ok().and_then(StoredType::number),
    };
    kept.ok_or_else(|| "a type that is not kept".into())
}

fn stored_type(ty: &NcType, unsigned: bool) -> Parsed<StoredType> {
    Ok(match ty {
        NcType::Byte if unsigned => StoredType::U8,
        NcType::Short if unsigned => StoredType::U16,
        NcType::Int if unsigned => StoredType::U32,
        NcType::Int64 if unsigned => StoredType::U64,
        NcType::Byte => StoredType::I8,
        NcType::UByte => StoredType::U8,
        NcType::Short => StoredType::I16,
        NcType::UShort => StoredType::U16,
        NcType::Int => StoredType::I32,
        NcType::UInt => StoredType::U32,
        NcType::Int64 => StoredType::I64,
        NcType::UInt64 => StoredType::U64,
        NcType::Float => StoredType::F32,
        NcType::Double => StoredType::F64,
        NcType::Char | NcType::String => return Err("text".into()),
        _ => return Err("a type of its own".into()),
    })
}
