//! Renders the planes of a batch of frames, from the blocks that they cut.

use super::PlanesView;
use crate::render::batches::{BlockRange, BlockSamples, SampleReader, Units};
use crate::render::report::RenderReport;
use wavesplat_core::base::error::Result;

/// Samples are decoded in these units, in which no 32-bit sample is out of range.
const UNITS: Units = Units { zero: 0.0, per: 1.0 / 16.0 };

/// A batch of frames, seen from one view.
pub(in crate::render) struct PlanesPass<'a> {
    pub(in crate::render) view: &'a PlanesView,
    pub(in crate::render) reader: &'a SampleReader<'a>,
}

impl PlanesPass<'_> {
    /// The pictures of all frames, one after another.
    pub(in crate::render) fn pictures(&self, report: &mut RenderReport) -> Result<Vec<f32>> {
        let (view, SampleReader { batch, blocks, .. }) = (self.view, self.reader);
        let frames = batch.layout().frames;
        let mut sums = vec![0.0; frames * view.camera.size.iter().product::<usize>()];
        self.add_missing(frames, &mut sums);
        let listed = batch.selection().blocks.iter().copied();
        let needed: Vec<usize> = listed.filter(|block| view.needs(&blocks.region(*block))).collect();
        let stats = self.reader.read(&needed, &vec![UNITS; frames], |read: &[BlockSamples]| {
            for (region, samples) in read {
                let sample = |frame: usize, voxel: usize| f64::from(samples[frame][voxel]);
                view.add(region, frames, sample, &mut sums);
            }
        })?;
        report.add_read(&stats);
        Ok(self.finish(frames, &sums))
    }

    /// Marks the pixels that need samples of blocks without any.
    fn add_missing(&self, frames: usize, sums: &mut [f64]) {
        let SampleReader { batch, blocks, .. } = self.reader;
        let ranges = batch.selection().ranges.iter();
        let listed = &batch.selection().blocks;
        let is_missing =
            |known: &&BlockRange| known.range.0 > known.range.1 && listed.binary_search(&known.block).is_err();
        for known in ranges.filter(is_missing) {
            self.view.add(&blocks.region(known.block), frames, |_, _| f64::NAN, sums);
        }
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
