//! The results of a run.

use super::data::Data;
use super::row::Row;
use super::targets::Verdict;
use crate::bench::machine::Provenance;
use serde::{Deserialize, Serialize};

/// All results of a run: `size.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// The program, the machine and the date.
    #[serde(flatten)]
    pub made: Provenance,
    /// Number of rounds. Each round takes every time several times in a row.
    pub rounds: usize,
    /// The measured archives.
    pub data: Vec<Data>,
    /// Every coder on every archive at every tolerance.
    pub rows: Vec<Row>,
    /// The targets that are met and missed.
    pub verdicts: Vec<Verdict>,
}
