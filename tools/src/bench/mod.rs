//! The benchmark: what a picture costs in time at which error, beside the conventional method.
//!
//! ```text
//! plan      which groups of contenders are measured side by side
//! look      from where pictures are taken, and which of their pixels are compared
//! truth     those pixels by brute force
//! step      one measured stage in a process of its own: conversion, or rendering of two views
//!   stages    ... by the library: conversion, coefficients, the conventional method with shared footprints
//!   textbook  ... the conventional method's textbook form
//! measure   a group: stages in turns (A B A B ...), and the check of every sample
//! point     what is recorded
//! journal   finished points on disk, so that a run can be interrupted
//! sanity    what must hold of every point, on any machine
//! machine   where it ran, and when
//! report    results.json and results.md;  plot, chart: the figures
//! size      another benchmark: sizes under a hard bound, and times, beside other coders
//! layers    another: what a looser tolerance of a picture leaves unread, and the errors
//! speed     another: views from files beside the conventional method, and what they are to reach
//! ```
//!
//! Errors are shares of the archive's value range throughout.

mod chart;
mod journal;
pub mod layers;
mod look;
mod machine;
mod measure;
pub mod plan;
mod plot;
pub mod point;
mod report;
pub mod sanity;
pub mod size;
pub mod speed;
mod stages;
mod step;
mod textbook;
mod truth;

pub use step::run_step;

use journal::Journal;
use machine::Machine;
use measure::Bench;
use plan::Sweep;
use point::Results;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Instant;
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
    /// `wavesplat-tools` itself, whose `bench-step` runs the stages.
    pub program: PathBuf,
    /// Begin anew where there are results already.
    pub force: bool,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// What all points of a run share: a run goes on only with the same.
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
    fn of(config: &Config) -> Result<Self> {
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

/// Measures what is not measured yet and writes all results; `say` hears what is going on.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<Results> {
    config.sweep.check()?;
    std::fs::create_dir_all(&config.output).map_err(|e| Error::io(&config.output, "creating the folder", e))?;
    let settings = Settings::of(config)?;
    let mut journal = Journal::open(&config.output, &settings, config.force)?;
    let groups = config.sweep.groups();
    let mut bench = Bench::new(config)?;
    let started = Instant::now();
    for (number, group) in groups.iter().enumerate() {
        let seconds = started.elapsed().as_secs();
        let done = group.keys().iter().all(|key| journal.has(key));
        let verb = if done { "done before" } else { "measuring" };
        say(&format!("[{}/{}, {seconds} s] {verb}: {group}", number + 1, groups.len()));
        if !done {
            journal.append(bench.measure(group)?)?;
        }
    }
    bench.finish()?;
    let keys: Vec<String> = groups.iter().flat_map(plan::Group::keys).collect();
    let date = config.date.clone().unwrap_or_else(machine::today);
    let results = Results { settings, date, points: journal.take(&keys) };
    report::write(&results, &config.output)?;
    plot::write(&results, &config.output)?;
    Ok(results)
}

/// What serde found, as an error about a file.
fn bad_json(path: &std::path::Path, error: &serde_json::Error) -> Error {
    Error::input(path, error.to_string())
}
