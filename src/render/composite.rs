//! The modes with slabs, which are composites and maximum intensity projections: splats every frame batch slab by slab,
//! and blends the slabs front to back.
//!
//! ```text
//! for each view
//!   for each batch of frames of a window           driver: as many as fit
//!     find the visible tiles of each slab          slabs::visible: from the ranges of blocks
//!     for each band of rows
//!       for each run of slabs, front to back       as many as fit, at most a block's depth
//!         splat the blocks that they need          each slab is a view of its own
//!         every tile of each slab inverts its pixels and blends them behind the earlier slabs
//!     give the finished frames to the sink
//! ```

use super::config::{Mode, RenderConfig};
use super::driver::{Job, for_each_batch};
use super::plan::Budget;
use super::report::{RenderReport, Rendered, lap};
use super::scene::{FrameBatch, Scene};
use super::slabs::blend::{Blend, Composite, Largest};
use super::slabs::lengths::WithLengths;
use super::slabs::medium::Medium;
use super::slabs::visible::Visible;
use super::slabs::{Slabs, TOGETHER, count, cut};
use super::splat::{BandAccumulator, Pixels, ResolvedTile, ViewSetup, splat};
use crate::base::error::Result;
use crate::base::progress::Progress;
use crate::wavelet::{LANES, Lane};
use std::ops::Range;
use std::time::Instant;

/// Renders a composite or a maximum intensity projection slab by slab, one view after another. Progress counts rows of
/// pixels of slabs.
pub(super) fn composite(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    setups: &[ViewSetup],
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let all: usize = setups.iter().map(|setup| count(setup, config)).sum();
    progress.start(Some((all * config.frames.len() * config.size()[1]) as u64));
    for (view, setup) in setups.iter().enumerate() {
        let slabs = cut(setup, config)?;
        let mut sink = |frame, picture: &[f32]| sink(Rendered { views: &[], view, frame, picture, error: None });
        render_view(scene, config, &slabs, progress, report, &mut sink)?;
    }
    Ok(())
}

/// Renders all frames from a view that is cut into slabs, and gives each to `sink`.
fn render_view(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    slabs: &Slabs,
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(usize, &[f32]) -> Result<()>,
) -> Result<()> {
    let Slabs { setups: slabs, thickness } = slabs;
    let least = |share: f64| share * thickness;
    match &config.mode {
        Mode::Composite { transfer, unit, .. } => {
            let unit = unit.unwrap_or_else(|| scene.grid().largest_spacing());
            let blend = Composite { medium: Medium::new(transfer), unit };
            View { slabs, least: least(Composite::LEAST), blend, config, progress }.render(scene, report, sink)
        }
        Mode::Mip { .. } => {
            View { slabs, least: least(Largest::LEAST), blend: Largest, config, progress }.render(scene, report, sink)
        }
        Mode::Projection => Ok(()),
    }
}

/// A view with its slabs and the way they blend.
struct View<'a, B> {
    slabs: &'a [ViewSetup],
    /// Minimum length of a ray in a slab, in world units; a slab is ignored at pixels with less.
    least: f64,
    blend: B,
    config: &'a RenderConfig,
    progress: &'a dyn Progress,
}

