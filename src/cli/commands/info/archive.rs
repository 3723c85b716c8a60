//! Describes an archive of frames.

use super::InfoArgs;
use crate::{note_text, print};
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::Archive;
use wavesplat_engine::convert::estimate::{Estimate, estimates};
use wavesplat_engine::convert::{ConvertConfig, MissingPolicy};
use wavesplat_format::Keep;

/// The keys of `--json`.
#[derive(Debug, Serialize)]
struct Info<'a> {
    format: &'static str,
    /// Whether frames are decoded a window at a time, or else read in place.
    decoded: bool,
    dims: [usize; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    sample: &'static str,
    frames: Option<usize>,
    times: &'a [f64],
    #[serde(skip)]
    span: Option<String>,
    /// The date of each time if the calendar is known, else empty.
    dates: Vec<String>,
    variable: Option<&'a str>,
    units: Option<&'a str>,
    time_units: Option<&'a str>,
    calendar: Option<&'a str>,
    space_units: Option<&'a str>,
    /// The value of missing samples: a number, or "NaN".
    missing_value: Option<String>,
    raw_bytes: Option<u64>,
    notes: Vec<String>,
    estimate: Option<Estimate>,
    /// Estimates for several tolerances.
    estimates: Vec<Estimate>,
    /// What `kept_bytes` of estimates keep.
    #[serde(skip)]
    keep: &'a Keep,
}

pub(super) fn run(args: &InfoArgs) -> Result<()> {
    if args.estimate.is_some() && args.inputs == [Path::new(STANDARD)] {
        return Err(Error::usage("--estimate: reads frames more than once, so they cannot come from standard input"));
    }
    let source = args.input.open_quietly(&args.inputs, args.common.stream_memory())?;
    let mut source = args.select.narrow(source)?;
    let archive = source.archive().clone();
    let progress = args.common.progress("estimate", "windows");
    let keep = Keep::joined(&args.keep).map_err(|what| Error::setting("keep", what))?;
    let configs = |tolerances: &[f64]| -> Vec<ConvertConfig> {
        let of = |tolerance: &f64| ConvertConfig {
            keep: keep.clone(),
            ..config(*tolerance, args.common.memory.0, &archive)
        };
        tolerances.iter().map(of).collect()
    };
    let asked = args.estimate.map(|one| one.map_or(configs(&TOLERANCES), |one| configs(&[one]))).unwrap_or_default();
    let estimates = estimates(source.as_mut(), &asked, &progress)?;
    let info = Info::new(&archive, &keep, estimates, args.estimate.is_some_and(|one| one.is_some()));
    if args.common.json {
        return args.common.report(&info, false);
    }
    print(&info.text())
}

/// The tolerances of a table.
const TOLERANCES: [f64; 5] = [0.1, 0.01, 1e-3, 1e-4, 1e-5];

/// The default configuration of `convert`.
fn config(tolerance: f64, memory: usize, archive: &Archive) -> ConvertConfig {
    let (missing, missing_value) = (MissingPolicy::Mask, archive.missing_value(None));
    ConvertConfig { missing, missing_value, memory, ..ConvertConfig::new(tolerance) }
}

impl<'a> Info<'a> {
    fn new(archive: &'a Archive, keep: &'a Keep, mut estimates: Vec<Estimate>, single: bool) -> Self {
        let labels = archive.time_labels();
        let estimate = if single { estimates.pop() } else { None };
        let frame = (archive.grid.whole().voxels() * archive.sample.size()) as u64;
        Self {
            format: archive.format,
            decoded: archive.memory > 0,
            dims: archive.grid.dims,
            spacing: archive.grid.spacing,
            origin: archive.grid.origin,
            sample: archive.sample.name(),
            frames: archive.frames,
            times: &archive.times,
            span: labels.span().or(archive.regular_times.map(|times| times.to_string())),
            dates: labels.dates(),
            variable: archive.variable.as_deref(),
            units: archive.units.samples.as_deref(),
            time_units: archive.units.times.as_deref(),
            calendar: archive.units.calendar.as_deref(),
            space_units: archive.units.space.as_deref(),
            missing_value: archive.missing.map(|value| format!("{value:?}")),
            raw_bytes: archive.frames.and_then(|frames| frame.checked_mul(frames as u64)),
            notes: archive.notes.iter().map(note_text).collect(),
            estimate,
            estimates,
            keep,
        }
    }

