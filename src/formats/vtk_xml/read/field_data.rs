//! Arrays of a file that belong to no point or cell. They are kept unchanged.

use super::header::VtiArray;
use super::image::VtiFile;
use crate::shared::pieces::Packed;
use crate::vtk_xml::layout::TYPES;
use std::io::Read;
use wavesplat_core::base::description::{Description, Dimension, Numbers, Values, Variable};
use wavesplat_core::base::mapped::{Access, FileBytes};

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
    let ty = TYPES.stored(array.ty.as_str())?;
    let size = tuples.checked_mul(array.components)?.checked_mul(ty.size()).filter(|size| *size <= MOST_BYTES)?;
    let encoded = image.encoded(array, ty, size).ok()?;
    let file = FileBytes::open(image.file.path(), Access::Read).ok()?;
    let mut bytes = Vec::new();
    encoded.open(file).ok()?.take(size as u64).read_to_end(&mut bytes).ok()?;
    if image.header.big_endian {
        ty.swap_endian(&mut bytes);
    }
    Some(Numbers::new(ty.number()?, &bytes)).filter(|_| bytes.len() == size)
}
