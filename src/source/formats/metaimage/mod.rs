//! MetaImage, with its samples in the same file (`.mha`) or in others (`.mhd`): axes x y z or x y z t.

mod data;
mod header;

use super::component;
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::sample::SampleType;
use crate::source::Parsed;
use crate::source::described::{Described, Stored, growing_head};
use crate::source::frames::Shape;
use crate::source::layout::{Axis, Counts, Layout};
use header::{Header, numbers};
use std::path::Path;

const SPACING: [&str; 2] = ["elementspacing", "elementsize"];
const ORIGIN: [&str; 3] = ["offset", "position", "origin"];
const TRANSFORM: [&str; 3] = ["transformmatrix", "rotation", "orientation"];

/// Reads the header and checks the size of every data file.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<Described> {
    let refused = |e| Error::input(path, e);
    let file = FileBytes::open(path, Access::Read)?;
    let header = growing_head(&file, Header::parse)?;
    let samples = samples(&header, variable).map_err(refused)?;
    let parts = data::parts(&file, &header, &samples)?;
    let mut described = Described::plain(samples.shape, parts);
    (described.spacing, described.origin, described.times) = grid(&header, &samples).map_err(refused)?;
    let (components, component) = samples.components;
    described.variable = (components > 1).then(|| component::label("", components, component));
    described.notes = notes(&header, samples.axes).map_err(refused)?;
    Ok(described)
}

/// What the samples are, wherever they are.
struct Samples {
    axes: usize,
    shape: Shape,
    frames: usize,
    /// Components of a voxel, and which of them is meant.
    components: (usize, usize),
    big_endian: bool,
    compressed: bool,
}

impl Samples {
    /// How some frames are stored.
    fn stored(&self, frames: usize) -> Parsed<Stored> {
        let mut layout = Layout::plain(self.shape.dims(), frames);
        layout.0.push(Axis::new(Counts::Only(self.components.1), self.components.0));
        Stored::new(&layout, self.shape.sample(), self.big_endian)
    }

    /// Some planes as if components were voxels beside one another.
    fn flat(&self, planes: usize) -> Parsed<Shape> {
        let [x, y, _] = self.shape.dims();
        Shape::new(
            [x.checked_mul(self.components.0).ok_or("a row of its size is too large")?, y, planes],
            self.shape.sample(),
        )
    }
}

fn samples(header: &Header, variable: Option<&str>) -> Parsed<Samples> {
    if header.flag(&["binarydata"])? == Some(false) {
        return Err("has its samples as text (BinaryData = False), which is not supported; write them as binary".into());
    }
    let axes = header.required("NDims")?.parse().map_err(|_| "NDims is no number")?;
    if axes != 3 && axes != 4 {
        return Err(format!("has {axes} dimension(s); supported are 3 (x y z) and 4 (x y z t)"));
    }
    let sizes: Vec<usize> = numbers(header.required("DimSize")?, "DimSize", axes)?;
    let frames = sizes.get(3).copied().unwrap_or(1);
    if frames == 0 {
        return Err("has 0 frames".into());
    }
    let shape = Shape::new([sizes[0], sizes[1], sizes[2]], sample_type(header.required("ElementType")?)?)?;
    let big_endian = header.flag(&["binarydatabyteordermsb", "elementbyteordermsb"])?.unwrap_or(false);
    let compressed = header.flag(&["compresseddata"])?.unwrap_or(false);
    let samples = Samples { axes, shape, frames, components: components(header, variable)?, big_endian, compressed };
    samples.stored(frames)?; // so that all sizes that follow are small enough
    Ok(samples)
}

/// Components of a voxel, and which of them is meant.
fn components(header: &Header, variable: Option<&str>) -> Parsed<(usize, usize)> {
    let count = header.get("elementnumberofchannels").unwrap_or("1");
    let count: usize = count.parse().map_err(|_| format!("ElementNumberOfChannels {count:?} is no number"))?;
    if count == 0 {
        return Err("has 0 channels".into());
    }
    let index = match variable.map(component::named) {
        Some((name, _)) if !name.is_empty() => {
            return Err(format!(
                "has no array {name}: its samples have no name; --variable '[0]' is their first component"
            ));
        }
        Some((_, index)) => index,
        None => None,
    };
    Ok((count, component::chosen("", count, index).map_err(|e| e.trim_start().to_string())?))
}

fn sample_type(name: &str) -> Parsed<SampleType> {
    Ok(match name.strip_suffix("_ARRAY").unwrap_or(name) {
        "MET_CHAR" => SampleType::I8,
        "MET_UCHAR" => SampleType::U8,
        "MET_SHORT" => SampleType::I16,
        "MET_USHORT" => SampleType::U16,
        "MET_INT" | "MET_LONG" => SampleType::I32, // of 4 bytes on every machine
        "MET_UINT" | "MET_ULONG" => SampleType::U32,
        "MET_FLOAT" => SampleType::F32,
        "MET_DOUBLE" => SampleType::F64,
        _ => {
            let types = "MET_CHAR to MET_UINT, MET_FLOAT and MET_DOUBLE are";
            return Err(format!("ElementType {name} is not supported; {types}"));
        }
    })
}

/// Spacing and origin of x, y, z, and times where a fourth axis has a spacing.
fn grid(header: &Header, &Samples { axes, frames, .. }: &Samples) -> Parsed<([f64; 3], [f64; 3], Vec<f64>)> {
    let field = |names: &[&str], default: f64| match header.any(names) {
        Some(text) => numbers(text, names[0], axes),
        None => Ok(vec![default; axes]),
    };
    let (spacing, origin) = (field(&SPACING, 1.0)?, field(&ORIGIN, 0.0)?);
    let times = match (spacing.get(3), header.any(&SPACING)) {
        (Some(step), Some(_)) if step.is_finite() => (0..frames).map(|t| origin[3] + step * t as f64).collect(),
        _ => Vec::new(),
    };
    let of_space = |all: &[f64]| std::array::from_fn(|axis| all[axis]);
    Ok((of_space(&spacing), of_space(&origin), times))
}

fn notes(header: &Header, axes: usize) -> Parsed<Vec<String>> {
    let mut notes = Vec::new();
    if let Some(text) = header.any(&TRANSFORM) {
        let matrix: Vec<f64> = numbers(text, "TransformMatrix", axes * axes)?;
        let identity = |(i, value): (usize, &f64)| *value == if i % (axes + 1) == 0 { 1.0 } else { 0.0 };
        if !matrix.iter().enumerate().all(identity) {
            notes.push("the TransformMatrix of the MetaImage is not kept: axes are taken as those of the world".into());
        }
    }
    let scaled = |(name, value): (&str, f64)| header.get(name).is_some_and(|text| text.parse() != Ok(value));
    if [("elementtointensityfunctionslope", 1.0), ("elementtointensityfunctionoffset", 0.0)].into_iter().any(scaled) {
        notes.push(
            "the ElementToIntensityFunction of the MetaImage is not applied: samples are as they are stored".into(),
        );
    }
    Ok(notes)
}

#[cfg(test)]
mod tests;
