//! `wavesplat-render`: renders pictures from coefficient files, or from frames by the conventional method.
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

use args::Cli;
use generate::Program;
use report::{Reported, summary, unit};
use scene::Opened;
use std::process::ExitCode;
use wavesplat::base::error::Result;
use wavesplat::cli;
use wavesplat::render::annotate::Annotation;
use wavesplat::render::render;
use wavesplat::render::sink::Provenance;

fn main() -> ExitCode {
    cli::main(Program::run)
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        if self.probes.is_asked() {
            return self.probe();
        }
        let Opened { mut scene, file, exaggeration, annotation, colours, axes } = self.scene()?;
        let mut config = self.config(scene.as_ref(), file.as_deref(), colours.as_ref())?;
        let (whole, lod) = file.as_ref().map_or((*scene.grid(), 0), |file| (file.whole_grid(), file.lod()));
        self.set_planes(&mut config, &axes, (scene.grid(), &whole, lod))?;
        let targets = self.targets(&config)?;
        config.memory = self.memory_besides_sinks(scene.as_ref(), &targets, &config)?;
        let colours = self.automatic_colours(scene.as_mut(), &mut config, colours)?;
        self.note_surfaces(&config, file.as_deref());
        let targets = (&targets.0, targets.1.as_ref());
        let colouring = self.colouring(scene.as_mut(), &config, targets, colours.as_ref())?;
        let provenance = Provenance {
            slice: self.slice_texts(&axes)?,
            annotate: self.around.words(),
            title: Some(annotation.title.clone()).filter(|title| !title.is_empty()),
            exaggerate: Some(exaggeration).filter(|factor| *factor != 1.0),
            ..self.provenance(scene.as_ref(), &config, (file.as_deref(), &annotation.times), &colouring)
        };
        let annotation = Annotation { axes: Some(self.volume_axes(&axes, &whole, &config)?), ..annotation };
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
}
