//! Reports of a rendering: its pictures, counts and times.

use serde::Serialize;
use wavesplat_core::base::system::Instant;
use wavesplat_core::view::camera::{Camera, View};

/// A finished picture: `width * height` pixels, row by row, each with [`Pixel::numbers`](super::Pixel::numbers)
/// numbers.
pub type Picture<'a> = &'a [f32];

/// A rendered frame.
#[derive(Debug, Clone, Copy)]
pub struct Rendered<'a> {
    /// The reports of all views.
    pub views: &'a [ViewReport],
    /// Index of the view.
    pub view: usize,
    /// Number of the frame.
    pub frame: usize,
    /// The picture in the requested quantity.
    pub picture: Picture<'a>,
    /// The error bound of every pixel, in the same unit, if pictures are certified. For projections, the reference is the picture of the
    /// source's samples, splatted without a cut and without rounding, and NaN is background. For composites and surfaces it is one number a pixel, which
    /// bounds light and opacity; the reference is the same drawing of the source's samples, without rounding and with no ray ended early.
    pub error: Option<Picture<'a>>,
}

/// The counts, errors and times of a rendering.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RenderReport {
    /// Number of frames rendered from every view; of pictures if each view shows its own frame.
    pub frames: usize,
    /// How each view was splatted.
    pub views: Vec<ViewReport>,
    /// Blocks in the scene, over all windows and channels touched. This and the following counts of blocks and tiles
    /// include a block or tile again for each frame batch, each group of views and each sweep of a certified picture of light.
    pub blocks: u64,
    /// Blocks that were decoded; repeated decoding counts again.
    pub blocks_read: u64,
    /// Blocks left out because they hold nothing in the region.
    pub blocks_empty: u64,
    /// Blocks left out because no pixel of any view sees them.
    pub blocks_outside: u64,
    /// Blocks left out because they are so deep that their contribution is within the splat error.
    pub blocks_dimmed: u64,
    /// Blocks left out of composites and largest values because no value near them is visible, or they hold nothing.
    pub blocks_transparent: u64,
    /// Blocks left out of composites because opaque values hide them in all frames of a batch, or no pixel sees them.
    pub blocks_hidden: u64,
    /// The parts that a looser tolerance left out of the blocks in the region, over all windows touched.
    pub left_out: LeftOut,
    /// The parts that were not read because only unrequested frames or finer levels of
    /// detail need them.
    pub other_frames: LeftOut,
    /// Error bound of every splatted sample against the source.
    pub certified_sample_error: f64,
    /// The root mean square of the expected errors of all views; NaN unless the pictures are projections.
    pub expected_error: f64,
    /// The largest error bound of any pixel, if pictures are certified.
    pub certified_error: Option<f64>,
    /// Stored bytes of blocks that were read, without those of the tiers above them.
    pub bytes_read: u64,
    /// The largest number of bytes that a view planned to use, of [`RenderConfig::memory`](super::RenderConfig).
    pub planned_bytes: u64,
    /// Nonzero coefficients splatted; repeated splatting counts again.
    pub coefficients: u64,
    /// Seconds spent on the sums of weights.
    pub weight_seconds: f64,
    /// Seconds spent reading and decoding.
    pub decode_seconds: f64,
    /// Seconds spent splatting.
    pub splat_seconds: f64,
    /// Seconds spent on pixels: gathering from the lattice, inverse transform and division by weights.
    pub inverse_seconds: f64,
    /// Seconds in total, without the sink.
    pub seconds: f64,
}

/// Counts of blocks and parts that are not read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Blocks that are skipped entirely.
    pub blocks: u64,
    /// Parts that are not read, including the parts of skipped blocks.
    pub parts: u64,
    /// Nonzero coefficients in these parts.
    pub coefficients: u64,
    /// Stored bytes of these parts.
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

/// The errors of some pixels of a view's first frame, against the field of the samples sampled finely along their rays.
/// They are an estimate of the errors of all pixels, without those of the samples.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Probed {
    /// Number of pixels.
    pub rays: usize,
    /// Root mean square of the largest difference of each pixel's numbers, in the unit of the pictures.
    pub rms: f64,
    /// The largest of all differences.
    pub largest: f64,
}

/// How a view was splatted.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ViewReport {
    /// Requested azimuth in degrees.
    pub azimuth: f64,
    /// Requested elevation in degrees.
    pub elevation: f64,
    /// Requested roll in degrees.
    pub roll: f64,
    /// Pixels per world unit.
    pub scale: f64,
    /// The world point in the middle of the picture.
    pub center: [f64; 3],
    /// Name of the splat method.
    pub method: &'static str,
    /// Number of slices that a ray crosses; `None` for projections.
    pub slices: Option<usize>,
    /// Cells of a slice per voxel across the ray; `None` for projections.
    pub cells: Option<usize>,
    /// The largest error that tabulating the transfer function makes in the light of one slice or a part of it, if there is one.
    pub table_error: Option<f64>,
    /// The errors of some pixels; `None` for projections, and if no ray of these meets the volume.
    pub probed: Option<Probed>,
    /// The stated error of the splat method, measured like the requested splat error.
    pub stated_splat_error: f64,
    /// Whether the stated error is only an estimate, for values without fine structures.
    pub splat_error_is_estimate: bool,
    /// Estimated root mean square error over the pixels that are not background, in the unit of the pictures, without
    /// the splat error.
    pub expected_error: f64,
}

impl RenderReport {
    /// Counts the error bounds of some pixels. NaN is background.
    pub(super) fn count_certified<'a>(&mut self, errors: impl IntoIterator<Item = &'a f32>) {
        let largest = errors.into_iter().map(|e| f64::from(*e)).fold(self.certified_error.unwrap_or(0.0), f64::max);
        self.certified_error = Some(largest);
    }

    /// Turns the sums over the frames of each view into root mean squares, and combines these into one for all views.
    pub(super) fn sum_up_expected_errors(&mut self, frames: usize) {
        let (frames, views) = (frames.max(1) as f64, self.views.len() as f64);
        self.views.iter_mut().for_each(|view| view.expected_error = (view.expected_error / frames).sqrt());
        let squares: f64 = self.views.iter().map(|view| view.expected_error * view.expected_error).sum();
        self.expected_error = (squares / views).sqrt();
    }
}

impl ViewReport {
    /// The report of a view before anything is rendered.
    pub(super) fn new(view: &View, camera: &Camera) -> Self {
        let &View { azimuth, elevation, roll, .. } = view;
        Self { azimuth, elevation, roll, scale: camera.scale, center: camera.beside(0.0), ..Self::default() }
    }
}

/// Adds the seconds since `clock` to a stage, and restarts the clock.
pub(super) fn lap(clock: &mut Instant, stage: &mut f64) {
    *stage += clock.elapsed().as_secs_f64();
    *clock = Instant::now();
}
