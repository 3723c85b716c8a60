//! The samples of a block in every frame of a batch, from its planes.

use super::units::Units;
use crate::base::error::Result;
use crate::base::vectors::dispatch;
use crate::render::layout::Layout;
use crate::render::plane_values::{BlockPlanes, PlaneValues, Scratch};
use crate::render::scene::FrameBatch;
use crate::wavelet::{LANES, Lane};

/// The samples of a block in each frame, in the frame's units; NaN is missing.
pub(in crate::render) fn samples(
    batch: &dyn FrameBatch,
    block: &dyn BlockPlanes,
    units: &[Units],
) -> Result<Vec<Vec<f32>>> {
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
    let mut out = vec![units.of(0.0); voxels];
    match plane {
        PlaneValues::Nothing => {}
        PlaneValues::Single(values) => dispatch!(convert(values, *units, &mut out[..])),
        PlaneValues::Double(values) => dispatch!(convert(values, *units, &mut out[..])),
        PlaneValues::Few(values) => values.iter().for_each(|(voxel, value)| out[*voxel as usize] = units.of(*value)),
    }
    out
}

#[inline(always)]
fn convert<T: Copy + Into<f64>>(values: &[T], units: Units, out: &mut [f32]) {
    out.iter_mut().zip(values).for_each(|(out, value)| *out = units.of((*value).into()));
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
