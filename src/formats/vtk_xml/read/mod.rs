//! Reads VTK's image data and rectilinear grids: one array of a `.vti` or `.vtr`, or of the files of a `.pvti` or
//! `.pvtr`, put together from its pieces.

mod blocks;
mod count;
mod encoded;
mod extent;
mod field_data;
mod header;
mod image;
mod pieced;
mod rectilinear;
mod skeleton;

use super::layout::{IMAGE_DATA, TYPES};
use crate::shared::component::{self, Chosen};
use crate::shared::directions::{Directions, Placed};
use crate::shared::offer::Offer;
use extent::Extent;
use header::{VtiArray, VtiHeader};
use image::VtiFile;
use std::path::Path;
use wavesplat_core::base::description::Description;
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::layout::{Axis, Layout};
use wavesplat_core::source::parts::Stored;
use wavesplat_core::source::{Advised, Parsed, VariableInfo};

/// Reads the XML of one file and of the files that it lists, and checks that the array is complete.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<FileHeader> {
    let image = VtiFile::open(path)?;
    let header = &image.header;
    let points = header.rectilinear.then(|| rectilinear::coordinates(&image)).transpose()?;
    let wanted = ChosenArray::new(header, variable, points.as_ref()).map_err(|e| Error::input(path, e))?;
    let (part, time) = pieced::part(&image, &wanted)?;
    let array = wanted.array;
    let mut description = wanted.description(header, points.as_ref()).map_err(|e| Error::input(path, e))?;
    field_data::describe(&image, &mut description);
    let variable = Some(component::label(&array.name, array.components, wanted.chosen.component));
    let Placed { spacing, origin, note, .. } = wanted.placed;
    let is_described = note.is_some() || points.is_some() || !header.fields.is_empty();
    let note = note.into_iter().chain(wanted.uneven);
    let (times, notes) = (time.into_iter().collect(), note.collect());
    let description = is_described.then_some(description);
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

/// The arrays of a file.
pub(super) fn offer(path: &Path) -> Result<Offer> {
    let header = VtiFile::open(path)?.header;
    let points = header.whole.points().map_err(|e| Error::input(path, e))?;
    let variable = |array: &VtiArray| {
        let sample = TYPES.stored(array.ty.as_str()).map_or(array.ty.as_str(), |ty| ty.name());
        VariableInfo::volume(&array.name, sample, array.of.dims(points), array.components)
    };
    let is_undecided = component::is_undecided(&header.names(), header.active());
    Ok(Offer { variables: header.arrays().iter().map(variable).collect(), is_undecided })
}

/// The array that is meant.
struct ChosenArray<'a> {
    array: &'a VtiArray,
    chosen: Chosen,
    whole: Extent,
    /// Voxels along its axes, the fastest first, as they are stored.
    lengths: [usize; 3],
    placed: Placed,
    /// A note on axes along which samples are not evenly spaced.
    uneven: Option<Note>,
    /// As they are when turned.
    shape: Shape,
    /// The type of the stored numbers.
    ty: StoredType,
    /// Bytes of all components of a sample.
    voxel: usize,
}

impl<'a> ChosenArray<'a> {
    fn new(header: &'a VtiHeader, variable: Option<&str>, coordinates: Option<&[Vec<f64>; 3]>) -> Advised<Self> {
        let chosen = component::choose(&header.names(), header.active(), variable)?;
        let array = &header.arrays()[chosen.array];
        let points = header.whole.points()?;
        let Some(ty) = TYPES.stored(array.ty.as_str()) else {
            let types = "UInt8 to Int64, Float32 and Float64 are";
            return Err(format!("array {}: type {} is not supported; {types}", array.name, array.ty).into());
        };
        let lengths = array.of.dims(points);
        let (directions, uneven) = match coordinates {
            Some(coordinates) => rectilinear::directions(coordinates, array.of)?,
            None => (directions(header, array, points)?, Vec::new()),
        };
        let placed = directions.placed(lengths, "directions of the .vti");
        let uneven = (!uneven.is_empty()).then(|| {
            let axes = uneven.join(", ");
            format!("the coordinates along {axes} are not regular: their mean step is taken").into()
        });
        let shape = Shape::new(Layout(placed.voxels(lengths).to_vec()).dims(), ty.sample())?;
        let voxel = array.components.checked_mul(ty.size()).ok_or("its samples have too many components")?;
        Ok(Self { array, chosen, whole: header.whole, lengths, placed, uneven, shape, ty, voxel })
    }

    /// The directions of the axes, or the coordinates of a rectilinear grid.
    fn description(&self, header: &VtiHeader, points: Option<&[Vec<f64>; 3]>) -> Parsed<Description> {
        let layout = Layout(self.placed.voxels(self.lengths).to_vec());
        match points {
            Some(points) => Ok(rectilinear::description(points, self.array.of, &layout)),
            None => {
                let directions = directions(header, self.array, header.whole.points()?)?;
                Ok(directions.description(IMAGE_DATA, "", &layout))
            }
        }
    }

    fn stored(&self, big_endian: bool) -> Parsed<Stored> {
        let components = Axis::single(self.chosen.component, self.array.components);
        let layout = Layout(self.placed.voxels(self.lengths).into_iter().chain([components]).collect());
        Stored::new(&layout, self.ty, big_endian)
    }
}

/// Where the samples of an array are in the world: those of cells between points.
fn directions(header: &VtiHeader, array: &VtiArray, points: [usize; 3]) -> Parsed<Directions> {
    let matrix = &header.direction;
    let columns = std::array::from_fn(|axis| [0, 1, 2].map(|row| matrix[3 * row + axis]));
    let lattice = Directions::new(columns, header.spacing, header.origin)?;
    let start = [0, 1, 2].map(|axis| header.whole.ends(axis).0 as f64);
    Ok(lattice.starting_at(array.of.origin(points, start, [1.0; 3])))
}

#[cfg(test)]
mod tests;
