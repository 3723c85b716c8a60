//! Colour and opacity along the rays, slab by slab.
//!
//! The volume is cut into slabs across the view direction, as in image-aligned splatting
//! ([Mueller](crate::bibliography)). The planes of each slab are splatted and inverted for all frames, and its means
//! are coloured and composited front to back.
//!
//! ```text
//! for each view
//!   for each group of frames of a window          plan: as many as fit
//!     which tiles of which slabs can be seen       visible: from the ranges of blocks
//!     for each band of rows
//!       for each run of slabs, front to back       as many as fit, and as a block is deep
//!         splat the blocks that they need          as for several views: each slab is a view of its own
//!         each slab: every tile inverts its pixels, and blends them behind what is there
//!     give the finished frames to the sink
//! ```
//!
//! A slab takes of each voxel the part of its kernel that lies in the slab. The kernel is a product of a Gaussian along
//! the ray and one across it, so the weight is that of the projection times a share of the Gaussian's integral (Phi is
//! the normal distribution):
//!
//! ```text
//! w_{i,slab} = w_i (Phi((far - z_i) / sigma) - Phi((near - z_i) / sigma))                                 (eq 29)
//! ```
//!
//! With these weights, a pixel of a slab has the length l = sum of w and the mean g = sum of w v / l. Its light is that
//! of the emission-absorption model of [Max](crate::bibliography):
//!
//! ```text
//! through = exp(-kappa(g) l)        kappa(v) = -ln(1 - opacity(v)) / unit                                 (eq 30)
//! light = sum over slabs of (product of through before) (1 - through) colour(g)                           (eq 31)
//! ```
//!
//! As slabs become thinner, that tends to the integral along the ray through the field that the kernels make of the
//! samples. Every mean is off by no more than the file's bound (eq 24).

mod blend;
mod cut;
mod lengths;
mod medium;
mod slab;
mod visible;

pub(super) use cut::{bytes, count, cut, of_block};
pub(super) use slab::Slab;

use super::accumulator::{self, BandAccumulator, Pixels, ResolvedTile};
use super::expectation::Expectation;
use super::plan::{self, Budget};
use super::scene::{BatchOutcome, FrameBatch, Scene};
use super::view_setup::ViewSetup;
use super::weights::WeightedView;
use super::{Mode, RenderConfig, RenderReport, Rendered, lap};
use crate::base::error::Result;
use crate::base::progress::Progress;
use crate::wavelet::{LANES, Lane};
use blend::{Blend, Composite, Largest};
use cut::Slabs;
use lengths::WithLengths;
use medium::Medium;
use std::ops::Range;
use std::time::Instant;
use visible::Visible;

/// Planes of slabs that are gathered together, about: what a pixel's weights cost is shared by as many.
pub(super) const TOGETHER: usize = 64;

/// Renders pictures of slabs, view by view; progress is in rows of pixels of slabs.
pub(super) fn render(
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

/// Renders all frames from a view that is cut into slabs, giving each to `sink`.
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

/// A view, and how its slabs become a picture.
struct View<'a, B> {
    slabs: &'a [ViewSetup],
    /// World units that a slab is thick at least where it counts.
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
        let weighted = WeightedView::of_no_weights(&self.slabs[0]);
        let expectation = Expectation::new(&weighted, self.config);
        let mut rest = self.config.frames.as_slice();
        while let Some(first) = rest.first() {
            let most = plan::in_group(scene, *first, rest);
            let (now, later) = rest.split_at(budget.frames(scene, self.config, most));
            let pictures = loop {
                let before = report.clone();
                let group = scene.group(now, 0, self.config, &expectation)?;
                let pictures = self.render_group(group.as_ref(), &budget, report)?;
                match group.finish()? {
                    BatchOutcome::Complete => break pictures,
                    BatchOutcome::NeedsRelayout => *report = before,
                }
            };
            let numbers = pictures.len() / now.len();
            now.iter().zip(pictures.chunks_exact(numbers)).try_for_each(|(frame, picture)| sink(*frame, picture))?;
            rest = later;
        }
        Ok(())
    }

    /// The pictures of all frames of a group, one after another.
    fn render_group(&self, group: &dyn FrameBatch, budget: &Budget<'_>, report: &mut RenderReport) -> Result<Vec<f32>> {
        let setup = &self.slabs[0];
        let visible = Visible::new(group, self.slabs, &self.blend)?;
        let source = WithLengths::new(group, setup, report)?;
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

    /// Blends all slabs of a band into its pixels, as many at a time as the budget has room for.
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
            accumulator::splat(&mut accumulators, &blocks, batch, source, report)?;
            let mut clock = Instant::now();
            let wanted = |n: usize, place: &_| visible.is_open(run[n], place);
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

    /// Puts a tile of some slabs, front to back, behind what is there.
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
        let (width, mut is_closed) = (tile.place.x.len(), true);
        for (y, at) in tile.place.y.clone().zip((0..).step_by(width)) {
            for first in (0..width).step_by(LANES) {
                let lanes = LANES.min(width - first);
                let place = [tile.place.x.start + first, y];
                if (0..frames).all(|f| pixels.at(f, place, lanes).iter().all(B::is_closed)) {
                    continue;
                }
                is_closed = false;
                tile.load(at + first, lanes, &mut planes);
                for (layer, planes) in layers.iter_mut().zip(planes.chunks_exact_mut(count)) {
                    layer.means(planes, |f, sums, lengths| self.blend_lane(sums, lengths, pixels.at(f, place, lanes)));
                }
            }
        }
        if is_closed {
            visible.close(tile.place);
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
