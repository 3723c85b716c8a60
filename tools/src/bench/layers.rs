//! Another benchmark: how much of a file a picture with a looser tolerance leaves unread, and how large its error is.

use super::camera::{CameraSettings, SIGMA};
use super::json::bad_json;
use super::machine::Provenance;
use super::process::{ProcessTask, in_process};
use super::size::Data;
use super::stages::MEMORY;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::convert::{ConvertConfig, convert};
use wavesplat::file::CoefficientFile;
use wavesplat::formats;
use wavesplat::render::{CoefficientScene, FrameScene, Limit, RenderConfig, RenderReport, Scene, SplatSource, render};
use wavesplat::source::OpenOptions;
use wavesplat::view::footprint::Kernel;

/// The number of the layout of `layers.json`; a change of a key's meaning changes it.
pub const SCHEMA: u32 = 1;
/// The tolerance of the files, as a share of the value range.
const FINE: f64 = 1e-3;
/// The splat error: small, so that it hardly affects the comparison.
const SPLAT: f64 = 1e-5;
/// Pixels a side of a picture.
const SIZE: usize = 256;
/// How often every time is taken; the least counts.
const REPEATS: usize = 3;

/// What to measure, with what, and where results go.
#[derive(Debug, Clone)]
pub struct Config {
    /// Archives.
    pub inputs: Vec<PathBuf>,
    /// Tolerances of pictures, as shares of the value range.
    pub tolerances: Vec<f64>,
    /// The folder of results.
    pub output: PathBuf,
    /// The path of `wavesplat-tools`, which measures with its command `bench-step`.
    pub program: PathBuf,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// All results of a run: `layers.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// By what, where and when.
    #[serde(flatten)]
    pub made: Provenance,
    /// The measured archives.
    pub data: Vec<Data>,
    /// Every archive at every tolerance by both measures, after the whole file.
    pub rows: Vec<Row>,
}

/// Pictures of one archive at one tolerance. Errors are shares of the largest absolute pixel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The name of the archive.
    pub data: String,
    /// As a share of the value range, and the measure that it limits; none: the whole file.
    pub limit: Option<(f64, String)>,
    /// Share of the file's nonzero codes that were read.
    pub codes: f64,
    /// Share of the bytes of blocks that were read.
    pub bytes: f64,
    /// Time of the pictures, as a share of that of the whole file's.
    pub time: f64,
    /// The certified error of pixels.
    pub certified: f64,
    /// The expected root mean square error.
    pub expected: f64,
    /// The largest error.
    pub largest: f64,
    /// The root mean square.
    pub rms: f64,
}

/// The settings of one archive's measurement, which runs in its own process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Task {
    name: String,
    source: PathBuf,
    dims: [usize; 3],
    frames: usize,
    range: (f64, f64),
    tolerances: Vec<f64>,
    file: PathBuf,
}

/// Measures everything and writes `layers.json` and `layers.md`; returns the results and the table. `say` hears what is
/// going on.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<(Results, String)> {
    fs::create_dir_all(&config.output).map_err(|e| Error::io(&config.output, "creating the folder", e))?;
    let data = config.inputs.iter().cloned().map(Data::of).collect::<Result<Vec<_>>>()?;
    let file = config.output.join("layers-work.wspl");
    let mut rows = Vec::new();
    for one in &data {
        say(&format!("measuring {}", one.name));
        let (tolerances, file) = (config.tolerances.clone(), file.clone());
        let (name, source, dims, frames, range) = (one.name.clone(), one.path.clone(), one.dims, one.frames, one.range);
        let task = Task { name, source, dims, frames, range, tolerances, file };
        rows.extend(in_process(&config.program, &task)?.measured);
    }
    let results = Results { made: Provenance::here(SCHEMA, config.date.as_ref()), data, rows };
    let text = markdown(&results);
    let json = config.output.join("layers.json");
    let numbers = serde_json::to_string_pretty(&results).map_err(|e| bad_json(&json, &e))?;
    for (path, text) in [(json, &numbers), (config.output.join("layers.md"), &text)] {
        fs::write(&path, text).map_err(|e| Error::io(&path, "writing", e))?;
    }
    Ok((results, text))
}

impl ProcessTask for Task {
    const NAME: &'static str = "layers";
    type Measured = Vec<Row>;

    fn measure(&self) -> Result<Vec<Row>> {
        measure(self)
    }
}

