//! The measured stages: conversion, and two views by any method.

use super::camera::{Look, SIGMA};
use super::json::bad_json;
use super::plan::{BASES, BOUNDS};
use super::process::ProcessTask;
use super::textbook;
use super::truth::{ImageError, Truth};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::Instant;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::mapped::Access;
use wavesplat::base::output::Output;
use wavesplat::base::progress::Silent;
use wavesplat::convert::ConvertConfig;
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, FrameScene, Quantity, RenderConfig, Scene, SplatSource};
use wavesplat::source::{self, FrameSource, OpenOptions, Selection, select};
use wavesplat::view::footprint::Kernel;

/// Frames to a coefficient file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Convert {
    /// The archive.
    pub(super) frames: PathBuf,
    /// How many of its frames.
    pub(super) count: usize,
    /// A name of [`super::plan::BASES`].
    pub(super) basis: String,
    /// A name of [`super::plan::BOUNDS`].
    pub(super) bound: String,
    pub(super) tolerance: f64,
    pub(super) output: PathBuf,
}

/// What a conversion did.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Converted {
    pub(super) seconds: f64,
    pub(super) input_bytes: u64,
    pub(super) file_bytes: u64,
    pub(super) coefficients_per_sample: f64,
    pub(super) outliers: u64,
    /// Highest less lowest value.
    pub(super) range: f64,
    /// The voxel bound.
    pub(super) delta: f64,
}

/// Two views of all frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Render {
    /// The coefficient file, or the archive for the conventional method.
    pub(super) input: PathBuf,
    pub(super) way: Way,
    /// How many frames.
    pub(super) frames: usize,
    pub(super) look: Look,
    pub(super) splat_error: f64,
    /// The file of the truth for the first view.
    pub(super) truth: PathBuf,
    /// Whether to render the first view once more for its certificate, not timed.
    pub(super) certify: bool,
}

/// How pictures are made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Way {
    Coefficients,
    /// Footprints shared by 32 frames.
    Shared,
    /// A table of footprints, cut at so many standard deviations.
    Textbook(f64),
}

/// What a rendering did.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Rendered {
    /// From opening the input to the last picture of the first view.
    pub(super) first_seconds: f64,
    /// All pictures of another view.
    pub(super) further_seconds: f64,
    /// The splat method.
    pub(super) splat: String,
    /// What splatting may have added, as a share of the value range; unknown for the textbook form.
    pub(super) stated_splat_error: Option<f64>,
    /// Of the first view.
    pub(super) error: ImageError,
    /// The largest error that the renderer certifies for any compared pixel, as a share of the value range.
    pub(super) certified_error: Option<f64>,
    /// That in units of the largest true error of the same pictures.
    pub(super) certificate_tightness: Option<f64>,
    /// Compared pixels that are further off than certified.
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

/// The programs' default budget.
pub(super) const MEMORY: usize = 512 << 20;

/// The first `count` frames of an archive.
pub(super) fn open_frames(path: &Path, count: usize) -> Result<Box<dyn FrameSource>> {
    let source = source::open(&[path.into()], &OpenOptions::default())?;
    let region = source.archive().grid.whole();
    select(source, Selection { first: 0, step: 1, frames: Some(count), region })
}

