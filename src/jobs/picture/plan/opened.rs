//! The scene of a request: an open coefficient file, or frames.

use super::annotations::annotation;
use super::config::frames_of;
use super::modes;
use super::named_colours::colours_of_source;
use super::views::{across_and_up, are_panels, face_on, is_placed, views};
use crate::axes::Axes;
use crate::picture::distributions::Distributions;
use crate::picture::reporter::Reporter;
use crate::picture::request::PictureRequest;
use crate::picture::session::{FRAMES_HINT, Session};
use crate::picture::values::{Detail, Exaggeration};
use crate::units::{values_of, values_of_archive};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat_core::base::description::{coordinates, is_regular};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::view::camera::Camera;
use wavesplat_engine::file::{CoefficientFile, time_labels};
use wavesplat_engine::render::annotate::Annotation;
use wavesplat_engine::render::{CoefficientScene, FrameScene, Scene, SplatSource};

/// The scene to render.
pub(in crate::picture) struct Opened {
    pub(in crate::picture) scene: Box<dyn Scene>,
    /// The coefficient file of the scene.
    pub(in crate::picture) file: Option<Arc<CoefficientFile>>,
    pub(in crate::picture) distributions: Distributions,
    /// The factor by which heights are drawn taller.
    pub(in crate::picture) exaggeration: f64,
    /// The times of frames.
    pub(in crate::picture) annotation: Annotation,
    /// The colours of samples, applied before splatting or along the ray.
    pub(in crate::picture) colours: Option<TransferFunction>,
    /// The axes of all voxels.
    pub(in crate::picture) axes: Axes,
}

impl Opened {
    /// Opens the scene to render, and its file.
    pub(in crate::picture) fn new(
        session: &Session,
        request: &PictureRequest,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        match session.coefficient_path(request.method) {
            Some(path) => Self::from_coefficients(session, path, request, reporter),
            None => Self::from_frames(session, request, reporter),
        }
    }

    /// A coefficient file, whose coefficients or decoded samples are splatted.
    fn from_coefficients(
        session: &Session,
        path: &Path,
        request: &PictureRequest,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        if path == Path::new(STANDARD) {
            return Err(Error::path(
                STANDARD,
                "a coefficient file cannot come from a pipe, since it is read from its end",
            ));
        }
        modes::check(request, false)?;
        let file = session.file(request.skip_damaged)?;
        let axes = Axes::from_file(&file)?;
        let exaggeration = exaggeration(request, &axes, &file.whole_grid(), reporter)?;
        let file = file.with_exaggeration(exaggeration);
        let lod = level_of_detail(request, &file)?;
        if request.lod == Detail::Auto {
            reporter.note(format_args!("`lod` auto takes level {lod} of {}", file.coarsest_detail()));
        }
        let file = Arc::new(file.with_detail(lod)?);
        note_irregular_axes(&file, reporter)?;
        let annotation = annotation(request, values_of(&file)?, time_labels(file.metadata()));
        let colours = modes::colours_of_file(request, &file)?;
        let scene = Box::new(CoefficientScene::new(file.clone(), request.method));
        let distributions = session.distributions(&file, request.skip_damaged);
        Ok(Self { scene, file: Some(file), distributions, exaggeration, annotation, colours, axes })
    }