/// Converts and renders in this process.
fn measure(task: &Task) -> Result<Vec<Row>> {
    let open = || formats::open(std::slice::from_ref(&task.source), &OpenOptions::default());
    let (truth, _) = pictures(&mut FrameScene::new(open()?, None), task, 0.0, None)?;
    let settings = ConvertConfig { range: Some(task.range), memory: MEMORY, ..ConvertConfig::new(FINE) };
    let mut bytes = Vec::new();
    convert(open()?.as_mut(), &settings, &task.file, &mut bytes, &Silent)?;
    fs::write(&task.file, bytes).map_err(|e| Error::io(&task.file, "writing", e))?;
    let measures = [("certified", Limit::Certified), ("expected", Limit::Expected)];
    let limits = measures.into_iter().flat_map(|m| task.tolerances.iter().map(move |t| Some((*t, m))));
    let (mut rows, mut whole) = (Vec::new(), RenderReport::default());
    for limit in std::iter::once(None).chain(limits) {
        let file = CoefficientFile::open(&task.file)?;
        let mut scene = CoefficientScene::new(file, SplatSource::Coefficients);
        let allowed = limit.map(|(tolerance, (_, limit))| (tolerance * (task.range.1 - task.range.0), limit));
        let (found, report) = pictures(&mut scene, task, SPLAT, allowed)?;
        if limit.is_none() {
            whole = report.clone();
        }
        let limit = limit.map(|(tolerance, (name, _))| (tolerance, name.into()));
        rows.push(row(task, limit, (&found, &truth), (&report, &whole)));
    }
    fs::remove_file(&task.file).map_err(|e| Error::io(&task.file, "removing", e))?;
    Ok(rows)
}

/// Renders all pictures of a view. Returns them and the report of the fastest run; the reference is rendered once.
fn pictures(
    scene: &mut dyn Scene,
    task: &Task,
    splat_error: f64,
    allowed: Option<(f64, Limit)>,
) -> Result<(Vec<f32>, RenderReport)> {
    let config = RenderConfig {
        kernel: Kernel::new(Some(SIGMA), 0.0, scene.grid())?,
        frames: (0..task.frames).collect(),
        splat_error,
        fast: false,
        allowed: allowed.map(|(allowed, _)| allowed),
        error: allowed.map(|(_, limit)| limit).unwrap_or_default(),
        memory: MEMORY,
        ..RenderConfig::new(scene, CameraSettings::first(task.dims, SIZE).view())
    };
    let (mut found, mut best) = (Vec::new(), RenderReport { seconds: f64::INFINITY, ..RenderReport::default() });
    for _ in 0..if splat_error > 0.0 { REPEATS } else { 1 } {
        found.clear();
        let report = render(scene, &config, &Silent, &mut |rendered| {
            found.extend_from_slice(rendered.picture);
            Ok(())
        })?;
        best = if report.seconds < best.seconds { report } else { best };
    }
    Ok((found, best))
}

fn row(
    task: &Task,
    limit: Option<(f64, String)>,
    (found, truth): (&[f32], &[f32]),
    (report, whole): (&RenderReport, &RenderReport),
) -> Row {
    let shown = || found.iter().zip(truth).filter(|(_, truth)| !truth.is_nan());
    let brightest = shown().map(|(_, truth)| f64::from(truth.abs())).fold(0.0, f64::max);
    let lost = |off: f64| if off.is_nan() { f64::MAX } else { off };
    let off = || shown().map(|(a, b)| lost(f64::from(a - b) / brightest));
    Row {
        data: task.name.clone(),
        limit,
        codes: report.coefficients as f64 / whole.coefficients as f64,
        bytes: report.bytes_read as f64 / whole.bytes_read as f64,
        time: report.seconds / whole.seconds,
        certified: report.certified_sample_error / brightest,
        expected: report.expected_error / brightest,
        largest: off().map(f64::abs).fold(0.0, f64::max),
        rms: (off().map(|d| d * d).sum::<f64>() / off().count().max(1) as f64).sqrt(),
    }
}

const HEAD: &str = "\
Files keep every sample within 1e-3 of the value range. *Tolerance* is a share of that range, too. All errors are shares
of the largest absolute pixel, relative to pictures of the archive by the exact method. No pixel's error exceeds *certified*
(plus the splat error, 1e-5 of the range). *Expected* is an estimate of *rms*, the true root mean square over all pixels and
frames. Codes, bytes and time are shares of those for the whole file.
";

const TITLES: &str = "\
| data | tolerance | codes | bytes | time | certified | expected | largest | rms | rms / expected |
|---|---|--:|--:|--:|--:|--:|--:|--:|--:|
";

fn markdown(results: &Results) -> String {
    let Provenance { machine, version, date, .. } = &results.made;
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    let made = format!("wavesplat {version}, {} threads of {cpu}, {}, {date}", machine.cores, machine.system);
    let mut text = format!("# What a looser tolerance skips\n\n{made}.\n\n{HEAD}\n{TITLES}");
    for row in &results.rows {
        let Row { data, limit, codes, bytes, time, certified, expected, largest, rms } = row;
        let limit = limit.as_ref().map_or("whole file".into(), |(t, name)| format!("{t:e} {name}"));
        let read = format!("{codes:.3} | {bytes:.3} | {time:.2}");
        let errors = [certified, expected, largest, rms].map(|e| format!("{e:.1e}")).join(" | ");
        let _ = writeln!(text, "| {data} | {limit} | {read} | {errors} | {:.2} |", rms / expected);
    }
    text
}

/// A sentence for every row that is further off than certified and what the splat adds.
pub fn complaints(results: &Results) -> Vec<String> {
    let missed = results.rows.iter().filter(|r| r.largest > r.certified * (1.0 + SPLAT / FINE) + 1e-6);
    missed.map(|r| format!("{}, {:?}: {:e} of {:e}", r.data, r.limit, r.largest, r.certified)).collect()
}
