//! The settings of a run.

use super::machine::Machine;
use super::plan::Sweep;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use wavesplat::base::error::{Error, Result};

/// The number of the layout of `results.json` and `points.jsonl`; a change of a key's meaning changes it.
pub const SCHEMA: u32 = 1;

/// What to measure, with what, and where results go.
#[derive(Debug, Clone)]
pub struct Config {
    /// What to measure.
    pub sweep: Sweep,
    /// The folder of results.
    pub output: PathBuf,
    /// The path of `wavesplat-tools`, which runs the stages with its command `bench-step`.
    pub program: PathBuf,
    /// Begin anew where there are results already.
    pub force: bool,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// The settings that all points of a run share. An interrupted run continues only with the same settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Voxels along x, y, z and the number of frames.
    pub dims: [usize; 4],
    /// Pixels a side of a picture.
    pub size: usize,
    /// How often every time is taken.
    pub repeats: usize,
    /// The version of the tools.
    pub version: String,
    /// A digest of the program.
    pub build: String,
    /// Where it ran.
    pub machine: Machine,
}

impl Settings {
    pub(super) fn new(config: &Config) -> Result<Self> {
        let program = std::fs::read(&config.program).map_err(|e| Error::io(&config.program, "reading", e))?;
        Ok(Self {
            schema: SCHEMA,
            dims: config.sweep.dims,
            size: config.sweep.size,
            repeats: config.sweep.repeats,
            version: env!("CARGO_PKG_VERSION").into(),
            build: format!("{:016x}", xxhash_rust::xxh3::xxh3_64(&program)),
            machine: Machine::this(),
        })
    }
}
