//! The measured stages: conversion, and two views by any method.

use super::look::{Look, SIGMA};
use super::plan::{BASES, BOUNDS};
use super::step::{Convert, Converted, Render, Rendered, Way};
use super::truth::Truth;
use super::{bad_json, textbook};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Instant;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::output::Output;
use wavesplat::base::progress::Silent;
use wavesplat::convert::ConvertConfig;
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, FrameScene, RenderConfig, Scene, SplatSource};
use wavesplat::source::{self, FrameSource, OpenOptions, Selection, select};
use wavesplat::view::footprint::Kernel;

/// The programs' default budget.
pub(super) const MEMORY: usize = 512 << 20;

/// The first `count` frames of an archive.
pub(super) fn open_frames(path: &Path, count: usize) -> Result<Box<dyn FrameSource>> {
    let source = source::open(&[path.into()], &OpenOptions::default())?;
    let region = source.archive().grid.whole();
    select(source, Selection { first: 0, step: 1, frames: Some(count), region })
}

/// Converts as `wavesplat convert` does.
pub(super) fn convert(step: &Convert) -> Result<Converted> {
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

/// Renders two views, the first from opening the input on, and compares the first with the truth outside of its time.
pub(super) fn render(step: &Render) -> Result<Rendered> {
    let truth = File::open(&step.truth).map_err(|e| Error::io(&step.truth, "opening", e))?;
    let truth: Truth = serde_json::from_reader(BufReader::new(truth)).map_err(|e| bad_json(&step.truth, &e))?;
    let clock = Instant::now();
    let mut method = Method::open(step)?;
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
enum Method {
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

impl Method {
    fn open(step: &Render) -> Result<Self> {
        let frames = || open_frames(&step.input, step.frames);
        Ok(match step.way {
            Way::Coefficients => {
                let file = CoefficientFile::open(&step.input)?;
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

impl Method {
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
        kernel: Kernel::new(Some(SIGMA), 0.0, scene.grid())?,
        frames: (0..step.frames).collect(),
        splat_error: step.splat_error,
        certify,
        memory: MEMORY,
        ..RenderConfig::new(scene, look.view())
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
