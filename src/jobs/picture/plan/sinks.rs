//! The sinks that write pictures.

use super::colouring::Colouring;
use super::format::is_page;
use super::pixels::rays;
use super::provenance::error_provenance;
use super::speed::frames_per_second;
use super::targets::{AllTargets, Targets};
use crate::picture::request::PictureRequest;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Grid;
use wavesplat_engine::render::annotate::Annotation;
use wavesplat_engine::render::sink::{Provenance, Sink, SinkConfig, Weighing};
use wavesplat_engine::render::{Pixel, RenderConfig, Rendered};

/// The sinks of pictures and of their errors: one for each view, or one for all.
pub(in crate::picture) struct Sinks {
    pictures: Vec<Sink>,
    errors: Vec<Sink>,
}

impl Sinks {
    /// Writes one rendered picture, and its error.
    pub(in crate::picture) fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        for sinks in [&mut self.errors, &mut self.pictures] {
            let index = if sinks.len() == 1 { 0 } else { rendered.view };
            sinks.get_mut(index).map_or(Ok(()), |sink| sink.picture(rendered))?;
        }
        Ok(())
    }

    /// Completes all files under their final names.
    pub(in crate::picture) fn finish(self) -> Result<()> {
        self.errors.into_iter().chain(self.pictures).try_for_each(Sink::finish)
    }
}

/// The input of the sinks of a run.
pub(in crate::picture) struct SinkInput<'a> {
    pub(in crate::picture) request: &'a PictureRequest,
    /// The lattice that is rendered.
    pub(in crate::picture) grid: &'a Grid,
    pub(in crate::picture) config: &'a RenderConfig,
    pub(in crate::picture) targets: &'a AllTargets,
    pub(in crate::picture) colouring: &'a Colouring,
    pub(in crate::picture) provenance: &'a Provenance,
    pub(in crate::picture) annotation: &'a Annotation,
}

impl SinkInput<'_> {
    /// The settings of the sinks of pictures, still without the pictures that they show.
    pub(in crate::picture) fn config(&self) -> Result<SinkConfig> {
        let Self { request, config, annotation, .. } = *self;
        Ok(SinkConfig {
            format: self.targets.pictures.format,
            size: config.views[0].size,
            shown: Vec::new(),
            provenance: Arc::new(self.provenance.clone()),
            fps: frames_per_second(request, config, &annotation.times)?,
            pixel: self.colouring.pixel,
            colours: self.colouring.picture_scale.clone(),
            depth: request.depth,
            weighing: self.weighing(),
            coloured_array: request.colormap.is_some(),
            annotation: (request.is_annotated() || is_page(request)).then(|| annotation.clone()),
            force: request.force,
        })
    }

    /// How means are weighed.
    fn weighing(&self) -> Option<Weighing> {
        let beyond = self.colouring.beyond? as f32;
        Some(Weighing { rays: rays(self.config, self.grid), beyond })
    }

    /// Opens the sinks of a run.
    pub(in crate::picture) fn open(&self) -> Result<Sinks> {
        let sink_config = self.config()?;
        let errors = match &self.targets.errors {
            Some(errors) => open(errors, &self.error_config(errors, &sink_config), self.config)?,
            None => Vec::new(),
        };
        Ok(Sinks { pictures: open(&self.targets.pictures, &sink_config, self.config)?, errors })
    }

    /// The settings of the sinks of errors.
    fn error_config(&self, errors: &Targets, sink_config: &SinkConfig) -> SinkConfig {
        let Colouring { pixel, error_scale, .. } = self.colouring;
        let values = |annotation: Annotation| match pixel {
            Pixel::Light => {
                Annotation { values: "certified error of light".into(), surfaces: Vec::new(), ..annotation }
            }
            Pixel::Value | Pixel::Channels => annotation,
        };
        SinkConfig {
            format: errors.format,
            provenance: Arc::new(error_provenance(self.provenance, self.colouring)),
            pixel: if *pixel == Pixel::Light { Pixel::Value } else { *pixel },
            colours: error_scale.clone(),
            coloured_array: false,
            weighing: None,
            annotation: sink_config.annotation.clone().map(values),
            ..sink_config.clone()
        }
    }
}

fn open(targets: &Targets, sink: &SinkConfig, config: &RenderConfig) -> Result<Vec<Sink>> {
    let shown = |n| SinkConfig { shown: targets.shown(n, config), ..sink.clone() };
    targets.names.iter().enumerate().map(|(n, name)| Sink::open(name, shown(n))).collect()
}
