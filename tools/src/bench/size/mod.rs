//! The benchmark of sizes: the size of files under a hard bound and the times to write and read them, compared with other coders.
//!
//! ```text
//! clock     processor time of one core
//! schemes   the measured ways of converting
//! own       one conversion, decoded and compared, in its own process
//! row       the measurements of one coder
//! peers     the same measurements of other coders, by `tools/peers/peers.py`
//! data      the archives: given ones, the demo's, those of `synth`, those of the peers' script
//! targets   the targets, and whether they are met
//! results   the results of a run
//! tables    size.md
//! ```

pub(super) mod clock;
mod schemes;
pub(super) mod own;
mod row;
pub(super) mod peers;
mod data;
mod targets;
mod results;
mod tables;

pub use data::{Data, Subject};
pub use peers::Peers;
pub use results::Results;
pub use row::{Own, Row};
pub use schemes::{BASELINE, SCHEMES, Scheme};
pub use targets::Verdict;

use super::json::bad_json;
use super::machine::Provenance;
use super::process::in_process;
use clock::IN_A_ROW;
use own::Task;
use peers::PeersTask;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};

/// The layout version of `size.json`; changes if the meaning of a key changes.
pub const SCHEMA: u32 = 1;

/// The settings of a run.
#[derive(Debug, Clone)]
pub struct Config {
    /// Archives of the user.
    pub inputs: Vec<PathBuf>,
    /// Archives to make; by default the usual ones if there are no inputs.
    pub subjects: Option<Vec<Subject>>,
    /// Makes them small, to check in seconds that everything works.
    pub small: bool,
    /// Shares of the value range.
    pub tolerances: Vec<f64>,
    /// Rounds through all coders.
    pub repeats: usize,
    /// Other coders.
    pub peers: Option<Peers>,
    /// The folder of results.
    pub output: PathBuf,
    /// The path of `wavesplat-tools`, which measures with its command `bench-step`.
    pub program: PathBuf,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// Measures everything and writes `size.json` and `size.md`. Returns the results and the tables; reports progress
/// through `say`.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<(Results, String)> {
    if config.repeats == 0 || config.tolerances.is_empty() {
        return Err(Error::usage("--repeats, --tolerances: nothing is left to measure"));
    }
    let work = config.output.join("size-work");
    fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
    let data = gather(config, &work, say)?;
    let mut rows = Vec::new();
    for one in &data {
        rows.extend(measure(config, one, &work.join("file.wspl"), say)?);
    }
    fs::remove_dir_all(&work).map_err(|e| Error::io(&work, "removing", e))?;
    let results = Results {
        made: Provenance::here(SCHEMA, config.date.as_ref()),
        rounds: config.repeats,
        data,
        verdicts: targets::judge(&rows),
        rows,
    };
    let text = tables::markdown(&results);
    write(&results, &text, &config.output)?;
    Ok((results, text))
}

/// A sentence for every row in which a scheme of wavesplat exceeds its bound.
pub fn complaints(results: &Results) -> Vec<String> {
    let missed = results.rows.iter().filter(|r| r.own.is_some() && !r.holds());
    let words = |r: &Row| {
        let Row { data, tolerance, coder, largest_error, bound, .. } = r;
        format!("{data}, {tolerance:e}, {coder}: a sample is off by {largest_error:e}, allowed are {bound:e}")
    };
    missed.map(words).collect()
}

/// Opens the user's archives and makes the others.
fn gather(config: &Config, work: &Path, say: &mut dyn FnMut(&str)) -> Result<Vec<Data>> {
    let usual = || if config.inputs.is_empty() { Subject::usual(config.peers.is_some()) } else { Vec::new() };
    let mut paths = config.inputs.clone();
    for subject in config.subjects.clone().unwrap_or_else(usual) {
        say(&format!("making {}", subject.name()));
        paths.push(subject.make(work, config.small, config.peers.as_ref())?);
    }
    let data = paths.into_iter().map(Data::of).collect::<Result<Vec<_>>>()?;
    let mut names = HashSet::new();
    match data.iter().find(|d| !names.insert(&d.name)) {
        Some(twice) => Err(Error::usage(format!("two archives are called {}: rename one", twice.name))),
        None => Ok(data),
    }
}

/// Measures every coder at every tolerance, round by round.
fn measure(config: &Config, data: &Data, file: &Path, say: &mut dyn FnMut(&str)) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for round in 0..config.repeats {
        say(&format!("measuring {}, round {} of {}", data.name, round + 1, config.repeats));
        for tolerance in &config.tolerances {
            for scheme in &SCHEMES {
                row::merge(&mut rows, vec![by_scheme(config, data, scheme, *tolerance, file)?]);
            }
        }
        if let Some(peers) = &config.peers {
            row::merge(&mut rows, peers.measure(&peers_task(config, data, round == 0))?);
        }
    }
    rows.sort_by_key(|row| config.tolerances.iter().position(|t| *t == row.tolerance)); // stable: coders keep their order
    Ok(rows)
}

fn by_scheme(config: &Config, data: &Data, scheme: &Scheme, tolerance: f64, file: &Path) -> Result<Row> {
    let task = Task {
        source: data.path.clone(),
        scheme: scheme.name.into(),
        tolerance,
        range: data.range,
        repeats: IN_A_ROW,
        output: file.into(),
    };
    let outcome = in_process(&config.program, &task)?;
    Ok(Row::of_scheme((&data.name, data.bytes), tolerance, scheme.name, &outcome.measured))
}

fn peers_task<'a>(config: &'a Config, data: &'a Data, all: bool) -> PeersTask<'a> {
    let only = (!all).then_some(peers::TIMED);
    let (path, tolerances) = (data.path.as_path(), config.tolerances.as_slice());
    PeersTask { data: &data.name, data_bytes: data.bytes, path, tolerances, only }
}

fn write(results: &Results, tables: &str, folder: &Path) -> Result<()> {
    let json = folder.join("size.json");
    let text = serde_json::to_string_pretty(results).map_err(|e| bad_json(&json, &e))?;
    for (path, text) in [(json, text.as_str()), (folder.join("size.md"), tables)] {
        fs::write(&path, text).map_err(|e| Error::io(&path, "writing", e))?;
    }
    Ok(())
}
