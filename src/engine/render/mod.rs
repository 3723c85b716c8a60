//! Renders a scene: splats the planes of a frame batch, then inverts every pixel.
//!
//! Splatting is linear, so it may come before the inverse transform along time, as in [Dobashi](wavesplat_core::bibliography):
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
//! report            what a rendering did: counts, times and errors
//! batches/          frame batches of a scene: their planes, blocks and samples, and the loop over them
//! renderer          the interface of the renderers of all modes
//! splat/            a view's camera and backend; blocks into bands; bands into tiles
//! scenes/           a coefficient file or an archive's frames as a scene
//! planes/           planes through the volume: where rays meet them, and the samples there
//! slices/           composites, isosurfaces and maximum intensity projections: the field along rays, slice by slice
//! projection/       projections: weights, memory, bands, planes to pixels; sums of a part of the voxels
//! annotate/, sink/  text in pictures, and output files, with page/ for web pages; pictures: a rendering into files
//! partial/          files of partial sums, and pictures of their totals
//! ```
//!
//! ```text
//! for each group of views                      projection/plan: as many as fit in memory
//!   for each batch of frames of a window       batches/driver: as many as fit; the scene selects its blocks
//!     for each band of pixels
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
mod report;
mod batches;
mod renderer;
mod splat;
mod scenes;
pub mod planes;
mod slices;
mod projection;
pub mod annotate;
mod ray_lengths;
pub mod page;
pub mod sink;
mod pictures;
pub mod partial;

pub use batches::{
    BatchOutcome, BatchRequest, BlockBytes, BlockPlanes, BlockRange, Expectation, FrameBatch, FrameBounds, Inverse,
    Layout, Order, OverviewRequest, PlaneValues, SampleErrors, Scene, Scratch, Selection, Thinning, stride,
};
pub use config::{Limit, Mode, Pixel, Plane, Quantity, RenderConfig, default_splat_error, splat_method};
pub use light::{Light, Surface};
pub use pictures::render_png;
pub use projection::partial_sums::{PartialSumSink, PartialSums, render_sums};
pub use report::{LeftOut, Picture, Probed, RenderReport, Rendered, ViewReport};
pub use scenes::{CoefficientScene, FrameScene, SplatSource};
pub use wavesplat_core::wavelet::{LANES, Lane};

use planes::Planes;
use projection::Projection;
use renderer::{Output, Renderer, check_memory};
use slices::{Composite, Isosurfaces, Largest, Sliced};
use std::time::Duration;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;

/// What renders the mode of `config`.
fn renderer<'a>(scene: &dyn Scene, config: &'a RenderConfig) -> Result<Box<dyn Renderer + 'a>> {
    config.check(scene.frames())?;
    if !config.mode.is_projection() && scene.channels() > 1 {
        let what = "the samples are colours already, and colours are rendered as projections only";
        return Err(Error::setting("mode", Note::with(what, Remedy::ProjectOrConvertSamples)));
    }
    let (grid, spacing) = (scene.grid(), scene.grid().largest_spacing());
    Ok(match &config.mode {
        Mode::Projection => Box::new(Projection::new(grid, scene.blocks(), config)?),
        Mode::Composite { transfer, unit, light, planes, .. } => {
            let unit = unit.unwrap_or(spacing);
            let blend = move |view: &_| Composite::new(transfer, unit, *light, view, spacing);
            let sliced = Sliced::new(grid, config, blend)?;
            Box::new(if config.certify { sliced.certified() } else { sliced.with_planes(planes, transfer) })
        }
        Mode::Iso { surfaces, light, .. } => {
            let sliced = Sliced::new(grid, config, |view| Isosurfaces::new(surfaces, *light, view))?;
            Box::new(if config.certify { sliced.certified() } else { sliced })
        }
        Mode::Mip { .. } => Box::new(Sliced::new(grid, config, Largest::new)?),
        Mode::Planes { planes, panels } => Box::new(Planes::new(grid, config, planes, panels)?),
    })
}

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
    let renderer = renderer(scene, config)?;
    check_memory(config, renderer.least_memory(scene, config))?;
    let views = renderer.reports(config);
    let mut report = RenderReport { frames: config.frames.len(), views: views.clone(), ..Default::default() };
    let mut sink_time = Duration::ZERO;
    let mut sink = |rendered: Rendered<'_>| {
        let writing = Instant::now();
        sink(Rendered { views: &views, ..rendered })?;
        sink_time += writing.elapsed();
        Ok(())
    };
    progress.start(Some((renderer.steps() * config.frames_of_view()) as u64));
    for task in config.tasks() {
        let mut output = Output { sink: &mut sink, report: &mut report, progress };
        renderer.render(scene, &task, &mut output)?;
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
    least_memory(scene, config).and_then(|least| check_memory(config, least))
}

/// The least memory in bytes with which [`render`] renders these views, without the memory of the sink.
///
/// # Errors
/// The errors that [`check`] returns, but for too little memory.
pub fn least_memory(scene: &dyn Scene, config: &RenderConfig) -> Result<usize> {
    Ok(renderer(scene, config)?.least_memory(scene, config))
}
