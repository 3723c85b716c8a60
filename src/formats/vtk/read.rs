//! Reads VTK's legacy files.

use super::header::{VtkArray, VtkHeader, stored_type};
use crate::shared::component::{self, Chosen};
use crate::shared::offer::Offer;
use crate::shared::pieces::{Piece, Pieces};
use crate::shared::text::Words;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::layout::{Axis, Layout};
use wavesplat_core::source::parts::{DataLocation, Part, Stored};
use wavesplat_core::source::{Parsed, VariableInfo};

/// Goes through the text of one file and finds the array.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<FileHeader> {
    let file = FileBytes::open(path, Access::Read)?;
    let header = VtkHeader::read(&file)?;
    let chosen = component::choose(&header.names(), header.scalars.first().copied(), variable);
    let chosen = chosen.map_err(|e| Error::input(path, e))?;
    let array = &header.arrays[chosen.array];
    let (shape, stored) = stored(&header, array, chosen).map_err(|e| Error::input(path, e))?;
    let at = if header.ascii { text(&file, array, stored.ty, shape.dims()) } else { DataLocation::Byte(array.start) };
    let part = Part { path: path.into(), state: file.state(), frames: 1, stored, at };
    let mut described = FileHeader::plain(shape, vec![part]);
    described.spacing = header.spacing;
    described.origin = array.of.origin(header.points, header.origin, header.spacing);
    described.times = header.time.into_iter().collect();
    described.variable = Some(component::label(&array.name, array.components, chosen.component));
    Ok(described)
}

/// The arrays of a file.
pub(super) fn offer(path: &Path) -> Result<Offer> {
    let header = VtkHeader::read(&FileBytes::open(path, Access::Read)?)?;
    let variable = |array: &VtkArray| {
        let sample = stored_type(&array.ty).map_or(array.ty.as_str(), |ty| ty.name());
        VariableInfo::volume(&array.name, sample, array.of.dims(header.points), array.components)
    };
    let is_undecided = component::is_undecided(&header.names(), header.scalars.first().copied());
    Ok(Offer { variables: header.arrays.iter().map(variable).collect(), is_undecided })
}

/// An array as text: all of it is one piece.
fn text(file: &FileBytes, array: &VtkArray, ty: StoredType, dims: [usize; 3]) -> DataLocation {
    let samples = Words { start: array.start, count: array.components * array.tuples, ty };
    let (path, state) = (file.path().into(), file.state());
    let piece = Piece { path, state, start: [0; 3], dims, samples: Box::new(samples) };
    DataLocation::Decoded(Box::new(Pieces {
        dims,
        voxel: array.components * ty.size(),
        together: 1,
        frames: vec![vec![piece]],
    }))
}

fn stored(header: &VtkHeader, array: &VtkArray, chosen: Chosen) -> Parsed<(Shape, Stored)> {
    let refused = |what: String| format!("array {}: {what}", array.name);
    let Some(ty) = stored_type(&array.ty) else {
        let types = "unsigned_char to int, vtktypeint64, float and double are";
        return Err(refused(format!("type {} is not supported; {types}", array.ty)));
    };
    let shape = Shape::new(array.of.dims(header.points), ty.sample())?;
    let samples = shape.frame_bytes() / ty.sample().size();
    if array.tuples != samples {
        return Err(refused(format!("has {} samples, but DIMENSIONS need {samples}", array.tuples)));
    }
    let mut layout = Layout::plain(shape.dims(), 1);
    layout.0.push(Axis::single(chosen.component, array.components));
    Ok((shape, Stored::new(&layout, ty, true)?))
}
