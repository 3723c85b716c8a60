//! Time series as a table, and as a chart.

use super::Series;
use super::chart::{Band, Chart, Line};
use crate::units::attribute_text;
use std::fmt::Write as _;
use wavesplat_core::base::decimal;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_engine::file::{CoefficientFile, setting, time_labels};

/// The names and units of samples and times.
pub(super) struct Named {
    variable: String,
    unit: String,
    times: TimeLabels,
}

impl Named {
    pub(super) fn from_file(file: &CoefficientFile) -> Result<Self> {
        let m = file.metadata();
        let described = file.description()?.and_then(|all| attribute_text(&all.attributes, "units"));
        let unit = setting(m, "units").map(ToString::to_string).or(described).unwrap_or_default();
        Ok(Self { variable: m.variable.clone().unwrap_or_else(|| "value".into()), unit, times: time_labels(m) })
    }

    /// A name with a unit in brackets, if there is one.
    fn with_unit(name: &str, unit: &str) -> String {
        if unit.is_empty() { name.into() } else { format!("{name} [{unit}]") }
    }
}

/// All series of a run.
pub(super) struct Table {
    pub(super) frames: Vec<usize>,
    pub(super) series: Vec<Series>,
    /// The largest error of any sample, for each frame.
    pub(super) errors: Vec<f64>,
    pub(super) named: Named,
}

impl Table {
    pub(super) fn csv(&self) -> String {
        let times = self.named.times.times();
        let has_dates = self.frames.iter().any(|frame| self.named.times.date(*frame).is_some());
        let mut heads = vec!["frame".to_string()];
        heads.extend((!times.is_empty()).then(|| Named::with_unit("time", self.named.times.unit())));
        heads.extend(has_dates.then(|| "date".into()));
        let column =
            |series: &Series| Named::with_unit(&format!("{} {}", self.named.variable, series.name), &self.named.unit);
        heads.extend(self.series.iter().map(column));
        let mut csv = row(&heads);
        for (n, frame) in self.frames.iter().enumerate() {
            let mut cells = vec![frame.to_string()];
            cells.extend(times.get(*frame).map(|time| decimal::short(*time)));
            cells.extend(has_dates.then(|| self.named.times.date(*frame).unwrap_or_default()));
            cells.extend(self.series.iter().map(|series| series.values[n].to_string()));
            csv += &row(&cells);
        }
        csv
    }

    pub(super) fn chart(&self) -> Chart {
        let times = self.named.times.times();
        let has_dates = !self.named.times.dates().is_empty();
        let at = |frame: &usize| times.get(*frame).copied().unwrap_or(*frame as f64);
        let line = |series: &Series| Line { name: series.name.clone(), values: series.values.clone() };
        Chart {
            x: self.frames.iter().map(at).collect(),
            x_name: match (times.is_empty(), has_dates) {
                (true, _) => "frame".into(),
                (false, true) => "date".into(),
                (false, false) => Named::with_unit("time", self.named.times.unit()),
            },
            dates: self.frames.iter().filter_map(|frame| self.named.times.date(*frame)).collect(),
            y_name: Named::with_unit(&self.named.variable, &self.named.unit),
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
