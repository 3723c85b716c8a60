//! The measured stages: conversion, and two views by any method.

use super::camera::{CameraSettings, SIGMA};
use super::json::bad_json;
use super::plan::{BASES, BOUNDS};
use super::process::ProcessTask;
use super::reference::{ImageError, ReferencePixels};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::Instant;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::convert::ConvertConfig;
use wavesplat::file::CoefficientFile;
use wavesplat::formats;
use wavesplat::render::{CoefficientScene, FrameScene, RenderConfig, Scene, SplatSource};
use wavesplat::source::{FrameSource, OpenOptions, Selection, select};
use wavesplat::view::footprint::Kernel;
use wavesplat_core::base::output::Output;
use wavesplat_demo::scenes::MEMORY;
use wavesplat_demo::textbook::{self, Splatter};

/// Converts frames to a coefficient file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Convert {
    /// The archive.
    pub(super) frames: PathBuf,
    /// Number of frames to convert.
    pub(super) count: usize,
    /// A name of [`super::plan::BASES`].
    pub(super) basis: String,
    /// A name of [`super::plan::BOUNDS`].
    pub(super) bound: String,
    pub(super) tolerance: f64,
    pub(super) output: PathBuf,
}

/// The result of a conversion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Converted {
    pub(super) seconds: f64,
    pub(super) input_bytes: u64,
    pub(super) file_bytes: u64,
    pub(super) coefficients_per_sample: f64,
    pub(super) outliers: u64,
    /// Highest minus lowest value.
    pub(super) range: f64,
    /// The voxel bound.
    pub(super) delta: f64,
}

/// Renders two views of all frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Render {
    /// The coefficient file, or the archive for the conventional method.
    pub(super) input: PathBuf,
    pub(super) way: RenderMethod,
    /// Number of frames.
    pub(super) frames: usize,
    pub(super) camera: CameraSettings,
    pub(super) splat_error: f64,
    /// The file with the reference for the first view.
    pub(super) truth: PathBuf,
    /// Whether to render the first view again, untimed, for its certificate.
    pub(super) certify: bool,
}

/// The way pictures are made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum RenderMethod {
    Coefficients,
    /// Footprints shared by 32 frames.
    Shared,
    /// A table of footprints, cut at this many standard deviations.
    Textbook(f64),
}

/// The result of a rendering.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Rendered {
    /// From opening the input to the last picture of the first view.
    pub(super) first_seconds: f64,
    /// All pictures of another view.
    pub(super) further_seconds: f64,
    /// The splat method.
    pub(super) splat: String,
    /// The splat error that the renderer states, as a share of the value range; unknown for the textbook form.
    pub(super) stated_splat_error: Option<f64>,
    /// Errors of the first view.
    pub(super) error: ImageError,
    /// The largest certificate of any compared pixel, as a share of the value range.
    pub(super) certified_error: Option<f64>,
    /// The largest certificate divided by the largest true error of the same pictures.
    pub(super) certificate_tightness: Option<f64>,
    /// Number of compared pixels with an error above their certificate.
    pub(super) beyond_certificate: usize,
}

impl ProcessTask for Convert {
    const NAME: &'static str = "convert";
    type Measured = Converted;

    fn measure(&self) -> Result<Converted> {
        convert(self)
    }
}

impl ProcessTask for Render {
    const NAME: &'static str = "render";
    type Measured = Rendered;

    fn measure(&self) -> Result<Rendered> {
        render(self)
    }
}

/// The first `count` frames of an archive.
pub(super) fn open_frames(path: &Path, count: usize) -> Result<Box<dyn FrameSource>> {
    let source = formats::open(&[path.into()], &OpenOptions::default())?;
    let region = source.archive().grid.whole();
    select(source, Selection { first: 0, step: 1, frames: Some(count), region })
}

/// Converts as `wavesplat convert` does.
fn convert(step: &Convert) -> Result<Converted> {
    let unknown = || Error::usage(format!("bench-step: there is no {} or no {}", step.basis, step.bound));
    let basis = BASES.iter().find(|b| b.name == step.basis).ok_or_else(unknown)?;
    let bound = BOUNDS.iter().find(|b| b.name == step.bound).ok_or_else(unknown)?;
    let config = ConvertConfig {
        coding: basis.basis.into(),
        window: basis.window,
        bound: bound.bound,
        memory: MEMORY,
        ..ConvertConfig::new(step.tolerance)
    };
    let clock = Instant::now();
    let mut frames = open_frames(&step.frames, step.count)?;
    let mut out = Output::create(&step.output, true)?;
    let report = wavesplat::convert::convert(frames.as_mut(), &config, &step.output, &mut out, &Silent)?;
    let seconds = clock.elapsed().as_secs_f64(); // without waiting for the disk
    out.commit()?;
    Ok(Converted {
        seconds,
        input_bytes: report.input_bytes,
        file_bytes: report.output_bytes,
        coefficients_per_sample: report.coefficients_per_sample,
        outliers: report.outliers,
        range: report.range.1 - report.range.0,
        delta: report.delta,
    })
}

