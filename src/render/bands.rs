//! Splats a batch into the pictures of some views, as many rows at a time as fit in memory. A band that needs more sums in
//! f64 than have room is splatted again, with fewer rows.

use super::plan::Budget;
use super::report::{RenderReport, lap};
use super::scene::FrameBatch;
use super::splat::{BandAccumulator, Pixels, ResolvedTile, splat};
use super::weights::WeightedView;
use crate::base::error::Result;
use std::ops::DerefMut;
use std::time::Instant;

/// Makes pixels of a view of the sums of a tile.
pub(super) type Finish<'a, T> = dyn Fn(usize, ResolvedTile<'_>, &mut Pixels<'_, T>) + Sync + 'a;

/// Splats all planes of a batch. `finish(view, tile, pixels)` makes pixels of the sums of a tile; a view has one buffer for
/// all its pictures.
pub(super) fn splat_bands<T: Send, P: DerefMut<Target = [T]>>(
    batch: &dyn FrameBatch,
    weighted: &[WeightedView<'_>],
    budget: &Budget<'_>,
    report: &mut RenderReport,
    (pictures, finish): (&mut [P], &Finish<'_, T>),
) -> Result<()> {
    let layout = batch.layout();
    let blocks = visible_blocks(batch, weighted, report);
    let (mut start, end) = (0, weighted[0].setup.camera.size[1]);
    while start < end {
        let plan = budget.band(&layout, start);
        let mut bands: Vec<_> = weighted
            .iter()
            .map(|view| BandAccumulator::new(view.setup, plan.rows.clone(), &layout).relative_to(view.weights.ones()))
            .collect();
        report.add_splatted(&splat(&mut bands, (&blocks, plan.blocks), &batch, &plan.room)?);
        report.planned_bytes = report.planned_bytes.max(budget.granted_bytes(&layout, &plan) as u64);
        budget.learn(&plan);
        if plan.room.is_exceeded() {
            continue; // with more room: fewer rows, or fewer blocks at a time
        }
        start = plan.rows.end;
        let mut clock = Instant::now();
        for (view, (band, pictures)) in bands.into_iter().zip(&mut *pictures).enumerate() {
            band.finish(pictures, |tile, rows| finish(view, tile, rows));
        }
        lap(&mut clock, &mut report.inverse_seconds);
    }
    Ok(())
}

/// The selected blocks that reach a pixel of any view. Counts the others in the report.
fn visible_blocks(batch: &dyn FrameBatch, weighted: &[WeightedView<'_>], report: &mut RenderReport) -> Vec<usize> {
    let all_rows = 0..weighted[0].setup.camera.size[1];
    let mut blocks = batch.selection().blocks.clone();
    let selected = blocks.len();
    blocks.retain(|b| weighted.iter().any(|view| view.setup.reaches(*b, &all_rows)));
    let reached = blocks.len();
    blocks.retain(|b| weighted.iter().any(|view| view.setup.sees(*b, &all_rows)));
    report.blocks_outside += (selected - reached) as u64;
    report.blocks_dimmed += (reached - blocks.len()) as u64;
    blocks
}