impl<B: Blend> View<'_, B> {
    fn render(
        &self,
        scene: &mut dyn Scene,
        report: &mut RenderReport,
        sink: &mut dyn FnMut(usize, &[f32]) -> Result<()>,
    ) -> Result<()> {
        let budget = Budget::of_slabs(self.config, scene, self.slabs);
        let job = Job { config: self.config, budget: &budget, views: &[] };
        let render = |batch: &dyn FrameBatch, report: &mut RenderReport| self.render_batch(batch, &budget, report);
        for_each_batch(scene, job, report, render, |frames, channels, _| {
            let pictures = &channels[0].pictures;
            let numbers = pictures.len() / frames.len();
            frames.iter().zip(pictures.chunks_exact(numbers)).try_for_each(|(frame, picture)| sink(*frame, picture))
        })
    }

    /// The pictures of all frames of a batch, one after another.
    fn render_batch(&self, batch: &dyn FrameBatch, budget: &Budget<'_>, report: &mut RenderReport) -> Result<Vec<f32>> {
        let visible = Visible::new(batch.selection(), self.slabs, &self.blend);
        let source = WithLengths::new(batch, &self.slabs[0]);
        let mut pixels = vec![B::EMPTY; source.layout.frames * budget.pixels()];
        for rows in budget.bands(&source.layout) {
            self.render_band(&source, (&visible, budget), &rows, &mut pixels, report)?;
        }
        let [tiles, clear, opaque] = visible.counts();
        report.tiles += tiles;
        report.tiles_clear += clear;
        report.tiles_opaque += opaque;
        Ok(B::finish(pixels))
    }

    /// Blends all slabs into the pixels of a band, as many slabs at a time as fit in the budget.
    fn render_band(
        &self,
        source: &WithLengths<'_>,
        (visible, budget): (&Visible, &Budget<'_>),
        rows: &Range<usize>,
        pixels: &mut [B::Pixel],
        report: &mut RenderReport,
    ) -> Result<()> {
        let mut next = 0;
        while next < self.slabs.len() {
            let open = (next..self.slabs.len()).filter(|slab| visible.any(*slab, rows));
            let run: Vec<usize> = open.take(budget.setups().len()).collect();
            let end = if run.len() < budget.setups().len() { self.slabs.len() } else { run[run.len() - 1] + 1 };
            let of_slab = |slab: &usize| BandAccumulator::new(&self.slabs[*slab], rows.clone(), &source.layout);
            let mut accumulators: Vec<_> = run.iter().map(of_slab).collect();
            let (blocks, batch) = (visible.blocks(&run, rows), budget.batch(&source.layout, rows.len()));
            report.add_splatted(&splat(&mut accumulators, (&blocks, batch), source)?);
            let mut clock = Instant::now();
            let wanted = |n: usize, rect: &_| visible.is_open(run[n], rect);
            let together = (TOGETHER / source.layout.planes()).max(1);
            BandAccumulator::finish_layers(&accumulators, together, pixels, wanted, |tile, pixels| {
                self.blend_tile(source, visible, tile, pixels);
            });
            lap(&mut clock, &mut report.inverse_seconds);
            self.progress.advance((source.layout.frames * rows.len() * (end - next)) as u64);
            next = end;
        }
        Ok(())
    }

    /// Blends the layers of a tile, front to back, behind the earlier slabs.
    fn blend_tile(
        &self,
        source: &WithLengths<'_>,
        visible: &Visible,
        mut tile: ResolvedTile<'_>,
        pixels: &mut Pixels<'_, B::Pixel>,
    ) {
        let (frames, count) = (source.layout.frames, source.layout.planes());
        let mut layers = source.layers(&tile.used(), tile.layers);
        let mut planes = vec![Lane::default(); tile.layers * count];
        let (width, mut is_closed) = (tile.rect.x.len(), true);
        for (y, at) in tile.rect.y.clone().zip((0..).step_by(width)) {
            for first in (0..width).step_by(LANES) {
                let lanes = LANES.min(width - first);
                let pixel = [tile.rect.x.start + first, y];
                if (0..frames).all(|f| pixels.at(f, pixel, lanes).iter().all(B::is_closed)) {
                    continue;
                }
                is_closed = false;
                tile.load(at + first, lanes, &mut planes);
                for (layer, planes) in layers.iter_mut().zip(planes.chunks_exact_mut(count)) {
                    layer.means(planes, |f, sums, lengths| self.blend_lane(sums, lengths, pixels.at(f, pixel, lanes)));
                }
            }
        }
        if is_closed {
            visible.close(tile.rect);
        }
    }

    fn blend_lane(&self, sums: &Lane, lengths: &Lane, pixels: &mut [B::Pixel]) {
        for ((pixel, sum), length) in pixels.iter_mut().zip(sums).zip(lengths) {
            if *length > self.least {
                self.blend.add(pixel, sum / length, *length);
            }
        }
    }
}
