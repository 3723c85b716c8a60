//! The archives of a run, and the measurements of one.

use super::convert::Scheme;
use super::evaluation::Evaluation;
use super::measured::Measured;
use super::peers;
use super::plan::{Coded, Plan, Tasks};
use super::results::{Archive, Row};
use super::settings::Config;
use super::work;
use crate::bench::process::in_process;
use crate::bench::size::Data;
use crate::output::{Format, Shape, Target};
use crate::synth::{Kind, Synth};
use clap::ValueEnum;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::sample::SampleType;

/// An archive of the user, or one to make.
pub(super) enum Subject {
    Given(PathBuf),
    Synthetic(Kind, [usize; 4]),
}

impl Subject {
    pub(super) fn path(&self, work: &Path) -> PathBuf {
        match self {
            Self::Given(path) => path.clone(),
            Self::Synthetic(kind, [x, y, z, t]) => {
                let kind = kind.to_possible_value().map_or(String::new(), |v| v.get_name().into());
                work.join(format!("{kind}-{x}x{y}x{z}x{t}.npy"))
            }
        }
    }

    pub(super) fn data(&self, work: &Path, say: &mut dyn FnMut(&str)) -> Result<Data> {
        let path = self.path(work);
        if let Self::Synthetic(kind, dims) = self {
            say(&format!("making {}", path.display()));
            synthetic(*kind, *dims, &path)?;
        }
        Data::of(path)
    }

    pub(super) fn remove(&self, work: &Path) -> Result<()> {
        let path = self.path(work);
        let made = matches!(self, Self::Synthetic(..));
        if made { fs::remove_file(&path).map_err(|e| Error::io(&path, "removing", e)) } else { Ok(()) }
    }
}

fn synthetic(kind: Kind, [nx, ny, nz, frames]: [usize; 4], path: &Path) -> Result<()> {
    let synth = Synth { kind, shape: Shape { dims: [nx, ny, nz], frames, ty: SampleType::F32 }, seed: 0 };
    Target::File(path.into(), Format::Npy).write(&synth.shape, |frame, bytes| synth.fill(frame, bytes))
}

pub(super) struct Bench<'a> {
    pub(super) config: &'a Config,
    pub(super) work: &'a Path,
}

impl Bench<'_> {
    pub(super) fn subjects(&self) -> Vec<Subject> {
        let Config { inputs, kinds, dims, .. } = self.config;
        let made = dims.iter().flat_map(|dims| kinds.iter().map(|kind| Subject::Synthetic(*kind, *dims)));
        inputs.iter().cloned().map(Subject::Given).chain(made).collect()
    }

    /// Measures everything about one archive, and compares it with the targets.
    pub(super) fn archive(&self, data: &Data, say: &mut dyn FnMut(&str)) -> Result<(Archive, Vec<Row>)> {
        let Config { tolerances, spacings, threads, size, .. } = self.config;
        let of = |scheme| tolerances.iter().map(move |tolerance| Coded { scheme, tolerance: *tolerance });
        let files = of(Scheme::Auto).chain(of(Scheme::Haar)).collect();
        let plan = Plan { data, files, spacings, threads, size: *size, folder: self.work };
        let missing = plan.without_textbook().into_iter().collect();
        let mut found = Archive { data: data.clone(), measured: BTreeMap::new(), missing };
        self.measure(&plan.tasks(), &mut found.measured, say)?;
        let cold = plan.cold(|spacing, threads| Evaluation { plan: &plan, found: &found }.best(spacing, threads));
        self.measure(&cold, &mut found.measured, say)?;
        self.measure(&plan.curves(), &mut found.measured, say)?;
        for (key, task) in &plan.comparisons() {
            say(&format!("comparing {}: {key}", data.name));
            found.measured.insert(key.clone(), self.one(task)?);
        }
        peers::add(self.config, &plan, &mut found, say)?;
        let rows = Evaluation { plan: &plan, found: &found }.rows();
        Ok((found, rows))
    }

    /// All tasks in turns, round by round.
    pub(super) fn measure(
        &self,
        tasks: &Tasks,
        found: &mut BTreeMap<String, Measured>,
        say: &mut dyn FnMut(&str),
    ) -> Result<()> {
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

    pub(super) fn one(&self, task: &work::Task) -> Result<Measured> {
        Ok(in_process(&self.config.program, task)?.measured)
    }
}
