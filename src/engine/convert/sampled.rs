//! The bound of [Dobashi](wavesplat_core::bibliography), section 3.4: an estimate from random pixels, not a guarantee.
//!
//! The relative error of a pixel stays below the tolerance if all sample errors are below epsilon (eq 10). But g is
//! known only after rendering, so the mean of g at random pixels replaces it:
//!
//! ```text
//! |I^ - I| / I < epsilon(t_j) sum of w_i / sum of v_i w_i                                                 (eq 10)
//! epsilon(t_j) = tolerance * g(t_j)                                                                       (eq 11)
//! g = sum of v_i w_i / sum of w_i                                                                         (eq 12)
//! sum over j of the squared error of a series <= sum over j of epsilon(t_j)^2                             (eq 13)
//! ```
//!
//! The pixels lie on the three views along the axes, with tau = 0 and the default kernel. Samples may have any sign, so
//! the mean is that of |g|. delta is the root mean square of epsilon over the window's frames, and bounds every series
//! as in eq 23.
//!
//! Pixels darker than the mean may exceed the tolerance. So may single frames: eq 13 bounds only the sum over time.

use rayon::prelude::*;
use std::ops::Range;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::source::FrameWindow;
use wavesplat_core::view::footprint::{Kernel, Method};
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// The line of sight of a pixel in the view along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// The axis that the line is parallel to: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// The position of the line in voxels along x, y, z; the entry of its own axis is unused.
    pub at: [f64; 3],
}

/// `samples` random pixels on each of three faces, uniform over the cells of their voxels.
///
/// A pixel depends only on the seed and its number, in every version. Asking for more samples appends pixels.
pub fn pixels(dims: [usize; 3], samples: u32, seed: u64) -> Vec<Pixel> {
    let unit = |counter: u64| (xxh3_64_with_seed(&counter.to_le_bytes(), seed) >> 11) as f64 / (1u64 << 53) as f64;
    let number = 0..u64::from(samples);
    let pixel = |(n, axis): (u64, usize)| {
        let position = |a: usize| unit((n * 3 + axis as u64) * 3 + a as u64) * dims[a] as f64 - 0.5;
        Pixel { axis, at: std::array::from_fn(position) }
    };
    number.flat_map(|n| (0..3).map(move |axis| (n, axis))).map(pixel).collect()
}

/// A window of an archive, and how to read it.
pub(super) struct View<'a> {
    pub(super) window: &'a dyn FrameWindow,
    pub(super) grid: &'a Grid,
    pub(super) sample: SampleType,
    /// The value of missing samples.
    pub(super) missing_value: Option<f64>,
    /// The largest |sample|.
    pub(super) magnitude: f64,
}

impl View<'_> {
    /// delta (eq 11 and 13): the root mean square over the window's frames of `tolerance` times the mean of |g| at
    /// `pixels`.
    pub(super) fn bound(&self, tolerance: f64, pixels: &[Pixel]) -> Result<f64> {
        let kernel = Kernel::new(None, 0.0, self.grid)?;
        let scale = scale(self.magnitude);
        let mut squares = 0.0;
        for frame in 0..self.window.frames() {
            let look = |scratch: &mut Scratch, pixel: &Pixel| self.mean(frame, pixel, kernel.sigma, scale, scratch);
            let means: Result<Vec<_>> = pixels.par_iter().map_init(Scratch::default, look).collect();
            let epsilon = tolerance * mean_of_present(&means?);
            squares += epsilon * epsilon;
        }
        Ok(((squares / self.window.frames() as f64).sqrt() / scale).min(f64::MAX))
    }

    /// g of one frame at a pixel (eq 12), in units of 1 / `scale`; none if all samples there are missing.
    fn mean(&self, frame: usize, pixel: &Pixel, sigma: f64, scale: f64, scratch: &mut Scratch) -> Result<Option<f64>> {
        let line = Line::new(self.grid, pixel, sigma);
        let mut sums = Sums::default();
        for piece in pieces(&line.region) {
            scratch.bytes.resize(piece.voxels() * self.sample.size(), 0);
            scratch.values.resize(piece.voxels(), 0.0);
            self.window.read_box(frame, &piece, &mut scratch.bytes)?;
            sample::load(self.sample, &scratch.bytes, &mut scratch.values);
            sums.add(&line.weights(&piece), &scratch.values, scale, self.missing_value);
        }
        Ok((sums.weight > 0.0).then(|| sums.emission / sums.weight))
    }
}

/// The sample buffers of one worker, reused from line to line.
#[derive(Debug, Default)]
struct Scratch {
    bytes: Vec<u8>,
    values: Vec<f64>,
}

/// A power of two that scales samples of this magnitude to near 1, so that sums and squares neither overflow nor
/// underflow.
fn scale(magnitude: f64) -> f64 {
    libm::scalbn(1.0, if magnitude > 0.0 { -libm::ilogb(magnitude).clamp(-1000, 1000) } else { 0 })
}

/// The mean absolute value of the present values; 0 without any.
fn mean_of_present(values: &[Option<f64>]) -> f64 {
    let present = || values.iter().flatten();
    present().map(|g| g.abs()).sum::<f64>() / present().count().max(1) as f64
}

/// The voxels near a line of sight, and their weights: a product of one factor along each axis (eq 2).
struct Line {
    region: Region,
    factors: [Vec<f64>; 3],
}

