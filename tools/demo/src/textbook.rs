//! The conventional method as textbooks have it (Westover, Footprint Evaluation for Volume Rendering, 1990): the
//! projected kernel is computed once into a table of 32 x 32 positions within a pixel; then every frame adds, for
//! each of its voxels in the picture, value times table to the picture.
//!
//! Where voxels are in the picture is computed once a view. Voxels of value 0 add nothing and are passed over. All
//! is f32. Frames are rendered in parallel, each by one thread.

use rayon::prelude::*;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::source::FrameSource;
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_core::view::footprint::Kernel;

/// The usual cut of a footprint, in standard deviations.
pub const CUT: f64 = 3.0;
/// Positions within a pixel along each axis.
const POSITIONS: usize = 32;
/// A pixel is background where its weights sum to less than this share of the largest.
const BACKGROUND: f32 = 0.01;

/// Renders the first `frames` frames of a source of f32 samples, giving each to `sink`: a number for each pixel and
/// channel that `colour` makes of a sample.
pub fn render<const CHANNELS: usize>(
    source: &mut dyn FrameSource,
    frames: usize,
    splatter: &Splatter,
    colour: impl Fn(f32) -> [f32; CHANNELS] + Sync,
    sink: &mut dyn FnMut(usize, &[[f32; CHANNELS]]),
) -> Result<()> {
    let whole = source.archive().grid.whole();
    let at_once = rayon::current_num_threads();
    for first in (0..frames).step_by(at_once) {
        let window = source.window(first, at_once.min(frames - first))?;
        let picture = |frame: usize| -> Result<Vec<[f32; CHANNELS]>> {
            let mut bytes = vec![0; whole.voxels() * size_of::<f32>()];
            window.read_box(frame, &whole, &mut bytes)?;
            let values: Vec<_> = bytes.as_chunks().0.iter().map(|b| colour(f32::from_le_bytes(*b))).collect();
            Ok(splatter.mean(&splatter.splat(&values)))
        };
        let pictures = (0..window.frames()).into_par_iter().map(picture).collect::<Result<Vec<_>>>()?;
        pictures.iter().zip(first..).for_each(|(picture, frame)| sink(frame, picture));
    }
    Ok(())
}

/// The start of a voxel that is outside of the picture, and so is passed over.
const OUTSIDE: u32 = u32::MAX;

/// All that is the same for every frame of a view.
pub struct Splatter {
    table: Table,
    places: Vec<FootprintPosition>,
    size: [usize; 2],
    /// The sum of the weights at each pixel, in a picture with a margin.
    weights: Vec<f32>,
}

/// Where a voxel's footprint goes.
struct FootprintPosition {
    /// The first pixel of the first row, in a picture with a margin.
    start: u32,
    /// Which of the table's footprints.
    footprint: u32,
    /// The attenuation exp(-tau z) at the voxel's depth z below the one nearest to the viewer.
    attenuation: f32,
}

impl Splatter {
    /// Of kernels that are cut at `radius` standard deviations.
    pub fn new(grid: &Grid, view: &View, kernel: Kernel, radius: f64) -> Result<Self> {
        let camera = Camera::new(view, grid)?;
        let (table, size) = (Table::new(kernel.sigma * camera.scale, radius), view.size);
        let (width, nearest) = (size[0] + table.side, camera.nearest_of(grid));
        let place = |voxel: [usize; 3]| {
            let [x, y, z] = camera.project(grid.position(voxel));
            let part = |c: f64| ((c - c.floor()) * POSITIONS as f64) as usize;
            // The margin is as wide as a footprint reaches, so that column 0 is where that of pixel 0 begins.
            let start = y.floor() as usize * width + x.floor() as usize;
            let inside = [x, y].iter().zip(size).all(|(c, pixels)| (0.0..pixels as f64).contains(c));
            FootprintPosition {
                start: if inside { start as u32 } else { OUTSIDE },
                footprint: (part(y) * POSITIONS + part(x)) as u32,
                attenuation: (kernel.tau * (nearest - z)).exp() as f32,
            }
        };
        let places = grid.whole().iter().map(place).collect();
        let mut splatter = Self { places, table, size, weights: Vec::new() };
        splatter.weights = splatter.splat(&vec![[1.0]; grid.whole().voxels()]).into_flattened();
        Ok(splatter)
    }

