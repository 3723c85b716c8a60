//! What is splatted: a scene gives the terms of its blocks.
//!
//! Coefficients, decoded samples and the frames of an archive are all sums over voxels of amounts in planes (eq 9), and
//! a linear map from planes to frames (eq 8). The rest of the renderer knows no more of them.

use super::config::RenderConfig;
use super::expectation::Expectation;
use super::layout::Layout;
use super::plane_values::BlockPlanes;
use crate::base::error::Result;
use crate::base::grid::{BlockGrid, Grid};
use crate::wavelet::Lane;
use serde::Serialize;

/// Something to render.
pub trait Scene {
    /// The lattice.
    fn grid(&self) -> &Grid;

    /// How the lattice is cut into blocks.
    fn blocks(&self) -> BlockGrid;

    /// Numbers of a pixel: 1, or of colours 3.
    fn channels(&self) -> usize {
        1
    }

    /// Number of frames, if it is known before they are read.
    fn frames(&self) -> Option<usize>;

    /// One past the last frame that can be rendered together with `frame`.
    fn batch_end(&self, frame: usize) -> usize;

    /// An upper bound of the planes that `frames` frames of a group need.
    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize;

    /// An upper bound of the bytes that one block takes.
    fn block_bytes(&self) -> usize;

    /// Opens one channel of some frames, and decides which blocks are read.
    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>>;
}

/// Frames that are to be rendered together.
#[derive(Debug, Clone, Copy)]
pub struct BatchRequest<'a> {
    /// Frame numbers, ascending, all before the same [`Scene::batch_end`].
    pub frames: &'a [usize],
    /// The channel: 0 unless samples are colours.
    pub channel: usize,
    /// How to render.
    pub config: &'a RenderConfig,
    /// The views, for errors that are expected in them; none of composites.
    pub views: &'a [Expectation<'a>],
}

/// Some frames that are rendered together.
pub trait FrameBatch: Sync {
    /// How the planes are used.
    fn layout(&self) -> Layout;

    /// The blocks that are read.
    fn selection(&self) -> &Selection;

    /// What a block adds to the planes.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;

    /// What gives the frames at some pixels from their planes, of which all but `used` are zero: the inverse transform (eq 8).
    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>>;

    /// How far the samples may be from the source's, besides what the terms in error planes say.
    fn errors(&self) -> &SampleErrors;

    /// What was found on the way; an error if what was read changed meanwhile.
    fn finish(&self) -> Result<BatchOutcome>;
}

/// The frames at some pixels from all planes. Overwrites these.
pub(super) type Inverse<'a> = dyn FnMut(&mut [Lane], &mut [Lane]) + 'a;

/// What reading a batch found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BatchOutcome {
    /// Nothing else than its layout has room for.
    Complete,
    /// More than that: it must be opened and rendered again, and will then have room.
    NeedsRelayout,
}

/// The blocks of a batch, chosen once when it is opened.
#[derive(Debug, Default)]
pub struct Selection {
    /// Blocks that touch the region and add to a plane, ascending.
    pub blocks: Vec<usize>,
    /// Of composites: every block that touches the region, and a range that holds its samples as they are splatted; out
    /// of order if all are missing. Empty for projections.
    pub ranges: Vec<(usize, (f64, f64))>,
    /// Blocks that hold nothing in the region.
    pub empty: u64,
    /// What a looser tolerance leaves out.
    pub left_out: LeftOut,
    /// What is only of frames that are not asked for.
    pub other_frames: LeftOut,
    /// No sample is further from the source's, in the samples' unit.
    pub certified: f64,
    /// For each view of the request, the mean square over its pixels that the samples' errors are expected to come to.
    pub expected: Vec<f64>,
}

/// What need not be read of blocks.
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

/// What is known of the errors of a batch's samples.
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
