//! `wavesplat-render`: renders pictures from coefficient files, or from frames by the conventional method.

use std::process::ExitCode;
use wavesplat_cli::render::Program;

fn main() -> ExitCode {
    wavesplat_cli::main(Program::run)
}
