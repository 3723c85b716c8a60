//! The description in a file of arrays: dimensions, attributes, coordinates and other small arrays.

use super::{ArrayFile, Variable};
use std::collections::HashSet;
use wavesplat_core::base::description::{
    ArrayAxis, Attribute, AxisRole, Description, Dimension, NumberType, Values, Variable as Described, frames_of,
    select,
};
use wavesplat_core::source::layout::Axis;
use wavesplat_core::source::{Extent, Parsed};

/// Bytes of an array that is kept whole.
const MOST_BYTES: usize = 8 << 20;

/// Bytes of all these arrays: less than a description may have, since it also has texts.
const MOST_BYTES_TOGETHER: usize = 14 << 20;

/// Values of an array for each frame that are kept.
const MOST_PER_FRAME: usize = 64;

/// Attributes that describe how samples are stored. They are not kept, because samples are decoded by them.
const STORAGE: [&str; 4] = ["scale_factor", "add_offset", "_FillValue", "_Unsigned"];

/// Attributes in the units of stored numbers, which differ from the samples of packed arrays.
const PACKED: [&str; 4] = ["valid_min", "valid_max", "valid_range", "missing_value"];

/// The samples' array, and its meaning.
pub(crate) struct Samples<'a> {
    pub(crate) variable: &'a Variable,
    pub(crate) axes: &'a [Axis],
    /// The variable with the times of the frames.
    pub(crate) times: Option<&'a str>,
    /// Whether the stored numbers are not the samples.
    pub(crate) packed: bool,
    /// What to read.
    pub(crate) extent: Extent,
}

/// The description, and the names of arrays that were left out because they are large.
pub(crate) fn description(
    source: &str,
    file: &dyn ArrayFile,
    all: &[Variable],
    samples: &Samples<'_>,
) -> (Description, Vec<String>) {
    let coordinates = named_coordinates(file, all, samples.variable);
    let found = Description { source: source.into(), ..Description::default() };
    let mut builder = Builder { file, samples, coordinates, found };
    builder.add_axes();
    builder.found.attributes = builder.attributes();
    builder.found.global = file.described("").into_iter().filter(is_users).collect();
    let left_out = builder.add_variables(all);
    (builder.found, left_out)
}

/// Names that the samples or the whole file give as `coordinates`, and those in the formulas of coordinates.
fn named_coordinates(file: &dyn ArrayFile, all: &[Variable], samples: &Variable) -> HashSet<String> {
    let of_file = file.described("").into_iter().filter(|attribute| attribute.name == "coordinates");
    let of_file = of_file.filter_map(|attribute| match attribute.value {
        Values::Texts(texts) => Some(texts.join(" ")),
        Values::Numbers(_) | Values::Times(_) => None,
    });
    let formulas = all.iter().filter_map(|variable| variable.text("formula_terms"));
    let texts = samples.text("coordinates").into_iter().chain(formulas).map(String::from).chain(of_file);
    texts.flat_map(|text| text.split_whitespace().map(String::from).collect::<Vec<_>>()).collect()
}

struct Builder<'a> {
    file: &'a dyn ArrayFile,
    samples: &'a Samples<'a>,
    /// Names of arrays that say where the samples are.
    coordinates: HashSet<String>,
    found: Description,
}