    /// Frames of an archive.
    fn from_frames(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Self> {
        refuse_for_frames(session, request)?;
        modes::check(request, true)?;
        let mut source = session.open_frames(reporter)?;
        let annotation = annotation(request, values_of_archive(source.archive()), source.archive().time_labels());
        let missing_value = source.archive().missing_value(request.missing_value);
        let colours = match modes::sample_colours(request) {
            Some(name) => {
                let is_piped = session.is_piped();
                let colours =
                    colours_of_source(name, request.range, source.as_mut(), is_piped, missing_value, reporter)?;
                Some(modes::with_given_values(request, colours)?)
            }
            None => None,
        };
        let grid = source.archive().grid;
        let axes = Axes::new(&grid, source.archive().units.space.as_deref(), source.archive().description.as_ref());
        let scene = match colours.clone().filter(|_| !modes::mode_name(request).colours_samples()) {
            Some(colours) => FrameScene::coloured(source, missing_value, colours),
            None => FrameScene::new(source, missing_value),
        };
        let exaggeration = exaggeration(request, &axes, &grid, reporter)?;
        let scene = Box::new(scene.with_grid(grid.exaggerated(exaggeration)));
        let distributions = Distributions::default();
        Ok(Self { scene, file: None, distributions, exaggeration, annotation, colours, axes })
    }
}

/// The factor by which heights are drawn taller, with a note if it was chosen automatically.
fn exaggeration(request: &PictureRequest, axes: &Axes, grid: &Grid, reporter: &dyn Reporter) -> Result<f64> {
    if let Exaggeration::Factor(factor) = request.exaggerate {
        return Ok(factor);
    }
    if let Some(factor) = height_of_section(request, axes, grid)? {
        let (height, across) = (axes.name(2), axes.name(section_across(request, axes, grid)?));
        reporter.note(format_args!(
            "the section is drawn 0.6 times as high as wide, since {height} does not compare with {across}; `exaggerate` sets another height"
        ));
        return Ok(factor);
    }
    let factor = grid.sensible_exaggeration();
    if factor != 1.0 {
        let what = "as tall as they are, since the volume is nearly flat";
        reporter.note(format_args!("heights are drawn {factor} times {what}; `exaggerate` 1 draws them true"));
    }
    Ok(factor)
}

/// The factor by which the heights of a section are multiplied that is seen face-on and whose sides do not compare: depths in metres
/// over degrees, or levels that are not even. Then the section has the usual shape of a chart.
fn height_of_section(request: &PictureRequest, axes: &Axes, grid: &Grid) -> Result<Option<f64>> {
    /// The height as a share of the width.
    const SHAPE: f64 = 0.6;
    let is_seen = are_panels(request, axes)? || face_on(request, axes, grid)?.is_some();
    if is_placed(request) || grid.dims[2] == 1 || !is_seen {
        return Ok(None);
    }
    let across = section_across(request, axes, grid)?;
    let extent = |axis: usize| grid.dims[axis] as f64 * grid.spacing[axis];
    let factor = SHAPE * extent(across) / extent(2);
    let factor = format!("{factor:.2e}").parse().unwrap_or(factor); // three digits
    Ok(Some(factor).filter(|factor: &f64| across < 2 && !axes.compare(across, 2) && factor.is_normal()))
}

/// The axis to the right in a section seen face-on; 2 if it has no heights.
fn section_across(request: &PictureRequest, axes: &Axes, grid: &Grid) -> Result<usize> {
    let extent = |axis: usize| grid.dims[axis] as f64 * grid.spacing[axis];
    let longest = usize::from(extent(1) > extent(0));
    let [only] = request.slice.as_slice() else { return Ok(longest) };
    Ok(match axes.find("slice", &only.axis)? {
        2 => 2,
        cut => across_and_up(cut)[0],
    })
}

/// Says which axes have voxels that are not drawn at their places.
fn note_irregular_axes(file: &CoefficientFile, reporter: &dyn Reporter) -> Result<()> {
    let Some(description) = file.description()? else { return Ok(()) };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if coordinates(&description, axis).is_some_and(|at| !is_regular(&at)) {
            reporter.note(format_args!("voxels along {name} are not at regular places, but are drawn so"));
        }
    }
    Ok(())
}

/// The level of detail: as given, or the coarsest whose voxels are no larger than a pixel of any view.
fn level_of_detail(request: &PictureRequest, file: &CoefficientFile) -> Result<u32> {
    if let Detail::Level(level) = request.lod {
        return Ok(level);
    }
    let grid = file.whole_grid();
    let all = file.metadata().windows.iter().map(|window| window.frames as usize).sum();
    let views = views(request, &grid, &frames_of(request, all)?)?;
    let scales = views.iter().map(|view| Ok(Camera::new(view, &grid)?.scale)).collect::<Result<Vec<_>>>()?;
    let voxel = scales.into_iter().fold(0.0, f64::max) * grid.largest_spacing();
    let fits = |lod: &u32| voxel * f64::from(1_u32 << lod) <= 1.0;
    Ok((0..=file.coarsest_detail()).take_while(fits).last().unwrap_or(0))
}

/// An error if a field or the input is not for frames.
fn refuse_for_frames(session: &Session, request: &PictureRequest) -> Result<()> {
    if request.skip_damaged {
        return Err(Error::setting("skip_damaged", "is for a coefficient file"));
    }
    if request.lod != Detail::Level(0) {
        return Err(Error::setting("lod", "is for a coefficient file"));
    }
    if request.method == SplatSource::Coefficients {
        return Err(Error::setting("inputs", format!("takes one coefficient file; {FRAMES_HINT}")));
    }
    if session.paths() == [PathBuf::from(STANDARD)] {
        let what = "reads frames more than once, so they cannot come from standard input";
        return Err(Error::value("method", "direct", what));
    }
    Ok(())
}
