//! Renders the planes of a batch of frames, from the blocks that they cut.

use super::PlanesView;
use crate::render::batches::{BlockRange, BlockSamples, SampleReader, Units};
use crate::render::report::RenderReport;
use wavesplat_core::base::error::Result;

/// Samples are decoded in these units, in which no 32-bit sample is out of range.
const UNITS: Units = Units { zero: 0.0, per: 1.0 / 16.0 };

/// A batch of frames, as one picture shows it.
pub(in crate::render) struct PlanesPass<'a> {
    /// The parts of the picture, at least one; all have its size, and none meets another one.
    pub(in crate::render) panels: &'a [PlanesView],
    pub(in crate::render) reader: &'a SampleReader<'a>,
}

impl PlanesPass<'_> {
    /// The pictures of all frames, one after another.
    pub(in crate::render) fn pictures(&self, report: &mut RenderReport) -> Result<Vec<f32>> {
        let (panels, SampleReader { batch, blocks, .. }) = (self.panels, self.reader);
        let frames = batch.layout().frames;
        let mut sums = vec![0.0; frames * panels[0].camera.size.iter().product::<usize>()];
        self.add_missing(frames, &mut sums);
        let listed = batch.selection().blocks.iter().copied();
        let is_needed = |block: &usize| panels.iter().any(|panel| panel.needs(&blocks.region(*block)));
        let needed: Vec<usize> = listed.filter(is_needed).collect();
        let stats = self.reader.read(&needed, &vec![UNITS; frames], |read: &[BlockSamples]| {
            for (region, samples) in read {
                let sample = |frame: usize, voxel: usize| f64::from(samples[frame][voxel]);
                panels.iter().for_each(|panel| panel.add(region, frames, sample, &mut sums));
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
            let region = blocks.region(known.block);
            self.panels.iter().for_each(|panel| panel.add(&region, frames, |_, _| f64::NAN, sums));
        }
    }

    /// The pictures, frame after frame, with a background.
    fn finish(&self, frames: usize, sums: &[f64]) -> Vec<f32> {
        let [width, height] = self.panels[0].camera.size;
        let mut pictures = vec![f32::NAN; frames * width * height];
        for (pixel, sums) in sums.chunks_exact(frames.max(1)).enumerate() {
            if self.panels.iter().any(|panel| panel.shows([pixel % width, pixel / width])) {
                let values = sums.iter().map(|sum| (sum / UNITS.per) as f32);
                values.enumerate().for_each(|(frame, value)| pictures[frame * width * height + pixel] = value);
            }
        }
        pictures
    }
}
