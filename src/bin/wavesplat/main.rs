//! `wavesplat`: converts archives to coefficient files, and inspects, checks and extracts them.

use std::process::ExitCode;
use wavesplat_cli::commands::Cli;

fn main() -> ExitCode {
    wavesplat_cli::main(Cli::run)
}
