//! Extracted samples as a dataset: dimensions, variables and attributes, for formats that hold all of them (NetCDF,
//! Zarr). With a description it is that of the source; without one it has times and positions.

use crate::contents::Contents;
use std::collections::BTreeSet;
use wavesplat_core::base::description::{
    Attribute, AxisRole, Description, NIFTI_HEADER, NumberType, Numbers, Values, coordinates,
};
use wavesplat_core::base::sample::{SampleType, store};
use wavesplat_core::base::stored::StoredType;

/// Everything of a file but the samples themselves.
#[derive(Debug)]
pub(crate) struct Dataset {
    pub(crate) dimensions: Vec<(String, u64)>,
    pub(crate) global: Vec<Attribute>,
    /// Coordinates and other arrays beside the samples.
    pub(crate) variables: Vec<DatasetVariable>,
    pub(crate) samples: SamplesVariable,
}

/// An array beside the samples.
#[derive(Debug)]
pub(crate) struct DatasetVariable {
    pub(crate) name: String,
    /// Indices of its dimensions, the slowest first.
    pub(crate) dimensions: Vec<usize>,
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) values: Values,
}

/// The array of the samples.
#[derive(Debug)]
pub(crate) struct SamplesVariable {
    pub(crate) name: String,
    pub(crate) dimensions: Vec<usize>,
    pub(crate) ty: SampleType,
    pub(crate) attributes: Vec<Attribute>,
    /// The value of missing samples.
    pub(crate) fill: Option<f64>,
}

/// Default names of the axes of frames, x, y, z.
const NAMES: [&str; 4] = ["time", "x", "y", "z"];

impl Dataset {
    /// The dataset of samples that are written as `ty`.
    pub(crate) fn new(contents: &Contents, ty: SampleType) -> Self {
        match &contents.description {
            Some(description) => Self::from_source(contents, description, ty),
            None => Self::plain(contents, ty),
        }
    }

    /// Times and positions alone.
    fn plain(contents: &Contents, ty: SampleType) -> Self {
        let lengths = [contents.frames.len(), contents.grid.dims[2], contents.grid.dims[1], contents.grid.dims[0]];
        let names = ["time", "z", "y", "x"];
        let dimensions = names.iter().zip(lengths).map(|(name, length)| ((*name).to_string(), length as u64)).collect();
        let variable = |(number, name): (usize, &&str)| DatasetVariable {
            name: (*name).into(),
            dimensions: vec![number],
            attributes: axis_attributes(contents, name),
            values: Values::floats(&positions(contents, name)),
        };
        let mut attributes = vec![text("long_name", &contents.name)];
        attributes.extend(contents.units.as_deref().map(|units| text("units", units)));
        let name = name_of(&contents.name, &names);
        let samples = SamplesVariable { name, dimensions: vec![0, 1, 2, 3], ty, attributes, fill: contents.missing };
        let global = vec![text("Conventions", "CF-1.8")];
        Self { dimensions, global, variables: names.iter().enumerate().map(variable).collect(), samples }
    }

    /// Dimensions, variables and attributes as the source has them.
    fn from_source(contents: &Contents, description: &Description, ty: SampleType) -> Self {
        let dimensions = named_dimensions(description);
        let samples_name = unlike_others(&contents.name, &dimensions, description);
        let mut names: BTreeSet<String> = BTreeSet::from([samples_name.clone()]);
        let is_new = |name: &String| names.insert(name.clone());
        let own = description.variables.iter().map(|variable| {
            let values = match &variable.values {
                Values::Times(ty) => as_type(*ty, &contents.times),
                values => values.clone(),
            };
            let dimensions = variable.dimensions.iter().map(|dimension| *dimension as usize).collect();
            let (name, attributes) = (sound(&variable.name), variable.attributes.clone());
            DatasetVariable { name, dimensions, attributes, values }
        });
        let mut variables: Vec<DatasetVariable> = own.chain(lattice(contents, description, &dimensions)).collect();
        variables.retain({
            let mut is_new = is_new;
            move |variable| is_new(&variable.name)
        });
        let samples = SamplesVariable {
            name: samples_name,
            dimensions: description.axes.iter().map(|axis| axis.dimension as usize).collect(),
            ty,
            attributes: samples_attributes(contents, description),
            fill: contents.missing,
        };
        let is_kept = |attribute: &&Attribute| attribute.name != NIFTI_HEADER;
        let global = description.global.iter().filter(is_kept).cloned().collect();
        Self { dimensions, global, variables, samples }
    }
}

/// The attributes of the samples, with their unit if another setting gave it.
fn samples_attributes(contents: &Contents, description: &Description) -> Vec<Attribute> {
    let mut attributes = description.attributes.clone();
    let is_there = attributes.iter().any(|attribute| attribute.name == "units");
    attributes.extend(contents.units.as_deref().filter(|_| !is_there).map(|units| text("units", units)));
    attributes
}

