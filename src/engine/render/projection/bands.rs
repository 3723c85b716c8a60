//! Splats a batch into the pictures of some views, as many pixels at a time as fit in memory. A band that needs more sums
//! in f64 than have room is splatted again, with fewer pixels.

use super::plan::Budget;
use super::weight_sums::WeightSums;
use crate::render::batches::{BlockReader, FrameBatch};
use crate::render::report::{RenderReport, lap};
use crate::render::splat::tile_rect::TileRect;
use crate::render::splat::{BandAccumulator, Pixels, ResolvedTile, splat};
use std::ops::DerefMut;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;

/// Views that are splatted together.
pub(super) struct ViewGroup<'a> {
    pub(super) weights: Vec<WeightSums<'a>>,
    pub(super) progress: &'a dyn Progress,
}

/// Makes pixels of a view of the sums of a tile.
pub(super) type Finish<'a, T> = dyn Fn(usize, ResolvedTile<'_>, &mut Pixels<'_, T>) + Sync + 'a;

impl ViewGroup<'_> {
    /// Splats all planes of a batch within a budget. `finish(view, tile, pixels)` makes pixels of the sums of a tile; a view has
    /// one buffer for all its pictures.
    pub(super) fn splat<T: Send, P: DerefMut<Target = [T]>>(
        &self,
        batch: &dyn FrameBatch,
        budget: &Budget<'_>,
        report: &mut RenderReport,
        pictures: &mut [P],
        finish: &Finish<'_, T>,
    ) -> Result<()> {
        let layout = batch.layout();
        let blocks = self.visible_blocks(batch, budget.size(), report);
        let mut left = vec![TileRect::whole(budget.size())];
        while let Some(rect) = left.pop() {
            let mut parts = budget.split(&layout, &rect).into_iter();
            let Some(rect) = parts.next() else { break };
            left.extend(parts.rev());
            let plan = budget.plan(&layout, rect);
            let mut bands: Vec<_> = self
                .weights
                .iter()
                .map(|view| BandAccumulator::new(view.setup, plan.rect.clone(), &layout).relative_to(view.ones()))
                .collect();
            let reader = BlockReader { source: &batch, at_a_time: plan.blocks, progress: self.progress };
            report.add_read(&splat(&mut bands, &blocks, &reader, &plan.room)?);
            report.planned_bytes = report.planned_bytes.max(budget.granted_bytes(&layout, &plan) as u64);
            budget.learn(&plan);
            if plan.room.is_exceeded() {
                left.push(plan.rect); // with more room: fewer pixels, or fewer blocks at a time
                continue;
            }
            let mut clock = Instant::now();
            for (view, (band, pictures)) in bands.into_iter().zip(&mut *pictures).enumerate() {
                band.finish(pictures, |tile, rows| finish(view, tile, rows));
            }
            lap(&mut clock, &mut report.inverse_seconds);
        }
        Ok(())
    }

    /// The selected blocks that reach a pixel of any view. Counts the others in the report.
    fn visible_blocks(&self, batch: &dyn FrameBatch, size: [usize; 2], report: &mut RenderReport) -> Vec<usize> {
        let whole = TileRect::whole(size);
        let mut blocks = batch.selection().blocks.clone();
        let selected = blocks.len();
        blocks.retain(|b| self.weights.iter().any(|view| view.setup.reaches(*b, &whole)));
        let reached = blocks.len();
        blocks.retain(|b| self.weights.iter().any(|view| view.setup.sees(*b)));
        // Those that share blocks above follow each other.
        self.weights[0].setup.blocks.sort_nested(&mut blocks);
        report.blocks_outside += (selected - reached) as u64;
        report.blocks_dimmed += (reached - blocks.len()) as u64;
        blocks
    }
}
