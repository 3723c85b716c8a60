//! A scene to pictures: splat the planes of a group of frames, then invert every pixel.
//!
//! Splatting is linear, so it may come before the inverse transform along time, as in [Dobashi](crate::bibliography):
//!
//! ```text
//! I^(t_j) = sum over k of C_k u_k(t_j)                                                                    (eq 8)
//! C_k(x, y) = sum of c_{i,k} w_i(x, y)                                                                    (eq 9)
//! g = I / sum of w_i                                                                                      (eq 12)
//! ```
//!
//! A *plane* is the image of one k (or of one frame, where decoded samples are splatted). It holds sums over pixels, or
//! over the cells of a lattice from which pixels follow. Coefficients are splatted once for all frames of a window, and
//! a new view needs no new conversion. Partial sums over any split of the voxels add up.
//!
//! ```text
//! for some views                               plan: as many as fit in memory
//!   for each group of frames of a window       plan: as many as fit
//!     for each band of rows
//!       for each batch of blocks               scene: read, decode            (workers)
//!         every plane of every view takes it   lattice: amounts -> cells      (one owner per plane)
//!       every tile inverts its pixels          lattice: cells -> planes of pixels
//!                                              reconstruct: planes -> frames, then / weights; certificate
//!     give the finished frames to the sink
//! ```
//!
//! A tile splats the voxels of a batch itself (`splat`) where footprints are less work than the lattice, where the
//! lattice is not precise enough, and where pictures are certified. All planes of a view are splatted in the same way,
//! weights and missing samples included, so that means stay means. Composites and largest values go slab by slab
//! (`slabs`).

mod plane_values;
pub mod annotate;
mod accumulator;
mod certificate;
mod coded;
mod coefficients;
mod config;
mod expectation;
mod view_setup;
mod reconstruct;
mod frames;
mod lattice;
mod tile_rect;
mod plan;
mod project;
mod select;
mod report;
mod scene;
pub mod sink;
mod slabs;
mod splat;
mod sparse_terms;
mod reference_weights;
mod weights;

pub use coefficients::{CoefficientScene, SplatSource};
pub use config::{Limit, Mode, Pixel, Quantity, RenderConfig};
pub use expectation::Expectation;
pub use frames::FrameScene;
pub use report::{RenderReport, ViewReport};
pub use scene::{LeftOut, Scene};

use crate::base::error::{Error, Result};
use crate::base::progress::Progress;
use crate::view::camera::View;
use crate::view::footprint::Method;
use plan::Budget;
use std::time::{Duration, Instant};
use view_setup::ViewSetup;

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

/// Renders all frames from all views, giving each to `sink`; those of one view come in order.
pub fn render(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let setups = setups(scene, config)?;
    let mut report = RenderReport { frames: config.frames.len(), ..Default::default() };
    report.views = reports(&setups, config);
    let views = report.views.clone();
    let mut sink_time = Duration::ZERO;
    let mut sink = |rendered: Rendered<'_>| {
        let writing = Instant::now();
        sink(Rendered { views: &views, ..rendered })?;
        sink_time += writing.elapsed();
        Ok(())
    };
    if config.mode.is_projection() {
        project::project(scene, config, &setups, progress, &mut report, &mut sink)?;
    } else {
        slabs::render(scene, config, &setups, progress, &mut report, &mut sink)?;
    }
    progress.finish();
    report.sum_up_expected_errors();
    report.seconds = (started.elapsed() - sink_time).as_secs_f64();
    Ok(report)
}

/// An error if [`render`] would refuse to begin.
pub fn check(scene: &dyn Scene, config: &RenderConfig) -> Result<()> {
    setups(scene, config).map(|_| ())
}

/// What is to be said of each view before it is splatted.
fn reports(setups: &[ViewSetup], config: &RenderConfig) -> Vec<ViewReport> {
    let slabs = |setup| (!config.mode.is_projection()).then(|| slabs::count(setup, config));
    config.views.iter().zip(setups).map(|(view, setup)| ViewReport::new(view, setup, slabs(setup))).collect()
}

/// All views, for each of which there is memory enough.
fn setups(scene: &dyn Scene, config: &RenderConfig) -> Result<Vec<ViewSetup>> {
    config.check()?;
    if scene.channels() > 1 && !config.mode.is_projection() {
        return Err(Error::usage(
            "--mode: the samples are colours already, of which only projections are made; leave it out, or convert without --transfer-function",
        ));
    }
    let setup = |view: &View| reference_weights::without_what_is_dim(ViewSetup::new(scene, config, view)?, config);
    let setups = config.views.iter().map(setup).collect::<Result<Vec<_>>>()?;
    match config.mode {
        Mode::Projection => Budget::check(config, scene, &setups)?,
        _ => {
            setups.iter().try_for_each(|setup| Budget::check(config, scene, &slabs::cut(setup, config)?.setups[..1]))?
        }
    }
    Ok(setups)
}

/// What splatting may add by default to pictures of a file of such a tolerance, or of frames: half of that, at most 1e-3.
pub fn default_splat_error(tolerance: Option<f64>) -> f64 {
    tolerance.map_or(f64::INFINITY, |t| t / 2.0).min(1e-3)
}

/// The cheapest splat method within an error.
pub fn splat_method(quantity: Quantity, error: f64) -> Method {
    Method::within(most_splat_error(quantity, error))
}

/// What splatting may be off by.
fn most_splat_error(quantity: Quantity, error: f64) -> f64 {
    match quantity {
        Quantity::Emission => error,
        // A pixel that is not background must keep some of its weights.
        Quantity::Mean => error.min(0.9 * view_setup::BACKGROUND),
    }
}

/// Adds the seconds since `clock` to a stage, and restarts it.
fn lap(clock: &mut Instant, stage: &mut f64) {
    *stage += clock.elapsed().as_secs_f64();
    *clock = Instant::now();
}
