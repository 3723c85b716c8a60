//! The case of [Dobashi](wavesplat::bibliography), table 1: eddy currents in a plate, Haar and multiwavelet, beside both conventional forms.

use super::archives::Bench;
use super::convert::{Conversion, Scheme};
use super::measured::{Measured, further};
use super::results::Row;
use super::view::{Method, View};
use super::work::{Task, Work};
use crate::bench::camera::CameraSettings;
use crate::bench::size::{Data, Subject};
use std::collections::BTreeMap;
use std::path::PathBuf;
use wavesplat::base::error::Result;

/// The paper's tolerance, about 5/256.
const TOLERANCE: f64 = 0.02;
/// The scheme, frames of its window, and its speed-up over the conventional method in the paper: with the transform, and
/// without it (a further view).
const PAPER: [(Scheme, usize, f64, f64); 2] =
    [(Scheme::Haar, 32, 4.1, 1643.0 / (323.3 + 8.0)), (Scheme::Multi, 33, 2.9, 1643.0 / (341.6 + 15.4))];
const CONVENTIONAL: [(&str, Method); 2] = [("direct", Method::Direct), ("textbook", Method::Textbook)];

impl Bench<'_> {
    /// Rows without targets. Their notes give the paper's numbers.
    pub(super) fn paper(&self, say: &mut dyn FnMut(&str)) -> Result<Vec<Row>> {
        say("making the paper's case");
        let small = self.config.dims.iter().all(|[x, y, z, _]| x * y * z < 75 * 75 * 20);
        let data = Data::of(Subject::Demo.make(self.work, small, None)?)?;
        let mut found = BTreeMap::new();
        self.measure(&self.paper_tasks(&data), &mut found, say)?;
        let seconds = |key: String| found.get(&key).map_or(f64::NAN, |m: &Measured| further(m).processor);
        let mut rows = Vec::new();
        for ((name, _), (scheme, _, total, view)) in CONVENTIONAL.iter().flat_map(|c| PAPER.map(|p| (c, p))) {
            let scheme = scheme.name();
            let convert = found[&format!("convert {scheme}")].time.processor;
            let own = seconds(format!("view {scheme}"));
            let mut row = |what: &str, seconds_of: f64, paper: f64| {
                let value = Ok((seconds(format!("view {name}")) / seconds_of, format!("the paper: {paper:.1}")));
                let target = format!("{what}, times faster than the {name} form");
                rows.push(Row::new(&target, "the paper's", format!("{scheme} {TOLERANCE}, 1 thread(s)"), value, None));
            };
            row("total: conversion and a view", convert + own, total);
            row("a further view", own, view);
        }
        Ok(rows)
    }

    fn paper_tasks(&self, data: &Data) -> Vec<(String, Task)> {
        let mut tasks = Vec::new();
        let mut add = |key: String, work| tasks.push((key, Task { threads: 1, work }));
        for (scheme, window, ..) in PAPER {
            let output = self.work.join(format!("paper-{}.wspl", scheme.name()));
            let (source, range) = (data.path.clone(), data.range);
            let conversion = Conversion { source, scheme, window, tolerance: TOLERANCE, range, output: output.clone() };
            add(format!("convert {}", scheme.name()), Work::Convert(conversion));
            add(format!("view {}", scheme.name()), Work::View(self.paper_view(data, output, Method::Codes)));
        }
        for (name, method) in CONVENTIONAL {
            add(format!("view {name}"), Work::View(self.paper_view(data, data.path.clone(), method)));
        }
        tasks
    }

    fn paper_view(&self, data: &Data, input: PathBuf, method: Method) -> View {
        View {
            input,
            method,
            camera: CameraSettings::first(data.dims, self.config.size),
            splat_error: TOLERANCE / 10.0,
            frames: (0..data.frames).collect(),
            region: None,
            allowed: None,
            cold: false,
        }
    }
}