    fn text(&self) -> String {
        let [x, y, z] = self.dims;
        let with = |unit: Option<&str>, before: &str| unit.map(|unit| format!("{before}{unit}")).unwrap_or_default();
        let how = if self.decoded { "decoded a window at a time" } else { "read in place" };
        let (space, unit) = (with(self.space_units, " "), with(self.units, " in "));
        let frames =
            self.frames.map_or("frames to the end of the stream".into(), |frames| format!("{frames} frame(s)"));
        let mut text = format!(
            "format     {}, {how}\n\
             volume     {x} x {y} x {z} voxels, spacing {:?}{space}, origin {:?}{space}\n\
             samples    {} ({}{unit}), {frames}\n",
            self.format,
            self.spacing,
            self.origin,
            self.sample,
            self.variable.unwrap_or("unnamed"),
        );
        if let Some(span) = &self.span {
            let _ = writeln!(text, "times      {span}");
        }
        if let Some(value) = &self.missing_value {
            let _ = writeln!(text, "missing    {value} stands for missing samples");
        }
        if let Some(bytes) = self.raw_bytes {
            let _ = writeln!(text, "size       {bytes} bytes of samples");
        }
        if let Some(e) = &self.estimate {
            let _ = writeln!(
                text,
                "estimate   about {} bytes as a coefficient file, {:.1}x smaller, at a tolerance of {} of the range {:.4e} to {:.4e} \
                 (by {} blocks of {} windows)",
                e.bytes, e.ratio, e.tolerance, e.range.0, e.range.1, e.blocks, e.windows
            );
            text += &self.results(std::slice::from_ref(e));
        }
        text += &self.table();
        self.notes.iter().for_each(|note| text += &format!("note       {note}\n"));
        text
    }

    /// The estimates of several tolerances, a line for each; empty if there are none.
    fn table(&self) -> String {
        let Some(Estimate { range: (lo, hi), blocks, windows, .. }) = self.estimates.first() else {
            return String::new();
        };
        let unit = self.units.map_or(String::new(), |unit| format!(" {unit}"));
        let basis = format!("range {lo:.4e} to {hi:.4e}{unit}, by {blocks} blocks of {windows} windows");
        let mut text = format!("estimate   {basis}; lost: voxels that change by less than the error\n");
        let [tolerance, bytes, ratio, error, lost] = ["tolerance", "bytes", "smaller", "error", "lost"];
        let _ = writeln!(text, "{tolerance:>20} {bytes:>13} {ratio:>9} {error:>10} {lost:>6}");
        for Estimate { tolerance, bytes, ratio, error, lost, .. } in &self.estimates {
            let lost = lost.map_or("-".into(), |lost| format!("{:.0} %", 100.0 * lost));
            let _ =
                writeln!(text, "{tolerance:>20} {bytes:>13} {:>9} {error:>10.2e} {lost:>6}", format!("{ratio:.1}x"));
        }
        text + &self.results(&self.estimates)
    }

    /// The errors of what is computed at some tolerances, a line for each, and what the promises cost.
    fn results(&self, estimates: &[Estimate]) -> String {
        let unit = self.units.map_or(String::new(), |unit| format!(", in {unit}"));
        let sides = self.keep.sides.iter().map(|value| format!("side {value}"));
        let names = ["difference", "gradient", "laplacian", "mean", "overshoot"].map(String::from);
        let cost = (!self.keep.is_empty()).then(|| "kept bytes".to_string());
        let columns = names.into_iter().chain(sides).chain(cost).map(|name| format!(" {name:>11}")).collect::<String>();
        let mut text = format!(
            "errors     of what is computed, without --keep\n           \
             difference (between frames), gradient, laplacian: root mean square, as a share of its own\n           \
             mean, overshoot: the largest of a block and frame{unit}\n"
        );
        if !self.keep.sides.is_empty() {
            text += "           side V: edges that cross V in only one of source and decoded samples, as a share of those in the source\n";
        }
        let _ = writeln!(text, "{:>20}{columns}", "tolerance");
        let percent = |share: &Option<f64>| share.map_or("-".into(), |share| format!("{:.2} %", 100.0 * share));
        for Estimate { tolerance, results, kept_bytes, .. } in estimates {
            let Some(results) = results else { return String::new() };
            let shares = [&results.difference, &results.gradient, &results.laplacian].map(percent).into_iter();
            let cells = shares
                .chain([results.mean, results.overshoot].map(|error| format!("{error:.2e}")))
                .chain(results.sides.iter().map(percent));
            let cells = cells.chain(kept_bytes.map(|bytes| bytes.to_string())).map(|cell| format!(" {cell:>11}"));
            let _ = writeln!(text, "{tolerance:>20}{}", cells.collect::<String>());
        }
        text
    }
}
