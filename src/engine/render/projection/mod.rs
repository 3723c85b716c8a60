//! Projections: splats every frame batch into all views, and inverts the pixels.
//!
//! ```text
//! weight_sums      the divisors of means, and the background
//! certificate      the error bound of a pixel
//! plan             how much fits in memory
//! splat_weights    the weights of a view
//! reconstruct      planes to pixels: inverse transform, division, certificate
//! bands            parts of all pictures of a batch
//! partial_sums     the contribution of some of the voxels to pictures
//! ```

pub(super) mod weight_sums;
mod certificate;
mod plan;
mod splat_weights;
pub(super) mod reconstruct;
mod bands;
pub(super) mod partial_sums;

use super::batches::{Expectation, FrameBatch, Job, RenderedBatch, Scene, for_each_batch};
use super::config::{RenderConfig, ViewTask};
use super::renderer::{Output, PictureSink, Renderer};
use super::report::{RenderReport, Rendered, ViewReport, lap};
use super::splat::{Pixels, ResolvedTile, ViewSetup};
use bands::ViewGroup;
use plan::{Budget, Kept};
use reconstruct::PixelReconstructor;
use splat_weights::splat_weights;
use std::borrow::Cow;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;
use wavesplat_core::base::zeroed::Zeroed;
use wavesplat_core::view::camera::View;

/// Renders projections, as many views together as fit in memory. Progress counts pictures.
pub(super) struct Projection {
    pub(super) setups: Vec<ViewSetup>,
}

impl Projection {
    /// Projections of a grid that is cut into blocks.
    pub(super) fn new(grid: &Grid, blocks: BlockGrid, config: &RenderConfig) -> Result<Self> {
        let setups = config.views.iter().map(|view| ViewSetup::new(grid, blocks, config, view));
        Ok(Self { setups: setups.collect::<Result<_>>()? })
    }
}

impl Renderer for Projection {
    fn least_memory(&self, scene: &dyn Scene, config: &RenderConfig) -> usize {
        Budget::least(config, Kept::Value, scene, &self.setups)
    }

    fn reports(&self, config: &RenderConfig) -> Vec<ViewReport> {
        let report = |(view, setup): (&View, &ViewSetup)| ViewReport {
            method: setup.method.name,
            stated_splat_error: setup.stated_error,
            splat_error_is_estimate: setup.is_quick_look(config),
            ..ViewReport::new(view, &setup.camera)
        };
        config.views.iter().zip(&self.setups).map(report).collect()
    }

    fn steps(&self) -> usize {
        self.setups.len()
    }

    fn render(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut Output<'_, '_>) -> Result<()> {
        let ViewTask { views, config } = task;
        let mut first = views.start;
        while first < views.end {
            let budget = Budget::for_most_views(config, Kept::Value, scene, &self.setups[first..views.end]);
            render_views(scene, config, &budget, first, output)?;
            first += budget.setups().len();
        }
        Ok(())
    }
}

/// Renders all frames from the views of the budget. `first_view` is the index of the first of them.
fn render_views(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    budget: &Budget<'_>,
    first_view: usize,
    output: &mut Output<'_, '_>,
) -> Result<()> {
    let Output { sink, report, progress } = output;
    let mut clock = Instant::now();
    let weights =
        budget.setups().iter().map(|setup| splat_weights(setup, config, budget)).collect::<Result<Vec<_>>>()?;
    let group = ViewGroup { weights, progress: *progress };
    let expectations: Vec<_> =
        group.weights.iter().map(|weights| Expectation::new(weights.view(), config.quantity)).collect();
    report.planned_bytes = report.planned_bytes.max(budget.planned_for_ones() as u64);
    lap(&mut clock, &mut report.weight_seconds);
    let together = |scene: &mut dyn Scene, frames: &[usize]| budget.share(scene, frames, config);
    let job = Job { config, together: &together, views: &expectations };
    let render = |batch: &dyn FrameBatch, budget: &Budget<'_>, report: &mut RenderReport| {
        render_batch(batch, &group, budget, config, report)
    };
    for_each_batch(scene, &job, report, render, |frames, channels, report| {
        for i in 0..group.weights.len() {
            add_expected_error(&channels, i, frames.len(), &mut report.views[first_view + i].expected_error);
            let pictures: Vec<&Pictures> = channels.iter().map(|channel| &channel.pictures[i]).collect();
            Pictures::give(&pictures, first_view + i, frames, *progress, *sink)?;
        }
        Ok(())
    })
}

/// Adds the expected mean square errors of a view, frame by frame, so that the sum does not depend on the batches.
fn add_expected_error(channels: &[RenderedBatch<Vec<Pictures>>], view: usize, frames: usize, sum: &mut f64) {
    let mean = channels.iter().map(|channel| channel.expected[view]).sum::<f64>() / channels.len() as f64;
    (0..frames).for_each(|_| *sum += mean);
}

/// Renders all frames of a batch from some views.
fn render_batch(
    batch: &dyn FrameBatch,
    group: &ViewGroup<'_>,
    budget: &Budget<'_>,
    config: &RenderConfig,
    report: &mut RenderReport,
) -> Result<Vec<Pictures>> {
    let (layout, pixels) = (batch.layout(), budget.pixels());
    let reconstructors: Vec<_> =
        group.weights.iter().map(|weights| PixelReconstructor::new(batch, weights, config)).collect();
    let empty = |view: &PixelReconstructor<'_>| Zeroed::new(view.pictures() * pixels);
    let mut pictures: Vec<Zeroed<f32>> = reconstructors.iter().map(empty).collect();
    let finish =
        |view: usize, tile: ResolvedTile<'_>, rows: &mut Pixels<'_, f32>| reconstructors[view].tile(tile, rows);
    group.splat(batch, budget, report, &mut pictures, &finish)?;
    if config.certify {
        report.count_certified(pictures.iter().flat_map(|all| &all[layout.frames * pixels..]));
    }
    Ok(pictures.into_iter().map(|all| Pictures { pixels, all }).collect())
}

/// The pictures of one channel of a batch from one view.
struct Pictures {
    pixels: usize,
    /// The pictures of all frames, followed by their error bounds if pictures are certified.
    all: Zeroed<f32>,
}

impl Pictures {
    /// Gives all frames to the sink, with the channels of each pixel interleaved.
    fn give(
        channels: &[&Self],
        view: usize,
        frames: &[usize],
        progress: &dyn Progress,
        sink: &mut PictureSink<'_>,
    ) -> Result<()> {
        for (i, frame) in frames.iter().enumerate() {
            progress.check()?;
            let [picture, error] = [i, frames.len() + i].map(|i| Self::together(channels, i));
            progress.advance(1);
            sink(Rendered {
                views: &[],
                view,
                frame: *frame,
                picture: picture.as_deref().unwrap_or_default(),
                error: error.as_deref(),
            })?;
        }
        Ok(())
    }

    /// Picture `i` with the channels interleaved; `None` if there is no such picture.
    fn together<'a>(channels: &[&'a Self], i: usize) -> Option<Cow<'a, [f32]>> {
        let values = |channel: &&'a Self| channel.all.get(i * channel.pixels..(i + 1) * channel.pixels);
        let [first, others @ ..] = channels else { return None };
        let first = values(first)?;
        if others.is_empty() {
            return Some(first.into());
        }
        let others: Vec<&[f32]> = others.iter().filter_map(values).collect();
        let pixel = |(at, value): (usize, &f32)| std::iter::once(*value).chain(others.iter().map(move |c| c[at]));
        Some(first.iter().enumerate().flat_map(pixel).collect())
    }
}