    /// The sums of value times weight, in a picture with a margin.
    fn splat<const CHANNELS: usize>(&self, values: &[[f32; CHANNELS]]) -> Vec<[f32; CHANNELS]> {
        let (side, [width, height]) = (self.table.side, self.size.map(|n| n + self.table.side));
        let mut picture = vec![[0.0; CHANNELS]; width * height];
        let there = self.places.iter().zip(values).filter(|(place, _)| place.start != OUTSIDE);
        for (place, value) in there.filter(|(_, value)| **value != [0.0; CHANNELS]) {
            let (footprint, value) =
                (self.table.footprint(place.footprint as usize), value.map(|v| v * place.attenuation));
            for (row, weights) in footprint.chunks_exact(side).enumerate() {
                let line = &mut picture[place.start as usize + row * width..][..side];
                for (pixel, weight) in line.iter_mut().zip(weights) {
                    pixel.iter_mut().zip(value).for_each(|(sum, value)| *sum += value * weight);
                }
            }
        }
        picture
    }

    /// The weighted mean without the margin; NaN is background.
    fn mean<const CHANNELS: usize>(&self, sums: &[[f32; CHANNELS]]) -> Vec<[f32; CHANNELS]> {
        let threshold = BACKGROUND * self.weights.iter().copied().fold(0.0, f32::max);
        let (reach, [width, height]) = (self.table.side / 2, self.size);
        let row = |y: usize| (y + reach) * (width + self.table.side) + reach;
        let mean = |i: usize| {
            let weight = self.weights[i];
            if weight < threshold { [f32::NAN; CHANNELS] } else { sums[i].map(|sum| sum / weight) }
        };
        (0..height).flat_map(|y| (row(y)..row(y) + width).map(mean)).collect()
    }
}

/// The footprint for every position of a voxel within a pixel.
struct Table {
    /// Pixels a side, odd; the voxel is in the middle one.
    side: usize,
    weights: Vec<f32>,
}

impl Table {
    /// Of a Gaussian of `sigma` pixels, cut at a square of `radius` standard deviations.
    fn new(sigma: f64, radius: f64) -> Self {
        let reach = (radius * sigma).ceil() as usize;
        let side = 2 * reach + 1;
        let line = |position: usize| {
            let centre = reach as f64 + (position as f64 + 0.5) / POSITIONS as f64;
            let gaussian = move |pixel: usize| (-0.5 * ((pixel as f64 + 0.5 - centre) / sigma).powi(2)).exp();
            (0..side).map(gaussian).collect::<Vec<f64>>()
        };
        let lines: Vec<Vec<f64>> = (0..POSITIONS).map(line).collect();
        let footprint = |y: &Vec<f64>, x: &Vec<f64>| {
            y.iter().flat_map(|a| x.iter().map(move |b| (a * b) as f32)).collect::<Vec<f32>>()
        };
        let weights = lines.iter().flat_map(|y| lines.iter().flat_map(move |x| footprint(y, x))).collect();
        Self { side, weights }
    }

    fn footprint(&self, position: usize) -> &[f32] {
        let pixels = self.side * self.side;
        &self.weights[position * pixels..][..pixels]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_voxel_is_a_gaussian_in_the_middle() {
        let view = View { azimuth: 0.0, elevation: 0.0, roll: 0.0, size: [9; 2], scale: Some(2.0), center: None };
        let kernel = Kernel::for_grid(&Grid::unit([1; 3]));
        let splatter = Splatter::new(&Grid::unit([1; 3]), &view, kernel, 2.0).expect("a view");
        let (reach, width) = (splatter.table.side / 2, 9 + splatter.table.side);
        assert_eq!(reach, 3, "two sigma of one and a half pixels");
        let sums = splatter.splat(&[[10.0]]);
        let at = |x: usize, y: usize| sums[(y + reach) * width + x + reach][0];
        // The voxel is at 4.5, the table's position nearest to it at 4.5 + 1/64.
        let weight = |d: f64| (-0.5 * ((d - 1.0 / 64.0) / 1.5).powi(2)).exp();
        for (x, d) in [(4, 0.0), (6, 2.0), (2, -2.0)] {
            assert!((f64::from(at(x, 4)) - 10.0 * weight(d) * weight(0.0)).abs() < 1e-5, "column {x}: {}", at(x, 4));
        }
        assert_eq!((at(0, 4), at(8, 4)), (0.0, 0.0), "cut");
        let mean = splatter.mean(&sums);
        assert!((mean[4 * 9 + 4][0] - 10.0).abs() < 1e-5 && mean[0][0].is_nan());
    }
}
