//! Time series of points and regions.

mod chart;
mod table;

use super::plan::config::frames_of;
use super::report::Outcome;
use super::reporter::Reporter;
use super::request::PictureRequest;
use super::session::Session;
use super::values::PointSpec;
use crate::axes::Axes;
use crate::extract::{ExtractConfig, ExtractReport, extract_to};
use crate::report::report_text;
use serde::Serialize;
use std::io::Write as _;
use std::path::Path;
use table::{Named, Table};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::inputs::spare_inputs;
use wavesplat_core::base::output::{Output, STANDARD};
use wavesplat_core::base::position::RegionSpec;
use wavesplat_core::base::sample::{is_missing, load};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::SplatSource;
use wavesplat_engine::render::planes::Taps;

/// The formats of time series.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Csv,
    Svg,
}

/// What to read from each frame.
enum Probe {
    Point(Taps),
    Region(Region),
}

impl Probe {
    /// The voxels that are read.
    fn region(&self) -> Region {
        match self {
            Self::Point(taps) => taps.region(),
            Self::Region(region) => *region,
        }
    }
}

/// One number per frame.
struct Series {
    name: String,
    values: Vec<f64>,
}

/// The report of `--json`.
#[derive(Default, Serialize)]
pub(super) struct SeriesReport {
    frames: usize,
    series: Vec<String>,
    /// The largest error of any sample, for each frame.
    certified_error: Vec<f64>,
    blocks_read: u64,
    bytes_read: u64,
    file_bytes_read: u64,
    file_bytes: u64,
}

impl SeriesReport {
    fn add(&mut self, read: &ExtractReport) {
        self.blocks_read += read.blocks_read;
        self.bytes_read += read.bytes_read;
        (self.file_bytes_read, self.file_bytes) = (read.file_bytes_read, read.file_bytes);
    }
}

