//! The sums of weights that the weighted mean divides by, and the background.
//!
//! ```text
//! g = sum of v_i w_i / sum of w_i                                                                         (eq 12)
//! background: sum of w_i < 1 % of the largest sum in the view                                             (eq 16)
//! ```
//!
//! Both sums of eq 12 are splatted in the same way, so g is a mean whatever the splat leaves out. Eq 16 is judged by
//! uncut weights, so that the background does not depend on the splat. Missing samples have no weight; their weights
//! are taken away.

use super::accumulator::{self, BandAccumulator, Blocks, Pixels, ResolvedTile};
use super::certificate;
use super::plan::Budget;
use super::plane_values::{BlockPlanes, UnitValues};
use super::reference_weights::ReferenceWeights;
use super::sparse_terms::Layout;
use super::splat::Order;
use super::view_setup::{BACKGROUND, ViewSetup};
use super::{Quantity, RenderConfig, RenderReport};
use crate::base::error::Result;
use crate::base::grid::BlockGrid;
use crate::view::footprint::{Footprint, Method};
use crate::wavelet::LANES;
use rayon::prelude::*;

/// Of a pixel's weights this share must not be missing.
const LEAST_PRESENT: f64 = 1e-6;

/// The sums of weights of all voxels of a view.
#[derive(Debug, Default)]
pub(super) struct Weights {
    size: [usize; 2],
    /// With the footprints that values are splatted with, so that the quotient is a mean.
    sums: Vec<f64>,
    /// With uncut footprints, so that the background is the same for every splat method. Empty: the same sums.
    reference_weights: Vec<f64>,
    /// At least what lies beyond the cut. Empty: not asked for.
    beyond: Vec<f64>,
    threshold: f64,
}

/// A view, and its sums of weights.
#[derive(Debug)]
pub(super) struct WeightedView<'a> {
    pub(super) setup: &'a ViewSetup,
    pub(super) weights: Weights,
}

impl<'a> WeightedView<'a> {
    pub(super) fn new(setup: &'a ViewSetup, config: &RenderConfig, budget: &Budget<'_>) -> Result<Self> {
        Ok(Self { weights: Weights::new(setup, config, budget)?, setup })
    }

    /// Where nothing is weighed.
    pub(super) fn of_no_weights(setup: &'a ViewSetup) -> Self {
        Self { setup, weights: Weights::default() }
    }
}

/// The weights of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelWeight {
    /// C, as values are splatted.
    pub(super) sum: f64,
    reference_weights: f64,
    /// T, beyond the cut.
    pub(super) beyond: f64,
    threshold: f64,
}

impl PixelWeight {
    /// What a mean divides by, less weights that are missing; NaN in the background, and where so much is missing that
    /// rounding is what is left.
    pub(super) fn present(&self, absent: f64) -> f64 {
        let present = self.sum - absent;
        let enough = self.reference_weights - absent >= self.threshold && present > LEAST_PRESENT * self.sum;
        if enough { present } else { f64::NAN }
    }
}

impl Weights {
    /// Splats a 1 for every voxel.
    pub(super) fn new(setup: &ViewSetup, config: &RenderConfig, budget: &Budget) -> Result<Self> {
        let by = |method: Method| Footprint::new(config.kernel, &setup.grid, setup.camera.scale, method);
        let sums = sums(setup, budget)?;
        let largest = sums.iter().copied().fold(0.0, f64::max);
        let mut weights = Self { size: setup.camera.size, threshold: BACKGROUND * largest, sums, ..Self::default() };
        if config.quantity == Quantity::Mean && setup.method != Method::EXACT {
            weights.judge(&ReferenceWeights::new(setup, &by(Method::EXACT)?), setup.stated_error);
        }
        if config.certify {
            let whole = ViewSetup { footprint: by(certificate::WHOLE)?, ..setup.clone() };
            weights.beyond = self::sums(&whole, budget)?;
            certificate::leave_beyond(&whole, &weights.sums, &mut weights.beyond);
        }
        Ok(weights)
    }

