//! The samples of a block in every frame of a batch, from its planes.

use super::layout::Layout;
use super::plane_values::{BlockPlanes, PlaneValues, Scratch};
use super::read::{BlockAdder, BlockReader, ReadStats};
use super::scene::FrameBatch;
use super::units::Units;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Region};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::wavelet::{LANES, Lane};

/// Reads the samples of a batch's blocks.
pub(in crate::render) struct SampleReader<'a> {
    pub(in crate::render) batch: &'a dyn FrameBatch,
    pub(in crate::render) blocks: BlockGrid,
    /// Blocks to decode at a time.
    pub(in crate::render) at_a_time: usize,
    pub(in crate::render) progress: &'a dyn Progress,
}

/// The voxels of a block, and their samples in each frame.
pub(in crate::render) type BlockSamples = (Region, Vec<Vec<f32>>);

impl SampleReader<'_> {
    /// Reads blocks, with the samples of each frame in its units. `add` takes those that were read together, in order.
    pub(in crate::render) fn read(
        &self,
        blocks: &[usize],
        units: &[Units],
        add: impl FnMut(&[BlockSamples]) + Sync,
    ) -> Result<ReadStats> {
        let reader = BlockReader { source: &self.batch, at_a_time: self.at_a_time, progress: self.progress };
        reader.read(blocks, &mut SampleAdder { of: self, units, add })
    }

    /// The samples of a block in each frame, in the frame's units.
    pub(in crate::render) fn read_one(&self, block: usize, units: &[Units]) -> Result<Vec<Vec<f32>>> {
        self.progress.check()?;
        self.batch.fetch(&[block])?;
        samples(self.batch, self.batch.planes(block)?.as_ref(), units)
    }
}

struct SampleAdder<'a, F> {
    of: &'a SampleReader<'a>,
    units: &'a [Units],
    add: F,
}

impl<F: FnMut(&[BlockSamples]) + Sync> BlockAdder for SampleAdder<'_, F> {
    type Block<'b> = BlockSamples;

    fn prepare<'b>(&self, block: usize, planes: Box<dyn BlockPlanes + 'b>) -> Result<BlockSamples> {
        Ok((self.of.blocks.region(block), samples(self.of.batch, planes.as_ref(), self.units)?))
    }

    fn add(&mut self, blocks: &[BlockSamples]) -> Result<()> {
        (self.add)(blocks);
        Ok(())
    }
}

/// The samples of a block in each frame, in the frame's units; NaN is missing.
fn samples(batch: &dyn FrameBatch, block: &dyn BlockPlanes, units: &[Units]) -> Result<Vec<Vec<f32>>> {
    let (layout, scratch) = (batch.layout(), &mut Scratch::default());
    let mut frames = Vec::with_capacity(units.len());
    if layout.coefficients > 0 {
        let values = inverted(batch, block, scratch)?;
        let of_frames = values.chunks_exact(block.voxels()).zip(units);
        frames.extend(of_frames.map(|(values, units)| in_units(&PlaneValues::Double(values), block.voxels(), units)));
    } else {
        for (frame, units) in units.iter().enumerate() {
            let plane = if layout.values { block.plane(layout.value(frame), scratch)? } else { PlaneValues::Nothing };
            frames.push(in_units(&plane, block.voxels(), units));
        }
    }
    if layout.absent {
        remove_missing(layout, block, scratch, &mut frames)?;
    }
    Ok(frames)
}

/// The values of a plane in other units.
fn in_units(plane: &PlaneValues<'_>, voxels: usize, units: &Units) -> Vec<f32> {
    let mut out = vec![units.number(0.0); voxels];
    match plane {
        PlaneValues::Nothing => {}
        PlaneValues::Single(values) => dispatch!(convert(values, *units, &mut out[..])),
        PlaneValues::Double(values) => dispatch!(convert(values, *units, &mut out[..])),
        PlaneValues::Few(values) => {
            values.iter().for_each(|(voxel, value)| out[*voxel as usize] = units.number(*value));
        }
    }
    out
}

#[inline(always)]
fn convert<T: Copy + Into<f64>>(values: &[T], units: Units, out: &mut [f32]) {
    out.iter_mut().zip(values).for_each(|(out, value)| *out = units.number((*value).into()));
}

/// Replaces missing samples by NaN.
fn remove_missing(
    layout: Layout,
    block: &dyn BlockPlanes,
    scratch: &mut Scratch,
    frames: &mut [Vec<f32>],
) -> Result<()> {
    let remove = |samples: &mut Vec<f32>, voxel: usize| samples[voxel] = f32::NAN;
    let in_all = block.plane(layout.absent_in_all(), scratch)?;
    in_all.for_each(|voxel, _| frames.iter_mut().for_each(|samples| remove(samples, voxel)));
    for (frame, samples) in frames.iter_mut().enumerate() {
        block.plane(layout.absent(frame), scratch)?.for_each(|voxel, _| remove(samples, voxel));
    }
    Ok(())
}

/// The values of all frames, one frame after another, by the inverse transform (eq 8).
fn inverted(batch: &dyn FrameBatch, block: &dyn BlockPlanes, scratch: &mut Scratch) -> Result<Vec<f64>> {
    let (layout, voxels) = (batch.layout(), block.voxels());
    let mut planes = vec![0.0; layout.value_planes() * voxels];
    for (plane, values) in planes.chunks_exact_mut(voxels).enumerate() {
        block.plane(plane, scratch)?.add_to(1.0, values);
    }
    let used: Vec<usize> = (0..layout.value_planes()).collect();
    let (mut inverse, mut frames) = (batch.inverse(&used), vec![0.0; layout.frames * voxels]);
    let (mut lanes, mut out) = (vec![Lane::default(); layout.planes()], vec![Lane::default(); layout.frames]);
    for first in (0..voxels).step_by(LANES) {
        let count = LANES.min(voxels - first);
        lanes.fill(Lane::default());
        for (lane, values) in lanes.iter_mut().zip(planes.chunks_exact(voxels)) {
            lane[..count].copy_from_slice(&values[first..first + count]);
        }
        inverse(&mut lanes, &mut out);
        for (lane, values) in out.iter().zip(frames.chunks_exact_mut(voxels)) {
            values[first..first + count].copy_from_slice(&lane[..count]);
        }
    }
    Ok(frames)
}
