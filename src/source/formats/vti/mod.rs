//! VTK's image data: one array of a `.vti`, or of the files of a `.pvti`, put together from its pieces.

mod blocks;
mod encoded;
mod extent;
mod header;
mod image;
mod pieced;
mod skeleton;

use super::component::{self, Chosen};
use crate::error::{Error, Result};
use crate::source::Parsed;
use crate::source::described::{Described, Stored};
use crate::source::frames::Shape;
use crate::source::layout::{Axis, Counts, Layout};
use extent::Extent;
use header::{Array, Header};
use image::{Image, sample_type};
use std::path::Path;

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Reads the XML of one file, and of those that it lists, and checks that the array is all there.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<Described> {
    let image = Image::open(path)?;
    let header = &image.header;
    let wanted = Wanted::of(header, variable).map_err(|e| Error::input(path, e))?;
    let (part, time) = pieced::part(&image, &wanted)?;
    let mut described = Described::plain(wanted.shape, vec![part]);
    described.spacing = header.spacing;
    let first = std::array::from_fn(|a| header.origin[a] + header.whole.ends(a).0 as f64 * header.spacing[a]);
    described.origin = wanted.array.of.origin(wanted.points, first, header.spacing);
    described.times = time.into_iter().collect();
    described.variable = Some(component::label(&wanted.array.name, wanted.array.components, wanted.chosen.component));
    if header.direction != IDENTITY {
        described.notes.push("the Direction of the .vti is not kept: axes are taken as those of the world".into());
    }
    Ok(described)
}

/// The array that is meant.
struct Wanted<'a> {
    array: &'a Array,
    chosen: Chosen,
    whole: Extent,
    /// Points of it along x, y, z.
    points: [usize; 3],
    shape: Shape,
    /// Bytes of all components of a sample.
    voxel: usize,
}

impl<'a> Wanted<'a> {
    fn of(header: &'a Header, variable: Option<&str>) -> Parsed<Self> {
        let arrays = header.arrays();
        let names: Vec<_> = arrays.iter().map(|array| (array.name.as_str(), array.components)).collect();
        let active =
            header.scalars.iter().find_map(|(of, name)| arrays.iter().position(|a| a.of == *of && a.name == *name));
        let chosen = component::choose(&names, active, variable)?;
        let array = &arrays[chosen.array];
        let points = header.whole.points()?;
        let Some(sample) = sample_type(&array.ty) else {
            let types = "UInt8 to Int32, Float32 and Float64 are";
            return Err(format!("array {}: type {} is not supported; {types}", array.name, array.ty));
        };
        let shape = Shape::new(array.of.dims(points), sample)?;
        let voxel = array.components.checked_mul(sample.size()).ok_or("its samples have too many components")?;
        Ok(Self { array, chosen, whole: header.whole, points, shape, voxel })
    }

    fn stored(&self, big_endian: bool) -> Parsed<Stored> {
        let mut layout = Layout::plain(self.shape.dims(), 1);
        layout.0.push(Axis::new(Counts::Only(self.chosen.component), self.array.components));
        Stored::new(&layout, self.shape.sample(), big_endian)
    }
}

#[cfg(test)]
mod tests;
