//! Reads MetaImage.

use super::data::{self, MetaImageSamples, header_meaning};
use super::header::MetaImageHeader;
use super::layout::{BIG_ENDIAN, NAME, ORIGIN, SPACING, TRANSFORM, TYPES};
use crate::shared::directions::{Directions, Placed};
use crate::shared::meaning::{Kind, Meaning};
use crate::shared::sequence::{SequenceTimes, stamped_note};
use crate::shared::words::numbers;
use std::path::Path;
use wavesplat_core::base::description::{Attribute, Description, LPS, Values};
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::{FileHeader, Units, growing_head};
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::{Advised, OpenOptions, Parsed};

/// Reads the header and checks the size of every data file.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let refused = |e| Error::input(path, e);
    let file = FileBytes::open(path, Access::Read)?;
    let header = growing_head(&file, MetaImageHeader::parse)?;
    let samples = samples(&header, options).map_err(|e| Error::input(path, e))?;
    let parts = data::parts(&file, &header, &samples)?;
    let (times, unit) = times(&header, &samples).map_err(refused)?;
    let unheeded = unheeded(&header, samples.axes).map_err(refused)?;
    let description = description(&header, &samples).map_err(refused)?;
    let is_stamped = options.axes.is_none() && samples.axes == 3 && samples.meaning.frames() == Some(PLANES);
    let MetaImageSamples { shape, placed: Placed { spacing, origin, note, .. }, variable, .. } = samples;
    let notes = note.into_iter().chain(is_stamped.then(stamped_note)).chain(unheeded).collect();
    let units = Units { times: unit, ..Units::default() };
    Ok(FileHeader { spacing, origin, times, units, variable, notes, description, ..FileHeader::plain(shape, parts) })
}

/// The axis of planes: the fourth one, after components.
const PLANES: usize = 3;

/// The directions of the axes and the other fields of the header; `None` if the axes are plain and there are no other
/// fields.
fn description(header: &MetaImageHeader, samples: &MetaImageSamples) -> Parsed<Option<Description>> {
    let text = |(name, value): (&str, &str)| Attribute { name: name.into(), value: Values::text(value) };
    let global: Vec<Attribute> = header.others().map(text).collect();
    let is_plain = global.is_empty() && samples.placed.is_plain();
    let described = directions(header, samples.axes, &samples.meaning)?.description(NAME, LPS, &samples.layout());
    Ok((!is_plain).then_some(Description { global, ..described }))
}

fn samples(header: &MetaImageHeader, options: &OpenOptions) -> Advised<MetaImageSamples> {
    if header.flag(&["binarydata"])? == Some(false) {
        return Err("has its samples as text (BinaryData = False), which is not supported; write them as binary".into());
    }
    let axes = header.required("NDims")?.parse().map_err(|_| "NDims is no number")?;
    if axes != 3 && axes != 4 {
        return Err(format!("has {axes} dimension(s); supported are 3 (x y z) and 4 (x y z t)").into());
    }
    let sizes: Vec<usize> = numbers(header.required("DimSize")?, "DimSize", axes)?;
    let (lengths, frames) = ([sizes[0], sizes[1], sizes[2]], sizes.get(3).copied().unwrap_or(1));
    if frames == 0 {
        return Err("has 0 frames".into());
    }
    let components = header.get("elementnumberofchannels").unwrap_or("1");
    let components = components.parse().map_err(|_| format!("ElementNumberOfChannels {components:?} is no number"))?;
    let own = header_meaning(components, lengths, (axes == 4).then_some(frames));
    let meaning = match options.axes.as_deref() {
        Some(letters) => by_letters(&own, letters)?,
        None => with_sequence(header, own),
    };
    let (component, variable) = meaning.component(None, options.variable.as_deref())?;
    let placed = directions(header, axes, &meaning)?.placed(meaning.lengths(), "directions of the MetaImage");
    let ty = stored_type(header.required("ElementType")?)?;
    let shape = Shape::new(meaning.layout(&placed, component).dims(), ty.sample())?;
    let big_endian = header.flag(&BIG_ENDIAN)?.unwrap_or(false);
    let compressed = header.flag(&["compresseddata"])?.unwrap_or(false);
    let samples = MetaImageSamples {
        axes,
        lengths,
        meaning,
        placed,
        shape,
        ty,
        frames,
        components,
        component,
        variable,
        big_endian,
        compressed,
    };
    samples.stored(frames)?; // so that all sizes that follow are small enough
    Ok(samples)
}

fn stored_type(name: &str) -> Parsed<StoredType> {
    TYPES.stored(name.strip_suffix("_ARRAY").unwrap_or(name)).ok_or_else(|| {
        let types = "MET_CHAR to MET_ULONG_LONG, MET_FLOAT and MET_DOUBLE are";
        format!("ElementType {name} is not supported; {types}")
    })
}

