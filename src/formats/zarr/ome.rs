//! OME-Zarr: what `multiscales` in the attributes of a group says of the axes and places of its arrays, in versions 0.1 to
//! 0.5.

use crate::arrays::{Attribute, Attributes, Variable};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;

/// Coordinates that no array has, by paths that no array has.
pub(super) type Coordinates = BTreeMap<String, Vec<f64>>;

/// Which resolutions of an image are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Resolutions {
    All,
    /// The first one of each image.
    Finest,
}

/// Units of length as they are called here, and as powers of ten in metres.
const LENGTHS: [(&str, &str, i32); 8] = [
    ("micrometer", "um", -6),
    ("nanometer", "nm", -9),
    ("angstrom", "angstrom", -10),
    ("millimeter", "mm", -3),
    ("centimeter", "cm", -2),
    ("meter", "m", 0),
    ("kilometer", "km", 3),
    ("picometer", "pm", -12),
];

/// Units of time as they are called here.
const TIMES: [(&str, &str); 6] = [
    ("second", "s"),
    ("millisecond", "ms"),
    ("microsecond", "us"),
    ("nanosecond", "ns"),
    ("minute", "min"),
    ("hour", "h"),
];

/// The axes of images of version 0.1 and 0.2.
const FIRST_AXES: [&str; 5] = ["t", "c", "z", "y", "x"];

/// An image in several resolutions.
#[derive(Deserialize)]
struct Image {
    axes: Option<Vec<SaidAxis>>,
    datasets: Vec<Dataset>,
    #[serde(default, rename = "coordinateTransformations")]
    transformations: Vec<Transformation>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum SaidAxis {
    Name(String),
    Full {
        name: String,
        #[serde(rename = "type")]
        kind: Option<String>,
        unit: Option<String>,
    },
}

#[derive(Deserialize)]
struct Dataset {
    path: String,
    #[serde(default, rename = "coordinateTransformations")]
    transformations: Vec<Transformation>,
}

#[derive(Deserialize)]
struct Transformation {
    scale: Option<Vec<f64>>,
    translation: Option<Vec<f64>>,
}

/// An axis of an image.
#[derive(Debug, Clone)]
struct OmeAxis {
    name: String,
    kind: String,
    unit: String,
}

/// Where the items of an axis are.
#[derive(Debug, Clone, Copy)]
struct Line {
    first: f64,
    step: f64,
}

/// The images of a group.
pub(super) struct Multiscales {
    group: String,
    images: Vec<Image>,
}

impl Multiscales {
    /// Those that the attributes of a group describe.
    pub(super) fn read(group: &str, attributes: &Map<String, Value>) -> Parsed<Option<Self>> {
        let inner = attributes.get("ome").and_then(|ome| ome.get("multiscales"));
        let Some(said) = inner.or_else(|| attributes.get("multiscales")).filter(|said| said.is_array()) else {
            return Ok(None);
        };
        let images = serde_json::from_value(said.clone())
            .map_err(|e| format!("the multiscales of the group {group} cannot be read: {e}"))?;
        Ok(Some(Self { group: group.trim_end_matches('/').into(), images }))
    }

    /// Names the axes of the arrays of all images, and adds their coordinates.
    pub(super) fn apply(&self, resolutions: Resolutions, all: &mut Vec<Variable>, coordinates: &mut Coordinates) {
        let mut coarse = BTreeSet::new();
        for image in &self.images {
            for (number, dataset) in image.datasets.iter().enumerate() {
                let path = format!("{}/{}", self.group, dataset.path.trim_matches('/'));
                if number > 0 {
                    coarse.insert(path.clone());
                }
                if number > 0 && resolutions == Resolutions::Finest {
                    continue;
                }
                let Some(array) = all.iter_mut().find(|array| array.path == path) else { continue };
                let made = image.describe(dataset, array, coordinates);
                all.extend(made);
            }
        }
        if resolutions == Resolutions::Finest {
            all.retain(|array| !coarse.contains(&array.path));
        }
    }
}

impl Image {
    /// Names the axes of an array; returns their coordinates, whose values it adds.
    fn describe(&self, dataset: &Dataset, array: &mut Variable, coordinates: &mut Coordinates) -> Vec<Variable> {
        let Some(axes) = self.axes(array.lengths.len()) else { return Vec::new() };
        array.dims = axes.iter().map(OmeAxis::dimension).collect();
        let Some(mut lines) = self.lines(dataset, axes.len()) else { return Vec::new() };
        let unit = take_lengths(&axes, &mut lines);
        let mut made = Vec::new();
        for (at, (axis, line)) in axes.iter().zip(lines).enumerate() {
            let (letter, unit) = match axis.kind.as_str() {
                "time" if (line.first, line.step) == (0.0, 1.0) && axis.unit.is_empty() => continue,
                "time" => ("T".to_string(), axis.time_unit()),
                "space" => (letter(&axes, at), unit.clone()),
                _ => continue,
            };
            let values: Vec<f64> = (0..array.lengths[at]).map(|i| line.first + line.step * i as f64).collect();
            if coordinates.iter().any(|(path, other)| {
                path.ends_with(&format!("/{}", array.dims[at])) && other.len() == values.len() && *other != values
            }) {
                array.dims[at] = format!("{}_{}", array.dims[at], array.name()); // of another resolution
            }
            let name = array.dims[at].clone();
            let path = format!("{}/{name}", array.path);
            let texts = [("axis", letter), ("units", unit)];
            let texts = texts.into_iter().filter(|(_, text)| !text.is_empty());
            let attributes: Attributes = texts.map(|(name, text)| (name.into(), Attribute::Text(text))).collect();
            coordinates.insert(path.clone(), values);
            let (sample, lengths) = (Ok(StoredType::F64), vec![array.lengths[at]]);
            made.push(Variable {
                path,
                sample,
                lengths,
                dims: vec![name],
                chunk: None,
                attributes,
                scales: Vec::new(),
            });
        }
        made
    }

