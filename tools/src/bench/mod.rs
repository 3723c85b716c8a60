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
mod json;
mod machine;
pub mod plan;
mod camera;
mod settings;
mod truth;
mod textbook;
pub mod point;
mod journal;
pub mod sanity;
mod process;
mod stages;
mod measure;
mod report;
mod plot;
pub mod size;
pub mod layers;
pub mod speed;
mod step;

pub use settings::{Config, SCHEMA, Settings};
pub use step::run_step;

use journal::Journal;
use measure::Bench;
use point::Results;
use std::time::Instant;
use wavesplat::base::error::{Error, Result};

/// Measures what is not measured yet and writes all results; `say` hears what is going on.
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
