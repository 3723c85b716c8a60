//! Runs a measurement in its own process. Its times are not disturbed by earlier work, and its peak memory is its own.

use super::json::bad_json;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::{Command, Stdio};
use wavesplat::base::error::{Error, Result};
use wavesplat_core::base::memory;

/// A measurement that runs in its own process.
pub(super) trait ProcessTask: Serialize + DeserializeOwned {
    /// The name by which `bench-step` finds it.
    const NAME: &'static str;
    /// The result of the measurement.
    type Measured: Serialize + DeserializeOwned;

    /// Measures in this process.
    fn measure(&self) -> Result<Self::Measured>;
}

/// The answer of a process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Outcome<T> {
    pub(super) measured: T,
    /// Peak memory of the process, with pages of mapped files.
    pub(super) peak_bytes: Option<u64>,
}

/// Runs a task in its own process: `program bench-step NAME TASK`.
pub(super) fn in_process<T: ProcessTask>(program: &Path, task: &T) -> Result<Outcome<T::Measured>> {
    let failed = |e| Error::io(program, "running", e);
    let text = serde_json::to_string(task).map_err(|e| bad_json(program, &e))?;
    let mut command = Command::new(program);
    command.args(["bench-step", T::NAME]).arg(text).stderr(Stdio::inherit());
    let child = command.output().map_err(failed)?;
    if !child.status.success() {
        return Err(Error::input(program, format!("a stage failed ({})", child.status)));
    }
    serde_json::from_slice(&child.stdout).map_err(|e| bad_json(program, &e))
}

/// Runs a task, given as JSON, in this process; returns the outcome as JSON.
pub(super) fn answer<T: ProcessTask>(text: &str) -> Result<String> {
    let wrong = |e: serde_json::Error| Error::usage(format!("bench-step: {e}"));
    let task: T = serde_json::from_str(text).map_err(wrong)?;
    let measured = task.measure()?;
    serde_json::to_string(&Outcome { measured, peak_bytes: memory::peak_with_files().map(|bytes| bytes as u64) })
        .map_err(wrong)
}