impl Builder<'_> {
    fn add_axes(&mut self) {
        let Samples { variable, axes, .. } = self.samples;
        for (&Axis { role, len, backwards, .. }, name) in axes.iter().zip(&variable.dims) {
            if role == AxisRole::Single && len > 1 {
                continue;
            }
            // axes without names get dimensions of their own, even if their lengths are equal
            let dimension = self.new_dimension(name, len);
            self.found.axes.push(ArrayAxis { dimension, role, reversed: backwards });
        }
    }

    fn new_dimension(&mut self, name: &str, length: usize) -> u32 {
        let unlimited = self.file.is_unlimited(name);
        self.found.dimensions.push(Dimension { name: name.into(), length: length as u64, unlimited });
        (self.found.dimensions.len() - 1) as u32
    }

    /// The dimension with this name and length.
    fn dimension(&mut self, name: &str, length: usize) -> u32 {
        let is_it = |dimension: &Dimension| dimension.name == name && dimension.length == length as u64;
        match self.found.dimensions.iter().position(is_it) {
            Some(at) => at as u32,
            None => self.new_dimension(name, length),
        }
    }

    /// The attributes of the samples, without those of their storage.
    fn attributes(&self) -> Vec<Attribute> {
        let Samples { variable, packed, .. } = self.samples;
        let is_kept = |attribute: &Attribute| {
            let name = attribute.name.as_str();
            let is_packed = *packed && PACKED.contains(&name);
            is_users(attribute) && !STORAGE.contains(&name) && !is_packed
        };
        self.file.described(&variable.path).into_iter().filter(is_kept).collect()
    }

    /// Adds the arrays that are small; returns the names of coordinates that are not.
    fn add_variables(&mut self, all: &[Variable]) -> Vec<String> {
        let (mut bytes, mut left_out) = (0, Vec::new());
        let mut near: Vec<&Variable> = all.iter().filter(|other| self.belongs(other)).collect();
        near.sort_by_key(|variable| count(variable)); // so that the largest are left out
        for variable in near {
            if stored_bytes(variable) > MOST_BYTES && self.samples.times != Some(variable.path.as_str()) {
                left_out.push(variable.name().to_string());
                continue;
            }
            let Ok(values) = self.values(variable) else { continue };
            let size = held_bytes(&values);
            if size > MOST_BYTES || bytes + size > MOST_BYTES_TOGETHER {
                left_out.push(variable.name().to_string());
                continue;
            }
            bytes += size;
            self.add(variable, values);
        }
        left_out
    }

    /// Whether an array is no field of its own, and is in the samples' group or in one around it.
    fn belongs(&self, other: &Variable) -> bool {
        let Samples { variable, axes, times, extent, .. } = self.samples;
        let group = |variable: &Variable| variable.path[..variable.path.len() - variable.name().len()].to_string();
        let along = |wanted: fn(AxisRole) -> bool| {
            let named = variable.dims.iter().zip(*axes).filter(|(_, axis)| wanted(axis.role));
            let names: Vec<&String> = named.map(|(name, _)| name).collect();
            other.dims.iter().filter(|dim| names.contains(dim)).count()
        };
        let voxels = along(|role| role.voxels().is_some());
        let along_time = along(|role| role == AxisRole::Frames) > 0;
        let frames = axes.iter().find(|axis| axis.role == AxisRole::Frames).map_or(1, |axis| axis.len);
        let is_small = match along_time {
            true => voxels == 0 && count(other) <= MOST_PER_FRAME.saturating_mul(frames),
            false => voxels < 3 && count(other).saturating_mul(size_of::<f64>()) <= 2 * MOST_BYTES,
        };
        let is_named = other.dims.iter().zip(&other.lengths).all(|(dim, length)| !dim.is_empty() || *length == 1);
        if *times == Some(other.path.as_str()) {
            return true;
        }
        let is_read = *extent == Extent::Whole || along_time;
        if self.tied(other).is_some() {
            return is_read;
        }
        let is_kept = is_small || self.is_coordinate(other);
        other.path != variable.path && group(variable).starts_with(&group(other)) && is_named && is_kept && is_read
    }

    /// The axis of the samples to which the file ties an array as its coordinates.
    fn tied(&self, other: &Variable) -> Option<usize> {
        let Samples { variable, axes, .. } = self.samples;
        let is_whole = |axis: &usize| axes[*axis].role != AxisRole::Single;
        (0..axes.len()).find(|axis| variable.scales.get(*axis) == Some(&other.path) && is_whole(axis))
    }

    /// Whether the samples or the whole file name an array as coordinates, or a coordinate names it in its formula.
    fn is_coordinate(&self, other: &Variable) -> bool {
        self.coordinates.contains(other.name())
    }

    /// The values of an array. Along an axis with a chosen index, only the values at that index.
    fn values(&self, variable: &Variable) -> Parsed<Values> {
        let Samples { times, .. } = self.samples;
        if *times == Some(variable.path.as_str()) {
            let is_packed = ["scale_factor", "add_offset"].iter().any(|name| variable.number(name).is_some());
            let stored = self.file.number_type(&variable.path)?;
            return Ok(Values::Times(if is_packed { NumberType::F64 } else { stored }));
        }
        let values = self.file.values(&variable.path)?;
        let kept: Vec<Option<Vec<usize>>> =
            variable.dims.iter().map(|dim| self.chosen(dim).map(|index| vec![index])).collect();
        if kept.iter().all(Option::is_none) { Ok(values) } else { Ok(select(&values, &variable.lengths, &kept)) }
    }

    /// The chosen index along a dimension of several that is not an axis of frames or voxels.
    fn chosen(&self, dim: &str) -> Option<usize> {
        let Samples { variable, axes, .. } = self.samples;
        let axis = axes[variable.dims.iter().position(|other| other == dim && !dim.is_empty())?];
        (axis.role == AxisRole::Single && axis.len > 1).then_some(axis.index)
    }

    fn add(&mut self, variable: &Variable, values: Values) {
        let tied = self.tied(variable).map(|axis| self.samples.variable.dims[axis].clone());
        let (name, dims) = match tied {
            Some(axis) => (axis.clone(), vec![axis]),
            None => (variable.name().to_string(), variable.dims.clone()),
        };
        let kept: Vec<(String, usize)> = dims.into_iter().zip(variable.lengths.iter().copied()).collect();
        let kept = kept.into_iter().filter(|(dim, _)| self.chosen(dim).is_none() && !dim.is_empty());
        let dimensions = kept.collect::<Vec<_>>().iter().map(|(dim, length)| self.dimension(dim, *length)).collect();
        let dimensions: Vec<u32> = match values {
            Values::Times(_) => frames_of(&self.found).into_iter().collect(), // whatever their own axis is called
            _ => dimensions,
        };
        let are_unpacked = matches!(values, Values::Times(_));
        let is_kept = |of: &Attribute| is_users(of) && !(are_unpacked && STORAGE.contains(&of.name.as_str()));
        let attributes = self.file.described(&variable.path).into_iter().filter(is_kept).collect();
        self.found.variables.push(Described { name, dimensions, values, attributes });
    }
}

