//! Renders a scene: splats the planes of a frame batch, then inverts every pixel.
//!
//! Splatting is linear, so it may come before the inverse transform along time, as in [Dobashi](crate::bibliography):
//!
//! ```text
//! I^(t_j) = sum over k of C_k u_k(t_j)                                                                    (eq 8)
//! C_k(x, y) = sum of c_{i,k} w_i(x, y)                                                                    (eq 9)
//! g = I / sum of w_i                                                                                      (eq 12)
//! ```
//!
//! A *plane* is the image of one k, or of one frame if decoded samples are splatted. It holds a sum for each pixel, or
//! for each cell of a lattice from which the pixels are computed. Coefficients are splatted once for all frames of a
//! window, and a new view needs no new conversion. Partial sums over any split of the voxels add up.
//!
//! Each module uses only the modules listed above it:
//!
//! ```text
//! light             lamps and surfaces; config: the caller's settings
//! layout            the planes of a batch; plane_values: a block's values, plane by plane
//! splat/            a view's camera and backend; blocks into bands; bands into tiles
//! weights           the divisors of means; expectation: the effect of block errors on the pixels of a view
//! overview          single samples of a few frames, for a first impression
//! scene             the source of blocks: a frame batch and the blocks selected for it
//! report            what a rendering did: counts, times and errors
//! scenes/           a coefficient file or an archive's frames as a scene
//! slices/           composites, isosurfaces and maximum intensity projections: the field along rays, slice by slice
//! planes/           planes through the volume: where rays meet them, and the samples there
//! plan              how much fits in memory
//! certificate       the error bound of a pixel; weigh: the weights of a view
//! reconstruct       planes to pixels: inverse transform, division, certificate
//! driver            the loop over frame batches; bands: rows of all pictures of a batch
//! project           the pictures of a batch as projections; composite: slice by slice; cut: planes through the volume
//! annotate/, sink/  text in pictures, and output files, with page/ for web pages; pictures: a rendering into files
//! setups            the setups of all views, and which mode renders them
//! sums              what a part of the voxels adds to pictures; parts/: files of such sums, and pictures of them
//! ```
//!
//! ```text
//! for each group of views                      plan: as many as fit in memory
//!   for each batch of frames of a window       driver: as many as fit; the scene selects its blocks
//!     for each band of rows
//!       for each run of blocks                 scene: read, decode                          (workers)
//!         add it to every plane of every view  splat: values -> cells or tiles              (one owner each)
//!       every tile inverts its pixels          reconstruct: planes -> frames, then / weights; certificate
//!     give the finished frames to the sink
//! ```
//!
//! Tiles splat the voxels directly (`splat::footprints`) if footprints are less work than the lattice, if the lattice
//! is not precise enough, or if pictures are certified. All planes of a view are splatted in the same way, weights and
//! missing samples included, so that means stay means. Composites and maximum intensity projections are not splatted:
//! `slices` samples the field along rays.

mod light;
mod config;
mod layout;
mod plane_values;
mod splat;
mod weights;
mod expectation;
mod overview;
mod scene;
mod report;
mod scenes;
mod slices;
pub mod planes;
mod plan;
mod certificate;
mod weigh;
mod reconstruct;
mod driver;
mod bands;
mod project;
mod composite;
mod cut;
pub mod annotate;
pub(crate) mod page;
pub mod sink;
mod pictures;
mod setups;
mod sums;
pub mod parts;

pub use crate::wavelet::{LANES, Lane};
pub use config::{Limit, Mode, Pixel, Plane, Quantity, RenderConfig, default_splat_error, splat_method};
pub use expectation::Expectation;
pub use layout::{Layout, Order};
pub use light::{Light, Surface};
pub use overview::{OverviewRequest, Thinning, stride};
pub use pictures::render_png;
pub use plane_values::{BlockPlanes, PlaneValues, Scratch};
pub use report::{Picture, Probed, RenderReport, Rendered, ViewReport};
pub use scene::{
    BatchOutcome, BatchRequest, FrameBatch, FrameBounds, Inverse, LeftOut, SampleErrors, Scene, Selection,
};
pub use scenes::{CoefficientScene, FrameScene, SplatSource};
pub use sums::{SumSink, Sums, render_sums};

use crate::base::error::Result;
use crate::base::progress::Progress;
use plan::Budget;
use setups::Setups;
use std::time::{Duration, Instant};

/// Renders all frames from all views, or each view's own frame ([`RenderConfig::paired`]), and gives each picture to
/// `sink`. The frames of one view come in order.
///
/// # Errors
/// Invalid settings, too little memory, failed reads, or an error of `sink`.
pub fn render(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let setups = Setups::new(scene, config)?;
    Budget::check(config, setups.least(scene, config))?;
    let mut report = RenderReport { frames: config.frames.len(), ..Default::default() };
    report.views = setups.reports(config);
    let views = report.views.clone();
    let mut sink_time = Duration::ZERO;
    let mut sink = |rendered: Rendered<'_>| {
        let writing = Instant::now();
        sink(Rendered { views: &views, ..rendered })?;
        sink_time += writing.elapsed();
        Ok(())
    };
    progress.start(Some(setups.steps(config)));
    for (views, config) in config.groups() {
        setups.render((scene, &config), views, progress, &mut report, &mut sink)?;
    }
    progress.finish();
    report.sum_up_expected_errors(config.frames_of_view());
    report.seconds = (started.elapsed() - sink_time).as_secs_f64();
    Ok(report)
}

/// Checks the settings and the memory limit as [`render`] does before it reads any block.
///
/// # Errors
/// The errors that [`render`] would return before its first picture.
pub fn check(scene: &dyn Scene, config: &RenderConfig) -> Result<()> {
    least_memory(scene, config).and_then(|least| Budget::check(config, least))
}

/// The least memory in bytes with which [`render`] renders these views, without the memory of the sink.
///
/// # Errors
/// The errors that [`check`] returns, but for too little memory.
pub fn least_memory(scene: &dyn Scene, config: &RenderConfig) -> Result<usize> {
    Ok(Setups::new(scene, config)?.least(scene, config))
}
