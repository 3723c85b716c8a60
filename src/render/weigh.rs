//! Computes the sums of weights of a view: splats a 1 for every voxel in the same way as values (eq 12).

use super::certificate;
use super::config::{BACKGROUND, Quantity, RenderConfig};
use super::layout::{Layout, Order};
use super::plan::Budget;
use super::plane_values::{BlockPlanes, BlockSource, UnitValues};
use super::splat::reference_weights::ReferenceWeights;
use super::splat::{BandAccumulator, DoubleRoom, FilteredCells, Pixels, ResolvedTile, ViewSetup, splat};
use super::weights::{WeightedView, Weights};
use crate::base::error::Result;
use crate::base::grid::{BlockGrid, Region};
use crate::view::footprint::{Footprint, Method};
use crate::wavelet::{LANES, Lane};
use rayon::prelude::*;

/// Computes the sums of weights of a view.
pub(super) fn weigh<'a>(setup: &'a ViewSetup, config: &RenderConfig, budget: &Budget<'_>) -> Result<WeightedView<'a>> {
    let by = |method: Method| Footprint::new(config.kernel, &setup.grid, setup.camera.scale, method);
    let (sums, cells) = sums(setup, budget)?;
    let largest = sums.iter().copied().fold(0.0, f64::max);
    let mut weights =
        Weights { size: setup.camera.size, threshold: BACKGROUND * largest, sums, cells, ..Weights::default() };
    if config.quantity == Quantity::Mean && setup.method != Method::EXACT {
        let exact = by(Method::EXACT)?;
        let reference = ReferenceWeights::new(setup, &exact);
        judge_background(&mut weights, &|pixel| reference.at(pixel), setup.stated_error * reference.most());
    }
    if config.certify {
        let whole = ViewSetup { footprint: by(certificate::WHOLE)?, ..setup.clone() };
        weights.beyond = self::sums(&whole, budget)?.0;
        certificate::leave_beyond(&whole, &weights.sums, &mut weights.beyond);
    }
    Ok(WeightedView { setup, weights })
}

/// Computes the sums of weights of a part of the voxels, without a background: that depends on all parts.
pub(super) fn weigh_part<'a>(setup: &'a ViewSetup, budget: &Budget<'_>) -> Result<WeightedView<'a>> {
    let (sums, cells) = sums(setup, budget)?;
    Ok(WeightedView { setup, weights: Weights { size: setup.camera.size, sums, cells, ..Weights::default() } })
}

/// The weights of a view from `sums` that were added over parts. The parts hold the voxels of `boxes`.
pub(super) fn weights_of_parts(
    setup: &ViewSetup,
    config: &RenderConfig,
    (sums, boxes): (Vec<f64>, &[Region]),
) -> Result<Weights> {
    let largest = sums.iter().copied().fold(0.0, f64::max);
    let mut weights = Weights { size: setup.camera.size, threshold: BACKGROUND * largest, sums, ..Weights::default() };
    if config.quantity == Quantity::Mean && setup.method != Method::EXACT {
        let exact = Footprint::new(config.kernel, &setup.grid, setup.camera.scale, Method::EXACT)?;
        let clipped: Vec<ViewSetup> = boxes.iter().map(|clip| ViewSetup { clip: *clip, ..setup.clone() }).collect();
        let of_boxes: Vec<_> = clipped.iter().map(|setup| ReferenceWeights::new(setup, &exact)).collect();
        let uncut = |pixel: [usize; 2]| of_boxes.iter().map(|of_box| of_box.at(pixel)).sum();
        let most = ReferenceWeights::new(setup, &exact).most();
        judge_background(&mut weights, &uncut, setup.stated_error * most);
    }
    Ok(weights)
}

/// Makes the background the same for every splat method: replaces sums by uncut sums wherever the difference may decide
/// whether a pixel is background.
///
/// The error of a sum is at most `near`. So this computes the largest sum of the view again, without a cut, and then all
/// sums near the threshold that follows from it. `uncut` gives the sum of a pixel without a cut.
fn judge_background(weights: &mut Weights, uncut: &(dyn Fn([usize; 2]) -> f64 + Sync), near: f64) {
    let pixel = |at: usize| [at % weights.size[0], at / weights.size[0]];
    let brighter = |best: usize, at: usize| if weights.sums[at] > weights.sums[best] { at } else { best };
    let largest = uncut(pixel((0..weights.sums.len()).fold(0, brighter)));
    let threshold = BACKGROUND * largest;
    let mut sums = weights.sums.clone();
    sums.par_iter_mut().enumerate().for_each(|(at, sum)| {
        if (*sum - threshold).abs() <= near {
            *sum = uncut(pixel(at));
        }
    });
    (weights.threshold, weights.reference) = (threshold, sums);
}

/// The sums of weights of all pixels, as splatted by the setup, and the cells of a lattice.
fn sums(setup: &ViewSetup, budget: &Budget<'_>) -> Result<(Vec<f64>, Option<FilteredCells>)> {
    let layout =
        Layout { coefficients: 1, frames: 1, values: false, absent: false, error_planes: 0, order: Order::Planes };
    let (mut out, mut cells) = (vec![0.0; setup.pixels()], None);
    let (mut start, end) = (0, setup.camera.size[1]);
    let blocks: Vec<usize> = setup.blocks.touching(&setup.clip).collect();
    while start < end {
        // The cells of a lattice are kept whole.
        let is_whole = setup.backend.is_lattice();
        let plan = if is_whole { budget.plan(&layout, 0..end) } else { budget.band(&layout, start) };
        let mut accumulator = BandAccumulator::new(setup, plan.rows.clone(), &layout);
        let blocks = (&blocks[..], plan.blocks);
        splat(std::slice::from_mut(&mut accumulator), blocks, &Ones(&setup.blocks), &DoubleRoom::new(1))?;
        accumulator.finish(&mut out, |mut tile, pixels| put_first_plane(&mut tile, pixels));
        cells = accumulator.into_filtered();
        start = plan.rows.end;
    }
    Ok((out, cells))
}

/// A 1 for every voxel of a block.
struct Ones<'a>(&'a BlockGrid);

impl BlockSource for Ones<'_> {
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        Ok(Box::new(UnitValues(self.0.region(block).voxels())))
    }
}

fn put_first_plane(tile: &mut ResolvedTile<'_>, pixels: &mut Pixels<'_, f64>) {
    let rect = tile.rect;
    if tile.used().is_empty() {
        return;
    }
    let mut plane = Lane::default();
    for (y, at) in rect.y.clone().zip((0..).step_by(rect.x.len())) {
        for first in (0..rect.x.len()).step_by(LANES) {
            let count = LANES.min(rect.x.len() - first);
            tile.load(at + first, count, std::slice::from_mut(&mut plane));
            pixels.put(0, [rect.x.start + first, y], &plane[..count]);
        }
    }
}
