//! What an array is: the meaning of its axes and numbers, and where its voxels and frames are.

use super::axes::{TimeHint, axes};
use super::chunks::Chunks;
use super::in_place::InPlace;
use super::places::Places;
use super::values::Values;
use super::{FileArrays, Variable, describe, openpmd, vtkhdf};
use std::path::Path;
use wavesplat_core::base::description::{AxisRole, Description};
use wavesplat_core::base::mapped::State;
use wavesplat_core::source::file_header::{FileHeader, Units};
use wavesplat_core::source::layout::{Axis, Layout, Shape};
use wavesplat_core::source::parts::{DataLocation, Part, Stored};
use wavesplat_core::source::{Advised, Extent, Parsed};

/// What variables are found in.
pub(crate) struct Context<'a> {
    /// Name of the format.
    pub(crate) format: &'static str,
    pub(crate) arrays: FileArrays<'a>,
    pub(crate) image: Option<vtkhdf::Image>,
    /// Of an axis beside space and time.
    pub(crate) index: Option<usize>,
    /// What axes count, by the user's word.
    pub(crate) axes: Option<&'a str>,
    /// Whether the user gave the spacing of voxels.
    pub(crate) spaced: bool,
    /// What to read beside the samples.
    pub(crate) extent: Extent,
}

/// What an array is.
pub(crate) struct ResolvedArray {
    pub(crate) variable: Variable,
    pub(crate) name: String,
    pub(crate) axes: Vec<Axis>,
    /// The layout of the axes that are read in full (fixed-index axes left out).
    pub(crate) layout: Layout,
    /// Maps output frames to stored frames; empty if the orders agree.
    pub(crate) order: Vec<usize>,
    pub(crate) places: Places,
    pub(crate) values: Values,
    pub(crate) description: Description,
}

impl Context<'_> {
    /// Finds out what an array is.
    pub(crate) fn resolve(&self, variable: &Variable) -> Advised<ResolvedArray> {
        let FileArrays { file, all } = self.arrays;
        let (mesh, unfit) = match openpmd::Mesh::read(file, variable) {
            Ok(mesh) => (mesh, None),
            Err(note) => (None, Some(note)),
        };
        let variable = mesh.as_ref().map_or_else(|| variable.clone(), |mesh| mesh.named(variable));
        let sample = variable.sample.clone().map_err(|ty| {
            let path = variable.shown();
            format!("{path}: {ty} is not supported; arrays of integers and floats in the file itself are")
        })?;
        if variable.lengths.contains(&0) {
            return Err(format!("{} has no samples: its axes are {:?}", variable.shown(), variable.lengths).into());
        }
        let hint = TimeHint::from_storage(&variable, &file.growing_axes(&variable.path));
        let (mut axes, guessed) = axes(&variable, all, self.index, self.axes, hint)?;
        let mut places = Places::find(self.arrays, &variable, &axes, self.spaced);
        places.notes.extend(guessed);
        axes.iter_mut().for_each(|axis| axis.backwards = places.is_backwards(axis.role));
        let layout = Layout(axes.iter().filter(|axis| axis.role != AxisRole::Single).copied().collect());
        layout.bytes(sample.size())?;
        if let Some(mesh) = mesh {
            (places.spacing, places.origin) = mesh.lattice(&axes);
            places.space_unit = Some("m".into());
            places.notes = mesh.note().into_iter().collect();
        }
        places.notes.extend(unfit);
        let order = self.take_image(&variable, &layout, &mut places)?;
        let name = match self.index {
            Some(index) => format!("{}[{index}]", own_name(&variable)),
            None => own_name(&variable),
        };
        let values = Values::from_attributes(&variable, sample)?;
        let description = self.described(&variable, &axes, &values, &mut places);
        Ok(ResolvedArray { name, axes, layout, order, places, values, variable, description })
    }

    /// The description of an array. Notes name the parts that are too large to be kept.
    fn described(&self, variable: &Variable, axes: &[Axis], values: &Values, places: &mut Places) -> Description {
        let times = places.time_path.as_deref();
        let (packed, extent) = (values.packing.is_some(), self.extent);
        let samples = describe::Samples { variable, axes, times, packed, extent };
        let (description, left_out) = describe::description(self.format, self.arrays.file, self.arrays.all, &samples);
        if !left_out.is_empty() {
            places.notes.push(format!("{} is too large to be kept with the samples", left_out.join(", ")).into());
        }
        description
    }

    /// Takes spacing, origin and times from VTKHDF; returns the order of frames.
    fn take_image(&self, variable: &Variable, layout: &Layout, places: &mut Places) -> Parsed<Vec<usize>> {
        let Some(image) = &self.image else { return Ok(Vec::new()) };
        image.check(layout.dims(), variable)?;
        (places.spacing, places.origin) = image.lattice(variable);
        places.times.clone_from(&image.times);
        if image.is_turned {
            places.notes.push("the Direction of the VTKHDF is not kept: axes are taken as those of the world".into());
        }
        image.offsets(self.arrays.file, variable, layout.len(AxisRole::Frames))
    }
}

/// The name of a variable; with that of its group if an axis has the same name, as a component of a vector may.
fn own_name(variable: &Variable) -> String {
    let (path, name) = (variable.shown(), variable.name());
    let group = path[..path.len() - name.len()].trim_end_matches('/').rsplit('/').next().unwrap_or_default();
    let is_axis = variable.dims.iter().any(|dim| dim == name);
    if is_axis && !group.is_empty() { format!("{group}_{name}") } else { name.into() }
}

impl ResolvedArray {
    /// The frames of this array, which are read chunk by chunk.
    pub(crate) fn decoded(&self, path: &Path, state: State, chunks: Chunks) -> Parsed<Part> {
        let stored = Stored { packing: self.values.packing.clone(), ..chunks.stored(&self.layout)? };
        let frames = if self.order.is_empty() { self.layout.len(AxisRole::Frames) } else { self.order.len() };
        Ok(Part { path: path.into(), state, frames, stored, at: DataLocation::Decoded(Box::new(chunks)) })
    }

    /// The frames of this array, which are in the file as they are.
    pub(crate) fn in_place(&self, path: &Path, state: State, place: InPlace) -> Parsed<Part> {
        let ty = self.variable.sample.clone()?;
        let stored = place.stored(self.axes.clone(), ty, state.len)?;
        let stored = Stored { packing: self.values.packing.clone(), ..stored };
        let (path, frames) = (path.into(), self.layout.len(AxisRole::Frames));
        Ok(Part { path, state, frames, stored, at: DataLocation::Byte(place.start) })
    }

    /// The header of a file with the frames of this array.
    pub(crate) fn described(self, parts: Vec<Part>) -> Parsed<FileHeader> {
        let shape = Shape::new(self.layout.dims(), self.values.sample)?;
        let Places { spacing, origin, times, space_unit, time_unit, calendar, notes, .. } = self.places;
        let units = Units { samples: self.values.unit, times: time_unit, space: space_unit, calendar };
        let (variable, missing, description) = (Some(self.name), self.values.missing, Some(self.description));
        Ok(FileHeader {
            description,
            spacing,
            origin,
            times,
            variable,
            units,
            missing,
            notes,
            ..FileHeader::plain(shape, parts)
        })
    }
}
