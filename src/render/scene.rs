//! What is splatted: a scene gives the values of its blocks, whatever they are made of.
//!
//! Coefficients, decoded samples and the frames of an archive are all sums over voxels of values in planes, and a
//! linear map from planes to frames. That is all the rest of the renderer knows of them.

use super::config::{Limit, Mode, Quantity, RenderConfig, default_splat_error};
use super::expectation::Expectation;
use super::layout::Layout;
use super::plane_values::BlockPlanes;
use crate::base::error::Result;
use crate::base::grid::{BlockGrid, Grid, Region};
use crate::base::memory;
use crate::view::camera::View;
use crate::view::footprint::Kernel;
use crate::wavelet::Lane;
use serde::Serialize;

/// Something to render: a lattice of voxels with values in every frame, read block by block.
///
/// [`super::CoefficientScene`] and [`super::FrameScene`] come with the library. Another program implements this trait for
/// data of its own, with three types: the scene, a [`FrameBatch`] of it, and a block of that ([`BlockPlanes`]). A scene
/// whose planes are the values of its frames takes [`Layout::of_values`], [`Selection::of_any_values`], and an inverse that
/// copies.
pub trait Scene {
    /// The lattice of voxels in the world.
    fn grid(&self) -> &Grid;

    /// How the lattice is cut into blocks.
    fn blocks(&self) -> BlockGrid;

    /// Numbers of a pixel: 1, or of colours 3.
    fn channels(&self) -> usize {
        1
    }

    /// Number of frames, if it is known before they are read.
    fn frames(&self) -> Option<usize>;

    /// What samples may be off by, as a share of their value range, if that is known; the default splat error follows it.
    fn tolerance(&self) -> Option<f64> {
        None
    }

    /// One past the last frame that can be rendered together with `frame`.
    fn batch_end(&self, frame: usize) -> usize;

    /// An upper bound of the planes that `frames` frames of a batch need.
    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize;

    /// An upper bound of the bytes that one block takes while it is read.
    fn block_bytes(&self) -> usize;

    /// Opens one channel of some frames, and decides which blocks are read.
    ///
    /// # Errors
    /// Whatever keeps the scene from reading them; it ends the rendering.
    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>>;
}

impl RenderConfig {
    /// Means of all frames of a scene from one view, and the defaults of all else.
    ///
    /// ```
    /// use wavesplat::render::{FrameScene, Quantity, RenderConfig};
    /// use wavesplat::source::ArraySource;
    /// use wavesplat::view::camera::View;
    ///
    /// let source = ArraySource::from_f32([8, 8, 8], &[1.0; 2 * 8 * 8 * 8])?;
    /// let scene = FrameScene::new(Box::new(source), None);
    /// let emission = RenderConfig { quantity: Quantity::Emission, ..RenderConfig::new(&scene, View::new(30.0, 20.0)) };
    /// assert_eq!(emission.frames, [0, 1]);
    /// # Ok::<(), wavesplat::Error>(())
    /// ```
    pub fn new(scene: &dyn Scene, view: View) -> Self {
        Self {
            mode: Mode::Projection,
            views: vec![view],
            kernel: Kernel::of_grid(scene.grid()),
            quantity: Quantity::Mean,
            frames: (0..scene.frames().unwrap_or(0)).collect(),
            region: None,
            splat_error: default_splat_error(scene.tolerance()),
            allowed: None,
            limited: Limit::Certified,
            certify: false,
            memory: memory::DEFAULT,
        }
    }
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

/// Some frames that are rendered together. Several threads read its blocks.
pub trait FrameBatch: Sync {
    /// How the planes are used.
    fn layout(&self) -> Layout;

    /// The blocks that are read.
    fn selection(&self) -> &Selection;

    /// Prepares for these blocks, which [`Self::planes`] is asked for next: scenes far away read them together. By default
    /// nothing is done.
    fn fetch(&self, _blocks: &[usize]) -> Result<()> {
        Ok(())
    }

    /// What a block adds to the planes.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;

    /// A function from planes to frames at some pixels, for planes of which all but `used` are zero: the inverse transform
    /// (eq 8). It is given [`Layout::planes`] lanes or more, each with one plane's sums at [`LANES`](super::LANES) pixels, and
    /// fills [`Layout::frames`] lanes.
    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>>;

    /// How far the samples may be from the source's, besides what the terms in error planes say.
    fn errors(&self) -> &SampleErrors;

    /// What was found on the way.
    ///
    /// # Errors
    /// The data changed while they were read.
    fn finish(&self) -> Result<BatchOutcome>;
}

/// Frames at some pixels (second argument) from all planes there (first argument, which it may overwrite).
pub type Inverse<'a> = dyn FnMut(&mut [Lane], &mut [Lane]) + 'a;

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

impl Selection {
    /// All blocks that touch the region of a request, for scenes that know no values before they read them.
    pub fn of_any_values(blocks: BlockGrid, request: &BatchRequest<'_>) -> Self {
        let region = request.config.region.unwrap_or(Region { start: [0; 3], end: blocks.dims });
        let touching: Vec<usize> = blocks.touching(&region).collect();
        let any = (f64::NEG_INFINITY, f64::INFINITY);
        let ranged = if request.config.mode.is_projection() { &[][..] } else { &touching };
        Self {
            ranges: ranged.iter().map(|block| (*block, any)).collect(),
            empty: (blocks.len() - touching.len()) as u64,
            blocks: touching,
            expected: vec![0.0; request.views.len()],
            ..Self::default()
        }
    }
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
