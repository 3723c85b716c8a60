//! The interface between the renderer and its data: a scene provides the values of its blocks.
//!
//! Coefficients, decoded samples and the frames of an archive all take the same form: values of voxels that are summed
//! in planes (eq 9), and a linear map from planes to frames (eq 8). The rest of the renderer knows nothing else about
//! them.

use super::expectation::Expectation;
use super::layout::Layout;
use super::overview::OverviewRequest;
use super::plane_values::BlockPlanes;
use super::read::BlockSource;
use crate::render::config::{Limit, Mode, Quantity, RenderConfig, default_splat_error};
use crate::render::report::LeftOut;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::base::memory;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::view::camera::View;
use wavesplat_core::view::footprint::Kernel;
use wavesplat_core::wavelet::Lane;

/// A data source to render: a grid of voxels with a value in every frame, read block by block.
///
/// The library has two scenes: [`CoefficientScene`](crate::render::CoefficientScene) and
/// [`FrameScene`](crate::render::FrameScene). Another program can implement this trait for its own data with three types:
/// the scene, a [`FrameBatch`] and a block ([`BlockPlanes`]). If the planes of a scene are the values of its frames, the
/// batch returns [`Layout::of_values`] and [`Selection::of_all`], and its inverse copies.
pub trait Scene {
    /// The grid of voxels.
    fn grid(&self) -> &Grid;

    /// How the grid is cut into blocks.
    fn blocks(&self) -> BlockGrid;

    /// Number of channels: 1, or 3 if the samples are colours.
    fn channels(&self) -> usize {
        1
    }

    /// Number of frames; `None` if it is unknown until all are read.
    fn frames(&self) -> Option<usize>;

    /// The largest error of a sample as a share of the value range, if it is known. It determines the default splat
    /// error.
    fn tolerance(&self) -> Option<f64> {
        None
    }

    /// One past the last frame that can be rendered together with `frame`.
    fn batch_end(&self, frame: usize) -> usize;

    /// An upper bound of the number of planes for a batch of `frames` frames.
    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize;

    /// An upper bound of the memory of one decoded block for a batch of `frames` frames, in bytes.
    fn block_bytes(&self, frames: usize, config: &RenderConfig) -> usize;

    /// As [`Self::block_bytes`], for batches of some of these frames: a scene that knows their blocks can state less. The frames are
    /// all before the same [`Self::batch_end`]; the result takes the number of frames of a batch.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn block_bytes_of(&mut self, frames: &[usize], config: &RenderConfig) -> Result<Box<BlockBytes>> {
        let most = self.block_bytes(frames.len(), config);
        Ok(Box::new(move |_| most))
    }

    /// Bytes that all blocks share, within a memory budget.
    fn shared_bytes(&self, _memory: usize) -> usize {
        0
    }

    /// An overview: single samples of a few frames, channel after channel, frame after frame, x fastest; NaN for missing
    /// ones. `None`, the default, if the scene only reads whole blocks.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn overview(&mut self, _request: &OverviewRequest<'_>, _progress: &dyn Progress) -> Result<Option<Vec<f32>>> {
        Ok(None)
    }

    /// Opens one channel of a frame batch, and selects the blocks to read.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>>;
}

impl RenderConfig {
    /// The defaults: means of all frames of a scene, seen from one view.
    ///
    /// ```
    /// # mod wavesplat { pub use wavesplat_core::{base::error::Error, source, view}; pub use wavesplat_engine::render; }
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
            kernel: Kernel::for_grid(scene.grid()),
            quantity: Quantity::Mean,
            frames: (0..scene.frames().unwrap_or(0)).collect(),
            paired: false,
            region: None,
            splat_error: default_splat_error(scene.tolerance()),
            fast: false,
            allowed: None,
            error: Limit::Certified,
            certify: false,
            memory: memory::DEFAULT,
        }
    }
}

/// The memory of one decoded block for a batch of a number of frames, in bytes.
pub type BlockBytes = dyn Fn(usize) -> usize;

/// A request for frames to render together.
#[derive(Debug, Clone, Copy)]
pub struct BatchRequest<'a> {
    /// Frame numbers, ascending, all before the same [`Scene::batch_end`].
    pub frames: &'a [usize],
    /// Index of the channel; 0 unless samples are colours.
    pub channel: usize,
    /// The settings of the rendering.
    pub config: &'a RenderConfig,
    /// The views in which to estimate errors; empty unless pictures are projections.
    pub views: &'a [Expectation<'a>],
}

/// Frames that are rendered together. Several threads read the blocks of a batch.
pub trait FrameBatch: Sync {
    /// The meaning of each plane.
    fn layout(&self) -> Layout;

