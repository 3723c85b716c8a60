//! Attributes of HDF5 objects.

use super::numbers::{StoredBytes, joined, number_type, sized};
use crate::arrays::describe::numbers;
use wavesplat_core::base::description;

/// The attributes of an object; those of types that users define are left out.
pub(super) fn described_all(all: &[hdf5_reader::Attribute]) -> Vec<description::Attribute> {
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
