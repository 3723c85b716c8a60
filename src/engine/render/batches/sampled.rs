//! Modes that need the samples of blocks: how much fits in memory, and the loop over their batches.

use super::driver::{Job, for_each_batch};
use super::samples::SampleReader;
use super::scene::{FrameBatch, Scene};
use crate::render::config::RenderConfig;
use crate::render::report::RenderReport;
use std::cell::Cell;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::memory;
use wavesplat_core::base::progress::Progress;

/// The memory of a view whose blocks are decoded to samples.
pub(in crate::render) struct SampledView<'a> {
    pub(in crate::render) config: &'a RenderConfig,
    /// Bytes for a number of frames that are rendered together, without blocks.
    pub(in crate::render) frame_bytes: &'a dyn Fn(usize) -> usize,
}

impl SampledView<'_> {
    /// The least memory in bytes with which the view can be rendered.
    pub(in crate::render) fn least_memory(&self, scene: &dyn Scene) -> usize {
        let alone = self.own_bytes(scene, 1, 1);
        memory::least(|memory| alone + scene.shared_bytes(memory))
    }

    /// Renders all frames of one channel, as many at a time as fit. `render` renders a batch, and `give` takes what it returns.
    pub(in crate::render) fn render<P>(
        &self,
        scene: &mut dyn Scene,
        progress: &dyn Progress,
        report: &mut RenderReport,
        mut render: impl FnMut(&SampleReader<'_>, &mut RenderReport) -> Result<P>,
        mut give: impl FnMut(&[usize], P, &mut RenderReport) -> Result<()>,
    ) -> Result<()> {
        let (blocks, at_a_time) = (scene.blocks(), self.blocks_at_a_time(scene));
        let planned = Cell::new(0);
        let together = |scene: &dyn Scene, most: usize| {
            let bytes = |frames: usize| self.bytes(scene, frames, at_a_time);
            let together = (1..=most).rev().find(|n| bytes(*n) <= self.config.memory).unwrap_or(1);
            planned.set(planned.get().max(bytes(together)));
            together
        };
        let job = Job { config: self.config, together: &together, views: &[] };
        let render = |batch: &dyn FrameBatch, report: &mut RenderReport| {
            render(&SampleReader { batch, blocks, at_a_time, progress }, report)
        };
        for_each_batch(scene, job, report, render, |frames, channels, report| {
            channels.into_iter().next().map_or(Ok(()), |channel| give(frames, channel.pictures, report))
        })?;
        report.planned_bytes = report.planned_bytes.max(planned.get() as u64);
        Ok(())
    }

    fn blocks_at_a_time(&self, scene: &dyn Scene) -> usize {
        let fits = |blocks: &usize| self.bytes(scene, 1, *blocks) <= self.config.memory;
        (1..=rayon::current_num_threads()).rev().find(fits).unwrap_or(1)
    }

    /// Bytes to render `frames` frames together, with `blocks` blocks decoded at a time.
    fn bytes(&self, scene: &dyn Scene, frames: usize, blocks: usize) -> usize {
        let shared = scene.shared_bytes(self.config.memory);
        self.own_bytes(scene, frames, blocks) + shared
    }

    /// As [`Self::bytes`], without those that all blocks share.
    fn own_bytes(&self, scene: &dyn Scene, frames: usize, blocks: usize) -> usize {
        memory::FIXED + (self.frame_bytes)(frames) + blocks * block_bytes(scene, self.config, frames)
    }
}

/// Bytes of a decoded block, with its samples in all frames, and its coefficients if these are inverted.
fn block_bytes(scene: &dyn Scene, config: &RenderConfig, frames: usize) -> usize {
    let voxels = scene.blocks().region(0).voxels();
    let coefficients = scene.most_planes(frames, config).saturating_sub(2 * frames + 1);
    let inverted = if coefficients > 0 { (coefficients + 2 * frames) * size_of::<f64>() } else { 0 };
    scene.block_bytes(frames, config) + voxels * (frames * size_of::<f32>() + 2 * size_of::<f64>() + inverted)
}