/// How many values an array has.
fn count(variable: &Variable) -> usize {
    variable.lengths.iter().fold(1, |count: usize, length| count.saturating_mul(*length))
}

/// Bytes of the numbers of an array.
fn stored_bytes(variable: &Variable) -> usize {
    count(variable).saturating_mul(variable.sample.as_ref().map_or(1, |ty| ty.size()))
}

fn held_bytes(values: &Values) -> usize {
    match values {
        Values::Texts(texts) => texts.iter().map(|text| text.len() + size_of::<u64>()).sum(),
        Values::Numbers(numbers) => numbers.count() * numbers.ty.size(),
        Values::Times(_) => 0,
    }
}

/// Whether an attribute is the user's, and not one that the NetCDF and HDF5 libraries write for their own use.
fn is_users(attribute: &Attribute) -> bool {
    const INTERNAL: [&str; 8] = [
        "CLASS",
        "NAME",
        "REFERENCE_LIST",
        "DIMENSION_LIST",
        "DIMENSION_LABELS",
        "_NCProperties",
        "_nc3_strict",
        "_ARRAY_DIMENSIONS",
    ];
    !INTERNAL.contains(&attribute.name.as_str()) && !attribute.name.starts_with("_Netcdf4")
}

/// Numbers as values.
#[cfg(any(feature = "hdf5", feature = "netcdf", feature = "zarr"))]
pub(crate) fn numbers(ty: wavesplat_core::base::description::NumberType, bytes: &[u8]) -> Values {
    Values::Numbers(wavesplat_core::base::description::Numbers::new(ty, bytes))
}
