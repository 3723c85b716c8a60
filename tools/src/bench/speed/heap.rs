//! Peak memory of converting archives of different sizes.

use super::archives::{Bench, Subject};
use super::convert::{Conversion, Scheme};
use super::results::{Row, Threshold, Value};
use super::work::{Task, Work};
use crate::bench::stages::MEMORY;
use crate::synth::Kind;
use wavesplat::base::error::Result;

/// Largest ratio of peaks that count as equal, because of the allocator and the sampling.
const EQUAL: f64 = 1.05;

/// The names of the targets.
const WITHIN: &str = "peak heap of conversion / --memory";
const ALIKE: &str = "peak heap of conversion, largest archive / smallest";

impl Bench<'_> {
    /// Converts each of the large archives by default settings.
    pub(super) fn heap(&self, say: &mut dyn FnMut(&str)) -> Result<Vec<Row>> {
        let why = || Err("not measured: needs --large".to_string());
        let large = &self.config.large;
        if large.is_empty() {
            let row = |target, limit| {
                Row::new(target, "4 GiB and 20 GiB", String::new(), why(), Some(Threshold::AtMost(limit)))
            };
            return Ok(vec![row(WITHIN, 1.0), row(ALIKE, EQUAL)]);
        }
        let (mut rows, mut peaks) = (Vec::new(), Vec::new());
        for dims in large {
            let (name, peak) = self.peak(*dims, say)?;
            let share = peak.clone().map(|p| (p / MEMORY as f64, format!("{:.0} MiB", p / 1024.0 / 1024.0)));
            rows.push(Row::new(WITHIN, &name, "default settings".into(), share, Some(Threshold::AtMost(1.0))));
            peaks.push(peak);
        }
        let all = peaks.into_iter().collect::<std::result::Result<Vec<f64>, String>>();
        let alike: Value = all.map(|p| (p[p.len() - 1] / p[0], String::new()));
        rows.push(Row::new(ALIKE, "both", "default settings".into(), alike, Some(Threshold::AtMost(EQUAL))));
        Ok(rows)
    }

    fn peak(&self, dims: [usize; 4], say: &mut dyn FnMut(&str)) -> Result<(String, std::result::Result<f64, String>)> {
        let subject = Subject::Synthetic(Kind::Moving, dims);
        let data = subject.data(self.work, say)?;
        say(&format!("looking at the memory of converting {}", data.name));
        let conversion = Conversion {
            source: data.path.clone(),
            scheme: Scheme::Auto,
            window: 32,
            tolerance: self.config.tolerances[0],
            range: data.range,
            output: self.work.join("large.wspl"),
        };
        let threads = self.config.threads.iter().copied().max().unwrap_or(1);
        let measured = self.one(&Task { threads, work: Work::Heap(conversion) })?;
        subject.remove(self.work)?;
        let unknown = || "not measured: the system does not tell what memory a process has".to_string();
        Ok((data.name, measured.peak_heap.map(|peak| peak as f64).ok_or_else(unknown)))
    }
}
