//! The plan of a frame batch of a coefficient file: which coefficients or values are splatted into which planes.

use crate::file::{CoefficientFile, FramesDrawn};
use crate::render::batches::{BatchRequest, Layout, Order};
use crate::render::config::RenderConfig;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::WantedFrames;
use wavesplat_core::wavelet::needed;
use wavesplat_format::Window;

/// The data of a file that are splatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SplatSource {
    /// The wavelet coefficients.
    Coefficients,
    /// The decoded samples of every frame: the conventional method.
    Samples,
}

impl Choice for SplatSource {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("coefficients", Self::Coefficients, "Splat coefficients once for all frames of a window"),
        ("direct", Self::Samples, "Splat every frame"),
    ];
}

/// The plan of a batch, made once before any block is read.
pub(super) struct BatchPlan {
    pub(super) what: SplatSource,
    pub(super) codec: WindowCodec,
    /// The frames, counted from the first frame of the window, and the coefficients that they need.
    pub(super) wanted: WantedFrames,
    /// The coefficients that the frames need, ascending.
    pub(super) kept: Vec<usize>,
    /// Whether planes hold the values of each frame instead of coefficients.
    pub(super) by_values: bool,
    /// Whether values of the requested frames are less work one by one than all frames at once.
    pub(super) few: bool,
    pub(super) layout: Layout,
}

impl BatchPlan {
    /// The plan for the frames of a request, which all belong to one window.
    pub(super) fn new(
        file: &CoefficientFile,
        what: SplatSource,
        window: u32,
        request: &BatchRequest<'_>,
    ) -> Result<Self> {
        let config = request.config;
        let first = file.window_range(window).start;
        let frames: Vec<usize> = request.frames.iter().map(|f| f - first).collect();
        let codec = file.codec(window)?;
        let wanted = WantedFrames::new(&codec, frames);
        let kept: Vec<usize> = (0..wanted.coefficients.len()).filter(|k| wanted.coefficients[*k]).collect();
        let few = few_asked(file, &codec, window, config);
        let by_values =
            what != SplatSource::Samples && !config.splats_errors() && (few || !config.mode.is_projection());
        let values = what == SplatSource::Samples || by_values;
        let layout = layout(file, &codec, window, request, values, kept.len());
        Ok(Self { what, codec, wanted, kept, by_values, few, layout })
    }

    /// The frames, and how their values are made.
    pub(super) fn drawn(&self) -> FramesDrawn<'_> {
        FramesDrawn { frames: &self.wanted.frames, by_coefficients: self.few }
    }
}

/// Number of error planes: one for the error that holds in every frame, and one for each level part that may be left
/// out.
pub(super) fn error_planes(config: &RenderConfig, levels: usize) -> usize {
    match (config.splats_errors(), config.allowed) {
        (false, _) => 0,
        (true, None) => 1,
        (true, Some(_)) => 1 + levels,
    }
}

/// Whether most coefficients of `series` series are nonzero. As measured, splatting all planes of a pixel at a time is
/// faster if more than about half are.
fn is_dense(window: &Window, series: usize) -> bool {
    window.pyramid.is_some() || 2 * window.coded > series as u64 * u64::from(window.coefficients)
}

/// The layout of a batch that needs `kept` coefficients, or if `values` the values of each frame instead.
fn layout(
    file: &CoefficientFile,
    codec: &WindowCodec,
    window: u32,
    request: &BatchRequest<'_>,
    values: bool,
    kept: usize,
) -> Layout {
    let BatchRequest { frames, channel, config, .. } = *request;
    let leaves = file.leaves_of(window, channel);
    let coded = codec.tiers() > 0 || leaves.iter().any(|leaf| leaf.coded > 0);
    let exact = leaves.iter().any(|leaf| leaf.exact > 0);
    let record = &file.metadata().windows[window as usize];
    let missing = file.has_missing(window);
    let is_dense = is_dense(record, file.channels() * file.grid.whole().voxels());
    Layout {
        coefficients: if values || !coded { 0 } else { kept },
        frames: frames.len(),
        values: values || exact || record.outliers > 0 || missing || file.keeps_sides(),
        absent: missing,
        error_planes: error_planes(config, codec.parts()),
        order: if values || is_dense { Order::Pixels } else { Order::Planes },
    }
}

/// Whether splatting the values of the requested frames is less work than splatting the coefficients that they need.
/// This counts all requested frames of the window, not those of a batch, since the size of a batch depends on the
/// memory.
fn few_asked(file: &CoefficientFile, codec: &WindowCodec, window: u32, config: &RenderConfig) -> bool {
    let range = file.window_range(window);
    let asked: Vec<usize> = config.frames.iter().filter(|f| range.contains(f)).map(|f| f - range.start).collect();
    are_few(asked.len(), needed(&codec.synthesis, &asked).into_iter().filter(|needed| *needed).count())
}

/// Whether so many frames are few beside the coefficients that they need.
pub(super) fn are_few(frames: usize, coefficients: usize) -> bool {
    COEFFICIENTS_FOR_A_VALUE * frames <= coefficients
}

/// As measured, values and coefficients take the same time for half as many frames as coefficients; for a quarter,
/// values take a fifth less.
const COEFFICIENTS_FOR_A_VALUE: usize = 4;
