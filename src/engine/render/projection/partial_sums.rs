//! The sums that a part of the voxels adds to pictures. Pictures of all voxels are the quotients of the sums of all parts:
//!
//! ```text
//! g = (sum over parts of I_p) / (sum over parts of (W_p - A_p))                                           (eq 12)
//! ```
//!
//! I_p is the emission of the voxels of a part, W_p their weights, and A_p the weights of those that are missing. How voxels
//! are splatted depends on the whole volume alone ([`Projection`] is made without a region), so the weight of a voxel at a
//! pixel is the same in every division. Sums of parts differ from those of one rendering by rounding only: additions to a plane are in
//! f32 within a part (`ROUNDING` in `splat/lattice/error.rs` counts them), and in f64 between parts.

use super::Projection;
use super::bands::ViewGroup;
use super::plan::{Budget, Kept};
use super::reconstruct::PartialSumKeeper;
use super::splat_weights::splat_part_weights;
use crate::render::batches::{FrameBatch, Job, Scene, for_each_batch};
use crate::render::config::{RenderConfig, ViewTask};
use crate::render::renderer::{Renderer, check_memory};
use crate::render::report::{RenderReport, lap};
use crate::render::splat::{Pixels, ResolvedTile, ViewSetup};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;
use wavesplat_core::base::zeroed::Zeroed;

/// Sums of all pixels of a view, row by row.
#[derive(Debug, Clone, Copy)]
pub enum PartialSums<'a> {
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
pub type PartialSumSink<'a> = dyn FnMut(PartialSums<'_>) -> Result<()> + 'a;

/// Renders the sums of the voxels of [`RenderConfig::region`]. The weights of a view come before its pictures.
///
/// # Errors
/// Settings that are not those of sums, too little memory, failed reads, or an error of `sink`.
pub fn render_sums(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut PartialSumSink<'_>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let projection = clipped_projection(scene, config)?;
    check_memory(config, Budget::least(config, Kept::Sums, scene, &projection.setups))?;
    let views = projection.reports(config);
    let mut report = RenderReport { frames: config.frames.len(), views, ..RenderReport::default() };
    progress.start(Some((projection.steps() * config.frames_of_view()) as u64));
    for task in config.tasks() {
        let mut output = PartialOutput { sink: &mut *sink, report: &mut report, progress };
        projection.sum_views(scene, &task, &mut output)?;
    }
    progress.finish();
    report.views.iter_mut().for_each(|view| view.expected_error = f64::NAN); // it depends on the weights of all parts
    report.expected_error = f64::NAN;
    report.seconds = started.elapsed().as_secs_f64();
    Ok(report)
}

/// Views that are set up for the whole volume, and clipped to the voxels of the region.
fn clipped_projection(scene: &dyn Scene, config: &RenderConfig) -> Result<Projection> {
    config.check(scene.frames())?;
    let refused =
        [(!config.mode.is_projection(), "mode"), (config.certify, "certify"), (config.chooses_by_view(), "error")];
    if let Some((_, setting)) = refused.into_iter().find(|(wrong, _)| *wrong) {
        return Err(Error::setting(setting, "applies to whole pictures, not to the sums of a part"));
    }
    let (clip, whole) = (config.clip(scene.grid())?, RenderConfig { region: None, ..config.clone() });
    let Projection { setups } = Projection::new(scene.grid(), scene.blocks(), &whole)?;
    Ok(Projection { setups: setups.into_iter().map(|setup| ViewSetup { clip, ..setup }).collect() })
}

/// The sink for partial sums, and its progress.
struct PartialOutput<'a, 's> {
    sink: &'a mut PartialSumSink<'s>,
    report: &'a mut RenderReport,
    progress: &'a dyn Progress,
}

impl Projection {
    /// Sums some of the views, as many together as fit in memory.
    fn sum_views(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut PartialOutput<'_, '_>) -> Result<()> {
        let ViewTask { views, config } = task;
        let PartialOutput { sink, report, progress } = output;
        let mut first = views.start;
        while first < views.end {
            let budget = Budget::for_most_views(config, Kept::Sums, scene, &self.setups[first..views.end]);
            let mut clock = Instant::now();
            let weights = budget.setups().iter().map(|setup| splat_part_weights(setup, &budget));
            let group = ViewGroup { weights: weights.collect::<Result<_>>()?, progress: *progress };
            report.planned_bytes = report.planned_bytes.max(budget.planned_for_ones() as u64);
            lap(&mut clock, &mut report.weight_seconds);
            for (view, weights) in group.weights.iter().enumerate() {
                sink(PartialSums::Weights { view: first + view, sums: &weights.sums })?;
            }
            let together = |scene: &mut dyn Scene, frames: &[usize]| budget.share(scene, frames, config);
            let job = Job { config, together: &together, views: &[] };
            let render = |batch: &dyn FrameBatch, budget: &Budget<'_>, report: &mut RenderReport| {
                sum_batch(batch, &group, budget, report)
            };
            for_each_batch(scene, &job, report, render, |frames, channels, _| {
                for view in 0..group.weights.len() {
                    let channels: Vec<&Planes> = channels.iter().map(|channel| &channel.pictures[view]).collect();
                    for n in 0..frames.len() {
                        give(&channels, first + view, frames, n, *sink)?;
                        progress.advance(1);
                    }
                }
                Ok(())
            })?;
            first += budget.setups().len();
        }
        Ok(())
    }
}

/// The sums of one channel of a batch in one view.
struct Planes {
    pixels: usize,
    /// Emissions of all frames, then their missing weights.
    all: Zeroed<f64>,
    missing: bool,
}

impl Planes {
    fn plane(&self, n: usize) -> &[f64] {
        &self.all[n * self.pixels..(n + 1) * self.pixels]
    }
}

/// The sums of a batch in some views.
fn sum_batch(
    batch: &dyn FrameBatch,
    group: &ViewGroup<'_>,
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<Planes>> {
    let (layout, keeper, pixels) = (batch.layout(), PartialSumKeeper { batch }, budget.pixels());
    let planes = layout.frames * (1 + usize::from(layout.absent));
    let mut pictures: Vec<Zeroed<f64>> = group.weights.iter().map(|_| Zeroed::new(planes * pixels)).collect();
    let keep = |_: usize, tile: ResolvedTile<'_>, pixels: &mut Pixels<'_, f64>| keeper.tile(tile, pixels);
    group.splat(batch, budget, report, &mut pictures, &keep)?;
    Ok(pictures.into_iter().map(|all| Planes { pixels, all, missing: layout.absent }).collect())
}

/// Gives frame `n` of some frames of a view to the sink.
fn give(channels: &[&Planes], view: usize, frames: &[usize], n: usize, sink: &mut PartialSumSink<'_>) -> Result<()> {
    let missing = channels.iter().any(|channel| channel.missing);
    let none = vec![0.0; if missing { channels[0].pixels } else { 0 }];
    let mut planes: Vec<&[f64]> = Vec::new();
    for channel in channels {
        planes.push(channel.plane(n));
        if missing {
            planes.push(if channel.missing { channel.plane(frames.len() + n) } else { &none });
        }
    }
    sink(PartialSums::Picture { view, frame: frames[n], planes: &planes, missing })
}
