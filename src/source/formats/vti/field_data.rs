//! Arrays of a file that belong to no point or cell. They are kept as they are.

use super::header::VtiArray;
use super::image::{VtiFile, stored_type};
use crate::base::description::{Description, Dimension, NumberType, Numbers, Values, Variable};
use crate::base::mapped::{Access, FileBytes};
use crate::base::sample::SampleType;
use crate::base::stored::StoredType;
use crate::source::formats::shared::pieces::Packed;
use std::io::Read;

/// Bytes of an array that is kept.
const MOST_BYTES: usize = 1 << 20;

/// Arrays that are kept.
const MOST: usize = 256;

/// Adds the arrays of numbers to a description; those that are large or cannot be read are left out.
pub(super) fn describe(image: &VtiFile, description: &mut Description) {
    for (array, tuples) in image.header.fields.iter().take(MOST) {
        let Some(numbers) = numbers(image, array, *tuples) else { continue };
        let lengths = if array.components == 1 { vec![*tuples] } else { vec![*tuples, array.components] };
        let first = description.dimensions.len() as u32;
        let dimension = |length: &usize| Dimension { name: String::new(), length: *length as u64, unlimited: false };
        description.dimensions.extend(lengths.iter().map(dimension));
        description.variables.push(Variable {
            name: array.name.clone(),
            dimensions: (first..first + lengths.len() as u32).collect(),
            values: Values::Numbers(numbers),
            attributes: Vec::new(),
        });
    }
}

/// The numbers of an array.
fn numbers(image: &VtiFile, array: &VtiArray, tuples: usize) -> Option<Numbers> {
    let ty = stored_type(&array.ty)?;
    let size = tuples.checked_mul(array.components)?.checked_mul(ty.size()).filter(|size| *size <= MOST_BYTES)?;
    let encoded = image.encoded(array, ty, size).ok()?;
    let file = FileBytes::open(image.file.path(), Access::Read).ok()?;
    let mut bytes = Vec::new();
    encoded.open(file).ok()?.take(size as u64).read_to_end(&mut bytes).ok()?;
    if image.header.big_endian {
        bytes.chunks_exact_mut(ty.size()).for_each(<[u8]>::reverse);
    }
    (bytes.len() == size).then(|| Numbers::new(number_type(ty), &bytes))
}

fn number_type(ty: StoredType) -> NumberType {
    match ty {
        StoredType::I64 => NumberType::I64,
        StoredType::U64 => NumberType::U64,
        StoredType::Sample(SampleType::U8) => NumberType::U8,
        StoredType::Sample(SampleType::I8) => NumberType::I8,
        StoredType::Sample(SampleType::U16) => NumberType::U16,
        StoredType::Sample(SampleType::I16) => NumberType::I16,
        StoredType::Sample(SampleType::U32) => NumberType::U32,
        StoredType::Sample(SampleType::I32) => NumberType::I32,
        StoredType::Sample(SampleType::F16 | SampleType::F32) => NumberType::F32, // VTK has no halves
        StoredType::Sample(SampleType::F64) => NumberType::F64,
    }
}