/// Writes time series.
pub(super) fn write_series(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Outcome> {
    let format = series_format(request, session)?;
    let AllSeries { file, table, report } = AllSeries::read(session, request, reporter)?;
    let text = if format == Format::Svg { table.chart().svg() } else { table.csv() };
    let mut out = Output::create(&request.output, request.force)?;
    out.write_all(text.as_bytes()).map_err(|e| Error::io(&request.output, "writing", e))?;
    out.commit()?;
    reporter.detail_read(report.file_bytes_read, report.file_bytes);
    let is_on_stdout = request.writes_to_stdout();
    Ok(Outcome { report: report_text(&report)?, is_on_stdout, end: file.refuse_skipped() })
}

/// Time series as lines of comma-separated values.
pub(super) fn series_csv(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Vec<u8>> {
    Ok(AllSeries::read(session, request, reporter)?.table.csv().into_bytes())
}

fn series_format(request: &PictureRequest, session: &Session) -> Result<Format> {
    let output = &request.output;
    spare_inputs(session.paths(), output)?;
    if output == Path::new(STANDARD) {
        return Ok(Format::Csv);
    }
    match output.extension().and_then(|e| e.to_str()) {
        Some("csv") => Ok(Format::Csv),
        Some("svg") => Ok(Format::Svg),
        _ => Err(Error::path(output, "a time series is written as .csv or .svg")),
    }
}

/// All series of a request.
struct AllSeries {
    file: CoefficientFile,
    table: Table,
    report: SeriesReport,
}

impl AllSeries {
    fn read(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Self> {
        let file = probed_file(session, request)?;
        let axes = Axes::from_file(&file)?;
        let frames = frames_of(request, file.frames())?;
        let mut report = SeriesReport { frames: frames.len(), ..SeriesReport::default() };
        let mut series = Vec::new();
        for (name, probe) in &all_probes(request, &file, &axes)? {
            let config = ExtractConfig {
                frames: frames.clone(),
                region: probe.region(),
                memory: session.memory,
                ..ExtractConfig::new(&file)
            };
            let (sums, read) = sums(&file, &config, probe, reporter)?;
            series.extend(series_of_sums(name, probe, &sums));
            report.add(&read);
        }
        report.series = series.iter().map(|series| series.name.clone()).collect();
        report.certified_error = errors(&file, &frames);
        let table = Table { frames, series, errors: report.certified_error.clone(), named: Named::from_file(&file)? };
        Ok(Self { file, table, report })
    }
}

fn probed_file(session: &Session, request: &PictureRequest) -> Result<CoefficientFile> {
    if session.coefficient_path(SplatSource::Coefficients).is_none() {
        return Err(Error::setting("probe", "takes one coefficient file"));
    }
    let file = session.file(request.skip_damaged)?;
    if file.channels() > 1 {
        return Err(Error::setting("probe", "the file holds colours, which have no single value"));
    }
    Ok(file)
}

/// All points and regions, with their names.
fn all_probes(request: &PictureRequest, file: &CoefficientFile, axes: &Axes) -> Result<Vec<(String, Probe)>> {
    let whole = file.grid.whole();
    let point = |point: &PointSpec| {
        let mut at = [0.0; 3];
        for (axis, position) in point.0.iter().enumerate() {
            at[axis] = axes.voxel("probe", axis, position)?;
        }
        let name: Vec<String> = (0..3).map(|axis| axes.text(axis, at[axis]).replace('@', "")).collect();
        Ok((name.join(" "), Probe::Point(Taps::new(at, &whole))))
    };
    let region = |spec: &RegionSpec| {
        let region = axes.region("probe_region", spec)?;
        Ok((spec.to_string(), Probe::Region(region)))
    };
    request.probe.iter().map(point).chain(request.probe_region.iter().map(region)).collect()
}

/// The samples of a probe in each frame, summed up.
fn sums(
    file: &CoefficientFile,
    config: &ExtractConfig,
    probe: &Probe,
    reporter: &dyn Reporter,
) -> Result<(Vec<Sum>, ExtractReport)> {
    let region = config.region;
    let mut sums = vec![Sum::default(); config.frames.len()];
    let (ty, declared, mut index) = (file.sample(), file.metadata().missing_value, 0);
    let weights: Option<Vec<f64>> = match probe {
        Probe::Point(taps) => Some(region.iter().map(|voxel| taps.weight(voxel)).collect()),
        Probe::Region(_) => None,
    };
    let mut add = |bytes: &[u8]| {
        let mut samples = vec![0.0; bytes.len() / ty.size()];
        load(ty, bytes, &mut samples);
        for sample in samples {
            let (frame, voxel) = (index / region.voxels(), index % region.voxels());
            let weight = weights.as_ref().map_or(1.0, |weights| weights[voxel]);
            sums[frame].add(sample, weight, is_missing(sample, declared));
            index += 1;
        }
        Ok(())
    };
    let report = extract_to(file, config, &mut add, reporter.progress("probe", "frames").as_ref())?;
    Ok((sums, report))
}

/// The series of a probe.
fn series_of_sums(name: &str, probe: &Probe, sums: &[Sum]) -> Vec<Series> {
    let series = |what: &str, value: fn(&Sum) -> f64| Series {
        name: format!("{what}{name}"),
        values: sums.iter().map(value).collect(),
    };
    match probe {
        Probe::Point(_) => vec![series("", Sum::interpolated)],
        Probe::Region(_) => {
            vec![series("mean ", Sum::mean), series("min ", |sum| sum.least), series("max ", |sum| sum.most)]
        }
    }
}

/// The samples of a frame, summed up.
#[derive(Clone, Copy)]
struct Sum {
    sum: f64,
    weight: f64,
    missing: bool,
    least: f64,
    most: f64,
}

impl Default for Sum {
    fn default() -> Self {
        Self { sum: 0.0, weight: 0.0, missing: false, least: f64::NAN, most: f64::NAN }
    }
}

impl Sum {
    fn add(&mut self, sample: f64, weight: f64, is_missing: bool) {
        if is_missing {
            self.missing = true;
            return;
        }
        self.sum += weight * sample;
        self.weight += weight;
        (self.least, self.most) = (self.least.min(sample), self.most.max(sample));
    }

    /// The weighted sum; NaN if a sample is missing.
    fn interpolated(&self) -> f64 {
        if self.missing { f64::NAN } else { self.sum }
    }

    /// The mean of the samples that are there; NaN if there is none.
    fn mean(&self) -> f64 {
        self.sum / self.weight
    }
}

/// The largest error of any sample, for each frame.
fn errors(file: &CoefficientFile, frames: &[usize]) -> Vec<f64> {
    let windows = &file.metadata().windows;
    frames.iter().map(|frame| windows[file.window_of(*frame) as usize].reached).collect()
}
