//! The benchmark: time and error of pictures, compared with the conventional method.
//!
//! ```text
//! chart      figures with logarithmic axes
//! json       errors of JSON
//! machine    where and when a run took place
//! plan       the groups of contenders that are measured together
//! camera     the views, and the pixels and frames that are compared with the reference
//! settings   the settings of a run
//! reference  the compared pixels by brute force
//! point      the recorded measurements
//! journal    finished points on disk, so that a run can be interrupted
//! sanity     checks of every point that hold on any machine
//! process    runs a measurement in its own process
//! stages     the measured stages: conversion, and rendering of two views
//! measure    measures a group: stages in turns (A B A B ...), and the check of every sample
//! report     results.json and results.md
//! plot       the figures
//! size       another benchmark: sizes under a hard bound, and times, compared with other coders
//! speed      another: seconds of the programs, beside another build's
//! step       the command `bench-step`
//! ```
//!
//! The modules are listed in the order of their layers: each uses only earlier ones (`tests/layering.rs`).
//!
//! Errors are shares of the archive's value range throughout.

mod chart;
mod json;
mod machine;
pub mod plan;
mod camera;
mod settings;
mod reference;
pub mod point;
mod journal;
pub mod sanity;
mod process;
mod stages;
mod measure;
mod report;
mod plot;
pub mod size;
pub mod speed;
mod step;

pub use settings::{Config, SCHEMA, Settings};
pub use step::run_step;

use journal::Journal;
use measure::Bench;
use point::Results;
use std::time::Instant;
use wavesplat::base::error::{Error, Result};

/// Measures the points that are not measured yet and writes all results. Reports progress through `say`.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<Results> {
    config.sweep.check()?;
    std::fs::create_dir_all(&config.output).map_err(|e| Error::io(&config.output, "creating the folder", e))?;
    let settings = Settings::new(config)?;
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
