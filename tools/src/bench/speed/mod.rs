//! The benchmark of speed: all pictures of a view from a coefficient file, compared with the conventional method.
//!
//! ```text
//! measured    the measurements of a process, and the least of several
//! cold        empties the cache;  the heap's peak
//! convert     frames to files
//! decode      files to codes, and to bare payloads
//! view        files or frames to pictures, and pictures compared with pictures
//! work        one of these measurements in its own process
//! plan        the measurements of an archive
//! results     the recorded results
//! evaluation  rows that compare measurements with targets
//! tables      speed.md
//! settings    the settings of a run
//! peers       the same measurements of other programs, by scripts in `tools/peers`
//! archives    the archives of a run, and all measurements of one
//! heap        rows about memory
//! paper       rows of the paper's table 1
//! against     another comparison: this build's `wavesplat-render` beside another build's
//! ```

mod measured;
mod cold;
mod convert;
mod decode;
mod view;
pub(super) mod work;
mod plan;
mod results;
mod evaluation;
mod tables;
mod settings;
mod peers;
mod archives;
mod heap;
mod paper;
pub mod against;

pub use measured::{Measured, Time};
pub use results::{Archive, Results, Row, SCHEMA};
pub use settings::{Config, KINDS, SMALL, Sizes, USUAL};

use super::json::bad_json;
use super::size::Data;
use archives::Bench;
use std::fs;
use std::path::Path;
use wavesplat::base::error::{Error, Result};

/// Measures everything and writes `speed.json` and `speed.md`. Returns the results and the tables; reports progress
/// through `say`.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<(Results, String)> {
    let counts = [config.repeats, config.tolerances.len(), config.spacings.len(), config.threads.len()];
    if counts.contains(&0) || config.threads.contains(&0) {
        return Err(Error::usage("--repeats, --tolerances, --spacings, --threads: nothing is left to measure"));
    }
    let work = config.output.join("speed-work");
    fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
    let (bench, mut results) =
        (Bench { config, work: &work }, Results::new(config.date.as_ref(), config.repeats, config.size));
    let subjects = bench.subjects();
    results.left = subjects.iter().map(|s| s.path(&work)).map(|p| Data::name_of(&p)).collect();
    results.rows = [bench.paper(say)?, bench.heap(say)?].concat();
    for subject in subjects {
        let data = subject.data(&work, say)?;
        let (archive, rows) = bench.archive(&data, say)?;
        results.add(archive, rows);
        subject.remove(&work)?;
        write(&results, &config.output)?; // an interrupted run leaves what it has
    }
    fs::remove_dir_all(&work).map_err(|e| Error::io(&work, "removing", e))?;
    let text = write(&results, &config.output)?;
    Ok((results, text))
}

/// Writes `speed.json` and `speed.md`; returns the tables.
fn write(results: &Results, folder: &Path) -> Result<String> {
    let (json, tables) = (folder.join("speed.json"), tables::markdown(results));
    let text = serde_json::to_string_pretty(results).map_err(|e| bad_json(&json, &e))?;
    for (path, text) in [(json, &text), (folder.join("speed.md"), &tables)] {
        fs::write(&path, text).map_err(|e| Error::io(&path, "writing", e))?;
    }
    Ok(tables)
}
