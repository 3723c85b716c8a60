//! What a rendering did.

use super::scene::{LeftOut, Selection};
use super::splat::{SplatStats, ViewSetup};
use crate::view::camera::View;
use serde::Serialize;
use std::time::Instant;

/// A finished picture: as many numbers as the scene has channels for each of `width * height` pixels, row by row.
pub type Picture<'a> = &'a [f32];

/// A frame as it was rendered.
#[derive(Debug, Clone, Copy)]
pub struct Rendered<'a> {
    /// How all views are splatted.
    pub views: &'a [ViewReport],
    /// The number of the view.
    pub view: usize,
    /// That of the frame.
    pub frame: usize,
    /// The quantity asked for.
    pub picture: Picture<'a>,
    /// If pictures are certified, a bound on the error of every pixel, in the same unit: against the picture of the
    /// source's samples splatted without a cut and without rounding. NaN is background.
    pub error: Option<Picture<'a>>,
}

/// What a rendering did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RenderReport {
    /// Frames rendered, of every view.
    pub frames: usize,
    /// How each view was splatted.
    pub views: Vec<ViewReport>,
    /// Blocks that the scene holds, over all windows touched and their channels; as what follows up to the parts, each time counted that frames
    /// are rendered together, from views that are.
    pub blocks: u64,
    /// Blocks that were decoded, each time counted.
    pub blocks_read: u64,
    /// Blocks left out because they hold nothing in the region.
    pub blocks_empty: u64,
    /// Blocks left out because no pixel of any view sees them.
    pub blocks_outside: u64,
    /// Blocks left out because they lie so deep that what they add is within the splat error.
    pub blocks_dimmed: u64,
    /// Tiles of all slabs, of every group of frames.
    pub tiles: u64,
    /// Those among them that are clear whatever their blocks hold.
    pub tiles_clear: u64,
    /// Tiles of pictures that became opaque in all frames of a group, so that what is behind was left out.
    pub tiles_opaque: u64,
    /// What a looser tolerance left out of the blocks in the region, over all windows touched.
    pub left_out: LeftOut,
    /// What of these blocks was not read because it is of frames that were not asked for.
    pub other_frames: LeftOut,
    /// No sample that was splatted is further from the source's.
    pub certified_sample_error: f64,
    /// Of all views, the root mean square of what each view reports; NaN unless these are projections.
    pub expected_error: f64,
    /// The largest error that a pixel may have, if pictures are certified.
    pub certified_error: Option<f64>,
    /// Stored bytes that were read of blocks.
    pub bytes_read: u64,
    /// Nonzero coefficients splatted, each time counted.
    pub coefficients: u64,
    /// Seconds spent on the sums of weights.
    pub weight_seconds: f64,
    /// Seconds spent reading and decoding.
    pub decode_seconds: f64,
    /// Seconds spent splatting.
    pub splat_seconds: f64,
    /// Seconds spent on pixels: from a lattice, by the inverse transform and the division by weights.
    pub inverse_seconds: f64,
    /// Seconds from beginning to end, without the sink.
    pub seconds: f64,
}

/// How a view was splatted.
#[derive(Debug, Clone, Serialize)]
pub struct ViewReport {
    /// Degrees, as asked for.
    pub azimuth: f64,
    /// Degrees, as asked for.
    pub elevation: f64,
    /// Degrees, as asked for.
    pub roll: f64,
    /// Pixels per world unit.
    pub scale: f64,
    /// The world point in the middle of the picture.
    pub center: [f64; 3],
    /// The splat method.
    pub method: &'static str,
    /// The slabs that the volume is cut into.
    pub slabs: Option<usize>,
    /// Its stated error, in the terms of the splat error that was asked for.
    pub stated_splat_error: f64,
    /// An estimate of the root mean square, over the pixels that are not background, of their errors, but for those of
    /// splatting; in the pictures' unit.
    pub expected_error: f64,
}

impl RenderReport {
    /// Adds the blocks of a batch.
    pub(super) fn add_selection(&mut self, blocks: usize, selection: &Selection) {
        self.blocks += blocks as u64;
        self.blocks_empty += selection.empty;
        self.left_out += selection.left_out;
        self.other_frames += selection.other_frames;
        self.certified_sample_error = self.certified_sample_error.max(selection.certified);
    }

    /// Adds what splatting took.
    pub(super) fn add_splatted(&mut self, stats: &SplatStats) {
        self.blocks_read += stats.blocks;
        self.coefficients += stats.coefficients;
        self.bytes_read += stats.bytes;
        self.decode_seconds += stats.decode.as_secs_f64();
        self.splat_seconds += stats.splat.as_secs_f64();
    }

    /// Turns sums over the frames of each view into root mean squares, and all these into one.
    pub(super) fn sum_up_expected_errors(&mut self) {
        let (frames, views) = (self.frames.max(1) as f64, self.views.len() as f64);
        self.views.iter_mut().for_each(|view| view.expected_error = (view.expected_error / frames).sqrt());
        let squares: f64 = self.views.iter().map(|view| view.expected_error * view.expected_error).sum();
        self.expected_error = (squares / views).sqrt();
    }
}

impl ViewReport {
    /// Of a view that is cut into slabs, or is not; before anything is splatted.
    pub(super) fn new(view: &View, setup: &ViewSetup, slabs: Option<usize>) -> Self {
        let &View { azimuth, elevation, roll, .. } = view;
        let (scale, center) = (setup.camera.scale, setup.camera.beside(0.0));
        let (method, stated_splat_error) = (setup.method.name, setup.stated_error);
        let expected_error = if slabs.is_some() { f64::NAN } else { 0.0 };
        Self { azimuth, elevation, roll, scale, center, method, slabs, stated_splat_error, expected_error }
    }
}

/// Adds the seconds since `clock` to a stage, and restarts it.
pub(super) fn lap(clock: &mut Instant, stage: &mut f64) {
    *stage += clock.elapsed().as_secs_f64();
    *clock = Instant::now();
}
