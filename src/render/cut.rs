//! Planes through the volume: every frame batch block by block, one view after another.

use super::composite::block_bytes;
use super::config::RenderConfig;
use super::driver::{Job, for_each_batch};
use super::planes::PlanesView;
use super::report::{RenderReport, Rendered, lap};
use super::scene::{FrameBatch, Scene};
use super::slices::units::Units;
use super::slices::values::samples;
use crate::base::error::Result;
use crate::base::grid::{BlockGrid, Region};
use crate::base::memory;
use crate::base::progress::Progress;
use rayon::prelude::*;
use std::time::Instant;

/// Samples are decoded in these units, in which no 32-bit sample is out of range.
const UNITS: Units = Units { zero: 0.0, per: 1.0 / 16.0 };

/// Renders all frames from all views. Progress counts pictures.
pub(super) fn cut(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    views: &[PlanesView],
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    progress.start(Some((views.len() * config.frames.len()) as u64));
    let (blocks, at_a_time) = (scene.blocks(), blocks_at_a_time(scene, config, views));
    for (number, view) in views.iter().enumerate() {
        let config = RenderConfig { region: Some(view.needed()), ..config.clone() };
        let fits = |scene: &dyn Scene, frames| needed(scene, &config, view, (frames, at_a_time)) <= config.memory;
        let together = |scene: &dyn Scene, most: usize| (1..=most).rev().find(|n| fits(scene, *n)).unwrap_or(1);
        let job = Job { config: &config, together: &together, views: &[] };
        let render =
            |batch: &dyn FrameBatch, report: &mut RenderReport| Cut { view, blocks, batch, at_a_time }.pictures(report);
        for_each_batch(scene, job, report, render, |frames, channels, _| {
            progress.advance(frames.len() as u64);
            let all = channels[0].pictures.chunks_exact(view.camera.size.iter().product());
            frames.iter().zip(all).try_for_each(|(frame, picture)| {
                sink(Rendered { views: &[], view: number, frame: *frame, picture, error: None })
            })
        })?;
    }
    Ok(())
}

/// The least memory in bytes with which any of the views can be rendered.
pub(super) fn least(scene: &dyn Scene, config: &RenderConfig, views: &[PlanesView]) -> usize {
    views.iter().map(|view| needed(scene, config, view, (1, 1))).max().unwrap_or(0)
}

/// Bytes to render `frames` frames together, with `blocks` blocks decoded at a time.
fn needed(scene: &dyn Scene, config: &RenderConfig, view: &PlanesView, (frames, blocks): (usize, usize)) -> usize {
    let pixels = view.camera.size.iter().product::<usize>();
    let pictures = frames * pixels * (size_of::<f64>() + size_of::<f32>());
    memory::FIXED + pictures + blocks * block_bytes(scene, config, frames)
}

fn blocks_at_a_time(scene: &dyn Scene, config: &RenderConfig, views: &[PlanesView]) -> usize {
    let fits = |blocks: &usize| views.iter().all(|view| needed(scene, config, view, (1, *blocks)) <= config.memory);
    (1..=rayon::current_num_threads()).rev().find(fits).unwrap_or(1)
}

/// A batch of frames, seen from one view.
struct Cut<'a> {
    view: &'a PlanesView,
    blocks: BlockGrid,
    batch: &'a dyn FrameBatch,
    at_a_time: usize,
}

/// The samples of a block in each frame; and what it held, for the report.
type Decoded = (Region, Vec<Vec<f32>>, [u64; 2]);

impl Cut<'_> {
    /// The pictures of all frames, one after another.
    fn pictures(&self, report: &mut RenderReport) -> Result<Vec<f32>> {
        let frames = self.batch.layout().frames;
        let mut sums = vec![0.0; frames * self.view.camera.size.iter().product::<usize>()];
        self.add_missing(frames, &mut sums);
        let listed = self.batch.selection().blocks.iter().copied();
        let read: Vec<usize> = listed.filter(|block| self.view.needs(&self.blocks.region(*block))).collect();
        for blocks in read.chunks(self.at_a_time) {
            let mut clock = Instant::now();
            self.batch.fetch(blocks)?;
            let all = blocks.par_iter().map(|block| self.decode(*block, frames)).collect::<Result<Vec<_>>>()?;
            lap(&mut clock, &mut report.decode_seconds);
            for (region, samples, held) in &all {
                let sample = |frame: usize, voxel: usize| f64::from(samples[frame][voxel]);
                self.view.add(region, frames, sample, &mut sums);
                report.blocks_read += 1;
                report.coefficients += held[0];
                report.bytes_read += held[1];
            }
            lap(&mut clock, &mut report.splat_seconds);
        }
        Ok(self.finish(frames, &sums))
    }

    /// Marks the pixels that need samples of blocks without any.
    fn add_missing(&self, frames: usize, sums: &mut [f64]) {
        let ranges = self.batch.selection().ranges.iter();
        let listed = &self.batch.selection().blocks;
        let is_missing = |block: &usize, (lo, hi): &(f64, f64)| lo > hi && listed.binary_search(block).is_err();
        for (block, _) in ranges.filter(|(block, range)| is_missing(block, range)) {
            self.view.add(&self.blocks.region(*block), frames, |_, _| f64::NAN, sums);
        }
    }

    fn decode(&self, block: usize, frames: usize) -> Result<Decoded> {
        let planes = self.batch.planes(block)?;
        let samples = samples(self.batch, planes.as_ref(), &vec![UNITS; frames])?;
        Ok((self.blocks.region(block), samples, planes.held()))
    }

    /// The pictures, frame after frame, with a background.
    fn finish(&self, frames: usize, sums: &[f64]) -> Vec<f32> {
        let [width, height] = self.view.camera.size;
        let mut pictures = vec![f32::NAN; frames * width * height];
        for (pixel, sums) in sums.chunks_exact(frames.max(1)).enumerate() {
            if self.view.shows([pixel % width, pixel / width]) {
                let values = sums.iter().map(|sum| (sum / UNITS.per) as f32);
                values.enumerate().for_each(|(frame, value)| pictures[frame * width * height + pixel] = value);
            }
        }
        pictures
    }
}
