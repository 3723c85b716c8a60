//! Files of named arrays: HDF5, NetCDF and their like. One variable of them is an archive, read chunk by chunk.
//!
//! What a file holds is asked of an [`ArrayFile`]; [`choose`] finds the variable that is meant, [`axes`] what its axes count,
//! [`places`] where its voxels and frames are, [`values`] what its numbers mean, and [`chunks`] reads it.

mod axes;
mod choose;
mod chunks;
mod hdf5;
mod netcdf;
mod places;
mod values;

use super::component;
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::sample::SampleType;
use crate::source::described::{At, Described, Part, Stored, Units};
use crate::source::frames::Shape;
use crate::source::layout::{Axis, Counts, Layout};
use crate::source::{OpenOptions, Parsed};
use chunks::Chunks;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

/// An array, and what is said of it.
#[derive(Debug, Clone)]
struct Variable {
    /// Its name, with those of the groups that it is in.
    path: String,
    /// The type of its numbers, or the name of one that is not supported.
    sample: Parsed<SampleType>,
    /// The slowest axis first.
    lengths: Vec<usize>,
    /// Name of each axis; empty where it has none.
    dims: Vec<String>,
    /// Lengths of the pieces that are packed together, if it is in such.
    chunk: Option<Vec<usize>>,
    attributes: Attributes,
}

type Attributes = BTreeMap<String, Attribute>;

/// What is said under a name.
#[derive(Debug, Clone, PartialEq)]
enum Attribute {
    Text(String),
    Numbers(Vec<f64>),
}

impl Variable {
    fn text(&self, attribute: &str) -> Option<&str> {
        match self.attributes.get(attribute)? {
            Attribute::Text(text) => Some(text.trim()),
            Attribute::Numbers(_) => None,
        }
    }

    fn numbers(&self, attribute: &str) -> &[f64] {
        match self.attributes.get(attribute) {
            Some(Attribute::Numbers(numbers)) => numbers,
            _ => &[],
        }
    }

    fn number(&self, attribute: &str) -> Option<f64> {
        self.numbers(attribute).first().copied()
    }

    /// The last part of its path.
    fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or_default()
    }

    /// The variable that says where the voxels or frames of an axis are: it has the axis' name, and this one only.
    fn coordinate<'a>(&self, axis: usize, all: &'a [Self]) -> Option<&'a Self> {
        let dim = self.dims[axis].as_str();
        let folder = &self.path[..self.path.len() - self.name().len()];
        let is = |v: &&Self| !dim.is_empty() && v.name() == dim && v.lengths == [self.lengths[axis]];
        let near = |v: &&Self| is(v) && v.path.strip_suffix(dim) == Some(folder);
        all.iter().find(near).or_else(|| all.iter().find(is))
    }
}

/// An open file of arrays.
trait ArrayFile: Send {
    /// All arrays that are in it.
    fn variables(&self) -> Parsed<Vec<Variable>>;

    /// The numbers of a box of an array, little-endian, the last axis fastest.
    fn read(&self, path: &str, sample: SampleType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>>;

    /// All numbers of an array with one axis or none, which may be of any type.
    fn numbers(&self, path: &str) -> Parsed<Vec<f64>>;
}

/// Opens a file of arrays.
type Open = fn(&Path, How) -> Result<Box<dyn ArrayFile>>;

/// How a file is read.
#[derive(Debug, Clone, Copy)]
struct How {
    access: Access,
    /// Bytes that reading may take.
    memory: usize,
}

/// Reads what an HDF5 file holds.
pub(super) fn describe_hdf5(path: &Path, options: &OpenOptions) -> Result<Described> {
    describe(path, hdf5::open, options)
}

/// Reads what a NetCDF file holds.
pub(super) fn describe_netcdf(path: &Path, options: &OpenOptions) -> Result<Described> {
    describe(path, netcdf::open, options)
}

fn describe(path: &Path, open: Open, options: &OpenOptions) -> Result<Described> {
    let state = FileBytes::open(path, Access::Read)?.state();
    let how = How { access: options.access, memory: options.memory / SHARE };
    let file = open(path, how)?;
    let refused = |e| Error::input(path, e);
    let all = file.variables().map_err(refused)?;
    let (variable, index) = match options.variable.as_deref() {
        Some(name) => choose::named(&all, name).map_err(refused)?,
        None => (choose::only(&all).map_err(refused)?, None),
    };
    let found = Found::of(file.as_ref(), &all, variable, (index, options.axes.as_deref())).map_err(refused)?;
    let chunks = Chunks::new(variable, &found.counts, (open, how)).map_err(|e| e.of(path))?;
    let stored = Stored { packing: found.values.packing.clone(), ..chunks.stored(&found.layout).map_err(refused)? };
    let frames = found.layout.len(Counts::Frames);
    let part = Part { path: path.into(), state, frames, stored, at: At::Decoded(Box::new(chunks)) };
    found.described(part).map_err(refused)
}

/// Of what a window may take, chunks as they are decoded have this part.
const SHARE: usize = 4;

/// What a variable is.
struct Found {
    name: String,
    counts: Vec<Counts>,
    /// Of all axes but those of which only one index is meant.
    layout: Layout,
    places: places::Places,
    values: values::Values,
}

impl Found {
    fn of(
        file: &dyn ArrayFile,
        all: &[Variable],
        variable: &Variable,
        (index, letters): (Option<usize>, Option<&str>),
    ) -> Parsed<Self> {
        let sample = variable.sample.clone().map_err(|ty| {
            format!(
                "{} has numbers of type {ty}, which is not supported; integers up to 32 bits and floats are",
                variable.path
            )
        })?;
        let counts = axes::counts(variable, all, index, letters)?;
        let places = places::Places::of(file, all, variable, &counts)?;
        let axis = |(i, counts): (usize, &Counts)| match *counts {
            Counts::Only(_) => None,
            counts => Some(Axis { counts, len: variable.lengths[i], backwards: places.is_backwards(counts) }),
        };
        let layout = Layout(counts.iter().enumerate().filter_map(axis).collect());
        let name = match index {
            Some(index) => format!("{}[{index}]", variable.name()),
            None => variable.name().to_string(),
        };
        Ok(Self { name, counts, layout, places, values: values::Values::of(variable, sample) })
    }

    fn described(self, part: Part) -> Parsed<Described> {
        let shape = Shape::new(self.layout.dims(), self.values.sample)?;
        let places::Places { spacing, origin, times, space_unit, time_unit, notes, .. } = self.places;
        let units = Units { samples: self.values.unit, times: time_unit, space: space_unit };
        let (variable, missing) = (Some(self.name), self.values.missing);
        Ok(Described { spacing, origin, times, variable, units, missing, notes, ..Described::plain(shape, vec![part]) })
    }
}