    /// Sums that are off by less than this share of the largest anywhere become uncut ones where the difference may matter: for
    /// the largest here, and for those near what is then the threshold. Where others are as large but for such a share, the
    /// largest may be one of these, and the threshold off by a hundredth of that.
    fn judge(&mut self, reference_weights: &ReferenceWeights<'_>, off: f64) {
        let pixel = |at: usize| [at % self.size[0], at / self.size[0]];
        let brightest =
            (0..self.sums.len()).fold(0, |best, at| if self.sums[at] > self.sums[best] { at } else { best });
        let largest = reference_weights.at(pixel(brightest));
        let (threshold, near) = (BACKGROUND * largest, off * reference_weights.most());
        let mut sums = self.sums.clone();
        sums.par_iter_mut().enumerate().for_each(|(at, sum)| {
            if (*sum - threshold).abs() <= near {
                *sum = reference_weights.at(pixel(at));
            }
        });
        (self.threshold, self.reference_weights) = (threshold, sums);
    }

    /// The sums of the pixels that are not background.
    pub(super) fn shown(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().copied().filter(|sum| *sum >= self.threshold)
    }

    /// The sum at a place of the picture, and that of the nearest pixel up to `reach` pixels beside it; at least what is
    /// not background.
    pub(super) fn near(&self, place: [f64; 2], reach: f64) -> Option<f64> {
        let within = |a: usize| place[a] >= -reach && place[a] < self.size[a] as f64 + reach;
        let pixel = |a: usize| (place[a].max(0.0) as usize).min(self.size[a] - 1);
        let seen = within(0) && within(1) && self.threshold > 0.0;
        seen.then(|| self.sums[pixel(1) * self.size[0] + pixel(0)].max(self.threshold))
    }

    /// The weights of the pixel in a column and a row.
    pub(super) fn at(&self, [x, y]: [usize; 2]) -> PixelWeight {
        let at = y * self.size[0] + x;
        let sum = self.sums[at];
        let reference_weights = self.reference_weights.get(at).copied().unwrap_or(sum);
        PixelWeight {
            sum,
            reference_weights,
            beyond: self.beyond.get(at).copied().unwrap_or(0.0),
            threshold: self.threshold,
        }
    }
}

fn sums(setup: &ViewSetup, budget: &Budget) -> Result<Vec<f64>> {
    let layout = Layout {
        coefficients: 1,
        frames: 1,
        values: false,
        absent: false,
        error_planes: 0,
        lengths: false,
        order: Order::Planes,
    };
    let mut out = vec![0.0; setup.pixels()];
    for rows in budget.bands(&layout) {
        let blocks: Vec<usize> = setup.blocks.touching(&setup.clip).collect();
        let mut accumulator = BandAccumulator::new(setup, rows.clone(), &layout);
        let (batch, report) = (budget.batch(&layout, rows.len()), &mut RenderReport::default());
        accumulator::splat(std::slice::from_mut(&mut accumulator), &blocks, batch, &Ones(&setup.blocks), report)?;
        accumulator.finish(&mut out, |mut tile, pixels| put_first_plane(&mut tile, pixels));
    }
    Ok(out)
}

/// A 1 for every voxel of a block.
struct Ones<'a>(&'a BlockGrid);

impl Blocks for Ones<'_> {
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        Ok(Box::new(UnitValues(self.0.region(block).voxels())))
    }
}

fn put_first_plane(tile: &mut ResolvedTile<'_>, pixels: &mut Pixels<'_, f64>) {
    let place = tile.place;
    if tile.used().is_empty() {
        return;
    }
    for (y, at) in place.y.clone().zip((0..).step_by(place.x.len())) {
        for first in (0..place.x.len()).step_by(LANES) {
            let count = LANES.min(place.x.len() - first);
            pixels.put(0, [place.x.start + first, y], &tile.load_one(at + first, count)[..count]);
        }
    }
}
