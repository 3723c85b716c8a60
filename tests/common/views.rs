//! Small volumes, views of them, and their images by brute force.

use super::memory::Memory;
use super::random::Random;
use super::samples::{bytes, numbers};
use crate::reference::camera::{self, Lattice};
use crate::reference::splat::{Images, images};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::render::RenderConfig;
use wavesplat::view::camera::View;

pub(crate) fn view(azimuth: f64, elevation: f64, size: [usize; 2]) -> View {
    View { azimuth, elevation, roll: 0.0, size, scale: None, center: None }
}

pub(crate) const SKEWED: Grid = Grid { dims: [9, 7, 5], spacing: [1.0, 0.7, 1.3], origin: [-40.0, 3.0, 1e3] };

/// A smooth signed field with some noise.
pub(crate) fn field(grid: &Grid, frames: usize, seed: u64) -> Vec<f64> {
    let mut random = Random(seed);
    let mut out = Vec::new();
    for t in 0..frames {
        for [x, y, z] in grid.whole().iter() {
            let phase = 0.7 * x as f64 - 0.4 * y as f64 + 0.9 * z as f64 + 0.3 * t as f64;
            out.push(3.0 * phase.sin() + 0.2 * x as f64 + 0.3 * random.signed());
        }
    }
    out
}

pub(crate) fn archive(grid: Grid, ty: SampleType, values: &[f64]) -> Memory {
    Memory::new(grid, ty, bytes(ty, values))
}

/// The values of an archive's samples.
pub(crate) fn values(memory: &Memory, ty: SampleType) -> Vec<f64> {
    numbers(ty, &memory.frames)
}

/// The images by brute force, at the scale (pixels per world unit) that the library chose or was given.
pub(crate) fn truth(
    grid: &Grid,
    config: &RenderConfig,
    scale: f64,
    values: &[f64],
    missing: Option<&[bool]>,
) -> Images {
    let (lattice, view) = of_reference(grid, config, scale);
    images(&lattice, &view, values, missing)
}

/// The lattice and the view in the reference's terms.
pub(crate) fn of_reference(grid: &Grid, config: &RenderConfig, scale: f64) -> (Lattice, camera::View) {
    let View { azimuth, elevation, roll, size: [width, height], center, .. } = config.views[0];
    let (sigma, tau) = (config.kernel.sigma, config.kernel.tau);
    let lattice = Lattice { dims: grid.dims, spacing: grid.spacing, origin: grid.origin };
    (lattice, camera::View { azimuth, elevation, roll, width, height, scale, center, sigma, tau })
}

/// The largest absolute value, without NaN.
pub(crate) fn largest<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> f64 {
    numbers.into_iter().filter(|v| v.is_finite()).fold(0.0, |m, v| m.max(v.abs()))
}

/// The largest rounding error of a number stored in a picture's `f32`: half a unit in its last place.
pub(crate) fn rounding(pixel: f32) -> f64 {
    f64::from(pixel.abs()) * 2f64.powi(-24) + 2f64.powi(-150)
}
