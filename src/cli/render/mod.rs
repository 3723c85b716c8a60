//! The options of `wavesplat-render`, and what they do.
#![allow(missing_docs)] // clap takes an option's comment as its help

mod along;
mod annotations;
mod args;
mod chart;
mod colouring;
mod colours;
mod config;
mod cuts;
mod generate;
#[cfg(feature = "view")]
pub mod live;
#[cfg(feature = "view")]
mod look;
mod motion;
mod places;
mod probes;
mod provenance;
mod ranges;
mod report;
mod scene;
mod sinks;
mod surfaces;
mod targets;
mod view_names;
mod views;
#[cfg(feature = "view")]
mod work;

use crate::base::error::Result;
use crate::file::CoefficientFile;
use crate::render::annotate::Annotation;
use crate::render::sink::Provenance;
use crate::render::{RenderConfig, Scene, render};
use args::Cli;
use colouring::Colouring;
pub use generate::Program;
use report::{Reported, summary, unit};
use scene::Opened;
use std::sync::Arc;
use targets::Targets;
#[cfg(feature = "view")]
pub use {look::Look, work::Work};

/// Everything that rendering needs, opened and chosen.
struct Prepared {
    scene: Box<dyn Scene>,
    /// The coefficient file of the scene.
    file: Option<Arc<CoefficientFile>>,
    config: RenderConfig,
    /// The files of pictures, and of their errors.
    targets: (Targets, Option<Targets>),
    colouring: Colouring,
    provenance: Provenance,
    annotation: Annotation,
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        if self.probes.is_asked() {
            return self.probe();
        }
        let Prepared { mut scene, file, config, targets, colouring, provenance, annotation } = self.prepared()?;
        let targets = (&targets.0, targets.1.as_ref());
        let mut sinks = self.sinks(&config, targets, &colouring, (&provenance, annotation))?;
        let progress = self.common.progress("render", unit(&config.mode));
        let report = render(scene.as_mut(), &config, &progress, &mut |rendered| sinks.picture(&rendered))?;
        sinks.finish()?;
        self.common.detail(summary(&report));
        self.note_errors(&report);
        let (file_bytes_read, file_bytes) = file.as_ref().map(|f| (f.bytes_read(), f.bytes())).unzip();
        if let (Some(read), Some(bytes)) = (file_bytes_read, file_bytes) {
            self.common.detail_read(read, bytes);
        }
        let coloured = colouring.coloured();
        let reported = Reported { report: &report, picture: &provenance, coloured, file_bytes_read, file_bytes };
        self.report(&reported)?;
        file.map_or(Ok(()), |file| file.refuse_skipped())
    }

    /// Opens the scene, and chooses the settings and colours of its pictures.
    fn prepared(&self) -> Result<Prepared> {
        let Opened { mut scene, file, exaggeration, annotation, colours, axes } = self.scene()?;
        let mut config = self.config(scene.as_ref(), file.as_deref(), colours.as_ref())?;
        let (whole, lod) = file.as_ref().map_or((*scene.grid(), 0), |file| (file.whole_grid(), file.lod()));
        self.set_planes(&mut config, &axes, (scene.grid(), &whole, lod))?;
        let targets = self.targets(&config)?;
        config.memory = self.memory_besides_sinks(scene.as_ref(), &targets, &config)?;
        let colours = self.automatic_colours(scene.as_mut(), &mut config, colours)?;
        self.note_surfaces(&config, file.as_deref());
        let colouring = self.colouring(scene.as_mut(), &config, (&targets.0, targets.1.as_ref()), colours.as_ref())?;
        let provenance = Provenance {
            slice: self.slice_texts(&axes)?,
            annotate: self.around.words(),
            title: Some(annotation.title.clone()).filter(|title| !title.is_empty()),
            exaggerate: Some(exaggeration).filter(|factor| *factor != 1.0),
            ..self.provenance(scene.as_ref(), &config, (file.as_deref(), &annotation.times), &colouring)
        };
        let annotation = Annotation { axes: Some(self.volume_axes(&axes, &whole, &config)?), ..annotation };
        Ok(Prepared { scene, file, config, targets, colouring, provenance, annotation })
    }
}
