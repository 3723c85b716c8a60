//! Time series of points and regions.

use super::args::Cli;
use super::chart::{Band, Chart, Line};
use super::conflicts::of_pictures;
use super::places::{Axes, Place, text};
use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::base::output::{Output, STANDARD};
use crate::base::sample::{is_missing, load};
use crate::base::time_labels::TimeLabels;
use crate::cli::{RegionSpec, spare_inputs};
use crate::extract::{ExtractConfig, ExtractReport, extract_to};
use crate::file::{CoefficientFile, setting, time_labels};
use crate::render::planes::Taps;
use clap::Args;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::str::FromStr;

/// Options for time series.
#[derive(Debug, Args)]
pub(crate) struct ProbeArgs {
    /// Write the time series of a point instead of pictures, to a .csv or .svg file, or as csv to -; repeat the option
    /// for more points. X, Y and Z are places as in --slice: shares like 0.5, voxels like #12, or coordinates like 45
    /// or 120m. Values between voxels are interpolated linearly
    #[arg(
        long = "probe",
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        conflicts_with_all = of_pictures(),
        help_heading = "Time series"
    )]
    points: Vec<PointSpec>,
    /// Write the mean, the least and the largest value of voxels x0:x1,y0:y1,z0:z1 over time instead of pictures; repeat
    /// it for more regions
    #[arg(long = "probe-region", value_name = "BOX", conflicts_with_all = of_pictures(), help_heading = "Time series")]
    regions: Vec<RegionSpec>,
}

/// A point.
#[derive(Debug, Clone, PartialEq)]
struct PointSpec([Place; 3]);

impl FromStr for PointSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let places = text.split(',').map(str::parse).collect::<std::result::Result<Vec<Place>, _>>()?;
        places.try_into().map(Self).map_err(|_| "takes three places X,Y,Z, like 0.5,#12,120m".into())
    }
}

impl ProbeArgs {
    pub(crate) fn is_asked(&self) -> bool {
        !self.points.is_empty() || !self.regions.is_empty()
    }
}

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

/// One number per frame.
struct Series {
    name: String,
    values: Vec<f64>,
}

/// The report of `--json`.
#[derive(Default, Serialize)]
struct Report {
    frames: usize,
    series: Vec<String>,
    /// The largest error of any sample, for each frame.
    certified_error: Vec<f64>,
    blocks_read: u64,
    bytes_read: u64,
    file_bytes_read: u64,
    file_bytes: u64,
}

impl Report {
    fn add(&mut self, read: &ExtractReport) {
        self.blocks_read += read.blocks_read;
        self.bytes_read += read.bytes_read;
        (self.file_bytes_read, self.file_bytes) = (read.file_bytes_read, read.file_bytes);
    }
}

impl Cli {
    /// Writes time series.
    pub(crate) fn probe(&self) -> Result<()> {
        let format = self.series_format()?;
        let file = self.probed_file()?;
        let axes = Axes::of_file(&file)?;
        let frames = self.frames.as_ref().map_or(Ok((0..file.frames()).collect()), |f| f.resolve(file.frames()))?;
        let probes = self.all_probes(&file, &axes)?;
        let mut report = Report { frames: frames.len(), ..Report::default() };
        let mut series = Vec::new();
        for (name, probe) in &probes {
            series.extend(self.read(&file, &frames, (name, probe), &mut report)?);
        }
        report.series = series.iter().map(|series| series.name.clone()).collect();
        report.certified_error = errors(&file, &frames);
        let table = Table { frames, series, errors: report.certified_error.clone(), of: Named::of(&file)? };
        let text = if format == Format::Svg { table.chart().svg() } else { table.csv() };
        let mut out = Output::create(&self.output, self.force)?;
        out.write_all(text.as_bytes()).map_err(|e| Error::io(&self.output, "writing", e))?;
        out.commit()?;
        self.common.detail_read(report.file_bytes_read, report.file_bytes);
        self.common.report(&report, self.output == Path::new(STANDARD))?;
        file.refuse_skipped()
    }

    fn series_format(&self) -> Result<Format> {
        spare_inputs(&self.inputs, &self.output)?;
        if self.output == Path::new(STANDARD) {
            return Ok(Format::Csv);
        }
        match self.output.extension().and_then(|e| e.to_str()) {
            Some("csv") => Ok(Format::Csv),
            Some("svg") => Ok(Format::Svg),
            _ => Err(Error::usage(format!("{}: a time series is written as .csv or .svg", self.output.display()))),
        }
    }

    fn probed_file(&self) -> Result<CoefficientFile> {
        let [path] = self.inputs.as_slice() else {
            return Err(Error::usage("--probe: takes one coefficient file"));
        };
        self.input.refuse_for_coefficients()?;
        let file = self.remote.open(path, self.input.access())?;
        if file.channels() > 1 {
            return Err(Error::usage("--probe: the file holds colours, which have no single value"));
        }
        if self.skip_damaged { file.skip_damaged() } else { Ok(file) }
    }

