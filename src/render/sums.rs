//! The sums that a part of the voxels adds to pictures. Pictures of all voxels are the quotients of the sums of all parts:
//!
//! ```text
//! g = (sum over parts of I_p) / (sum over parts of (W_p - A_p))                                           (eq 12)
//! ```
//!
//! I_p is the emission of the voxels of a part, W_p their weights, and A_p the weights of those that are missing. How voxels
//! are splatted depends on the whole volume alone ([`splatted`] knows no region), so the weight of a voxel at a pixel is the
//! same in every division. Sums of parts differ from those of one rendering by rounding only: additions to a plane are in
//! f32 within a part (`ROUNDING` in `splat/lattice/error.rs` counts them), and in f64 between parts.

use super::bands::splat_bands;
use super::config::RenderConfig;
use super::driver::{Job, for_each_batch};
use super::plan::{Budget, Kept};
use super::reconstruct::SumKeeper;
use super::report::{RenderReport, lap};
use super::scene::{FrameBatch, Scene};
use super::setups::{reports_of_splatted, splatted};
use super::splat::{Pixels, ResolvedTile, ViewSetup};
use super::weigh::weigh_part;
use super::weights::WeightedView;
use crate::base::error::{Error, Result};
use crate::base::progress::Progress;
use crate::base::zeroed::Zeroed;
use std::ops::Range;
use std::time::Instant;

/// Sums of all pixels of a view, row by row.
#[derive(Debug, Clone, Copy)]
pub enum Sums<'a> {
    /// The weights of all voxels of the part.
    Weights {
        /// Index of the view.
        view: usize,
        /// The sums.
        sums: &'a [f64],
    },
    /// The emissions of a frame, channel after channel.
    Picture {
        /// Index of the view.
        view: usize,
        /// Number of the frame.
        frame: usize,
        /// For each channel, its emissions, and then the weights of missing samples if there are any.
        planes: &'a [&'a [f64]],
        /// Whether there are missing samples.
        missing: bool,
    },
}

/// Where sums go.
pub type SumSink<'a> = dyn FnMut(Sums<'_>) -> Result<()> + 'a;

/// Renders the sums of the voxels of [`RenderConfig::region`]. The weights of a view come before its pictures.
///
/// # Errors
/// Settings that are not those of sums, too little memory, failed reads, or an error of `sink`.
pub fn render_sums(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut SumSink<'_>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let setups = setups_of_part(scene, config)?;
    Budget::check(config, Budget::least((config, Kept::Sums), scene, &setups))?;
    let mut report = RenderReport { frames: config.frames.len(), ..RenderReport::default() };
    report.views = reports_of_splatted(&setups, config);
    progress.start(Some((setups.len() * config.frames_of_view()) as u64));
    for (views, config) in config.groups() {
        sum_views((scene, progress), &config, (&setups, views), &mut report, sink)?;
    }
    progress.finish();
    report.views.iter_mut().for_each(|view| view.expected_error = f64::NAN); // it depends on the weights of all parts
    report.expected_error = f64::NAN;
    report.seconds = started.elapsed().as_secs_f64();
    Ok(report)
}

/// The setups of all views, chosen for the whole volume and clipped to the voxels of the region.
fn setups_of_part(scene: &dyn Scene, config: &RenderConfig) -> Result<Vec<ViewSetup>> {
    config.check(scene.frames())?;
    let refused =
        [(!config.mode.is_projection(), "mode"), (config.certify, "certify"), (config.chooses_by_view(), "limited")];
    if let Some((_, setting)) = refused.into_iter().find(|(wrong, _)| *wrong) {
        return Err(Error::setting(setting, "applies to whole pictures, not to the sums of a part"));
    }
    let (clip, whole) = (config.clip(scene.grid())?, RenderConfig { region: None, ..config.clone() });
    let setups = splatted((*scene.grid(), scene.blocks()), &whole)?;
    Ok(setups.into_iter().map(|setup| ViewSetup { clip, ..setup }).collect())
}

/// Renders some of the views, as many together as fit in memory.
fn sum_views(
    (scene, progress): (&mut dyn Scene, &dyn Progress),
    config: &RenderConfig,
    (setups, which): (&[ViewSetup], Range<usize>),
    report: &mut RenderReport,
    sink: &mut SumSink<'_>,
) -> Result<()> {
    let mut first = which.start;
    while first < which.end {
        let budget = Budget::of_most((config, Kept::Sums), scene, &setups[first..which.end]);
        let mut clock = Instant::now();
        let weighted = budget.setups().iter().map(|setup| weigh_part(setup, &budget)).collect::<Result<Vec<_>>>()?;
        lap(&mut clock, &mut report.weight_seconds);
        for (view, weighted) in weighted.iter().enumerate() {
            sink(Sums::Weights { view: first + view, sums: &weighted.weights.sums })?;
        }
        let together = |scene: &dyn Scene, most: usize| budget.frames(scene, config, most);
        let job = Job { config, together: &together, views: &[], progress };
        let render = |batch: &dyn FrameBatch, report: &mut RenderReport| sums_of(batch, &weighted, &budget, report);
        for_each_batch(scene, job, report, render, |frames, channels, _| {
            for view in 0..weighted.len() {
                let channels: Vec<&Planes> = channels.iter().map(|channel| &channel.pictures[view]).collect();
                give((&channels, budget.pixels()), (first + view, frames), (progress, sink))?;
            }
            Ok(())
        })?;
        first += budget.setups().len();
    }
    Ok(())
}

/// The sums of one channel of a batch in one view.
struct Planes {
    /// Emissions of all frames, then their missing weights.
    all: Zeroed<f64>,
    missing: bool,
}

/// The sums of a batch in some views.
fn sums_of(
    batch: &dyn FrameBatch,
    weighted: &[WeightedView<'_>],
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<Planes>> {
    let (layout, keeper) = (batch.layout(), SumKeeper { batch });
    let planes = layout.frames * (1 + usize::from(layout.absent));
    let mut pictures: Vec<Zeroed<f64>> = weighted.iter().map(|_| Zeroed::new(planes * budget.pixels())).collect();
    let keep = |_: usize, tile: ResolvedTile<'_>, pixels: &mut Pixels<'_, f64>| keeper.tile(tile, pixels);
    splat_bands(batch, weighted, budget, report, (&mut pictures, &keep))?;
    Ok(pictures.into_iter().map(|all| Planes { all, missing: layout.absent }).collect())
}

/// Gives all frames of a view to the sink.
fn give(
    (channels, pixels): (&[&Planes], usize),
    (view, frames): (usize, &[usize]),
    (progress, sink): (&dyn Progress, &mut SumSink<'_>),
) -> Result<()> {
    let missing = channels.iter().any(|channel| channel.missing);
    let none = vec![0.0; if missing { pixels } else { 0 }];
    for (n, frame) in frames.iter().enumerate() {
        let plane = |n: usize| n * pixels..(n + 1) * pixels;
        let mut planes: Vec<&[f64]> = Vec::new();
        for channel in channels {
            planes.push(&channel.all[plane(n)]);
            if missing {
                let absent = plane(frames.len() + n);
                planes.push(if channel.missing { &channel.all[absent] } else { &none });
            }
        }
        sink(Sums::Picture { view, frame: *frame, planes: &planes, missing })?;
        progress.advance(1);
    }
    Ok(())
}
