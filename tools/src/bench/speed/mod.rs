//! The benchmark of speed: every picture of a view from a coefficient file, beside the conventional method.
//!
//! ```text
//! plan      what is measured of an archive
//! work      one measurement in a process of its own
//!   convert   frames to files
//!   decode    files to codes, and to bare payloads
//!   view      files or frames to pictures, and pictures against pictures
//!   cold      with an empty cache;  the heap's peak
//! measured  what a process measured, and the least of several
//! peers     the same of other programs, by scripts in `tools/peers`
//! rows      what is to be how fast, beside what was measured
//! heap      rows of memory;  paper: rows of the paper's table 1
//! tables    speed.md for people
//! ```

mod cold;
mod convert;
mod decode;
mod heap;
mod measured;
mod paper;
mod peers;
mod plan;
mod rows;
mod tables;
mod view;
pub(super) mod work;

pub use measured::{Measured, Time};
pub use rows::Row;

use super::machine::Made;
use super::size::{Data, Peers};
use super::step::{Outcome, Step, in_process};
use crate::output::{Format, Shape, Target};
use crate::synth::{Kind, Synth};
use clap::ValueEnum;
use convert::Scheme;
use plan::{Coded, Plan, Tasks};
use rows::Judge;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::sample::SampleType;

/// The number of the layout of `speed.json`; a change of a key's meaning changes it.
pub const SCHEMA: u32 = 1;

/// What archives show unless the user says.
pub const KINDS: [Kind; 3] = [Kind::Smooth, Kind::Moving, Kind::Sparse];

/// How large all is.
#[derive(Debug)]
pub struct Sizes {
    /// Archives.
    pub dims: &'static [[usize; 4]],
    /// Archives whose conversion's memory is looked at.
    pub large: [[usize; 4]; 2],
    /// Pixels a side of a picture.
    pub size: usize,
    /// Rounds.
    pub repeats: usize,
}

/// What targets are about: large archives have 4 and 20 GiB.
pub const USUAL: Sizes = Sizes {
    dims: &[[128, 128, 128, 32], [256, 256, 256, 32], [128, 128, 128, 64]],
    large: [[256, 256, 256, 64], [256, 256, 256, 320]],
    size: 512,
    repeats: 3,
};
/// Whether everything works, in seconds.
pub const SMALL: Sizes =
    Sizes { dims: &[[20, 18, 16, 8]], large: [[48, 48, 48, 32], [48, 48, 48, 64]], size: 64, repeats: 1 };

/// What to measure, with what, and where results go.
#[derive(Debug, Clone)]
pub struct Config {
    /// Archives of the user.
    pub inputs: Vec<PathBuf>,
    /// What the archives that are made show.
    pub kinds: Vec<Kind>,
    /// Their sizes.
    pub dims: Vec<[usize; 4]>,
    /// Pixels from a voxel to the next.
    pub spacings: Vec<f64>,
    /// Pixels a side of a picture.
    pub size: usize,
    /// Shares of the value range; the first is what the targets are about.
    pub tolerances: Vec<f64>,
    /// Numbers of threads.
    pub threads: Vec<usize>,
    /// Rounds through all measurements.
    pub repeats: usize,
    /// Sizes of the archives whose conversion's memory is looked at; none: it is not.
    pub large: Vec<[usize; 4]>,
    /// Other programs.
    pub peers: Option<Peers>,
    /// The folder of results.
    pub output: PathBuf,
    /// `wavesplat-tools` itself, whose `bench-step` measures.
    pub program: PathBuf,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// All results of a run: `speed.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// By what, where and when.
    #[serde(flatten)]
    pub made: Made,
    /// How many rounds were run.
    pub rounds: usize,
    /// Pixels a side of a picture.
    pub size: usize,
    /// Everything that was measured.
    pub archives: Vec<Archive>,
    /// The names of archives that are still to be measured: of a run that was interrupted.
    pub left: Vec<String>,
    /// Every target, and what stands beside.
    pub rows: Vec<Row>,
}

/// What was measured of an archive.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Archive {
    /// The archive.
    pub data: Data,
    /// Results by their keys.
    pub measured: BTreeMap<String, Measured>,
    /// Why some were not measured.
    pub missing: BTreeMap<String, String>,
}

/// Measures everything and writes `speed.json` and `speed.md`; returns the results and the tables. `say` hears what is
/// going on.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<(Results, String)> {
    let counts = [config.repeats, config.tolerances.len(), config.spacings.len(), config.threads.len()];
    if counts.contains(&0) || config.threads.contains(&0) {
        return Err(Error::usage("--repeats, --tolerances, --spacings, --threads: nothing is left to measure"));
    }
    let work = config.output.join("speed-work");
    fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
    let (bench, mut results) = (Bench { config, work: &work }, Results::new(config));
    let subjects = bench.subjects();
    results.left = subjects.iter().map(|s| s.path(&work)).map(|p| Data::name_of(&p)).collect();
    results.rows = [bench.paper(say)?, bench.heap(say)?].concat();
    for subject in subjects {
        let data = subject.data(&work, say)?;
        let (archive, rows) = bench.archive(&data, say)?;
        results.add(archive, rows);
        subject.remove(&work)?;
        results.write(&config.output)?; // an interrupted run leaves what it has
    }
    fs::remove_dir_all(&work).map_err(|e| Error::io(&work, "removing", e))?;
    let text = results.write(&config.output)?;
    Ok((results, text))
}