    /// The axes, if there are as many as an array has.
    fn axes(&self, count: usize) -> Option<Vec<OmeAxis>> {
        let named = |name: &str| OmeAxis { name: name.into(), kind: kind_of(name).into(), unit: String::new() };
        let axes: Vec<OmeAxis> = match &self.axes {
            None => FIRST_AXES.into_iter().map(named).collect(),
            Some(axes) => axes
                .iter()
                .map(|axis| match axis {
                    SaidAxis::Name(name) => named(name),
                    SaidAxis::Full { name, kind, unit } => {
                        let kind = kind.clone().unwrap_or_else(|| kind_of(name).into());
                        OmeAxis { name: name.clone(), kind, unit: unit.clone().unwrap_or_default() }
                    }
                })
                .collect(),
        };
        Some(axes).filter(|axes| axes.len() == count)
    }

    /// Where the items of all axes are, if it is said.
    fn lines(&self, dataset: &Dataset, count: usize) -> Option<Vec<Line>> {
        let mut lines = vec![Line { first: 0.0, step: 1.0 }; count];
        let mut is_said = false;
        for Transformation { scale, translation } in dataset.transformations.iter().chain(&self.transformations) {
            for (line, scale) in lines.iter_mut().zip(scale.iter().flatten()) {
                *line = Line { first: line.first * scale, step: line.step * scale };
            }
            lines.iter_mut().zip(translation.iter().flatten()).for_each(|(line, by)| line.first += by);
            is_said |= scale.is_some() || translation.is_some();
        }
        is_said.then_some(lines)
    }
}

impl OmeAxis {
    /// The name of the dimension. That of channels says that it counts neither voxels nor frames.
    fn dimension(&self) -> String {
        if self.kind == "channel" { "channel".into() } else { self.name.clone() }
    }

    fn time_unit(&self) -> String {
        let known = TIMES.iter().find(|(said, _)| *said == self.unit);
        known.map_or_else(|| self.unit.clone(), |(_, called)| (*called).into())
    }
}

/// What axes of a name count, where no type says it.
fn kind_of(name: &str) -> &'static str {
    match name {
        "t" => "time",
        "c" => "channel",
        "x" | "y" | "z" => "space",
        _ => "",
    }
}

/// Converts all lengths to one unit, if that is possible, and returns it.
fn take_lengths(axes: &[OmeAxis], lines: &mut [Line]) -> String {
    let known = |axis: &OmeAxis| LENGTHS.iter().find(|(said, ..)| *said == axis.unit);
    let space: Vec<usize> = (0..axes.len()).filter(|at| axes[*at].kind == "space").collect();
    let Some(last) = space.last() else { return String::new() };
    let Some((_, called, power)) = known(&axes[*last]) else {
        let is_same = space.iter().all(|at| axes[*at].unit == axes[*last].unit);
        return if is_same { axes[*last].unit.clone() } else { String::new() };
    };
    let powers: Option<Vec<i32>> = space.iter().map(|at| known(&axes[*at]).map(|(_, _, own)| own - power)).collect();
    let Some(powers) = powers else { return String::new() };
    for (at, power) in space.into_iter().zip(powers) {
        let scaled = |length: f64| match power {
            0.. => length * 10_f64.powi(power),
            power => length / 10_f64.powi(-power),
        };
        lines[at] = Line { first: scaled(lines[at].first), step: scaled(lines[at].step) };
    }
    (*called).into()
}

/// The letter of an axis of space: its name, or by its place among them.
fn letter(axes: &[OmeAxis], at: usize) -> String {
    let space: Vec<usize> = (0..axes.len()).filter(|at| axes[*at].kind == "space").collect();
    let named = |at: &usize| ["x", "y", "z"].contains(&axes[*at].name.to_lowercase().as_str());
    if space.iter().all(named) {
        return axes[at].name.to_uppercase();
    }
    let from_last = space.iter().rev().position(|of| *of == at).unwrap_or_default();
    ["X", "Y", "Z"].get(from_last).copied().unwrap_or_default().into()
}
