//! The results of a run.

use super::data::Data;
use super::row::Row;
use super::targets::Verdict;
use crate::bench::machine::Made;
use serde::{Deserialize, Serialize};

/// All results of a run: `size.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// By what, where and when.
    #[serde(flatten)]
    pub made: Made,
    /// Number of rounds. Each round takes every time several times in a row.
    pub rounds: usize,
    /// What was measured.
    pub data: Vec<Data>,
    /// Every coder on everything at every tolerance.
    pub rows: Vec<Row>,
    /// Which targets are met.
    pub verdicts: Vec<Verdict>,
}
