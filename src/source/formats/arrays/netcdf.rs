//! NetCDF files, classic and version 4, as [`super::ArrayFile`].

use super::describe::numbers;
use super::in_place::InPlace;
use super::{ArrayFile, Attribute, Attributes, ReadConfig, Variable, hdf5};
use crate::base::description::{self, NumberType};
use crate::base::error::{Error, Result};
use crate::base::mapped::FileBytes;
use crate::base::sample::SampleType;
use crate::base::stored::StoredType;
use crate::source::Parsed;
use hdf5_reader::Hdf5File;
use netcdf_reader::classic::data::compute_record_stride;
use netcdf_reader::error::Error as NcError;
use netcdf_reader::{
    NcAttrValue, NcAttribute, NcFile, NcGroup, NcOpenOptions, NcSliceInfo, NcSliceInfoElem, NcType, NcVariable,
};
use std::ops::Range;
use std::path::Path;

/// What the library puts where a float was never written.
const UNWRITTEN: f64 = 9.969_209_968_386_869e36;

/// Opens a file.
pub(super) fn open(path: &Path, how: ReadConfig) -> Result<Box<dyn ArrayFile>> {
    let storage = hdf5::storage(FileBytes::open(path, how.access)?);
    let options = NcOpenOptions { chunk_cache_bytes: 0, max_chunk_bytes: how.memory, ..NcOpenOptions::default() };
    let file = NcFile::from_storage_with_options(storage.clone(), options);
    let file = file.map_err(|e| Error::input(path, format!("is no NetCDF file that can be read: {e}")))?;
    let hdf5 = if file.as_classic().is_some() { None } else { Hdf5File::from_storage(storage).ok() };
    Ok(Box::new(NetCdfArrayFile { file, hdf5 }))
}

/// Why something cannot be read.
fn reason(error: &NcError) -> String {
    match error {
        NcError::Hdf5(error) => hdf5::reason(error),
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
        let mut all = Vec::new();
        self.add(self.file.root_group().map_err(|e| e.to_string())?, "", &mut all);
        Ok(all)
    }

    fn read(&self, path: &str, _: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        // The stored type. Its bytes are the same if the samples are declared unsigned.
        let stored = stored_type(self.file.variable(path).map_err(|e| e.to_string())?.dtype(), false)?;
        let of = |r: &Range<usize>| NcSliceInfoElem::Slice { start: r.start as u64, end: r.end as u64, step: 1 };
        let slice = NcSliceInfo { selections: ranges.iter().map(of).collect() };
        macro_rules! read {
            ($ty:ty) => {{
                let numbers = self.file.read_variable_slice_parallel::<$ty>(path, &slice).map_err(|e| reason(&e))?;
                numbers.into_iter().flat_map(<$ty>::to_le_bytes).collect()
            }};
        }
        let stored = match stored {
            StoredType::Sample(stored) => stored,
            StoredType::I64 => return Ok(read!(i64)),
            StoredType::U64 => return Ok(read!(u64)),
        };
        Ok(match stored {
            SampleType::U8 => read!(u8),
            SampleType::I8 => read!(i8),
            SampleType::U16 => read!(u16),
            SampleType::I16 => read!(i16),
            SampleType::U32 => read!(u32),
            SampleType::I32 => read!(i32),
            SampleType::F32 => read!(f32),
            SampleType::F64 => read!(f64),
            SampleType::F16 => return Err("NetCDF has no half floats".into()),
        })
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
        let numbers = self.file.read_variable_as_f64(path).map_err(|e| format!("{path}: {}", reason(&e)))?;
        Ok(numbers.into_iter().collect())
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let of_file = || self.file.global_attributes().unwrap_or_default();
        let of_variable = || self.file.variable(path).map(NcVariable::attributes).unwrap_or_default();
        let all = if path.is_empty() { of_file() } else { of_variable() };
        let one = |a: &NcAttribute| Some(description::Attribute { name: a.name.clone(), value: described(&a.value)? });
        all.iter().filter_map(one).collect()
    }

    fn values(&self, path: &str) -> Parsed<description::Values> {
        let variable = self.file.variable(path).map_err(|e| e.to_string())?;
        if *variable.dtype() == NcType::String {
            return self.file.read_variable_as_strings(path).map(description::Values::Texts).map_err(|e| reason(&e));
        }
        let ty = number_type(variable.dtype())?;
        Ok(numbers(ty, &self.raw(path, ty)?))
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        number_type(self.file.variable(path).map_err(|e| e.to_string())?.dtype())
    }

    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let Ok(variable) = self.file.variable(path) else { return Vec::new() };
        let dimensions = variable.dimensions();
        (0..dimensions.len()).filter(|axis| dimensions[*axis].is_unlimited).collect()
    }

    fn is_unlimited(&self, dimension: &str) -> bool {
        let dimensions = self.file.dimensions().unwrap_or_default();
        dimensions.iter().any(|known| known.name == dimension && known.is_unlimited)
    }
}