    /// All points and regions, with their names.
    fn all_probes(&self, file: &CoefficientFile, axes: &Axes) -> Result<Vec<(String, Probe)>> {
        let whole = file.grid.whole();
        let point = |point: &PointSpec| {
            let mut at = [0.0; 3];
            for (axis, place) in point.0.iter().enumerate() {
                at[axis] = axes.voxel("--probe", axis, place)?;
            }
            let name: Vec<String> = (0..3).map(|axis| axes.text(axis, at[axis]).replace('@', "")).collect();
            Ok((name.join(" "), Probe::Point(Taps::new(at, &whole))))
        };
        let region = |spec: &RegionSpec| {
            let region = spec.resolve(&file.grid).map_err(|e| renamed(&e))?;
            Ok((spec.to_string(), Probe::Region(region)))
        };
        let points = self.probes.points.iter().map(point);
        points.chain(self.probes.regions.iter().map(region)).collect()
    }

    /// The series of a probe.
    fn read(
        &self,
        file: &CoefficientFile,
        frames: &[usize],
        (name, probe): (&str, &Probe),
        report: &mut Report,
    ) -> Result<Vec<Series>> {
        let region = match probe {
            Probe::Point(taps) => taps.region(),
            Probe::Region(region) => *region,
        };
        let memory = self.common.memory.0;
        let config = ExtractConfig { frames: frames.to_vec(), region, memory, ..ExtractConfig::new(file) };
        let mut sums = vec![Sum::default(); frames.len()];
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
        report.add(&extract_to(file, &config, &mut add, &self.common.progress("probe", "frames"))?);
        let series = |what: &str, of: fn(&Sum) -> f64| Series {
            name: format!("{what}{name}"),
            values: sums.iter().map(of).collect(),
        };
        Ok(match probe {
            Probe::Point(_) => vec![series("", Sum::interpolated)],
            Probe::Region(_) => {
                vec![series("mean ", Sum::mean), series("min ", |sum| sum.least), series("max ", |sum| sum.most)]
            }
        })
    }
}

/// The error of a region, by the name of the option that gave it.
fn renamed(error: &Error) -> Error {
    Error::usage(error.to_string().replace("--region", "--probe-region"))
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

/// What the file calls its samples and times.
struct Named {
    variable: String,
    unit: String,
    times: TimeLabels,
}

impl Named {
    fn of(file: &CoefficientFile) -> Result<Self> {
        let m = file.metadata();
        let described = file.description()?.and_then(|all| text(&all.attributes, "units"));
        let unit = setting(m, "units").map(ToString::to_string).or(described).unwrap_or_default();
        Ok(Self { variable: m.variable.clone().unwrap_or_else(|| "value".into()), unit, times: time_labels(m) })
    }

    /// A name with a unit in brackets, if there is one.
    fn with_unit(name: &str, unit: &str) -> String {
        if unit.is_empty() { name.into() } else { format!("{name} [{unit}]") }
    }
}

/// All series of a run.
struct Table {
    frames: Vec<usize>,
    series: Vec<Series>,
    errors: Vec<f64>,
    of: Named,
}

impl Table {
    fn csv(&self) -> String {
        let times = self.of.times.times();
        let has_dates = self.frames.iter().any(|frame| self.of.times.date(*frame).is_some());
        let mut heads = vec!["frame".to_string()];
        heads.extend((!times.is_empty()).then(|| Named::with_unit("time", self.of.times.unit())));
        heads.extend(has_dates.then(|| "date".into()));
        let column =
            |series: &Series| Named::with_unit(&format!("{} {}", self.of.variable, series.name), &self.of.unit);
        heads.extend(self.series.iter().map(column));
        let mut csv = row(&heads);
        for (n, frame) in self.frames.iter().enumerate() {
            let mut cells = vec![frame.to_string()];
            cells.extend(times.get(*frame).map(f64::to_string));
            cells.extend(has_dates.then(|| self.of.times.date(*frame).unwrap_or_default()));
            cells.extend(self.series.iter().map(|series| series.values[n].to_string()));
            csv += &row(&cells);
        }
        csv
    }

    fn chart(&self) -> Chart {
        let times = self.of.times.times();
        let has_dates = !self.of.times.dates().is_empty();
        let at = |frame: &usize| times.get(*frame).copied().unwrap_or(*frame as f64);
        let line = |series: &Series| Line { name: series.name.clone(), values: series.values.clone() };
        Chart {
            x: self.frames.iter().map(at).collect(),
            x_name: match (times.is_empty(), has_dates) {
                (true, _) => "frame".into(),
                (false, true) => "date".into(),
                (false, false) => Named::with_unit("time", self.of.times.unit()),
            },
            dates: self.frames.iter().filter_map(|frame| self.of.times.date(*frame)).collect(),
            y_name: Named::with_unit(&self.of.variable, &self.of.unit),
            lines: self.series.iter().map(line).collect(),
            band: Band { half: self.errors.clone() },
        }
    }
}

/// A row of a csv file.
fn row(cells: &[String]) -> String {
    let quoted = |cell: &String| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell.clone(),
    };
    let mut row = cells.iter().map(quoted).collect::<Vec<_>>().join(",");
    let _ = writeln!(row);
    row
}
