//! What is splatted: a scene gives the terms of its blocks, whatever they are made of.
//!
//! Coefficients, decoded samples and the frames of an archive are all sums over voxels of amounts in planes, and a
//! linear map from planes to frames. That is all the rest of the renderer knows of them.

use super::RenderConfig;
pub(super) use super::splat::Order;
use crate::error::Result;
use crate::sample::{self, SampleType};
use crate::volume::{BlockGrid, Grid, Region};
use crate::wavelet::Lane;
use serde::Serialize;

/// Something to render.
pub trait Scene {
    /// The lattice.
    fn grid(&self) -> &Grid;

    /// How the lattice is cut into blocks.
    fn blocks(&self) -> BlockGrid;

    /// Number of frames, if it is known before they are read.
    fn frames(&self) -> Option<usize>;

    /// Where the frames end that can be rendered together with `frame`.
    fn group_end(&self, frame: usize) -> usize;

    /// An upper bound of the planes that `frames` frames of a group need.
    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize;

    /// An upper bound of the bytes that one block takes while its terms are made.
    fn block_bytes(&self, config: &RenderConfig) -> usize;

    /// Opens some frames of one group, ascending.
    fn group(&mut self, frames: &[usize], config: &RenderConfig) -> Result<Box<dyn Group + '_>>;
}

/// Some frames that are rendered together.
pub trait Group: Sync {
    /// How the planes are used.
    fn layout(&self) -> Layout;

    /// The blocks that touch `region` and have terms.
    fn blocks(&self, region: &Region) -> Result<Contents>;

    /// The terms of a block.
    fn terms(&self, block: usize) -> Result<Terms>;

    /// The frames at some pixels from their planes: the inverse transform (eq 8). Overwrites `planes`.
    fn reconstruct(&self, planes: &mut [Lane], frames: &mut [Lane]);

    /// How far the samples may be from the source's, besides what the terms in error planes say.
    fn errors(&self) -> &SampleErrors;

    /// An error if what was read changed meanwhile.
    fn finish(&self) -> Result<()>;
}

/// The blocks of a group.
#[derive(Debug, Default)]
pub struct Contents {
    /// Those that have terms, ascending.
    pub blocks: Vec<usize>,
    /// How many others hold nothing in the region.
    pub empty: u64,
    /// What a looser tolerance leaves out of all.
    pub left_out: LeftOut,
}

/// What a looser tolerance leaves out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Blocks of which nothing is read.
    pub blocks: u64,
    /// Parts that are not read, those of such blocks included.
    pub parts: u64,
    /// Nonzero coefficients in them.
    pub coefficients: u64,
    /// Stored bytes of them.
    pub bytes: u64,
}

impl std::ops::AddAssign for LeftOut {
    fn add_assign(&mut self, other: Self) {
        self.blocks += other.blocks;
        self.parts += other.parts;
        self.coefficients += other.coefficients;
        self.bytes += other.bytes;
    }
}

/// What is known of the errors of a group's samples.
#[derive(Debug, Clone, Default)]
pub struct SampleErrors {
    /// `factors[plane][frame]`: how much the sums of an error plane count in a frame.
    pub factors: Vec<Vec<f64>>,
    /// What holds for all samples of a frame.
    pub frames: Vec<FrameBounds>,
}

/// What holds for all samples of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameBounds {
    /// No sample is further off.
    pub error: f64,
    /// A range that holds the source's samples; out of order if all are missing.
    pub range: (f64, f64),
    /// No sample is made of terms whose absolute values sum to more.
    pub absolute_sum: f64,
}

/// The planes of a group, one after another: coefficients, then values of single frames, then weights of what is
/// missing in single frames and of what is missing in all of them, and last errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Planes of coefficients.
    pub coefficients: usize,
    /// Frames of the group.
    pub frames: usize,
    /// Whether values are splatted into single frames.
    pub values: bool,
    /// Whether anything is missing.
    pub absent: bool,
    /// Planes of errors; none unless pictures are certified.
    pub error_planes: usize,
    /// How tiles should keep the planes.
    pub order: Order,
}

impl Layout {
    /// The plane of the values of a frame.
    pub fn value(&self, frame: usize) -> usize {
        self.coefficients + frame
    }

    /// Number of planes whose sums are values.
    pub fn value_planes(&self) -> usize {
        self.coefficients + if self.values { self.frames } else { 0 }
    }

    /// The plane of the weights that are missing in a frame.
    pub fn absent(&self, frame: usize) -> usize {
        self.value_planes() + frame
    }

    /// The plane of the weights that are missing in all frames.
    pub fn absent_in_all(&self) -> usize {
        self.value_planes() + self.frames
    }