    /// The selected blocks.
    fn selection(&self) -> &Selection;

    /// Prepares to read these blocks next, the first ones first. A remote scene may ask for them at once; by default this does
    /// nothing.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn fetch(&self, _blocks: &[usize]) -> Result<()> {
        Ok(())
    }

    /// Reads a block: its values in each plane.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;

    /// The inverse transform (eq 8), from the planes of some pixels to their frames. Planes not listed in `used` are
    /// zero. The function takes at least [`Layout::planes`] lanes and fills [`Layout::frames`] lanes; a lane holds one
    /// number for each of [`LANES`](crate::render::LANES) pixels.
    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>>;

    /// Error bounds of the samples, to be combined with the sums of the error planes.
    fn errors(&self) -> &SampleErrors;

    /// Ends the batch and reports whether its layout sufficed.
    ///
    /// # Errors
    /// The input changed while it was read.
    fn finish(&self) -> Result<BatchOutcome>;
}

impl BlockSource for &dyn FrameBatch {
    fn fetch(&self, blocks: &[usize]) -> Result<()> {
        FrameBatch::fetch(*self, blocks)
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        FrameBatch::planes(*self, block)
    }
}

/// Computes the frames at some pixels (second argument) from all planes (first argument). May overwrite the planes.
pub type Inverse<'a> = dyn FnMut(&mut [Lane], &mut [Lane]) + 'a;

/// The outcome of a batch after its blocks are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BatchOutcome {
    /// The layout held everything that was read.
    Complete,
    /// The blocks needed planes that the layout lacks. Open and render the batch again; the new layout has them.
    NeedsRelayout,
}

/// What is known of a block before it is read.
#[derive(Debug, Clone, Copy)]
pub struct BlockRange {
    /// Index of the block.
    pub block: usize,
    /// A range that holds its samples as splatted; inverted if all are missing.
    pub range: (f64, f64),
    /// Error bound of its samples against the source. If the range is unknown, that of the frames counts as well.
    pub error: f64,
}

/// The blocks of a batch, selected once when it is opened.
#[derive(Debug, Default)]
pub struct Selection {
    /// Blocks that touch the region and add to a plane, ascending.
    pub blocks: Vec<usize>,
    /// For modes with slices: what is known of every block that touches the region. Empty for projections.
    pub ranges: Vec<BlockRange>,
    /// Number of blocks that hold nothing in the region.
    pub empty: u64,
    /// The parts that a looser tolerance leaves out.
    pub left_out: LeftOut,
    /// The parts that only unrequested frames or finer levels of detail need.
    pub other_frames: LeftOut,
    /// Error bound of every sample against the source, in the unit of samples.
    pub certified: f64,
    /// For each view of the request, the expected mean square over its pixels of the error that the samples cause.
    pub expected: Vec<f64>,
}

impl Selection {
    /// Selects all blocks that touch the region of the request, for scenes that know no values before they read them.
    pub fn of_all(blocks: BlockGrid, request: &BatchRequest<'_>) -> Self {
        let region = request.config.region.unwrap_or(Region { start: [0; 3], end: blocks.dims });
        let touching: Vec<usize> = blocks.touching(&region).collect();
        let range = (f64::NEG_INFINITY, f64::INFINITY);
        let ranged = if request.config.mode.is_projection() { &[][..] } else { &touching };
        Self {
            ranges: ranged.iter().map(|block| BlockRange { block: *block, range, error: 0.0 }).collect(),
            empty: (blocks.len() - touching.len()) as u64,
            blocks: touching,
            expected: vec![0.0; request.views.len()],
            ..Self::default()
        }
    }
}

/// Error bounds of a batch's samples.
#[derive(Debug, Clone, Default)]
pub struct SampleErrors {
    /// `factors[plane][frame]`: the factor of an error plane's sums in a frame.
    pub factors: Vec<Vec<f64>>,
    /// Bounds for all samples of each frame.
    pub frames: Vec<FrameBounds>,
}

/// Bounds for all samples of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameBounds {
    /// The largest error of any sample.
    pub error: f64,
    /// A range that holds the source's samples; inverted if all are missing.
    pub range: (f64, f64),
    /// The largest sum of absolute terms of any sample.
    pub absolute_sum: f64,
}

/// The rounding of the inverse transform, as a share of the sum of absolute terms. It has at most ten levels of up to
/// seven products each, and its intermediate sums are at most a few hundred times larger than the terms.
pub(in crate::render) const INVERSE: f64 = 1.0 / (1u64 << 36) as f64;

impl FrameBounds {
    /// The rounding of any sample.
    pub(in crate::render) fn rounding(&self) -> f64 {
        INVERSE * self.absolute_sum
    }
}
