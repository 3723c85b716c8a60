//! The options of `wavesplat-render`, and what they do.
#![allow(missing_docs)] // clap takes an option's comment as its help

mod along;
mod annotations;
mod args;
mod chart;
mod colouring;
mod colours;
mod config;
mod conflicts;
mod cuts;
mod generate;
#[cfg(feature = "view")]
pub mod live;
#[cfg(feature = "view")]
mod look;
mod motion;
mod parts;
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

use crate::base::error::{Error, Result};
use crate::base::progress::Progress;
use crate::file::CoefficientFile;
use crate::render::annotate::Annotation;
use crate::render::sink::Provenance;
use crate::render::{RenderConfig, Scene, render};
use args::Cli;
use clap::Parser;
use colouring::Colouring;
pub use generate::Program;
use ranges::Ranges;
use report::{Reported, summary, unit};
use scene::Opened;
use std::ffi::OsString;
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

/// Runs `wavesplat-render` with these arguments within a program that has its own threads, progress and messages.
///
/// # Errors
/// Those of the program; [`Error::Usage`](crate::Error::Usage) names its options.
pub fn run_within(words: impl IntoIterator<Item = OsString>, progress: &dyn Progress) -> Result<()> {
    parsed(words)?.work(Some(progress))
}

/// Parses the arguments of `wavesplat-render`, with `--quiet` added.
fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<Cli> {
    let first_line = |text: &str| text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string();
    let words = ["wavesplat-render", "--quiet"].map(OsString::from).into_iter().chain(words);
    let program = Program::try_parse_from(words).map_err(|e| Error::usage(first_line(&e.to_string())))?;
    let Program::Render(mut cli) = program else { return Err(Error::usage("--generate: shows no pictures")) };
    cli.imply_mode()?;
    cli.imply_look()?;
    Ok(*cli)
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        self.work(None)
    }

    /// Writes what is asked for. Progress goes to the terminal unless there is another.
    fn work(&self, progress: Option<&dyn Progress>) -> Result<()> {
        if self.probes.is_asked() {
            return self.probe();
        }
        if self.is_of_parts() {
            return self.work_on_parts(progress);
        }
        let Prepared { mut scene, file, config, targets, colouring, provenance, annotation } = self.prepared()?;
        let targets = (&targets.0, targets.1.as_ref());
        let mut sinks = self.sinks(&config, targets, &colouring, (&provenance, annotation))?;
        let terminal = self.common.progress("render", unit(&config.mode));
        let progress = progress.unwrap_or(&terminal);
        let report = render(scene.as_mut(), &config, progress, &mut |rendered| sinks.picture(&rendered))?;
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
        let (channels, targeted) = (scene.channels(), (&targets.0, targets.1.as_ref()));
        let ranges = |needed| Ranges::small(scene.as_mut(), &config, needed, &self.common);
        let colouring = self.colouring(channels, &config, targeted, colours.as_ref(), ranges)?;
        let provenance = Provenance {
            slice: self.slice_texts(&axes)?,
            annotate: self.around.words(),
            title: Some(annotation.title.clone()).filter(|title| !title.is_empty()),
            bar_title: self.around.bar_title(),
            exaggerate: Some(exaggeration).filter(|factor| *factor != 1.0),
            ..self.provenance(scene.grid(), &config, (file.as_deref(), &annotation.times), &colouring)
        };
        let annotation = Annotation { axes: Some(self.volume_axes(&axes, &whole, &config)?), ..annotation };
        self.note_title(&annotation, &config);
        Ok(Prepared { scene, file, config, targets, colouring, provenance, annotation })
    }
}
