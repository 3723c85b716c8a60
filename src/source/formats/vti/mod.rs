//! VTK's image data: one array of a `.vti`, or of the files of a `.pvti`, put together from its pieces.

mod blocks;
mod count;
mod encoded;
mod extent;
mod header;
mod image;
mod pieced;
mod skeleton;

use super::shared::component::{self, Chosen};
use super::shared::directions::{Directions, Placed};
use crate::base::description::Description;
use crate::base::error::{Error, Result};
use crate::source::file_header::FileHeader;
use crate::source::layout::Shape;
use crate::source::layout::{Axis, Counts, Layout};
use crate::source::parts::Stored;
use crate::source::{Advised, Parsed, VariableInfo};
use extent::Extent;
use header::{VtiArray, VtiHeader};
use image::{VtiFile, sample_type};
use std::path::Path;

/// Reads the XML of one file, and of those that it lists, and checks that the array is all there.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<FileHeader> {
    let image = VtiFile::open(path)?;
    let header = &image.header;
    let wanted = ChosenArray::of(header, variable).map_err(|e| Error::input(path, e))?;
    let (part, time) = pieced::part(&image, &wanted)?;
    let array = wanted.array;
    let description = wanted.description(header).map_err(|e| Error::input(path, e))?;
    let variable = Some(component::label(&array.name, array.components, wanted.chosen.component));
    let Placed { spacing, origin, note, .. } = wanted.placed;
    let (times, notes): (_, Vec<_>) = (time.into_iter().collect(), note.into_iter().collect());
    let description = (!notes.is_empty()).then_some(description);
    Ok(FileHeader {
        spacing,
        origin,
        times,
        variable,
        notes,
        description,
        ..FileHeader::plain(wanted.shape, vec![part])
    })
}

/// The arrays among which the user must choose; none if it is clear which one is meant.
pub(super) fn undecided(path: &Path) -> Result<Vec<VariableInfo>> {
    let header = VtiFile::open(path)?.header;
    let points = header.whole.points().map_err(|e| Error::input(path, e))?;
    if !component::is_undecided(&header.names(), header.active()) {
        return Ok(Vec::new());
    }
    let variable = |array: &VtiArray| {
        let sample = sample_type(&array.ty).map_or(array.ty.as_str(), |ty| ty.name());
        VariableInfo::volume(&array.name, sample, array.of.dims(points), array.components)
    };
    Ok(header.arrays().iter().map(variable).collect())
}

/// The array that is meant.
struct ChosenArray<'a> {
    array: &'a VtiArray,
    chosen: Chosen,
    whole: Extent,
    /// Voxels along its axes, the fastest first, as they are stored.
    lengths: [usize; 3],
    placed: Placed,
    /// As they are when turned.
    shape: Shape,
    /// Bytes of all components of a sample.
    voxel: usize,
}

impl<'a> ChosenArray<'a> {
    fn of(header: &'a VtiHeader, variable: Option<&str>) -> Advised<Self> {
        let chosen = component::choose(&header.names(), header.active(), variable)?;
        let array = &header.arrays()[chosen.array];
        let points = header.whole.points()?;
        let Some(sample) = sample_type(&array.ty) else {
            let types = "UInt8 to Int32, Float32 and Float64 are";
            return Err(format!("array {}: type {} is not supported; {types}", array.name, array.ty).into());
        };
        let lengths = array.of.dims(points);
        let placed = directions(header, array, points)?.placed(lengths, "directions of the .vti");
        let shape = Shape::new(Layout(placed.voxels(lengths).to_vec()).dims(), sample)?;
        let voxel = array.components.checked_mul(sample.size()).ok_or("its samples have too many components")?;
        Ok(Self { array, chosen, whole: header.whole, lengths, placed, shape, voxel })
    }

    /// The directions of the axes.
    fn description(&self, header: &VtiHeader) -> Parsed<Description> {
        let directions = directions(header, self.array, header.whole.points()?)?;
        Ok(directions.description("VTK image data", "", &Layout(self.placed.voxels(self.lengths).to_vec())))
    }

    fn stored(&self, big_endian: bool) -> Parsed<Stored> {
        let components = Axis::new(Counts::Only(self.chosen.component), self.array.components);
        let layout = Layout(self.placed.voxels(self.lengths).into_iter().chain([components]).collect());
        Stored::new(&layout, self.shape.sample(), big_endian)
    }
}

/// Where the samples of an array are in the world: those of cells between points.
fn directions(header: &VtiHeader, array: &VtiArray, points: [usize; 3]) -> Parsed<Directions> {
    let matrix = &header.direction;
    let columns = std::array::from_fn(|axis| [0, 1, 2].map(|row| matrix[3 * row + axis]));
    let lattice = Directions::of(columns, header.spacing, header.origin)?;
    let start = [0, 1, 2].map(|axis| header.whole.ends(axis).0 as f64);
    Ok(lattice.from_place(array.of.origin(points, start, [1.0; 3])))
}

#[cfg(test)]
mod tests;
