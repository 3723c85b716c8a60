//! Describes a coefficient file.

use super::{description, made_by};
use crate::{CommonArgs, print};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use wavesplat_core::base::description::Description;
use wavesplat_core::base::error::Result;
use wavesplat_core::source::CHANNELS;
use wavesplat_engine::convert::Bound;
use wavesplat_engine::file::promise::range_of_shares;
use wavesplat_engine::file::report::{BoundReport, WindowReport, largest_bound};
use wavesplat_engine::file::{CoefficientFile, time_labels};

/// The keys of `--json`.
#[derive(Debug, Serialize)]
struct Info {
    id: String,
    /// The version of the format that a reader needs.
    format: String,
    bytes: u64,
    dims: [u64; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    sample: &'static str,
    channels: usize,
    colours: Option<String>,
    frames: u64,
    times: Vec<f64>,
    /// The date of each time if the calendar is known, else empty.
    dates: Vec<String>,
    #[serde(skip)]
    span: Option<String>,
    variable: Option<String>,
    #[serde(flatten)]
    promise: BoundReport,
    /// The range of values that shares refer to.
    range: (f64, f64),
    /// The largest error, or root mean square, that any window allows.
    delta: f64,
    value_range: (f64, f64),
    missing_value: Option<f64>,
    block_edge: u32,
    blocks: u64,
    raw_bytes: u64,
    coefficients: u64,
    outliers: u64,
    missing: u64,
    lost_blocks: u64,
    windows: Vec<WindowReport>,
    /// What samples keep besides the bound; empty if nothing.
    keep: String,
    settings: Vec<(String, String)>,
    /// The options of `wavesplat convert` that reproduce the file, by name.
    options: BTreeMap<String, String>,
    program: String,
    /// The metadata of the source that the file keeps.
    #[serde(skip_serializing_if = "Option::is_none")]
    description: Option<serde_json::Value>,
    #[serde(skip)]
    described: Option<Description>,
}

pub(super) fn run(file: &CoefficientFile, common: &CommonArgs) -> Result<()> {
    let info = Info::from_file(file)?;
    if common.json {
        return common.report(&info, false);
    }
    print(&info.text(file.metadata().bound, common.verbose))
}

impl Info {
    fn from_file(file: &CoefficientFile) -> Result<Self> {
        let m = file.metadata();
        let voxels: u64 = m.dims.iter().product();
        let windows: Vec<WindowReport> =
            m.windows.iter().map(|w| WindowReport::new(w, voxels * u64::from(m.channels))).collect();
        let times = time_labels(m);
        let described = file.description()?;
        Ok(Self {
            format: file.format_version(),
            id: file.id().to_string(),
            bytes: file.bytes(),
            dims: m.dims,
            spacing: m.spacing,
            origin: m.origin,
            sample: m.sample.name(),
            channels: file.channels(),
            colours: file.colour_transform().map(|painter| painter.colours.words()),
            frames: m.frames,
            times: m.times.clone(),
            dates: times.dates(),
            span: times.span(),
            variable: m.variable.clone(),
            promise: BoundReport::from_metadata(m),
            range: range_of_shares(m),
            delta: largest_bound(m),
            value_range: file.value_range(),
            missing_value: m.missing_value,
            block_edge: m.block_edge,
            blocks: m.blocks(),
            raw_bytes: voxels * m.frames * file.of_source().0.size() as u64,
            coefficients: windows.iter().map(|w| w.coefficients).sum(),
            outliers: windows.iter().map(|w| w.outliers).sum(),
            missing: windows.iter().map(|w| w.missing).sum(),
            lost_blocks: (0..windows.len() as u32).flat_map(|w| file.leaves(w)).map(|leaf| leaf.lost).sum(),
            windows,
            keep: m.keep().to_string(),
            settings: m.settings.clone(),
            options: made_by::options(file),
            program: m.program.clone(),
            description: described.as_ref().map(description::json),
            described,
        })
    }

    fn text(&self, bound: Bound, verbose: bool) -> String {
        let [x, y, z] = self.dims;
        let name = self.variable.as_deref().unwrap_or("unnamed");
        let ratio = self.raw_bytes as f64 / self.bytes as f64;
        let per_sample = self.coefficients as f64 / (x * y * z * self.frames) as f64;
        let (share, reached) = (self.largest(|w| w.share), self.largest(|w| w.reached));
        let mut text = format!(
            "volume     {x} x {y} x {z} voxels, spacing {:?}, origin {:?}\n\
             samples    {} ({name}), {} frames, decoded values {:.4e} to {:.4e}\n\
             size       {} bytes, {ratio:.1}x smaller than raw; {} blocks of {} voxels a side\n\
             bound      {}: {}\n\
             reached    at most {share:.4} of the bound; largest sample error {reached:.4e}\n\
             content    {per_sample:.4} coefficients per sample, {} outliers, {} missing samples\n\
             id         {} ({}, format {})\n",
            self.spacing,
            self.origin,
            self.sample,
            self.frames,
            self.value_range.0,
            self.value_range.1,
            self.bytes,
            self.blocks,
            self.block_edge,
            self.promise.bound,
            self.promise.promise,
            self.outliers,
            self.missing,
            self.id,
            self.program,
            self.format
        );
        if !self.keep.is_empty() {
            let _ = writeln!(text, "keeps      {}", self.keep);
        }
        let unit = |name: &str| self.settings.iter().find(|(n, _)| n == name).map(|(_, unit)| unit.as_str());
        if let Some(span) = &self.span {
            let _ = writeln!(text, "times      {span}");
        }
        let units: Vec<String> = [("samples in ", "units"), ("places in ", "space-units")]
            .into_iter()
            .filter_map(|(what, name)| Some(format!("{what}{}", unit(name)?)))
            .collect();
        if !units.is_empty() {
            let _ = writeln!(text, "units      {}", units.join(", "));
        }
        text += &self.described.as_ref().map(|all| description::text(all, verbose)).unwrap_or_default();
        if let Some(colours) = &self.colours {
            let _ = writeln!(text, "colours    {} channels: {} by {colours}", self.channels, CHANNELS.join(", "));
        }
        if self.lost_blocks > 0 {
            let lost = self.lost_blocks;
            let _ =
                writeln!(text, "LOST       {lost} blocks, when the file was recovered; wavesplat verify lists them");
        }
        let quote = |value: &str| if value.contains(' ') { "\"" } else { "" };
        let options = self.options.iter().map(|(name, value)| format!("--{name}={0}{value}{0}", quote(value)));
        let options: Vec<String> = options.collect();
        let _ = writeln!(text, "made by    convert {}", options.join(" "));
        let shown = if verbose { self.windows.len() } else { self.windows.len().min(MOST_WINDOWS) };
        for w in &self.windows[..shown] {
            let _ = writeln!(text, "window     {}", w.line(bound, self.promise.tolerance));
        }
        if shown < self.windows.len() {
            let _ = writeln!(text, "           and {} more windows; -v shows all", self.windows.len() - shown);
        }
        text
    }

    fn largest(&self, value: fn(&WindowReport) -> f64) -> f64 {
        self.windows.iter().map(value).fold(0.0, f64::max)
    }
}

/// The number of windows listed without `--verbose`.
const MOST_WINDOWS: usize = 8;
