//! The command `bench-step`: runs one measurement by name, for [`super::process::in_process`].

use super::process::{ProcessTask, answer};
use super::size::own;
use super::stages::{Convert, Render};
use wavesplat::base::error::{Error, Result};

/// Runs the measurement `name` with the settings `task`, given as JSON; returns the outcome as JSON.
///
/// # Errors
/// There is no such measurement, the settings are not valid, or the measurement fails.
pub fn run_step(name: &str, task: &str) -> Result<String> {
    match name {
        Convert::NAME => answer::<Convert>(task),
        Render::NAME => answer::<Render>(task),
        own::Task::NAME => answer::<own::Task>(task),
        _ => Err(Error::usage(format!("bench-step: there is no measurement '{name}'"))),
    }
}
