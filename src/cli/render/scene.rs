//! The scene to render: a coefficient file, or frames.

use super::annotations::values_of;
use super::args::{Cli, Detail, Exaggeration, MethodName};
use super::places::Axes;
use crate::base::address::public_name;
use crate::base::description::{coordinates, is_regular};
use crate::base::error::{Error, Result};
use crate::base::grid::Grid;
use crate::base::output::STANDARD;
use crate::cli::remote::is_coefficient_name;
use crate::cli::transfer_function;
use crate::colour::TransferFunction;
use crate::file::{CoefficientFile, time_labels};
use crate::render::annotate::Annotation;
use crate::render::parts::is_part;
use crate::render::{CoefficientScene, FrameScene, Scene, SplatSource};
use crate::view::camera::Camera;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The scene to render.
pub(crate) struct Opened {
    pub(crate) scene: Box<dyn Scene>,
    /// The coefficient file of the scene.
    pub(crate) file: Option<Arc<CoefficientFile>>,
    /// The factor by which heights are drawn taller.
    pub(crate) exaggeration: f64,
    /// The times of frames.
    pub(crate) annotation: Annotation,
    /// The colours of samples, applied before splatting or along the ray.
    pub(crate) colours: Option<TransferFunction>,
    /// The axes of all voxels.
    pub(crate) axes: Axes,
}

impl Cli {
    /// Opens the scene to render, and its file.
    pub(crate) fn scene(&self) -> Result<Opened> {
        match self.inputs.as_slice() {
            [only] if self.method == MethodName::Coefficients || is_coefficient_name(only) => {
                self.coefficient_scene(only)
            }
            _ => self.frame_scene(),
        }
    }

    /// A coefficient file, whose coefficients or decoded samples are splatted.
    fn coefficient_scene(&self, path: &Path) -> Result<Opened> {
        if path == Path::new(STANDARD) {
            return Err(Error::usage("-: a coefficient file cannot come from a pipe, since it is read from its end"));
        }
        self.input.refuse_for_coefficients()?;
        self.along.check(false, self.colour.is_asked())?;
        let file = self.remote.open(path, self.input.access()).map_err(|e| hint_at_frames(path, e))?;
        let exaggeration = self.exaggeration(&file.whole_grid());
        let file = file.with_exaggeration(exaggeration);
        let lod = self.level_of_detail(&file)?;
        if self.lod == Detail::Auto {
            self.common.note(format_args!("--lod auto takes level {lod} of {}", file.coarsest_detail()));
        }
        let file = file.with_detail(lod)?;
        let file = Arc::new(if self.skip_damaged { file.skip_damaged()? } else { file });
        self.note_irregular_axes(&file)?;
        let what = match self.method {
            MethodName::Coefficients => SplatSource::Coefficients,
            MethodName::Direct => SplatSource::Samples,
        };
        let annotation = self.annotation(values_of(&file)?, time_labels(file.metadata()));
        let colours = self.along.of_file(self.colour.range, &file)?;
        let scene = Box::new(CoefficientScene::new(file.clone(), what));
        let axes = Axes::of_file(&file)?;
        Ok(Opened { scene, file: Some(file), exaggeration, annotation, colours, axes })
    }

    /// The factor by which heights are drawn taller, with a note if it was chosen automatically.
    fn exaggeration(&self, grid: &Grid) -> f64 {
        if let Exaggeration::Factor(factor) = self.exaggerate {
            return factor;
        }
        let factor = grid.sensible_exaggeration();
        if factor != 1.0 {
            let what = "as tall as they are, since the volume is nearly flat";
            self.common.note(format_args!("heights are drawn {factor} times {what}; --exaggerate 1 draws them true"));
        }
        factor
    }

    /// Says which axes have voxels that are not drawn at their places.
    fn note_irregular_axes(&self, file: &CoefficientFile) -> Result<()> {
        let Some(description) = file.description()? else { return Ok(()) };
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if coordinates(&description, axis).is_some_and(|at| !is_regular(&at)) {
                self.common.note(format_args!("voxels along {name} are not at regular places, but are drawn so"));
            }
        }
        Ok(())
    }

    /// The level of detail: as given, or the coarsest whose voxels are no larger than a pixel of any view.
    fn level_of_detail(&self, file: &CoefficientFile) -> Result<u32> {
        if let Detail::Level(level) = self.lod {
            return Ok(level);
        }
        let grid = file.whole_grid();
        let frames = self.frames_of(file.metadata().windows.iter().map(|window| window.frames as usize).sum())?;
        let views = self.views(&grid, &frames)?;
        let scales = views.iter().map(|view| Ok(Camera::new(view, &grid)?.scale)).collect::<Result<Vec<_>>>()?;
        let voxel = scales.into_iter().fold(0.0, f64::max) * grid.largest_spacing();
        let fits = |lod: &u32| voxel * f64::from(1_u32 << lod) <= 1.0;
        Ok((0..=file.coarsest_detail()).take_while(fits).last().unwrap_or(0))
    }

    /// Frames of an archive.
    fn frame_scene(&self) -> Result<Opened> {
        self.refuse_for_frames()?;
        self.along.check(true, self.colour.is_asked())?;
        let mut source = self.input.open(&self.inputs, &self.common)?;
        let annotation = self.annotation(String::new(), source.archive().time_labels());
        let missing_value = source.archive().missing_value(self.missing_value);
        let colours = match self.along.colours() {
            Some(name) => {
                let inputs = self.inputs.as_slice();
                let range = self.colour.range;
                Some(transfer_function(name, range, (inputs, source.as_mut()), missing_value, &self.common)?)
            }
            None => None,
        };
        let grid = source.archive().grid;
        let axes = Axes::new(&grid, source.archive().description.as_ref());
        let scene = match colours.clone().filter(|_| !self.along.mode_name().colours_samples()) {
            Some(colours) => FrameScene::coloured(source, missing_value, colours),
            None => FrameScene::new(source, missing_value),
        };
        let exaggeration = self.exaggeration(&grid);
        let scene = Box::new(scene.with_grid(grid.exaggerated(exaggeration)));
        Ok(Opened { scene, file: None, exaggeration, annotation, colours, axes })
    }

    /// An error if an option or the input is not for frames.
    fn refuse_for_frames(&self) -> Result<()> {
        if self.skip_damaged {
            return Err(Error::usage("--skip-damaged: is for a coefficient file"));
        }
        if self.lod != Detail::Level(0) {
            return Err(Error::usage("--lod: is for a coefficient file"));
        }
        if self.method == MethodName::Coefficients {
            return Err(Error::usage(format!("takes one coefficient file; {FRAMES_HINT}")));
        }
        if self.inputs == [PathBuf::from(STANDARD)] {
            let what = "--method direct reads frames more than once, so they cannot come from standard input";
            return Err(Error::usage(what));
        }
        Ok(())
    }
}

const FRAMES_HINT: &str = "convert frames first, or render them with --method direct";

/// Adds a hint to the error for a file without coefficients.
fn hint_at_frames(path: &Path, error: Error) -> Error {
    if is_part(path) {
        return Error::usage(format!("{}: is a part of a picture; --sum makes pictures of parts", path.display()));
    }
    let foreign = matches!(&error, Error::CoefficientFile { source: wavesplat_format::Error::Foreign(_), .. });
    if !is_coefficient_name(path) && (foreign || path.is_dir()) {
        return Error::usage(format!("{}: not a coefficient file; {FRAMES_HINT}", public_name(path).display()));
    }
    error
}