/// Renders two views. The time of the first includes opening the input; comparing it with the reference is not timed.
fn render(step: &Render) -> Result<Rendered> {
    let truth = File::open(&step.truth).map_err(|e| Error::io(&step.truth, "opening", e))?;
    let truth: ReferencePixels =
        serde_json::from_reader(BufReader::new(truth)).map_err(|e| bad_json(&step.truth, &e))?;
    let clock = Instant::now();
    let mut method = Renderer::open(step)?;
    let opening = clock.elapsed().as_secs_f64();
    let mut differences = Vec::new();
    let first = method.view(step, &step.camera, &mut |frame, picture| {
        differences.extend(truth.differences(frame, picture));
    })?;
    let further = method.view(step, &step.camera.further(), &mut |_, _| {})?;
    let certified = if step.certify { method.certified(step, &truth)? } else { Vec::new() };
    let largest = |of: fn(&(f64, f64)) -> f64| certified.iter().map(of).reduce(f64::max);
    Ok(Rendered {
        first_seconds: opening + first.seconds,
        further_seconds: further.seconds,
        splat: first.splat,
        stated_splat_error: first.stated_error,
        error: ReferencePixels::error(&differences),
        certified_error: largest(|c| c.0),
        certificate_tightness: largest(|c| c.0).zip(largest(|c| c.1)).map(|(certified, error)| certified / error),
        beyond_certificate: certified.iter().filter(|(certified, error)| error > certified).count(),
    })
}

/// A renderer of views.
enum Renderer {
    Library(Box<dyn Scene>),
    Textbook(Box<dyn FrameSource>, f64),
}

/// The measurements of one view.
struct ViewTiming {
    /// Time without the sink.
    seconds: f64,
    splat: String,
    stated_error: Option<f64>,
}

impl Renderer {
    fn open(step: &Render) -> Result<Self> {
        let frames = || open_frames(&step.input, step.frames);
        Ok(match step.way {
            RenderMethod::Coefficients => {
                let file = CoefficientFile::open(&step.input)?;
                Self::Library(Box::new(CoefficientScene::new(file, SplatSource::Coefficients)))
            }
            RenderMethod::Shared => Self::Library(Box::new(FrameScene::new(frames()?, None))),
            RenderMethod::Textbook(radius) => Self::Textbook(frames()?, radius),
        })
    }

    fn view(
        &mut self,
        step: &Render,
        camera: &CameraSettings,
        sink: &mut dyn FnMut(usize, &[f32]),
    ) -> Result<ViewTiming> {
        match self {
            Self::Library(scene) => by_library(scene.as_mut(), step, camera, false, &mut |r| sink(r.frame, r.picture)),
            Self::Textbook(source, radius) => by_textbook(source.as_mut(), step, camera, *radius, sink),
        }
    }
}

impl Renderer {
    /// The certified and the true errors of the first view's compared pixels, as shares of the value range; none for
    /// the textbook form, which has no certificates.
    fn certified(&mut self, step: &Render, truth: &ReferencePixels) -> Result<Vec<(f64, f64)>> {
        let mut all = Vec::new();
        if let Self::Library(scene) = self {
            by_library(scene.as_mut(), step, &step.camera, true, &mut |r| {
                let certified = truth.at_pixels(r.frame, r.error.unwrap_or_default());
                all.extend(certified.into_iter().zip(truth.differences(r.frame, r.picture)));
            })?;
        }
        Ok(all)
    }
}

fn by_library(
    scene: &mut dyn Scene,
    step: &Render,
    camera: &CameraSettings,
    certify: bool,
    sink: &mut dyn FnMut(wavesplat::render::Rendered<'_>),
) -> Result<ViewTiming> {
    let config = RenderConfig {
        kernel: Kernel::new(Some(SIGMA), 0.0, scene.grid())?,
        frames: (0..step.frames).collect(),
        splat_error: step.splat_error,
        fast: false,
        certify,
        memory: MEMORY,
        ..RenderConfig::new(scene, camera.view())
    };
    let report = wavesplat::render::render(scene, &config, &Silent, &mut |rendered| {
        sink(rendered);
        Ok(())
    })?;
    let stated_error = Some(report.views[0].stated_splat_error);
    Ok(ViewTiming { seconds: report.seconds, splat: report.views[0].method.into(), stated_error })
}

fn by_textbook(
    source: &mut dyn FrameSource,
    step: &Render,
    camera: &CameraSettings,
    radius: f64,
    sink: &mut dyn FnMut(usize, &[f32]),
) -> Result<ViewTiming> {
    let (clock, mut in_sink) = (Instant::now(), 0.0);
    let grid = source.archive().grid;
    let splatter = Splatter::new(&grid, &camera.view(), Kernel::new(Some(SIGMA), 0.0, &grid)?, radius)?;
    textbook::render(source, step.frames, &splatter, |value| [value], &mut |frame, picture| {
        let clock = Instant::now();
        sink(frame, picture.as_flattened());
        in_sink += clock.elapsed().as_secs_f64();
    })?;
    let seconds = clock.elapsed().as_secs_f64() - in_sink;
    Ok(ViewTiming { seconds, splat: format!("table-{radius}"), stated_error: None })
}