/// Names and lengths of all dimensions. A dimension without a name gets the default of its axis; all names differ.
fn named_dimensions(description: &Description) -> Vec<(String, u64)> {
    let mut taken: BTreeSet<String> = BTreeSet::new();
    let role = |number: usize| description.axes.iter().find(|axis| axis.dimension as usize == number).map(|a| a.role);
    let named = |(number, dimension): (usize, &wavesplat_core::base::description::Dimension)| {
        let fallback = match role(number) {
            Some(AxisRole::Frames) => NAMES[0].to_string(),
            Some(role) => role.voxels().map_or_else(|| format!("dim_{number}"), |axis| NAMES[axis + 1].into()),
            None => format!("dim_{number}"),
        };
        let wanted = if dimension.name.is_empty() { fallback } else { sound(&dimension.name) };
        let mut name = wanted.clone();
        while !taken.insert(name.clone()) {
            name = format!("{wanted}_{number}");
        }
        (name, dimension.length)
    };
    description.dimensions.iter().enumerate().map(named).collect()
}

/// Positions on the lattice, for sources that place voxels without coordinates of axes: none if an axis has these.
fn lattice(contents: &Contents, description: &Description, dimensions: &[(String, u64)]) -> Vec<DatasetVariable> {
    let (grid, has_own) = (&contents.grid, (0..3).any(|axis| coordinates(description, axis).is_some()));
    let is_placed = grid.spacing != [1.0; 3] || grid.origin != [0.0; 3];
    let time = description.variables.iter().any(|variable| matches!(variable.values, Values::Times(_)));
    let axis = |axis: &wavesplat_core::base::description::ArrayAxis| {
        let name = match axis.role.voxels() {
            Some(along) if !has_own && is_placed => NAMES[along + 1],
            None if axis.role == AxisRole::Frames && !time && !contents.numbered => NAMES[0],
            _ => return None,
        };
        let mut at = positions(contents, name);
        if axis.reversed {
            at.reverse();
        }
        Some(DatasetVariable {
            name: dimensions[axis.dimension as usize].0.clone(),
            dimensions: vec![axis.dimension as usize],
            attributes: axis_attributes(contents, name),
            values: Values::floats(&at),
        })
    };
    description.axes.iter().filter_map(axis).collect()
}

/// Times or positions along an axis.
fn positions(contents: &Contents, name: &str) -> Vec<f64> {
    let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else { return contents.times.clone() };
    (0..contents.grid.dims[axis]).map(|i| contents.grid.position([i; 3])[axis]).collect()
}

fn axis_attributes(contents: &Contents, name: &str) -> Vec<Attribute> {
    let (space, time) = (contents.space_units.as_deref(), contents.time_units.as_deref());
    // ParaView reads an axis marked X or Y as longitude or latitude, and bends the volume.
    let (long, axis, units) = match name {
        "time" if contents.numbered => ("number of the frame", Some("T"), None),
        "time" => ("time", Some("T"), time),
        "z" => ("z", Some("Z"), space),
        _ => (name, None, space),
    };
    let calendar = contents.calendar.as_deref().filter(|_| name == "time");
    let more = [("axis", axis), ("units", units), ("calendar", calendar)];
    let more = more.into_iter().filter_map(|(name, value)| Some(text(name, value?)));
    [text("long_name", long)].into_iter().chain(more).collect()
}

fn text(name: &str, value: &str) -> Attribute {
    Attribute { name: name.into(), value: Values::text(value) }
}

/// A name of a variable or dimension, without characters that some format refuses in names.
fn sound(name: &str) -> String {
    let name: String = name.chars().map(|c| if c.is_control() || c == '/' { '_' } else { c }).collect();
    if name.is_empty() { "unnamed".into() } else { name }
}

/// A name for the samples that neither a dimension, whose name its coordinates have, nor another variable has.
fn unlike_others(name: &str, dimensions: &[(String, u64)], description: &Description) -> String {
    let is_taken = |name: &str| {
        let mut others = description.variables.iter().map(|variable| sound(&variable.name));
        dimensions.iter().any(|(other, _)| other == name) || others.any(|other| other == name)
    };
    let mut own = sound(name);
    while is_taken(&own) {
        own = format!("values_{own}");
    }
    own
}

/// The variable's name in letters, digits and underscores, different from all dimensions.
fn name_of(name: &str, dimensions: &[&str]) -> String {
    let name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic());
    if starts_well && !dimensions.contains(&name.as_str()) { name } else { format!("values_{name}") }
}

/// Numbers as those of a type, rounded if it has no fractions.
fn as_type(ty: NumberType, numbers: &[f64]) -> Values {
    let bytes: Vec<u8> = match StoredType::from_number(ty) {
        Some(StoredType::I64) => numbers.iter().flat_map(|n| (n.round() as i64).to_le_bytes()).collect(),
        Some(StoredType::U64) => numbers.iter().flat_map(|n| (n.round() as u64).to_le_bytes()).collect(),
        stored => {
            let sample = stored.map_or(SampleType::U8, StoredType::sample); // characters are bytes
            let mut bytes = vec![0; numbers.len() * sample.size()];
            store(sample, numbers, &mut bytes);
            bytes
        }
    };
    Values::Numbers(Numbers::new(ty, &bytes))
}

/// The type of numbers that samples have; halves are written as floats of 32 bits.
pub(crate) fn number_type(ty: SampleType) -> NumberType {
    StoredType::from(ty).number().unwrap_or(NumberType::F32)
}