    /// The first plane of errors.
    pub fn first_error(&self) -> usize {
        self.value_planes() + if self.absent { self.frames + 1 } else { 0 }
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        self.first_error() + self.error_planes
    }
}

/// What a block adds to the planes: for each voxel in array order, some (plane, amount).
#[derive(Debug, Default)]
pub struct Terms {
    ends: Vec<u32>,
    planes: Vec<u16>,
    amounts: Vec<f64>,
    /// Nonzero coefficients among them.
    pub coefficients: u64,
    /// Stored bytes that were read for them.
    pub bytes_read: u64,
}

impl Terms {
    /// Without a voxel yet.
    pub fn new(bytes_read: u64) -> Self {
        Self { bytes_read, ..Self::default() }
    }

    /// One term of 1 in plane 0 for every voxel: what the weights are made of.
    pub fn ones(voxels: usize) -> Self {
        let mut terms = Self::default();
        for _ in 0..voxels {
            terms.add(0, 1.0);
            terms.end_voxel();
        }
        terms
    }

    /// Adds a term to the current voxel.
    pub fn add(&mut self, plane: usize, amount: f64) {
        self.planes.push(plane as u16);
        self.amounts.push(amount);
    }

    /// Adds errors of the current voxel, one for each error plane.
    pub(super) fn add_errors(&mut self, layout: &Layout, errors: &[f64]) {
        let planes = layout.first_error()..layout.planes();
        planes.zip(errors).filter(|(_, e)| **e > 0.0).for_each(|(plane, e)| self.add(plane, *e));
    }

    /// Goes on to the next voxel.
    pub fn end_voxel(&mut self) {
        self.ends.push(self.planes.len() as u32);
    }

    /// The planes and amounts of a voxel.
    pub fn of_voxel(&self, voxel: usize) -> (&[u16], &[f64]) {
        let start = if voxel == 0 { 0 } else { self.ends[voxel - 1] as usize };
        let range = start..self.ends[voxel] as usize;
        (&self.planes[range.clone()], &self.amounts[range])
    }

    /// Weights that are missing: in all frames of the window, or in those of the group that `absent` names.
    pub(super) fn add_absent(&mut self, layout: &Layout, in_all: bool, absent: impl Fn(usize) -> bool) {
        if in_all {
            self.add(layout.absent_in_all(), 1.0);
        } else {
            (0..layout.frames).filter(|f| absent(*f)).for_each(|f| self.add(layout.absent(f), 1.0));
        }
    }

    /// The terms of samples that are splatted frame by frame, each off by `errors`: `samples` holds `layout.frames`
    /// frames of as many voxels.
    pub fn of_samples(
        layout: &Layout,
        ty: SampleType,
        samples: &[u8],
        errors: &[f64],
        is_missing: impl Fn(usize, f64) -> bool,
    ) -> Self {
        let mut values = vec![0.0; samples.len() / ty.size()];
        sample::load(ty, samples, &mut values);
        let voxels = values.len() / layout.frames;
        let mut terms = Self::default();
        for voxel in 0..voxels {
            let missing = |f: usize| is_missing(f * voxels + voxel, values[f * voxels + voxel]);
            for f in (0..layout.frames).filter(|f| !missing(*f) && values[f * voxels + voxel] != 0.0) {
                terms.add(layout.value(f), values[f * voxels + voxel]);
            }
            if layout.absent {
                terms.add_absent(layout, false, missing);
            }
            terms.add_errors(layout, errors);
            terms.end_voxel();
        }
        terms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_follow_one_another() {
        let layout =
            Layout { coefficients: 5, frames: 3, values: true, absent: true, error_planes: 2, order: Order::Planes };
        assert_eq!((layout.value(0), layout.absent(0), layout.absent_in_all()), (5, 8, 11));
        assert_eq!((layout.first_error(), layout.planes()), (12, 14));
        let plain = Layout { values: false, absent: false, error_planes: 0, ..layout };
        assert_eq!(plain.planes(), 5);
    }

    #[test]
    fn missing_samples_take_weights_instead_of_values() {
        let layout =
            Layout { coefficients: 0, frames: 2, values: true, absent: true, error_planes: 0, order: Order::Planes };
        let samples: Vec<u8> = [f32::NAN, 1.0, 3.0, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let terms = Terms::of_samples(&layout, SampleType::F32, &samples, &[], |_, v| v.is_nan());
        assert_eq!(terms.of_voxel(0), (&[1u16, 2][..], &[3.0, 1.0][..]));
        assert_eq!(terms.of_voxel(1), (&[0u16, 1][..], &[1.0, 2.0][..]));
    }
}
