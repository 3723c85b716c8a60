//! Measures a group: runs its contenders in turns, and checks every sample.

use super::camera::{CameraSettings, compared_frames};
use super::json::bad_json;
use super::plan::{Contender, Group};
use super::point::{Conversion, Point, Rendering, Spread};
use super::process::{Outcome, in_process};
use super::reference::ReferencePixels;
use super::settings::Config;
use super::stages::{Convert, Converted, Render, RenderMethod, Rendered, open_frames};
use crate::synth::{Kind, Synth};
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::{self, SampleType};
use wavesplat::file::CoefficientFile;
use wavesplat::file::verify::{Comparison, verify};
use wavesplat_demo::output::{Format, Shape, Target};
use wavesplat_demo::scenes::MEMORY;

/// What all groups share.
pub(super) struct Bench<'a> {
    config: &'a Config,
    camera: CameraSettings,
    /// The folder of archives and files; removed at the end.
    work: PathBuf,
    /// The kind of the archive in the folder.
    kind: Option<Kind>,
}

/// A conversion, the results of all its runs, and the comparison of every sample.
struct CheckedConversion {
    runs: Vec<Outcome<Converted>>,
    found: Comparison,
}

impl<'a> Bench<'a> {
    pub(super) fn new(config: &'a Config) -> Result<Self> {
        let work = config.output.join("work");
        fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
        let [nx, ny, nz, _] = config.sweep.dims;
        Ok(Self { config, camera: CameraSettings::first([nx, ny, nz], config.sweep.size), work, kind: None })
    }

    /// Removes the files that only the measurements needed.
    pub(super) fn finish(self) -> Result<()> {
        fs::remove_dir_all(&self.work).map_err(|e| Error::io(&self.work, "removing", e))
    }

    /// All points of a group.
    pub(super) fn measure(&mut self, group: &Group) -> Result<Vec<Point>> {
        self.prepare(group.kind)?;
        let converted = self.convert(group)?;
        let rendered = self.render(group)?;
        let points = group.contenders.iter().zip(group.keys()).zip(converted.iter().zip(rendered));
        Ok(points.map(|((c, key), (converted, runs))| self.point(group, c, key, converted.as_ref(), &runs)).collect())
    }

    fn frames(&self) -> PathBuf {
        self.work.join("frames.npy")
    }

    fn truth(&self) -> PathBuf {
        self.work.join("truth.json")
    }

    fn file(&self, contender: usize) -> PathBuf {
        self.work.join(format!("{contender}.wspl"))
    }

    /// Writes the archive and the reference of a kind, unless they exist.
    fn prepare(&mut self, kind: Kind) -> Result<()> {
        if self.kind == Some(kind) {
            return Ok(());
        }
        let [nx, ny, nz, frames] = self.config.sweep.dims;
        let synth = Synth { kind, shape: Shape { dims: [nx, ny, nz], frames, ty: SampleType::F32 }, seed: 0 };
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        Target::File(self.frames(), Format::Npy).write(&synth.shape, |frame, bytes| {
            synth.fill(frame, bytes);
            range = values(bytes).iter().fold(range, |(low, high), v| (low.min(*v), high.max(*v)));
        })?;
        let compared = compared_frames(Contender::Shared.frames(frames));
        let compared: Vec<(usize, Vec<f64>)> = compared.into_iter().map(|f| (f, frame(&synth, f))).collect();
        let truth = ReferencePixels::new(synth.shape.dims, &self.camera, &compared, range.1 - range.0);
        write_json(&self.truth(), &truth)?;
        self.kind = Some(kind);
        Ok(())
    }

    /// Runs all conversions in turns, then compares every sample of each.
    fn convert(&self, group: &Group) -> Result<Vec<Option<CheckedConversion>>> {
        let steps: Vec<Option<Convert>> =
            group.contenders.iter().enumerate().map(|(i, c)| self.conversion(group, i, c)).collect();
        let mut runs: Vec<Vec<Outcome<Converted>>> = steps.iter().map(|_| Vec::new()).collect();
        let repeats = group.rounds(self.config.sweep.repeats);
        for round in 0..repeats {
            for ((step, contender), runs) in steps.iter().zip(&group.contenders).zip(&mut runs) {
                if let Some(step) = step.as_ref().filter(|_| round < contender.rounds(repeats)) {
                    runs.push(in_process(&self.config.program, step)?);
                }
            }
        }
        let check =
            |(step, runs): (Option<Convert>, _)| step.map(|s| Ok(CheckedConversion { runs, found: compare(&s)? }));
        steps.into_iter().zip(runs).map(|pair| check(pair).transpose()).collect()
    }

    fn conversion(&self, group: &Group, number: usize, contender: &Contender) -> Option<Convert> {
        let Contender::Coefficients(basis, bound) = contender else { return None };
        Some(Convert {
            frames: self.frames(),
            count: contender.frames(self.config.sweep.dims[3]),
            basis: basis.name.into(),
            bound: bound.name.into(),
            tolerance: group.tolerance,
            output: self.file(number),
        })
    }