impl Results {
    /// Nothing yet.
    fn new(config: &Config) -> Self {
        Self {
            made: Made::here(SCHEMA, config.date.as_ref()),
            rounds: config.repeats,
            size: config.size,
            archives: Vec::new(),
            left: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Puts the rows of an archive after those of the archives before.
    fn add(&mut self, archive: Archive, rows: Vec<Row>) {
        let known: Vec<&String> = self.archives.iter().map(|a| &a.data.name).collect();
        let at = self.rows.iter().rposition(|r| known.contains(&&r.data)).map_or(0, |last| last + 1);
        self.rows.splice(at..at, rows);
        self.left.retain(|name| *name != archive.data.name);
        self.archives.push(archive);
    }

    /// Returns the tables.
    fn write(&self, folder: &Path) -> Result<String> {
        let (json, tables) = (folder.join("speed.json"), tables::markdown(self));
        let text = serde_json::to_string_pretty(self).map_err(|e| super::bad_json(&json, &e))?;
        for (path, text) in [(json, &text), (folder.join("speed.md"), &tables)] {
            fs::write(&path, text).map_err(|e| Error::io(&path, "writing", e))?;
        }
        Ok(tables)
    }
}

/// An archive of the user, or one to make.
enum Subject {
    Given(PathBuf),
    Made(Kind, [usize; 4]),
}

impl Subject {
    fn path(&self, work: &Path) -> PathBuf {
        match self {
            Self::Given(path) => path.clone(),
            Self::Made(kind, [x, y, z, t]) => {
                let kind = kind.to_possible_value().map_or(String::new(), |v| v.get_name().into());
                work.join(format!("{kind}-{x}x{y}x{z}x{t}.npy"))
            }
        }
    }

    fn data(&self, work: &Path, say: &mut dyn FnMut(&str)) -> Result<Data> {
        let path = self.path(work);
        if let Self::Made(kind, dims) = self {
            say(&format!("making {}", path.display()));
            synthetic(*kind, *dims, &path)?;
        }
        Data::of(path)
    }

    fn remove(&self, work: &Path) -> Result<()> {
        let path = self.path(work);
        let made = matches!(self, Self::Made(..));
        if made { fs::remove_file(&path).map_err(|e| Error::io(&path, "removing", e)) } else { Ok(()) }
    }
}

fn synthetic(kind: Kind, [nx, ny, nz, frames]: [usize; 4], path: &Path) -> Result<()> {
    let synth = Synth { kind, shape: Shape { dims: [nx, ny, nz], frames, ty: SampleType::F32 }, seed: 0 };
    Target::File(path.into(), Format::Npy).write(&synth.shape, |frame, bytes| synth.fill(frame, bytes))
}

struct Bench<'a> {
    config: &'a Config,
    work: &'a Path,
}

impl Bench<'_> {
    fn subjects(&self) -> Vec<Subject> {
        let Config { inputs, kinds, dims, .. } = self.config;
        let made = dims.iter().flat_map(|dims| kinds.iter().map(|kind| Subject::Made(*kind, *dims)));
        inputs.iter().cloned().map(Subject::Given).chain(made).collect()
    }

    /// Everything about one archive, and how it is judged.
    fn archive(&self, data: &Data, say: &mut dyn FnMut(&str)) -> Result<(Archive, Vec<Row>)> {
        let Config { tolerances, spacings, threads, size, .. } = self.config;
        let of = |scheme| tolerances.iter().map(move |tolerance| Coded { scheme, tolerance: *tolerance });
        let files = of(Scheme::Auto).chain(of(Scheme::Haar)).collect();
        let plan = Plan { data, files, spacings, threads, size: *size, folder: self.work };
        let missing = plan.without_textbook().into_iter().collect();
        let mut found = Archive { data: data.clone(), measured: BTreeMap::new(), missing };
        self.measure(&plan.tasks(), &mut found.measured, say)?;
        let cold = plan.cold(|spacing, threads| Judge { plan: &plan, found: &found }.best(spacing, threads));
        self.measure(&cold, &mut found.measured, say)?;
        self.measure(&plan.curves(), &mut found.measured, say)?;
        for (key, task) in &plan.comparisons() {
            say(&format!("comparing {}: {key}", data.name));
            found.measured.insert(key.clone(), self.one(task)?);
        }
        self.peers(&plan, &mut found, say)?;
        let rows = Judge { plan: &plan, found: &found }.rows();
        Ok((found, rows))
    }

    /// All tasks in turns, round by round.
    fn measure(&self, tasks: &Tasks, found: &mut BTreeMap<String, Measured>, say: &mut dyn FnMut(&str)) -> Result<()> {
        for round in 0..self.config.repeats {
            for (key, task) in tasks {
                say(&format!("round {} of {}: {key}", round + 1, self.config.repeats));
                let measured = self.one(task)?;
                match found.get_mut(key) {
                    Some(known) => known.join(&measured),
                    None => drop(found.insert(key.clone(), measured)),
                }
            }
        }
        Ok(())
    }

    fn one(&self, task: &work::Task) -> Result<Measured> {
        let outcome: Outcome<Measured> = in_process(&self.config.program, &Step::Speed(task.clone()))?;
        Ok(outcome.did)
    }
}
