//! Both programs, each of which knows the options of the other.

use super::{commands, render};
use clap::{Command, CommandFactory};

/// The other of the two programs, which may read the same file of options.
pub(super) fn other_program(program: &Command) -> Command {
    match program.get_name() {
        "wavesplat" => render::Program::command(),
        _ => commands::Cli::command(),
    }
}
