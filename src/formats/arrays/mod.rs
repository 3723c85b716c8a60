//! Files of named arrays, such as HDF5 and NetCDF, and named arrays that the caller holds ([`held`]). One variable is an
//! archive, read chunk by chunk.
//!
//! An [`ArrayFile`] lists the arrays. [`choose`] finds the variable, [`axes`] the meaning of its axes, [`places`] the
//! positions of voxels and frames, and [`values`] the meaning of its numbers. [`chunks`] reads it, unless it is stored as
//! it is ([`in_place`]).

mod variable;
#[cfg(feature = "hdf5")]
pub(crate) mod hdf5_storage;
pub(crate) mod opener;
pub(crate) mod axes;
mod steps;
mod choose;
mod chunks;
pub(crate) mod describe;
#[cfg_attr(not(feature = "netcdf"), allow(dead_code, reason = "classic NetCDF alone says where numbers are"))]
pub(crate) mod in_place;
mod auxiliary_times;
mod sibling_times;
mod places;
mod openpmd;
mod values;
mod minc;
mod vtkhdf;
mod resolve;
mod archive;
pub(crate) mod held;

pub(crate) use archive::ArrayArchive;
pub(crate) use variable::{Attribute, Attributes, Variable, attributes};

use in_place::InPlace;
use std::ops::Range;
use wavesplat_core::base::description;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;

/// An open file, and all arrays that are meant in it.
#[derive(Clone, Copy)]
pub(crate) struct FileArrays<'a> {
    pub(crate) file: &'a dyn ArrayFile,
    pub(crate) all: &'a [Variable],
}

/// An open file of arrays.
pub(crate) trait ArrayFile: Send {
    /// All arrays that are in it.
    fn variables(&self) -> Parsed<Vec<Variable>>;

    /// Names that lead to something that is not read, each with what that is, as a sentence.
    fn elsewhere(&self) -> Vec<String> {
        Vec::new()
    }

    /// The numbers of a box of an array, little-endian, the last axis fastest.
    fn read(&self, path: &str, ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>>;

    /// All numbers of an array with one axis or none, which may be of any type.
    fn numbers(&self, path: &str) -> Parsed<Vec<f64>> {
        match self.values(path)? {
            description::Values::Numbers(numbers) => Ok(numbers.to_f64()),
            _ => Err(format!("the values of {path} are no numbers")),
        }
    }

    /// The attributes of an array, with their types and in the file's order; of the whole file with an empty path.
    fn described(&self, path: &str) -> Vec<description::Attribute>;

    /// All values of an array.
    fn values(&self, path: &str) -> Parsed<description::Values>;

    /// The type of an array's numbers.
    fn number_type(&self, path: &str) -> Parsed<description::NumberType>;

    /// The axes along which an array may grow.
    fn growing_axes(&self, _path: &str) -> Vec<usize> {
        Vec::new()
    }

    /// Whether the file may grow along a dimension.
    fn is_unlimited(&self, _dimension: &str) -> bool {
        false
    }

    /// Where the numbers of an array are, if they are stored uncompressed.
    fn in_place(&self, _path: &str) -> Option<InPlace> {
        None
    }

    /// The attributes of a group; empty if there is no such group.
    fn group(&self, _path: &str) -> Attributes {
        Attributes::new()
    }
}

/// Coordinates of an axis that are read.
const MOST_COORDINATES: usize = 1 << 24;

/// The numbers of a coordinate; an error if there are more than an axis can have.
fn coordinates(file: &dyn ArrayFile, coordinate: &Variable) -> Parsed<Vec<f64>> {
    match coordinate.lengths.iter().try_fold(1_usize, |all, n| all.checked_mul(*n)) {
        Some(count) if count <= MOST_COORDINATES => {
            Ok(description::unpacked(file.numbers(&coordinate.path)?, |name| coordinate.number(name)))
        }
        _ => Err(format!("{} is too long", coordinate.path)),
    }
}
