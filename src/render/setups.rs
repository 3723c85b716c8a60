//! The setups of all views of a rendering, and the mode that renders them.

use super::config::{Mode, RenderConfig};
use super::plan::{Budget, Kept};
use super::planes::PlanesView;
use super::project::project;
use super::report::{RenderReport, Rendered, ViewReport};
use super::scene::Scene;
use super::slices::SlicedView;
use super::splat::ViewSetup;
use super::splat::reference_weights::{with_backend, without_dim_voxels};
use super::{composite, cut};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::{BlockGrid, Grid};
use crate::base::progress::Progress;
use crate::view::camera::View;
use std::ops::Range;

/// The setups of all views.
pub(super) enum Setups {
    /// Of projections.
    Splatted(Vec<ViewSetup>),
    /// Of composites and maximum intensity projections.
    Sliced(Vec<SlicedView>),
    /// Of planes through the volume.
    Planes(Vec<PlanesView>),
}

impl Setups {
    pub(super) fn new(scene: &dyn Scene, config: &RenderConfig) -> Result<Self> {
        config.check(scene.frames())?;
        let (grid, views) = (scene.grid(), config.views.iter());
        if config.mode.is_projection() {
            return splatted((*grid, scene.blocks()), config).map(Self::Splatted);
        }
        if scene.channels() > 1 {
            let what = "the samples are colours already, and colours are rendered as projections only";
            return Err(Error::setting("mode", Note::with(what, Remedy::ProjectOrConvertSamples)));
        }
        if let Mode::Planes { planes } = &config.mode {
            let clip = config.clip(grid)?;
            return views
                .map(|view| PlanesView::new(grid, clip, planes, view))
                .collect::<Result<_>>()
                .map(Self::Planes);
        }
        views.map(|view| SlicedView::new(grid, config, view)).collect::<Result<_>>().map(Self::Sliced)
    }

    /// The least memory with which any view can be rendered alone.
    pub(super) fn least(&self, scene: &dyn Scene, config: &RenderConfig) -> usize {
        match self {
            Self::Splatted(setups) => Budget::least((config, Kept::Value), scene, setups),
            Self::Sliced(views) => composite::least(scene, config, views),
            Self::Planes(views) => cut::least(scene, config, views),
        }
    }

    /// The report of each view, before anything is rendered.
    pub(super) fn reports(&self, config: &RenderConfig) -> Vec<ViewReport> {
        let views = config.views.iter();
        match self {
            Self::Splatted(setups) => reports_of_splatted(setups, config),
            Self::Sliced(all) => {
                let of = |(view, sliced): (&View, &SlicedView)| {
                    ViewReport::of_slices(view, &sliced.camera, sliced.slices(), sliced.cells)
                };
                views.zip(all).map(of).collect()
            }
            Self::Planes(all) => views.zip(all).map(|(view, of)| ViewReport::of_planes(view, &of.camera)).collect(),
        }
    }

    /// The steps of progress: slices of pictures, or pictures.
    pub(super) fn steps(&self, config: &RenderConfig) -> u64 {
        let of_each_frame = match self {
            Self::Splatted(setups) => setups.len(),
            Self::Sliced(views) => views.iter().map(SlicedView::slices).sum(),
            Self::Planes(views) => views.len(),
        };
        (of_each_frame * config.frames_of_view()) as u64
    }

    /// Renders the frames of `config` from some of the views.
    pub(super) fn render(
        &self,
        (scene, config): (&mut dyn Scene, &RenderConfig),
        which: Range<usize>,
        progress: &dyn Progress,
        report: &mut RenderReport,
        sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
    ) -> Result<()> {
        match self {
            Self::Splatted(setups) => project(scene, config, (setups, which), progress, report, sink),
            Self::Sliced(views) => composite::composite(scene, config, (views, which), progress, report, sink),
            Self::Planes(views) => cut::cut(scene, config, (views, which), progress, report, sink),
        }
    }
}

/// The setups of projections of a grid that is cut into blocks.
pub(super) fn splatted(volume: (Grid, BlockGrid), config: &RenderConfig) -> Result<Vec<ViewSetup>> {
    let setup = |view: &View| {
        let setup = with_backend(ViewSetup::new(volume, config, view)?, config)?;
        without_dim_voxels(setup, config)
    };
    config.views.iter().map(setup).collect()
}

/// The reports of projections, before anything is rendered.
pub(super) fn reports_of_splatted(setups: &[ViewSetup], config: &RenderConfig) -> Vec<ViewReport> {
    let of = |(view, setup): (&View, &ViewSetup)| ViewReport {
        splat_error_is_estimate: config.quick && setup.backend.is_lattice(),
        ..ViewReport::new(view, setup)
    };
    config.views.iter().zip(setups).map(of).collect()
}
