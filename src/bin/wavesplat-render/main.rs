//! `wavesplat-render`: renders pictures from coefficient files, or from frames by the conventional method.

use std::process::ExitCode;
use wavesplat::cli::{self, render::Program};

fn main() -> ExitCode {
    cli::main(Program::run)
}