    /// Runs all renderings in turns.
    fn render(&self, group: &Group) -> Result<Vec<Vec<Outcome<Rendered>>>> {
        let mut runs: Vec<Vec<Outcome<Rendered>>> = group.contenders.iter().map(|_| Vec::new()).collect();
        let repeats = self.config.sweep.repeats;
        for round in 0..repeats {
            for ((number, contender), runs) in group.contenders.iter().enumerate().zip(&mut runs) {
                if round < contender.rounds(repeats) {
                    let step = Render { certify: round == 0, ..self.rendering(group, number, contender) };
                    runs.push(in_process(&self.config.program, &step)?);
                }
            }
        }
        Ok(runs)
    }

    fn rendering(&self, group: &Group, number: usize, contender: &Contender) -> Render {
        let (input, way) = match contender {
            Contender::Coefficients(..) => (self.file(number), RenderMethod::Coefficients),
            Contender::Shared => (self.frames(), RenderMethod::Shared),
            Contender::Textbook(radius) => (self.frames(), RenderMethod::Textbook(*radius)),
        };
        let frames = contender.frames(self.config.sweep.dims[3]);
        Render {
            input,
            way,
            frames,
            camera: self.camera,
            splat_error: group.splat_error,
            truth: self.truth(),
            certify: false,
        }
    }

    fn point(
        &self,
        group: &Group,
        contender: &Contender,
        key: String,
        converted: Option<&CheckedConversion>,
        rendered: &[Outcome<Rendered>],
    ) -> Point {
        let frames = contender.frames(self.config.sweep.dims[3]);
        let conversion = converted.map(|checked| conversion(checked, frames));
        let voxel = conversion.as_ref().map_or(Some(0.0), |c| sample_bound(contender, c));
        Point {
            key,
            group: group.name(),
            sweep: if group.splat.is_some() { "splat" } else { "tolerance" }.into(),
            kind: group.kind.name(),
            tolerance: group.tolerance,
            method: contender.method().into(),
            bound: contender.bound().map(Into::into),
            frames,
            rendering: rendering(rendered, frames, voxel),
            conversion,
        }
    }
}

/// The largest error that a sample may have, as a share of the value range; none if there is no guarantee.
fn sample_bound(contender: &Contender, conversion: &Conversion) -> Option<f64> {
    let Contender::Coefficients(basis, bound) = contender else { return Some(0.0) };
    (bound.worst)(basis.window as f64).map(|worst| worst * conversion.voxel_bound)
}

fn conversion(checked: &CheckedConversion, frames: usize) -> Conversion {
    let (run, found) = (&checked.runs[0].measured, &checked.found);
    let seconds = Spread::of(checked.runs.iter().map(|r| r.measured.seconds).collect());
    Conversion {
        megabytes_per_second: run.input_bytes as f64 / 1e6 / seconds.median,
        seconds,
        file_bytes: run.file_bytes,
        ratio: run.input_bytes as f64 / run.file_bytes as f64,
        bytes_per_sample: run.file_bytes as f64 / found.samples as f64,
        coefficients_per_sample: run.coefficients_per_sample,
        coefficients_per_voxel: run.coefficients_per_sample * frames as f64,
        outliers: run.outliers,
        voxel_bound: run.delta / run.range,
        largest_voxel_error: found.largest_error / run.range,
        rms_voxel_error: found.rms_error / run.range,
        share_of_bound: found.largest_share_of_bound,
        series_outside: found.series_outside,
        peak_bytes: most(&checked.runs),
    }
}

/// The smallest share of the largest sum of weights with which a pixel is not background.
const LEAST_WEIGHT: f64 = 0.01;

/// `voxel` is the largest error that a sample may have, if there is a bound.
fn rendering(runs: &[Outcome<Rendered>], frames: usize, voxel: Option<f64>) -> Rendering {
    let spread = |seconds: fn(&Rendered) -> f64| Spread::of(runs.iter().map(|r| seconds(&r.measured)).collect());
    let further_view = spread(|r| r.further_seconds);
    let run = &runs[0].measured;
    Rendering {
        first_view: spread(|r| r.first_seconds),
        milliseconds_per_frame: 1e3 * further_view.median / frames as f64,
        further_view,
        splat: run.splat.clone(),
        stated_splat_error: run.stated_splat_error,
        pixel_bound: voxel.zip(run.stated_splat_error).map(|(voxel, splat)| voxel + splat / LEAST_WEIGHT),
        image_error: run.error,
        certified_error: run.certified_error,
        certificate_tightness: run.certificate_tightness,
        beyond_certificate: run.beyond_certificate,
        peak_bytes: most(runs),
    }
}

fn most<T>(runs: &[Outcome<T>]) -> Option<u64> {
    runs.iter().filter_map(|r| r.peak_bytes).max()
}

/// Compares every sample of a file with its source.
fn compare(step: &Convert) -> Result<Comparison> {
    let file = CoefficientFile::open(&step.output)?;
    let mut frames = open_frames(&step.frames, step.count)?;
    Ok(verify(&file, Some(frames.as_mut()), MEMORY, &Silent)?.against.unwrap_or_default())
}

fn frame(synth: &Synth, number: usize) -> Vec<f64> {
    let mut bytes = vec![0; synth.shape.frame_bytes()];
    synth.fill(number, &mut bytes);
    values(&bytes)
}

fn values(bytes: &[u8]) -> Vec<f64> {
    let mut values = vec![0.0; bytes.len() / SampleType::F32.size()];
    sample::load(SampleType::F32, bytes, &mut values);
    values
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string(value).map_err(|e| bad_json(path, &e))?;
    fs::write(path, text).map_err(|e| Error::io(path, "writing", e))
}
