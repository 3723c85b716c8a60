//! Projections: splats every frame batch into all views, and inverts the pixels.

use super::bands::splat_bands;
use super::config::RenderConfig;
use super::driver::{Job, RenderedBatch, for_each_batch};
use super::expectation::Expectation;
use super::plan::{Budget, Kept};
use super::reconstruct::PixelReconstructor;
use super::report::{RenderReport, Rendered, lap};
use super::scene::{FrameBatch, Scene};
use super::splat::{Pixels, ResolvedTile, ViewSetup};
use super::weigh::weigh;
use super::weights::WeightedView;
use crate::base::error::Result;
use crate::base::progress::Progress;
use crate::base::zeroed::Zeroed;
use std::borrow::Cow;
use std::ops::Range;
use std::time::Instant;

/// Renders projections from some of the views, as many together as fit in memory. Progress counts pictures.
pub(super) fn project(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (setups, which): (&[ViewSetup], Range<usize>),
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let mut sink = |rendered: Rendered<'_>| {
        progress.advance(1);
        sink(rendered)
    };
    let mut first = which.start;
    while first < which.end {
        let budget = Budget::of_most((config, Kept::Value), scene, &setups[first..which.end]);
        render_views((scene, progress), config, (&budget, first), report, &mut sink)?;
        first += budget.setups().len();
    }
    Ok(())
}

/// Renders all frames from the views of the budget. `first_view` is the index of the first of them.
fn render_views(
    (scene, progress): (&mut dyn Scene, &dyn Progress),
    config: &RenderConfig,
    (budget, first_view): (&Budget<'_>, usize),
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let mut clock = Instant::now();
    let weighted = budget.setups().iter().map(|setup| weigh(setup, config, budget)).collect::<Result<Vec<_>>>()?;
    let expectations: Vec<_> = weighted.iter().map(|view| Expectation::new(view, config)).collect();
    lap(&mut clock, &mut report.weight_seconds);
    let together = |scene: &dyn Scene, most: usize| budget.frames(scene, config, most);
    let job = Job { config, together: &together, views: &expectations, progress };
    let render =
        |batch: &dyn FrameBatch, report: &mut RenderReport| render_batch(batch, &weighted, (config, budget), report);
    for_each_batch(scene, job, report, render, |frames, channels, report| {
        for i in 0..weighted.len() {
            add_expected_error(&channels, i, frames.len(), &mut report.views[first_view + i].expected_error);
            let pictures: Vec<&Pictures> = channels.iter().map(|channel| &channel.pictures[i]).collect();
            Pictures::give(&pictures, (first_view + i, frames), sink)?;
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
    weighted: &[WeightedView<'_>],
    (config, budget): (&RenderConfig, &Budget<'_>),
    report: &mut RenderReport,
) -> Result<Vec<Pictures>> {
    let layout = batch.layout();
    let reconstructors: Vec<_> = weighted.iter().map(|view| PixelReconstructor::new(batch, view, config)).collect();
    let empty = |pixels: &PixelReconstructor<'_>| {
        let mut pictures = Zeroed::new(pixels.pictures() * budget.pixels());
        pictures.fill(f32::NAN);
        pictures
    };
    let mut pictures: Vec<Zeroed<f32>> = reconstructors.iter().map(empty).collect();
    let finish =
        |view: usize, tile: ResolvedTile<'_>, rows: &mut Pixels<'_, f32>| reconstructors[view].tile(tile, rows);
    splat_bands(batch, weighted, budget, report, (&mut pictures, &finish))?;
    if config.certify {
        let of_errors = pictures.iter().flat_map(|all| &all[layout.frames * budget.pixels()..]);
        let largest = of_errors.map(|e| f64::from(*e)).fold(report.certified_error.unwrap_or(0.0), f64::max);
        report.certified_error = Some(largest);
    }
    Ok(pictures.into_iter().map(|all| Pictures { pixels: budget.pixels(), all }).collect())
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
        (view, frames): (usize, &[usize]),
        sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
    ) -> Result<()> {
        for (i, frame) in frames.iter().enumerate() {
            let of = |i: usize| Self::together(channels, i);
            let (picture, error) = (of(i), of(frames.len() + i));
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
        let of = |channel: &&'a Self| channel.all.get(i * channel.pixels..(i + 1) * channel.pixels);
        let [first, others @ ..] = channels else { return None };
        let first = of(first)?;
        if others.is_empty() {
            return Some(first.into());
        }
        let others: Vec<&[f32]> = others.iter().filter_map(of).collect();
        let pixel = |(at, value): (usize, &f32)| std::iter::once(*value).chain(others.iter().map(move |c| c[at]));
        Some(first.iter().enumerate().flat_map(pixel).collect())
    }
}
