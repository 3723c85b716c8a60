//! `wavesplat`: converts archives to coefficient files, and inspects, checks and extracts them.

use std::process::ExitCode;
use wavesplat::cli::{self, commands};

fn main() -> ExitCode {
    cli::main(commands::Cli::run)
}
