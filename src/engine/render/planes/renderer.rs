//! Planes through the volume: every frame batch block by block, one view after another.

use super::{PlanesPass, PlanesView};
use crate::render::batches::{SampleReader, SampledView, Scene};
use crate::render::config::{Plane, RenderConfig, ViewTask};
use crate::render::renderer::{Output, Renderer, give};
use crate::render::report::{RenderReport, ViewReport};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::view::camera::View;

/// Renders planes through the volume. Progress counts pictures.
pub(in crate::render) struct Planes {
    /// The panels of each view's picture.
    views: Vec<Vec<PlanesView>>,
    /// The view of the first panel, if there are panels.
    first: Option<View>,
}

impl Planes {
    pub(in crate::render) fn new(
        grid: &Grid,
        config: &RenderConfig,
        planes: &[Plane],
        panels: &[View],
    ) -> Result<Self> {
        let clip = config.clip(grid)?;
        let side_by_side = || -> Result<Vec<PlanesView>> {
            let alone = planes.iter().zip(panels);
            alone.map(|(plane, panel)| PlanesView::new(grid, clip, std::slice::from_ref(plane), panel)).collect()
        };
        let views = config.views.iter().map(|view| match panels {
            [] => Ok(vec![PlanesView::new(grid, clip, planes, view)?]),
            panels if panels.len() == planes.len() && panels.iter().all(|panel| panel.size == view.size) => {
                side_by_side()
            }
            _ => Err(Error::setting("planes", "takes a panel of the picture's size for each plane, or none")),
        });
        Ok(Self { views: views.collect::<Result<_>>()?, first: panels.first().copied() })
    }
}

impl Renderer for Planes {
    fn least_memory(&self, scene: &dyn Scene, config: &RenderConfig) -> usize {
        let least = |panels: &Vec<PlanesView>| {
            SampledView { config, frame_bytes: &|frames| panels[0].bytes(frames) }.least_memory(scene)
        };
        self.views.iter().map(least).max().unwrap_or(0)
    }

    fn reports(&self, config: &RenderConfig) -> Vec<ViewReport> {
        let none = f64::NAN;
        let report = |(view, panels): (_, &Vec<PlanesView>)| ViewReport {
            method: "planes",
            stated_splat_error: none,
            expected_error: none,
            ..ViewReport::new(self.first.as_ref().unwrap_or(view), &panels[0].camera)
        };
        config.views.iter().zip(&self.views).map(report).collect()
    }

    fn steps(&self) -> usize {
        self.views.len()
    }

    fn render(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut Output<'_, '_>) -> Result<()> {
        let Output { sink, report, progress } = output;
        for number in task.views.clone() {
            let panels = &self.views[number];
            let needed = panels.iter().map(PlanesView::needed).reduce(|a, b| a.joined(&b));
            let config = RenderConfig { region: needed, ..task.config.clone() };
            let sampled = SampledView { config: &config, frame_bytes: &|frames| panels[0].bytes(frames) };
            let render =
                |reader: &SampleReader<'_>, report: &mut RenderReport| PlanesPass { panels, reader }.pictures(report);
            sampled.render(scene, *progress, report, render, |frames, pictures, _| {
                progress.advance(frames.len() as u64);
                give(*sink, number, frames, &pictures)
            })?;
        }
        Ok(())
    }
}