impl Line {
    fn new(grid: &Grid, pixel: &Pixel, sigma: f64) -> Self {
        let axes: [_; 3] = std::array::from_fn(|a| match a == pixel.axis {
            true => (0..grid.dims[a], vec![1.0; grid.dims[a]]),
            false => factors(pixel.at[a], sigma / grid.spacing[a], grid.dims[a]),
        });
        let region = Region { start: axes.each_ref().map(|a| a.0.start), end: axes.each_ref().map(|a| a.0.end) };
        Self { region, factors: axes.map(|a| a.1) }
    }

    /// The factors of a piece of the region.
    fn weights(&self, piece: &Region) -> [&[f64]; 3] {
        std::array::from_fn(|a| {
            let first = piece.start[a] - self.region.start[a];
            &self.factors[a][first..first + piece.dims()[a]]
        })
    }
}

/// The Gaussian of the voxels near `centre` on an axis of `len` voxels, cut at the radius of the exact method; all
/// lengths in voxels.
fn factors(centre: f64, sigma: f64, len: usize) -> (Range<usize>, Vec<f64>) {
    let reach = Method::EXACT.radius * sigma;
    let first = (centre - reach).ceil().max(0.0) as usize;
    let end = ((centre + reach).floor() as usize + 1).min(len);
    let nearest = (centre.round().max(0.0) as usize).min(len - 1); // used even if voxels are far apart
    let range = first.min(nearest)..end.max(nearest + 1);
    let gauss = |i: usize| {
        let off = i as f64 - centre;
        libm::exp(-(off * off) / (2.0 * sigma * sigma))
    };
    (range.clone(), range.map(gauss).collect())
}

/// The number of voxels read together, to limit each worker's memory. Sums go row by row and do not depend on it.
const PIECE: usize = 1 << 13;

/// Splits a region into pieces of at most [`PIECE`] voxels, or of single rows.
fn pieces(region: &Region) -> impl Iterator<Item = Region> {
    let (region, [nx, ny, _]) = (*region, region.dims());
    let (rows, planes) = ((PIECE / nx).clamp(1, ny), (PIECE / (nx * ny)).max(1));
    let [_, y, z] = std::array::from_fn(|a| region.start[a]..region.end[a]);
    z.step_by(planes).flat_map(move |z| {
        y.clone().step_by(rows).map(move |y| Region {
            start: [region.start[0], y, z],
            end: [region.end[0], (y + rows).min(region.end[1]), (z + planes).min(region.end[2])],
        })
    })
}

/// The sums of eq 12 over samples that are not missing.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    emission: f64,
    weight: f64,
}

impl Sums {
    /// Adds samples, x fastest, then y, z, each times `scale`.
    fn add(&mut self, weights: &[&[f64]; 3], values: &[f64], scale: f64, missing_value: Option<f64>) {
        let [along_x, along_y, along_z] = weights;
        let rows = along_z.iter().flat_map(|z| along_y.iter().map(move |y| z * y));
        for (row, factor) in values.chunks_exact(along_x.len()).zip(rows) {
            let (mut emission, mut weight) = (0.0, 0.0);
            for (value, w) in row.iter().zip(*along_x) {
                let missing = sample::is_missing(*value, missing_value);
                emission += if missing { 0.0 } else { w * (value * scale) };
                weight += if missing { 0.0 } else { *w };
            }
            self.emission += factor * emission;
            self.weight += factor * weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_on_their_faces_and_stay() {
        let dims = [5, 1, 70];
        let many = pixels(dims, 4000, 3);
        assert_eq!(many[..300], pixels(dims, 100, 3));
        assert_ne!(many[..300], pixels(dims, 100, 4));
        for (a, len) in dims.into_iter().enumerate() {
            let len = len as f64;
            assert!(many.iter().all(|p| (-0.5..=len - 0.5).contains(&p.at[a])));
            let mean = many.iter().map(|p| (p.at[a] + 0.5) / len).sum::<f64>() / many.len() as f64;
            assert!((mean - 0.5).abs() < 0.01, "axis {a}: {mean}");
            assert_eq!(many.iter().filter(|p| p.axis == a).count(), 4000);
        }
        let first = many[0].at.map(|x| (x * 1e6).round());
        assert_eq!(first, [3_658_618.0, 352_658.0, 62_233_126.0], "the same for ever");
    }

    #[test]
    fn pieces_tile_a_region() {
        for dims in [[7, 5, 3], [40_000, 2, 2], [300, 200, 2], [9, 9, 900]] {
            let region = Region { start: [1, 2, 3], end: std::array::from_fn(|a| dims[a] + a + 1) };
            let (mut voxels, mut last) = (0, None);
            for piece in pieces(&region) {
                assert!(region.contains(&piece) && piece.voxels() <= PIECE.max(dims[0]));
                assert!(last.is_none_or(|l| l < (piece.start[2], piece.start[1])));
                last = Some((piece.start[2], piece.start[1]));
                voxels += piece.voxels();
            }
            assert_eq!(voxels, region.voxels(), "{dims:?}");
        }
    }

    #[test]
    fn sums_stay_in_range() {
        for magnitude in [5e-324, 1e-300, 1.0, 3.0, f64::MAX] {
            let scaled = magnitude * scale(magnitude);
            assert!((1e-24..1e24).contains(&scaled), "{magnitude:e} becomes {scaled:e}");
        }
        assert_eq!(scale(0.0), 1.0);
    }
}
