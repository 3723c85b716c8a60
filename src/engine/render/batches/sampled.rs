//! Modes that need the samples of blocks: how much fits in memory, and the loop over their batches.

use super::driver::{Job, Share, for_each_batch};
use super::samples::SampleReader;
use super::scene::{BlockBytes, FrameBatch, Scene};
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
        let block_bytes = scene.block_bytes(1, self.config);
        let alone = self.own_bytes(scene, &move |_| block_bytes, 1, 1);
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
        let (blocks, planned) = (scene.blocks(), Cell::new(0));
        let together = |scene: &mut dyn Scene, frames: &[usize]| {
            let (share, bytes) = self.share(scene, frames)?;
            planned.set(planned.get().max(bytes));
            Ok(share)
        };
        let job = Job { config: self.config, together: &together, views: &[] };
        let render = |batch: &dyn FrameBatch, at_a_time: &usize, report: &mut RenderReport| {
            render(&SampleReader { batch, blocks, at_a_time: *at_a_time, progress }, report)
        };
        for_each_batch(scene, &job, report, render, |frames, channels, report| {
            channels.into_iter().next().map_or(Ok(()), |channel| give(frames, channel.pictures, report))
        })?;
        report.planned_bytes = report.planned_bytes.max(planned.get() as u64);
        Ok(())
    }

    /// How many blocks to decode at a time, how many of some frames to render together, and the bytes that they take.
    fn share(&self, scene: &mut dyn Scene, frames: &[usize]) -> Result<(Share<usize>, usize)> {
        let block_bytes = scene.block_bytes_of(frames, self.config)?;
        let (scene, shared) = (&*scene, scene.shared_bytes(self.config.memory));
        let bytes = |frames: usize, blocks: usize| self.own_bytes(scene, &block_bytes, frames, blocks) + shared;
        let fits = |frames: usize, blocks: usize| bytes(frames, blocks) <= self.config.memory;
        let blocks = (1..=rayon::current_num_threads()).rev().find(|blocks| fits(1, *blocks)).unwrap_or(1);
        let frames = (1..=frames.len()).rev().find(|frames| fits(*frames, blocks)).unwrap_or(1);
        Ok((Share { frames, memory: blocks }, bytes(frames, blocks)))
    }

    /// Bytes to render `frames` frames together, with `blocks` blocks decoded at a time, without those that all blocks share.
    fn own_bytes(&self, scene: &dyn Scene, block_bytes: &BlockBytes, frames: usize, blocks: usize) -> usize {
        let block = block_bytes(frames) + sample_bytes(scene, self.config, frames);
        memory::FIXED + (self.frame_bytes)(frames) + blocks * block
    }
}

/// Bytes of a block's samples in all frames, and of its coefficients if these are inverted.
fn sample_bytes(scene: &dyn Scene, config: &RenderConfig, frames: usize) -> usize {
    let voxels = scene.blocks().region(0).voxels();
    let coefficients = scene.most_planes(frames, config).saturating_sub(2 * frames + 1);
    let inverted = if coefficients > 0 { (coefficients + 2 * frames) * size_of::<f64>() } else { 0 };
    voxels * (frames * size_of::<f32>() + 2 * size_of::<f64>() + inverted)
}
