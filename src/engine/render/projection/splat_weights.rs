//! Computes the sums of weights of a view: splats a 1 for every voxel in the same way as values (eq 12).

use super::certificate;
use super::plan::Budget;
use super::weight_sums::WeightSums;
use crate::render::batches::{BlockPlanes, BlockReader, BlockSource, Layout, Order, UnitValues};
use crate::render::config::RenderConfig;
use crate::render::splat::tile_rect::TileRect;
use crate::render::splat::{BandAccumulator, DoubleRoom, FilteredCells, Pixels, ResolvedTile, ViewSetup, splat};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::BlockGrid;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::view::footprint::Footprint;
use wavesplat_core::wavelet::{LANES, Lane};

/// Splats the weights of a view.
pub(super) fn splat_weights<'a>(
    setup: &'a ViewSetup,
    config: &RenderConfig,
    budget: &Budget<'_>,
) -> Result<WeightSums<'a>> {
    let mut weights = splat_part_weights(setup, budget)?.with_background(config, &[setup.clip])?;
    if config.certify {
        let footprint = Footprint::new(config.kernel, &setup.grid, setup.camera.scale, certificate::WHOLE)?;
        let whole = ViewSetup { footprint, ..setup.clone() };
        weights.beyond = splat_ones(&whole, budget)?.0;
        certificate::leave_beyond(&whole, &weights.sums, &mut weights.beyond);
    }
    Ok(weights)
}

/// Splats the weights of a part of the voxels. They have no background: that depends on all parts.
pub(super) fn splat_part_weights<'a>(setup: &'a ViewSetup, budget: &Budget<'_>) -> Result<WeightSums<'a>> {
    let (sums, cells) = splat_ones(setup, budget)?;
    Ok(WeightSums::new(setup, sums, cells))
}

/// The sums of weights of all pixels, as splatted by the setup, and the cells of a lattice.
fn splat_ones(setup: &ViewSetup, budget: &Budget<'_>) -> Result<(Vec<f64>, Option<FilteredCells>)> {
    let layout =
        Layout { coefficients: 1, frames: 1, values: false, absent: false, error_planes: 0, order: Order::Planes };
    let (mut out, mut cells) = (vec![0.0; setup.pixels()], None);
    let blocks: Vec<usize> = setup.blocks.touching(&setup.clip).collect();
    let whole = TileRect::whole(setup.camera.size);
    // The cells of a lattice are kept whole.
    let bands = if setup.backend.is_lattice() { vec![whole] } else { budget.split(&layout, &whole) };
    for band in bands {
        let plan = budget.plan(&layout, band);
        let mut accumulator = BandAccumulator::new(setup, plan.rect, &layout);
        let reader = BlockReader { source: &Ones(&setup.blocks), at_a_time: plan.blocks, progress: &Silent };
        splat(std::slice::from_mut(&mut accumulator), &blocks, &reader, &DoubleRoom::new(1))?;
        accumulator.finish(&mut out, |mut tile, pixels| put_first_plane(&mut tile, pixels));
        cells = accumulator.into_filtered();
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
