//! Dimension scales of HDF5: arrays that a file ties to the axes of others.

use crate::arrays::Variable;
use crate::arrays::axes::role_of_name;
use hdf5_reader::Dataset;
use hdf5_reader::reference::read_object_references;
use std::collections::HashMap;

/// The mark of a scale that netCDF writes for an axis without coordinates.
const NO_COORDINATES: &str = "This is a netCDF dimension but not a netCDF variable";

/// The scales of arrays, by the addresses of the arrays in the file.
#[derive(Default)]
pub(super) struct Scales {
    /// The number of the array at an address.
    arrays: HashMap<u64, usize>,
    /// Addresses of the first scale of each axis of each array.
    of_axes: Vec<Vec<Option<u64>>>,
}

impl Scales {
    /// Remembers the next array. Addresses in the file have `size` bytes.
    pub(super) fn add(&mut self, dataset: &Dataset, size: u8) {
        self.arrays.insert(dataset.address(), self.of_axes.len());
        self.of_axes.push(addresses(dataset, size));
    }

    /// Gives the axes of arrays the names of their scales, unless they have a name that says more.
    pub(super) fn name(&self, all: &mut [Variable]) {
        for (number, scales) in self.of_axes.iter().enumerate() {
            for (axis, scale) in scales.iter().enumerate() {
                let scale = scale.and_then(|address| all.get(*self.arrays.get(&address)?));
                let Some(name) = scale.filter(|scale| has_coordinates(scale)).map(|scale| scale.name().to_string())
                else {
                    continue;
                };
                let own = &mut all[number].dims[axis];
                if role_of_name(own).is_none() {
                    *own = name;
                }
            }
        }
    }
}

fn has_coordinates(scale: &Variable) -> bool {
    !scale.text("NAME").unwrap_or_default().starts_with(NO_COORDINATES)
}

/// The address of the first scale of each axis; `None`, or an empty list, if the references are damaged.
fn addresses(dataset: &Dataset, size: u8) -> Vec<Option<u64>> {
    let Ok(list) = dataset.attribute("DIMENSION_LIST") else { return Vec::new() };
    let first = |entry: &[u8]| {
        let references = dataset.resolve_vlen_reference_bytes(entry, size.into()).ok()?;
        read_object_references(&references, size).ok()?.first().copied()
    };
    let entry = 4 + usize::from(size) + 4; // a length, and a place in the heap
    list.raw_data.chunks_exact(entry).take(dataset.ndim()).map(first).collect()
}
