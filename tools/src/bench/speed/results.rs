//! The results of a run: measurements by archive, and rows that compare them with targets.

use super::measured::Measured;
use crate::bench::machine::Provenance;
use crate::bench::size::Data;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The number of the layout of `speed.json`; a change of a key's meaning changes it.
pub const SCHEMA: u32 = 1;

/// All results of a run: `speed.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// By what, where and when.
    #[serde(flatten)]
    pub made: Provenance,
    /// How many rounds were run.
    pub rounds: usize,
    /// Pixels a side of a picture.
    pub size: usize,
    /// Everything that was measured.
    pub archives: Vec<Archive>,
    /// The names of archives that are still to be measured: of a run that was interrupted.
    pub left: Vec<String>,
    /// Every target, and results for comparison.
    pub rows: Vec<Row>,
}

/// The measurements of an archive.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Archive {
    /// The archive.
    pub data: Data,
    /// Results by their keys.
    pub measured: BTreeMap<String, Measured>,
    /// Why some were not measured.
    pub missing: BTreeMap<String, String>,
}

/// A target, and the number that was reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The quantity that is compared.
    pub target: String,
    /// The name of the archive.
    pub data: String,
    /// The file, the spacing and the number of threads.
    pub case: String,
    /// The result; `None` if it was not measured.
    pub value: Option<f64>,
    /// The target, in words; `None` for a result shown only for comparison.
    pub wanted: Option<String>,
    /// Whether it was reached, where both are there.
    pub met: Option<bool>,
    /// Which method it was, or why nothing was measured.
    pub note: String,
}

/// Which values are good.
#[derive(Debug, Clone, Copy)]
pub(super) enum Threshold {
    AtLeast(f64),
    AtMost(f64),
}

impl Threshold {
    fn met(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
        }
    }

    fn words(self) -> String {
        match self {
            Self::AtLeast(limit) => format!(">= {limit}"),
            Self::AtMost(limit) if limit < 0.01 => format!("<= {limit:e}"),
            Self::AtMost(limit) => format!("<= {limit}"),
        }
    }
}

/// A value, with a word on it; or why there is none.
pub(super) type Value = Result<(f64, String), String>;

impl Row {
    pub(super) fn new(target: &str, data: &str, case: String, value: Value, wanted: Option<Threshold>) -> Self {
        let finite = value.and_then(|(v, note)| if v.is_finite() { Ok((v, note)) } else { Err(format!("{v}")) });
        let (value, note) = match finite {
            Ok((value, note)) => (Some(value), note),
            Err(why) => (None, why),
        };
        let met = value.zip(wanted).map(|(v, w)| w.met(v));
        let wanted = wanted.map(Threshold::words);
        Self { target: target.into(), data: data.into(), case, value, wanted, met, note }
    }
}

impl Results {
    /// Nothing yet.
    pub(super) fn new(date: Option<&String>, rounds: usize, size: usize) -> Self {
        Self {
            made: Provenance::here(SCHEMA, date),
            rounds,
            size,
            archives: Vec::new(),
            left: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Puts the rows of an archive after those of the archives before.
    pub(super) fn add(&mut self, archive: Archive, rows: Vec<Row>) {
        let known: Vec<&String> = self.archives.iter().map(|a| &a.data.name).collect();
        let at = self.rows.iter().rposition(|r| known.contains(&&r.data)).map_or(0, |last| last + 1);
        self.rows.splice(at..at, rows);
        self.left.retain(|name| *name != archive.data.name);
        self.archives.push(archive);
    }
}
