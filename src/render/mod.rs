//! A scene to pictures (method.md sections 6 and 7): splat the planes of a batch of frames, then invert every pixel.
//!
//! The modules are listed in the order in which a code becomes a pixel; each uses only those above it.
//!
//! ```text
//! config            what is asked for
//! layout            the planes of a batch; plane_values: a block's values, plane by plane
//! splat/            a view's camera and backend; blocks into bands; bands into tiles
//! weights           what a mean divides by; expectation: how errors of blocks show in a view
//! scene             where blocks come from: a batch of frames, and the blocks that are selected for it
//! scenes/           a coefficient file or an archive's frames as a scene
//! slabs/            composites and largest values: the volume in slabs
//! plan              what fits in memory; weigh: the weights of a view
//! reconstruct       planes to pixels: inverse transform, division, certificate
//! driver            the loop over batches of frames
//! project, composite   what is made of each batch
//! annotate/, sink/  letters and files; pictures: a rendering into files
//! ```
//!
//! ```text
//! for some views                               plan: as many as fit in memory
//!   for each batch of frames of a window       driver: as many as fit; the scene selects its blocks
//!     for each band of rows
//!       for each run of blocks                 scene: read, decode                          (workers)
//!         every plane of every view takes it   splat: values -> cells or tiles              (one owner each)
//!       every tile inverts its pixels          reconstruct: planes -> frames, then / weights; certificate
//!     give the finished frames to the sink
//! ```

mod config;
mod layout;
mod plane_values;
mod splat;
mod weights;
mod expectation;
mod scene;
mod report;
mod scenes;
mod slabs;
mod plan;
mod certificate;
mod weigh;
mod reconstruct;
mod driver;
mod project;
mod composite;
pub mod annotate;
pub mod sink;
mod pictures;

pub use crate::wavelet::{LANES, Lane};
pub use config::{Limit, Mode, Pixel, Quantity, RenderConfig, default_splat_error, splat_method};
pub use expectation::Expectation;
pub use layout::{Layout, Order};
pub use pictures::render_png;
pub use plane_values::{BlockPlanes, PlaneValues, Scratch};
pub use report::{Picture, RenderReport, Rendered, ViewReport};
pub use scene::{
    BatchOutcome, BatchRequest, FrameBatch, FrameBounds, Inverse, LeftOut, SampleErrors, Scene, Selection,
};
pub use scenes::{CoefficientScene, FrameScene, SplatSource};

use crate::base::error::{Error, Result};
use crate::base::progress::Progress;
use crate::view::camera::View;
use plan::Budget;
use splat::ViewSetup;
use splat::reference_weights::without_what_is_dim;
use std::time::{Duration, Instant};

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
        composite::composite(scene, config, &setups, progress, &mut report, &mut sink)?;
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
    let volume = (*scene.grid(), scene.blocks());
    let setup = |view: &View| without_what_is_dim(ViewSetup::new(volume, config, view)?, config);
    let setups = config.views.iter().map(setup).collect::<Result<Vec<_>>>()?;
    match config.mode {
        Mode::Projection => Budget::check(config, scene, &setups)?,
        _ => {
            setups
                .iter()
                .try_for_each(|setup| Budget::check(config, scene, &slabs::cut(setup, config)?.setups[..1]))?;
        }
    }
    Ok(setups)
}