impl NetCdfArrayFile {
    /// All numbers of an array, as they are stored.
    fn raw(&self, path: &str, ty: NumberType) -> Parsed<Vec<u8>> {
        macro_rules! read {
            ($ty:ty) => {{
                let numbers = self.file.read_variable::<$ty>(path).map_err(|e| reason(&e))?;
                numbers.into_iter().flat_map(<$ty>::to_le_bytes).collect()
            }};
        }
        Ok(match ty {
            NumberType::Char => self.file.read_variable_raw_bytes(path).map_err(|e| reason(&e))?,
            NumberType::U8 => read!(u8),
            NumberType::I8 => read!(i8),
            NumberType::U16 => read!(u16),
            NumberType::I16 => read!(i16),
            NumberType::U32 => read!(u32),
            NumberType::I32 => read!(i32),
            NumberType::U64 => read!(u64),
            NumberType::I64 => read!(i64),
            NumberType::F32 => read!(f32),
            NumberType::F64 => read!(f64),
        })
    }

    fn add(&self, group: &NcGroup, path: &str, all: &mut Vec<Variable>) {
        for variable in &group.variables {
            all.push(self.variable(variable, format!("{path}{}", variable.name())));
        }
        for group in &group.groups {
            self.add(group, &format!("{path}{}/", group.name), all);
        }
    }

    fn variable(&self, found: &NcVariable, path: String) -> Variable {
        let dims = found.dimensions();
        let chunk = self.hdf5.as_ref().and_then(|file| file.dataset(&path).ok()?.chunks());
        let chunk = chunk.filter(|chunk| chunk.len() == dims.len());
        let mut attributes = attributes(found);
        let unsigned = attributes.get("_Unsigned") == Some(&Attribute::Text("true".into()));
        let sample = stored_type(found.dtype(), unsigned);
        if let (true, Ok(sample)) = (unsigned, &sample) {
            let turn = 2_f64.powi(8 * sample.size() as i32);
            for name in ["_FillValue", "missing_value", "valid_range", "valid_min", "valid_max"] {
                if let Some(Attribute::Numbers(numbers)) = attributes.get_mut(name) {
                    numbers.iter_mut().filter(|n| **n < 0.0).for_each(|n| *n += turn);
                }
            }
        }
        if matches!(sample, Ok(StoredType::Sample(SampleType::F32 | SampleType::F64)))
            && !attributes.contains_key("_FillValue")
        {
            attributes.insert("_FillValue".into(), Attribute::Numbers(vec![UNWRITTEN]));
        }
        Variable {
            sample,
            lengths: dims.iter().map(|dim| usize::try_from(dim.size).unwrap_or(usize::MAX)).collect(),
            dims: dims.iter().map(|dim| dim.name.clone()).collect(),
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
    Ok(match ty {
        NcType::Char => NumberType::Char,
        NcType::Byte => NumberType::I8,
        NcType::UByte => NumberType::U8,
        NcType::Short => NumberType::I16,
        NcType::UShort => NumberType::U16,
        NcType::Int => NumberType::I32,
        NcType::UInt => NumberType::U32,
        NcType::Int64 => NumberType::I64,
        NcType::UInt64 => NumberType::U64,
        NcType::Float => NumberType::F32,
        NcType::Double => NumberType::F64,
        _ => return Err("a type that is not kept".into()),
    })
}

fn stored_type(ty: &NcType, unsigned: bool) -> Parsed<StoredType> {
    Ok(StoredType::Sample(match ty {
        NcType::Int64 if unsigned => return Ok(StoredType::U64),
        NcType::Int64 => return Ok(StoredType::I64),
        NcType::UInt64 => return Ok(StoredType::U64),
        NcType::Byte if unsigned => SampleType::U8,
        NcType::Short if unsigned => SampleType::U16,
        NcType::Int if unsigned => SampleType::U32,
        NcType::Byte => SampleType::I8,
        NcType::UByte => SampleType::U8,
        NcType::Short => SampleType::I16,
        NcType::UShort => SampleType::U16,
        NcType::Int => SampleType::I32,
        NcType::UInt => SampleType::U32,
        NcType::Float => SampleType::F32,
        NcType::Double => SampleType::F64,
        NcType::Char | NcType::String => return Err("text".into()),
        _ => return Err("a type of its own".into()),
    }))
}
