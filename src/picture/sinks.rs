//! The sinks that write pictures.

use super::annotations::is_annotated;
use super::colouring::Colouring;
use super::provenance::error_provenance;
use super::request::PictureRequest;
use super::speed::frames_per_second;
use super::targets::{AllTargets, Targets, is_page};
use crate::base::error::Result;
use crate::render::annotate::Annotation;
use crate::render::sink::{Provenance, Sink, SinkConfig};
use crate::render::{Pixel, RenderConfig, Rendered};
use std::sync::Arc;

/// The sinks of pictures and of their errors: one for each view, or one for all.
pub(super) struct Sinks {
    pictures: Vec<Sink>,
    errors: Vec<Sink>,
}

impl Sinks {
    /// Writes one rendered picture, and its error.
    pub(super) fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        for sinks in [&mut self.errors, &mut self.pictures] {
            let index = if sinks.len() == 1 { 0 } else { rendered.view };
            sinks.get_mut(index).map_or(Ok(()), |sink| sink.picture(rendered))?;
        }
        Ok(())
    }

    /// Completes all files under their final names.
    pub(super) fn finish(self) -> Result<()> {
        self.errors.into_iter().chain(self.pictures).try_for_each(Sink::finish)
    }
}

/// The input of the sinks of a run.
pub(super) struct SinkInput<'a> {
    pub(super) request: &'a PictureRequest,
    pub(super) config: &'a RenderConfig,
    pub(super) targets: &'a AllTargets,
    pub(super) colouring: &'a Colouring,
    pub(super) provenance: &'a Provenance,
    pub(super) annotation: &'a Annotation,
}

impl SinkInput<'_> {
    /// The settings of the sinks of pictures, still without the pictures that they show.
    pub(super) fn config(&self) -> Result<SinkConfig> {
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
            coloured_array: request.colormap.is_some(),
            annotation: (is_annotated(request) || is_page(request)).then(|| annotation.clone()),
            force: request.force,
        })
    }

    /// Opens the sinks of a run.
    pub(super) fn open(&self) -> Result<Sinks> {
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
        SinkConfig {
            format: errors.format,
            provenance: Arc::new(error_provenance(self.provenance, self.colouring)),
            pixel: if *pixel == Pixel::Light { Pixel::Value } else { *pixel },
            colours: error_scale.clone(),
            coloured_array: false,
            ..sink_config.clone()
        }
    }
}

fn open(targets: &Targets, sink: &SinkConfig, config: &RenderConfig) -> Result<Vec<Sink>> {
    let shown = |n| SinkConfig { shown: targets.shown(n, config), ..sink.clone() };
    targets.names.iter().enumerate().map(|(n, name)| Sink::open(name, shown(n))).collect()
}
