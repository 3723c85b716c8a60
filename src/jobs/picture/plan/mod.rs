//! A request resolved against what it draws: from names to numbers, places, colours and files.

pub(super) mod named_colours;
pub(super) mod modes;
mod format;
pub(super) mod targets;
pub(super) mod annotations;
mod camera_path;
mod views;
mod panels;
mod planes;
pub(super) mod config;
mod range_rules;
pub(super) mod pixels;
pub(super) mod ranges;
mod value_colours;
pub(super) mod colouring;
pub(super) mod opened;
pub(super) mod opening;
pub(super) mod provenance;
mod speed;
pub(super) mod sinks;

use super::reporter::Reporter;
use super::request::PictureRequest;
use super::session::Session;
use annotations::{note_scale, note_title, panels_of, surfaces_of, volume_axes};
use colouring::{Colouring, ColouringInput, automatic_colours, note_surfaces};
use config::render_config;
use modes::check_slices;
use opened::Opened;
use planes::{set_planes, slice_texts};
use provenance::provenance;
use ranges::{KnownSamples, Ranges};
use sinks::SinkInput;
use std::sync::Arc;
use targets::AllTargets;
use wavesplat_core::base::error::Result;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::annotate::Annotation;
use wavesplat_engine::render::sink::Provenance;
use wavesplat_engine::render::{RenderConfig, Scene};

/// Everything that rendering needs, opened and chosen.
pub(super) struct Plan {
    pub(super) scene: Box<dyn Scene>,
    /// The coefficient file of the scene.
    pub(super) file: Option<Arc<CoefficientFile>>,
    pub(super) config: RenderConfig,
    pub(super) targets: AllTargets,
    pub(super) colouring: Colouring,
    pub(super) provenance: Provenance,
    pub(super) annotation: Annotation,
}

impl Plan {
    /// Opens the scene of a request, and chooses the settings and colours of its pictures.
    pub(super) fn new(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Self> {
        check_slices(request)?;
        let Opened { mut scene, file, distributions, exaggeration, annotation, colours, axes } =
            Opened::new(session, request, reporter)?;
        let all = scene.frames().unwrap_or(0);
        let mut config =
            render_config(request, scene.as_ref(), file.as_deref(), &axes, colours.as_ref(), all, session.memory)?;
        let (whole, lod) = file.as_ref().map_or((*scene.grid(), 0), |file| (file.whole_grid(), file.lod()));
        set_planes(&mut config, request, &axes, scene.grid(), &whole, lod)?;
        let targets = AllTargets::new(request, session.paths(), &config)?;
        config.memory = targets.memory_besides(scene.as_ref(), request.depth, &config)?;
        let colours = automatic_colours(request, scene.as_mut(), &distributions, &mut config, colours, reporter)?;
        note_surfaces(&config, file.as_deref(), reporter);
        let input = ColouringInput {
            request,
            channels: scene.channels(),
            config: &config,
            pictures: &targets.pictures,
            errors: targets.errors.as_ref(),
            colours: colours.as_ref(),
            known: KnownSamples {
                least: file.as_ref().map(|file| file.source_range().0).filter(|least| least.is_finite()),
                are_of_body: axes.labels().iter().any(|axis| axis.sides.is_some()),
            },
        };
        let colouring = input.colouring(|needed| Ranges::small(scene.as_mut(), &config, needed, reporter), reporter)?;
        let provenance = Provenance {
            slice: slice_texts(request, &axes)?,
            exaggerate: Some(exaggeration).filter(|factor| *factor != 1.0),
            ..provenance(request, scene.grid(), &config, file.as_deref(), &annotation.times, &colouring)
        };
        let annotation = Annotation {
            axes: Some(volume_axes(request, &axes, &whole, &config, exaggeration)?),
            surfaces: surfaces_of(&config.mode),
            panels: panels_of(&config.mode, lod),
            ..annotation
        };
        note_scale(&annotation, reporter);
        note_title(request, &annotation, &config, reporter);
        Ok(Self { scene, file, config, targets, colouring, provenance, annotation })
    }

    /// The input of the sinks of the pictures.
    pub(super) fn sinks<'a>(&'a self, request: &'a PictureRequest) -> SinkInput<'a> {
        let Self { scene, config, targets, colouring, provenance, annotation, .. } = self;
        SinkInput { request, grid: scene.grid(), config, targets, colouring, provenance, annotation }
    }
}
