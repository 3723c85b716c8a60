//! Planes through the volume: every frame batch block by block, one view after another.

use super::{PlanesPass, PlanesView};
use crate::render::batches::{SampleReader, SampledView, Scene};
use crate::render::config::{Plane, RenderConfig, ViewTask};
use crate::render::renderer::{Output, Renderer, give};
use crate::render::report::{RenderReport, ViewReport};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Grid;

/// Renders planes through the volume. Progress counts pictures.
pub(in crate::render) struct Planes {
    views: Vec<PlanesView>,
}

impl Planes {
    pub(in crate::render) fn new(grid: &Grid, config: &RenderConfig, planes: &[Plane]) -> Result<Self> {
        let clip = config.clip(grid)?;
        let views = config.views.iter().map(|view| PlanesView::new(grid, clip, planes, view));
        Ok(Self { views: views.collect::<Result<_>>()? })
    }
}

impl Renderer for Planes {
    fn least_memory(&self, scene: &dyn Scene, config: &RenderConfig) -> usize {
        let least =
            |view: &PlanesView| SampledView { config, frame_bytes: &|frames| view.bytes(frames) }.least_memory(scene);
        self.views.iter().map(least).max().unwrap_or(0)
    }

    fn reports(&self, config: &RenderConfig) -> Vec<ViewReport> {
        let none = f64::NAN;
        let report = |(view, planes): (_, &PlanesView)| ViewReport {
            method: "planes",
            stated_splat_error: none,
            expected_error: none,
            ..ViewReport::new(view, &planes.camera)
        };
        config.views.iter().zip(&self.views).map(report).collect()
    }

    fn steps(&self) -> usize {
        self.views.len()
    }

    fn render(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut Output<'_, '_>) -> Result<()> {
        let Output { sink, report, progress } = output;
        for number in task.views.clone() {
            let view = &self.views[number];
            let config = RenderConfig { region: Some(view.needed()), ..task.config.clone() };
            let sampled = SampledView { config: &config, frame_bytes: &|frames| view.bytes(frames) };
            let render =
                |reader: &SampleReader<'_>, report: &mut RenderReport| PlanesPass { view, reader }.pictures(report);
            sampled.render(scene, *progress, report, render, |frames, pictures, _| {
                progress.advance(frames.len() as u64);
                give(*sink, number, frames, &pictures)
            })?;
        }
        Ok(())
    }
}