/// Converts as `wavesplat convert` does.
fn convert(step: &Convert) -> Result<Converted> {
    let unknown = || Error::usage(format!("bench-step: there is no {} or no {}", step.basis, step.bound));
    let basis = BASES.iter().find(|b| b.name == step.basis).ok_or_else(unknown)?;
    let bound = BOUNDS.iter().find(|b| b.name == step.bound).ok_or_else(unknown)?;
    let plain = ConvertConfig::new(basis.basis, basis.window, step.tolerance, MEMORY);
    let config = ConvertConfig { bound: bound.bound, ..plain };
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

/// Renders two views, the first from opening the input on, and compares the first with the truth outside of its time.
fn render(step: &Render) -> Result<Rendered> {
    let truth = File::open(&step.truth).map_err(|e| Error::io(&step.truth, "opening", e))?;
    let truth: Truth = serde_json::from_reader(BufReader::new(truth)).map_err(|e| bad_json(&step.truth, &e))?;
    let clock = Instant::now();
    let mut method = Renderer::open(step)?;
    let opening = clock.elapsed().as_secs_f64();
    let mut differences = Vec::new();
    let first = method.view(step, &step.look, &mut |frame, picture| {
        differences.extend(truth.differences(frame, picture));
    })?;
    let further = method.view(step, &step.look.further(), &mut |_, _| {})?;
    let certified = if step.certify { method.certified(step, &truth)? } else { Vec::new() };
    let largest = |of: fn(&(f64, f64)) -> f64| certified.iter().map(of).reduce(f64::max);
    Ok(Rendered {
        first_seconds: opening + first.seconds,
        further_seconds: further.seconds,
        splat: first.splat,
        stated_splat_error: first.stated_error,
        error: Truth::error(&differences),
        certified_error: largest(|c| c.0),
        certificate_tightness: largest(|c| c.0).zip(largest(|c| c.1)).map(|(certified, error)| certified / error),
        beyond_certificate: certified.iter().filter(|(certified, error)| error > certified).count(),
    })
}

/// What renders views.
enum Renderer {
    Library(Box<dyn Scene>),
    Textbook(Box<dyn FrameSource>, f64),
}

/// What one view took.
struct Viewed {
    /// Without the sink.
    seconds: f64,
    splat: String,
    stated_error: Option<f64>,
}

impl Renderer {
    fn open(step: &Render) -> Result<Self> {
        let frames = || open_frames(&step.input, step.frames);
        Ok(match step.way {
            Way::Coefficients => {
                let file = CoefficientFile::open(&step.input, Access::Map)?;
                Self::Library(Box::new(CoefficientScene::new(file, SplatSource::Coefficients)))
            }
            Way::Shared => Self::Library(Box::new(FrameScene::new(frames()?, None))),
            Way::Textbook(radius) => Self::Textbook(frames()?, radius),
        })
    }

    fn view(&mut self, step: &Render, look: &Look, sink: &mut dyn FnMut(usize, &[f32])) -> Result<Viewed> {
        match self {
            Self::Library(scene) => by_library(scene.as_mut(), step, look, false, &mut |r| sink(r.frame, r.picture)),
            Self::Textbook(source, radius) => by_textbook(source.as_mut(), step, look, *radius, sink),
        }
    }
}

impl Renderer {
    /// The certified and the true errors of the first view's compared pixels where pictures are certified, as shares of the
    /// value range; none of the textbook form.
    fn certified(&mut self, step: &Render, truth: &Truth) -> Result<Vec<(f64, f64)>> {
        let mut all = Vec::new();
        if let Self::Library(scene) = self {
            by_library(scene.as_mut(), step, &step.look, true, &mut |r| {
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
    look: &Look,
    certify: bool,
    sink: &mut dyn FnMut(wavesplat::render::Rendered<'_>),
) -> Result<Viewed> {
    let config = RenderConfig {
        views: vec![look.view()],
        kernel: Kernel::new(Some(SIGMA), 0.0, scene.grid())?,
        quantity: Quantity::Mean,
        frames: (0..step.frames).collect(),
        region: None,
        splat_error: step.splat_error,
        allowed: None,
        limited: Default::default(),
        certify,
        memory: MEMORY,
        reserved: 0,
        mode: Default::default(),
    };
    let report = wavesplat::render::render(scene, &config, &Silent, &mut |rendered| {
        sink(rendered);
        Ok(())
    })?;
    let stated_error = Some(report.views[0].stated_splat_error);
    Ok(Viewed { seconds: report.seconds, splat: report.views[0].method.into(), stated_error })
}

fn by_textbook(
    source: &mut dyn FrameSource,
    step: &Render,
    look: &Look,
    radius: f64,
    sink: &mut dyn FnMut(usize, &[f32]),
) -> Result<Viewed> {
    let (clock, mut in_sink) = (Instant::now(), 0.0);
    textbook::render(source, step.frames, look, radius, &mut |frame, picture| {
        let clock = Instant::now();
        sink(frame, picture);
        in_sink += clock.elapsed().as_secs_f64();
    })?;
    let seconds = clock.elapsed().as_secs_f64() - in_sink;
    Ok(Viewed { seconds, splat: format!("table-{radius}"), stated_error: None })
}
