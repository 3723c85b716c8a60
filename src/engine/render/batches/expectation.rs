//! Estimates the errors of pixels from the mean square errors of blocks and the weights of a view.
//!
//! A pixel is the mean of its voxels by their weights w_i. Let s_i^2 be the mean square error of voxel i, and W = sum
//! of w_i. If errors are independent, the pixel's expected squared error is sum of w_i^2 s_i^2 / W^2. If the errors of
//! all voxels are equal, it is at most sum of w_i s_i^2 / W. Errors of neighbours are correlated, as if they were equal
//! within boxes of L voxels a side. Then F voxels count as one, and the error is between the two:
//!
//! ```text
//! expected squared error of g = sum of s_i^2 w_i / W min(1, F w_i / W)                                    (eq 27)
//! F = L L^2 (1 + n) / (L^2 + n)        n = 4 pi sigma^2, the voxels of a footprint
//! ```
//!
//! Along the ray, all L voxels of a box count as one. Across the ray, the voxels within a footprint count as one. In
//! the mean over pixels, w_i becomes a = 2 pi sigma^2 w_i pixels, and w_i^2 becomes half of a w_i. For the emission,
//! everything is multiplied by W^2. The estimate spreads a block's errors evenly over its voxels and treats missing
//! samples as present.

use crate::render::config::{Quantity, RenderConfig};
use std::f64::consts::PI;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::Camera;
use wavesplat_core::view::footprint::Footprint;

/// A view in which errors are estimated.
#[derive(Debug, Clone, Copy)]
pub struct Expectation<'a> {
    view: ViewWeights<'a>,
    quantity: Quantity,
    /// Number of pixels that are not background.
    pixels: f64,
    /// The mean square over these pixels of the error caused by an error of 1 in every sample.
    unit: f64,
    /// a / w.
    area: f64,
}

/// The voxels of a view, and the sums of their weights in its pixels.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct ViewWeights<'a> {
    pub(in crate::render) camera: &'a Camera,
    pub(in crate::render) footprint: &'a Footprint,
    pub(in crate::render) grid: &'a Grid,
    /// The voxels that are splatted.
    pub(in crate::render) clip: Region,
    pub(in crate::render) sums: &'a [f64],
    /// Pixels with a smaller sum are background.
    pub(in crate::render) threshold: f64,
}

impl ViewWeights<'_> {
    /// The sums of the pixels that are not background.
    fn shown(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().copied().filter(|sum| *sum >= self.threshold)
    }

    /// The sum at a point of the picture, or of the nearest pixel for points within reach of a footprint outside; at least
    /// the background threshold. `None` for other points.
    fn near(&self, point: [f64; 2]) -> Option<f64> {
        let (reach, size) = (self.footprint.reach, self.camera.size);
        let within = |a: usize| point[a] >= -reach && point[a] < size[a] as f64 + reach;
        let pixel = |a: usize| (point[a].max(0.0) as usize).min(size[a] - 1);
        let is_visible = within(0) && within(1) && self.threshold > 0.0;
        is_visible.then(|| self.sums[pixel(1) * size[0] + pixel(0)].max(self.threshold))
    }
}

/// The mean square over pixels of the error that a block causes if the mean square error of its samples is 1.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::render) struct BlockInfluence {
    /// For equal errors of all voxels.
    together: f64,
    /// For independent errors.
    apart: f64,
}

impl BlockInfluence {
    /// For equal errors of `alike` voxels each (F of eq 27).
    pub(in crate::render) fn for_alike(&self, alike: f64) -> f64 {
        if alike.is_finite() { (alike * self.apart).min(self.together) } else { self.together }
    }

    /// Whether the block influences no pixel.
    pub(in crate::render) fn is_nothing(&self) -> bool {
        self.together == 0.0
    }
}

impl<'a> Expectation<'a> {
    pub(in crate::render) fn new(view: ViewWeights<'a>, quantity: Quantity) -> Self {
        let (mut pixels, mut squares) = (0.0, 0.0);
        for sum in view.shown() {
            pixels += 1.0;
            squares += sum * sum;
        }
        let pixels: f64 = if pixels > 0.0 { pixels } else { 1.0 };
        let unit = if quantity == Quantity::Mean { 1.0 } else { squares / pixels };
        Self { area: view.footprint.area(), view, quantity, pixels, unit }
    }

    /// The mean square error over pixels if every sample has the error `error`.
    pub(in crate::render) fn allowed(&self, error: f64) -> f64 {
        error * error * self.unit
    }

    /// The influence of the block at `region`.
    pub(in crate::render) fn of_block(&self, region: &Region) -> BlockInfluence {
        let clip = region.intersect(&self.view.clip);
        let mut sum = BlockInfluence::default();
        let mut points = 0.0;
        for voxel in spread(&clip) {
            let one = self.of_voxel(voxel);
            points += 1.0;
            sum.together += one.together;
            sum.apart += one.apart;
        }
        let share = clip.voxels() as f64 / (self.pixels * f64::max(points, 1.0));
        BlockInfluence { together: sum.together * share, apart: sum.apart * share }
    }

    /// Eq 27 for one voxel, summed over pixels.
    fn of_voxel(&self, voxel: [usize; 3]) -> BlockInfluence {
        let ViewWeights { camera, footprint, grid, .. } = self.view;
        let [x, y, z] = camera.project(grid.position(voxel));
        let Some(sum) = self.view.near([x, y]) else { return BlockInfluence::default() };
        let weight = footprint.at_depth(z);
        let unit = if self.quantity == Quantity::Mean { 1.0 } else { sum * sum };
        let together = self.area * weight / sum * unit;
        BlockInfluence { together, apart: together * (0.5 * weight / sum) }
    }
}

/// F for boxes of `side` voxels: the number of voxels that count as one (eq 27). It is the same for all views.
pub(in crate::render) fn alike(config: &RenderConfig, grid: &Grid, side: f64) -> f64 {
    let footprint = footprint(config, grid);
    let across = (1.0 + footprint) / (1.0 + footprint / (side * side));
    side * across
}

/// n: the number of voxels in a footprint.
fn footprint(config: &RenderConfig, grid: &Grid) -> f64 {
    let (cell, sigma) = (grid.spacing.iter().product::<f64>(), config.kernel.sigma);
    4.0 * PI * sigma * sigma / libm::cbrt(cell * cell)
}

/// A sample of voxels that represents a region.
fn spread(region: &Region) -> impl Iterator<Item = [usize; 3]> + use<> {
    const A_SIDE: usize = 4;
    let dims = region.dims();
    let counts = if region.is_empty() { [0; 3] } else { dims.map(|n| n.min(A_SIDE)) };
    let start = region.start;
    let at = move |i: [usize; 3]| std::array::from_fn(|a| start[a] + (2 * i[a] + 1) * dims[a] / (2 * counts[a]));
    Region { start: [0; 3], end: counts }.iter().map(at)
}
