//! Renders the planes of a batch of frames, from the blocks that they cut.

use super::PlanesView;
use crate::base::error::Result;
use crate::base::grid::{BlockGrid, Region};
use crate::render::report::{RenderReport, lap};
use crate::render::scene::FrameBatch;
use crate::render::slices::units::Units;
use crate::render::slices::values::samples;
use rayon::prelude::*;
use std::time::Instant;

/// Samples are decoded in these units, in which no 32-bit sample is out of range.
const UNITS: Units = Units { zero: 0.0, per: 1.0 / 16.0 };

/// A batch of frames, seen from one view.
pub(in crate::render) struct Cut<'a> {
    pub(in crate::render) view: &'a PlanesView,
    pub(in crate::render) blocks: BlockGrid,
    pub(in crate::render) batch: &'a dyn FrameBatch,
    /// Blocks to decode at a time.
    pub(in crate::render) at_a_time: usize,
}

/// The samples of a block in each frame; and what it held, for the report.
type Decoded = (Region, Vec<Vec<f32>>, [u64; 2]);

impl Cut<'_> {
    /// The pictures of all frames, one after another.
    pub(in crate::render) fn pictures(&self, report: &mut RenderReport) -> Result<Vec<f32>> {
        let frames = self.batch.layout().frames;
        let mut sums = vec![0.0; frames * self.view.camera.size.iter().product::<usize>()];
        self.add_missing(frames, &mut sums);
        let listed = self.batch.selection().blocks.iter().copied();
        let read: Vec<usize> = listed.filter(|block| self.view.needs(&self.blocks.region(*block))).collect();
        self.batch.fetch(&read)?;
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
