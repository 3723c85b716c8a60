//! Projections: the planes of a group of frames of every view, and from these its pictures.

use super::accumulator::{self, BandAccumulator, Blocks};
use super::expectation::Expectation;
use super::plan::{self, Budget};
use super::plane_values::BlockPlanes;
use super::reconstruct::PixelReconstructor;
use super::scene::{BatchOutcome, FrameBatch, Scene};
use super::view_setup::ViewSetup;
use super::weights::WeightedView;
use super::{RenderConfig, RenderReport, Rendered, lap};
use crate::base::error::Result;
use crate::base::progress::Progress;
use std::borrow::Cow;
use std::time::Instant;

/// Renders projections, of as many views together as there is memory for.
pub(super) fn project(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    setups: &[ViewSetup],
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    progress.start(Some((setups.len() * config.frames.len()) as u64));
    let mut sink = |rendered: Rendered<'_>| {
        progress.advance(1);
        sink(rendered)
    };
    let mut first = 0;
    while first < setups.len() {
        let budget = Budget::of_most(config, scene, &setups[first..]);
        render_views(scene, config, (&budget, first), report, &mut sink)?;
        first += budget.setups().len();
    }
    Ok(())
}

/// Renders all frames from views that go together, the first of which is number `first_view`.
fn render_views(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (budget, first_view): (&Budget<'_>, usize),
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let mut clock = Instant::now();
    let weighted_views =
        budget.setups().iter().map(|setup| WeightedView::new(setup, config, budget)).collect::<Result<Vec<_>>>()?;
    let expectations: Vec<_> = weighted_views.iter().map(|weighted| Expectation::new(weighted, config)).collect();
    lap(&mut clock, &mut report.weight_seconds);
    let (mut rest, count) = (config.frames.as_slice(), scene.channels());
    while let Some(first) = rest.first() {
        let most = plan::in_group(scene, *first, rest);
        let (now, later) = rest.split_at(budget.frames(scene, config, most));
        let channel =
            |channel| render_channel(scene, config, (now, channel), (&weighted_views, &expectations), budget, report);
        let channels = (0..count).map(channel).collect::<Result<Vec<_>>>()?;
        for (i, view) in (first_view..).take(weighted_views.len()).enumerate() {
            let expected = channels.iter().map(|views| views[i].1).sum::<f64>() / count as f64;
            // Frame by frame, so that it is the same however frames are grouped.
            now.iter().for_each(|_| report.views[view].expected_error += expected);
            let pictures: Vec<&Pictures> = channels.iter().map(|views| &views[i].0).collect();
            Pictures::give(&pictures, (view, now), sink)?;
        }
        rest = later;
    }
    Ok(())
}

/// Renders a channel of some frames from some views, again where more is found than its layout has room for: of each view the
/// pictures, and the mean square of the errors that are expected.
fn render_channel(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (frames, channel): (&[usize], usize),
    (weighted_views, expectations): (&[WeightedView<'_>], &[Expectation<'_>]),
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<(Pictures, f64)>> {
    loop {
        let before = report.clone();
        let group = scene.group(frames, channel, config, &expectations[0])?;
        let pictures = render_group(group.as_ref(), weighted_views, config, budget, report)?;
        let expected = |expectation| group.expected(&weighted_views[0].setup.clip, expectation);
        let expected = expectations.iter().map(expected).collect::<Result<Vec<_>>>()?;
        match group.finish()? {
            BatchOutcome::Complete => return Ok(pictures.into_iter().zip(expected).collect()),
            BatchOutcome::NeedsRelayout => *report = before,
        }
    }
}

impl Blocks for &dyn FrameBatch {
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        FrameBatch::planes(*self, block)
    }
}

/// The pictures of a channel of a group from one view.
struct Pictures {
    pixels: usize,
    /// Those of the frames, and if they are certified, those of their errors.
    all: Vec<f32>,
}

impl Pictures {
    /// Gives the frames of all channels to the sink, the channels of each pixel side by side.
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

    /// The picture of a number, of all channels; none if there are not so many.
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

/// Renders all frames of a group from some views.
fn render_group(
    group: &dyn FrameBatch,
    weighted_views: &[WeightedView<'_>],
    config: &RenderConfig,
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<Pictures>> {
    let layout = group.layout();
    let blocks = blocks_to_read(group, weighted_views, report)?;
    let finish: Vec<PixelReconstructor<'_>> =
        weighted_views.iter().map(|weighted| PixelReconstructor::new(group, weighted, config)).collect();
    let empty = |finish: &PixelReconstructor<'_>| vec![f32::NAN; finish.planes() * budget.pixels()];
    let mut pictures: Vec<Vec<f32>> = finish.iter().map(empty).collect();
    for rows in budget.bands(&layout) {
        let mut accumulators: Vec<_> =
            weighted_views.iter().map(|weighted| BandAccumulator::new(weighted.setup, rows.clone(), &layout)).collect();
        accumulator::splat(&mut accumulators, &blocks, budget.batch(&layout, rows.len()), &group, report)?;
        let mut clock = Instant::now();
        for ((accumulator, finish), pictures) in accumulators.into_iter().zip(&finish).zip(&mut pictures) {
            accumulator.finish(pictures, |tile, pixels| finish.tile(tile, pixels));
        }
        lap(&mut clock, &mut report.inverse_seconds);
    }
    if config.certify {
        let of_errors = pictures.iter().flat_map(|all| &all[layout.frames * budget.pixels()..]);
        let largest = of_errors.map(|e| f64::from(*e)).fold(report.certified_error.unwrap_or(0.0), f64::max);
        report.certified_error = Some(largest);
    }
    Ok(pictures.into_iter().map(|all| Pictures { pixels: budget.pixels(), all }).collect())
}

/// The blocks of a group that a pixel sees, and a word in the report on the others.
fn blocks_to_read(
    group: &dyn FrameBatch,
    weighted_views: &[WeightedView<'_>],
    report: &mut RenderReport,
) -> Result<Vec<usize>> {
    let setup = weighted_views[0].setup;
    let all_rows = 0..setup.camera.size[1];
    let contents = group.blocks(&setup.clip)?;
    report.add(&contents);
    let mut blocks = contents.blocks;
    let held = blocks.len();
    blocks.retain(|b| weighted_views.iter().any(|weighted| weighted.setup.reaches(*b, &all_rows)));
    let reached = blocks.len();
    blocks.retain(|b| weighted_views.iter().any(|weighted| weighted.setup.sees(*b, &all_rows)));
    report.blocks += setup.blocks.len() as u64;
    report.blocks_outside += (held - reached) as u64;
    report.blocks_dimmed += (reached - blocks.len()) as u64;
    Ok(blocks)
}