/// What the user's letters say: for all axes, also that of components if there are several.
fn by_letters(own: &Meaning, letters: &str) -> Advised<Meaning> {
    if own.components() != 1 {
        return Meaning::by_letters(&own.sizes, letters);
    }
    let Meaning { mut sizes, mut kinds } = Meaning::by_letters(&own.sizes[1..], letters)?;
    sizes.insert(0, 1);
    kinds.insert(0, Kind::Components);
    Ok(Meaning { sizes, kinds })
}

/// Takes planes or components as frames if they have times of their own.
fn with_sequence(header: &MetaImageHeader, mut own: Meaning) -> Meaning {
    let is_timed = |axis: &usize| own.sizes[*axis] > 1 && header.sequence(*axis, own.sizes[*axis]).is_some();
    if own.frames().is_none()
        && let Some(axis) = [0, PLANES].iter().find(|axis| is_timed(axis))
    {
        own.kinds[*axis] = Kind::Frames;
    }
    own
}

/// Where voxels are in the world.
fn directions(header: &MetaImageHeader, axes: usize, meaning: &Meaning) -> Parsed<Directions> {
    let matrix = matrix(header, axes)?;
    let rows = std::array::from_fn(|row| std::array::from_fn(|axis| matrix[row][axis]));
    let along_space = |all: &[f64]| std::array::from_fn(|axis| all[axis]);
    let (spacing, origin) = (per_axis(header, &SPACING, 1.0, axes)?, per_axis(header, &ORIGIN, 0.0, axes)?);
    let own = Directions::new(rows, along_space(&spacing), along_space(&origin))?;
    if meaning.is_in_order() && meaning.voxels() == [1, 2, 3] {
        return Ok(own);
    }
    let step = |axis: usize| {
        let axis = axis.checked_sub(1)?;
        let row: [f64; 3] = along_space(matrix.get(axis)?);
        Some(row.map(|part| part * spacing[axis]))
    };
    Ok(meaning.directions(step, along_space(&origin)))
}

/// The direction of each axis.
fn matrix(header: &MetaImageHeader, axes: usize) -> Parsed<Vec<Vec<f64>>> {
    let unit = |axis| (0..axes).map(|a| if a == axis { 1.0 } else { 0.0 }).collect();
    let Some(text) = header.any(&TRANSFORM) else { return Ok((0..axes).map(unit).collect()) };
    Ok(numbers(text, "TransformMatrix", axes * axes)?.chunks(axes).map(<[f64]>::to_vec).collect())
}

/// Times that are written beside the samples, with their unit, or those of an axis of frames that has a spacing.
fn times(header: &MetaImageHeader, samples: &MetaImageSamples) -> Parsed<(Vec<f64>, Option<String>)> {
    let Some(axis) = samples.meaning.frames() else { return Ok((Vec::new(), None)) };
    let frames = samples.meaning.sizes[axis];
    if let Some(SequenceTimes { times, unit }) = header.sequence(axis, frames) {
        return Ok((times, unit));
    }
    let axes = samples.axes;
    let (spacing, origin) = (per_axis(header, &SPACING, 1.0, axes)?, per_axis(header, &ORIGIN, 0.0, axes)?);
    let step = axis.checked_sub(1).filter(|_| header.any(&SPACING).is_some()).map(|axis| (spacing[axis], origin[axis]));
    Ok(match step {
        Some((step, first)) if step.is_finite() => ((0..frames).map(|t| first + step * t as f64).collect(), None),
        _ => (Vec::new(), None),
    })
}

/// A number for each axis, by the first of some fields that is there.
fn per_axis(header: &MetaImageHeader, names: &[&str], default: f64, axes: usize) -> Parsed<Vec<f64>> {
    header.any(names).map_or_else(|| Ok(vec![default; axes]), |text| numbers(text, names[0], axes))
}

/// Notes on fields of the header that are ignored.
fn unheeded(header: &MetaImageHeader, axes: usize) -> Parsed<Vec<Note>> {
    let mut notes = Vec::new();
    let matrix = matrix(header, axes)?;
    let of_time = |a: usize| [matrix[3][a], matrix[a][3]];
    if axes == 4 && (0..4).any(|a| of_time(a) != [if a == 3 { 1.0 } else { 0.0 }; 2]) {
        notes
            .push("the TransformMatrix of the MetaImage mixes time with space: its part of space is kept alone".into());
    }
    let scaled = |(name, value): (&str, f64)| header.get(name).is_some_and(|text| text.parse() != Ok(value));
    if [("elementtointensityfunctionslope", 1.0), ("elementtointensityfunctionoffset", 0.0)].into_iter().any(scaled) {
        notes.push(
            "the ElementToIntensityFunction of the MetaImage is not applied: samples are as they are stored".into(),
        );
    }
    Ok(notes)
}
