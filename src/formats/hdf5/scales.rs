//! Dimension scales of HDF5: arrays that a file ties to the axes of others.

use crate::arrays::Variable;
use hdf5_reader::Dataset;
use hdf5_reader::reference::read_object_references;
use std::collections::HashMap;

/// The mark of a scale that netCDF writes for an axis without coordinates.
const NO_COORDINATES: &str = "This is a netCDF dimension but not a netCDF variable";

/// Names of scales that are the times of frames, of several scales of one axis.
const TIMES: [&str; 4] = ["time", "times", "t", "sim_time"];

/// The scales of arrays, by the addresses of the arrays in the file.
#[derive(Default)]
pub(super) struct Scales {
    /// The number of the array at an address.
    arrays: HashMap<u64, usize>,
    /// Addresses of the scales of each axis of each array.
    of_axes: Vec<Vec<Vec<u64>>>,
}

impl Scales {
    /// Remembers the next array. Addresses in the file have `size` bytes.
    pub(super) fn add(&mut self, dataset: &Dataset, size: u8) {
        self.arrays.insert(dataset.address(), self.of_axes.len());
        self.of_axes.push(addresses(dataset, size));
    }

    /// Passes over an array that is not there.
    pub(super) fn skip(&mut self) {
        self.of_axes.push(Vec::new());
    }

    /// Ties scales to the axes of arrays, and gives axes without a label the names of their scales.
    pub(super) fn tie(&self, all: &mut [Variable]) {
        for (number, axes) in self.of_axes.iter().enumerate() {
            for (axis, scales) in axes.iter().enumerate() {
                let Some(scale) = self.of_axis(&all[number], axis, scales, all).cloned() else { continue };
                let own = &mut all[number];
                if own.dims[axis].is_empty() {
                    own.dims[axis] = scale.name().into();
                }
                own.scales[axis] = scale.path;
            }
        }
    }

    /// The scale of an axis: of several, that with times, or the first. One as long as the axis is preferred.
    fn of_axis<'a>(&self, of: &Variable, axis: usize, scales: &[u64], all: &'a [Variable]) -> Option<&'a Variable> {
        let found = scales.iter().filter_map(|address| all.get(*self.arrays.get(address)?));
        let found: Vec<_> = found.filter(|scale| has_coordinates(scale)).collect();
        let fits = |scale: &&&Variable| scale.lengths == [of.lengths[axis]];
        let is_time = |scale: &&&Variable| fits(scale) && TIMES.contains(&scale.name().to_lowercase().as_str());
        let found = found.iter();
        found.clone().find(is_time).or_else(|| found.clone().find(fits)).or_else(|| found.clone().next()).copied()
    }
}

fn has_coordinates(scale: &Variable) -> bool {
    !scale.text("NAME").unwrap_or_default().starts_with(NO_COORDINATES)
}

/// The addresses of the scales of each axis; none if the references are damaged.
fn addresses(dataset: &Dataset, size: u8) -> Vec<Vec<u64>> {
    let Ok(list) = dataset.attribute("DIMENSION_LIST") else { return Vec::new() };
    let all = |entry: &[u8]| {
        let references = dataset.resolve_vlen_reference_bytes(entry, size.into()).unwrap_or_default();
        read_object_references(&references, size).unwrap_or_default()
    };
    let entry = 4 + usize::from(size) + 4; // a length, and a place in the heap
    list.raw_data.chunks_exact(entry).take(dataset.ndim()).map(all).collect()
}
