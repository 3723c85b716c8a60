//! The sinks that write pictures.

use super::args::Cli;
use super::colouring::Colouring;
use super::provenance::error_provenance;
use super::targets::Targets;
use crate::base::error::Result;
use crate::render::annotate::Annotation;
use crate::render::sink::{Provenance, Sink, SinkConfig};
use crate::render::{Pixel, RenderConfig, Rendered};
use std::sync::Arc;

/// The sinks of pictures and of their errors: one for each view, or one for all.
pub(crate) struct Sinks {
    pictures: Vec<Sink>,
    errors: Vec<Sink>,
}

impl Sinks {
    /// Writes one rendered picture, and its error.
    pub(crate) fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        for sinks in [&mut self.errors, &mut self.pictures] {
            let index = if sinks.len() == 1 { 0 } else { rendered.view };
            sinks.get_mut(index).map_or(Ok(()), |sink| sink.picture(rendered))?;
        }
        Ok(())
    }

    /// Completes all files under their final names.
    pub(crate) fn finish(self) -> Result<()> {
        self.errors.into_iter().chain(self.pictures).try_for_each(Sink::finish)
    }
}

impl Cli {
    /// The settings of the sinks of pictures, still without the pictures that they show.
    pub(crate) fn sink_config(
        &self,
        config: &RenderConfig,
        pictures: &Targets,
        colouring: &Colouring,
        (provenance, annotation): (&Provenance, Annotation),
    ) -> Result<SinkConfig> {
        Ok(SinkConfig {
            format: pictures.format,
            size: self.size.0,
            shown: Vec::new(),
            provenance: Arc::new(provenance.clone()),
            fps: self.fps(config, &annotation.times)?,
            pixel: colouring.pixel,
            colours: colouring.of_pictures.clone(),
            depth: self.depth,
            coloured_array: self.colour.is_asked(),
            annotation: (self.around.is_asked() || self.is_page()).then_some(annotation),
            force: self.force,
        })
    }

    /// Opens the sinks of a run.
    pub(crate) fn sinks(
        &self,
        config: &RenderConfig,
        (pictures, errors): (&Targets, Option<&Targets>),
        colouring: &Colouring,
        (provenance, annotation): (&Provenance, Annotation),
    ) -> Result<Sinks> {
        let of_pictures = self.sink_config(config, pictures, colouring, (provenance, annotation))?;
        let Colouring { pixel, of_errors, .. } = colouring;
        let Some(errors) = errors else {
            return Ok(Sinks { pictures: open(pictures, &of_pictures, config)?, errors: Vec::new() });
        };
        let of_errors = SinkConfig {
            format: errors.format,
            provenance: Arc::new(error_provenance(provenance, colouring)),
            pixel: if *pixel == Pixel::Light { Pixel::Value } else { *pixel },
            colours: of_errors.clone(),
            coloured_array: false,
            ..of_pictures.clone()
        };
        let errors = open(errors, &of_errors, config)?;
        Ok(Sinks { pictures: open(pictures, &of_pictures, config)?, errors })
    }
}

fn open(targets: &Targets, sink: &SinkConfig, config: &RenderConfig) -> Result<Vec<Sink>> {
    let shown = |n| SinkConfig { shown: targets.shown(n, config), ..sink.clone() };
    targets.names.iter().enumerate().map(|(n, name)| Sink::open(name, shown(n))).collect()
}
