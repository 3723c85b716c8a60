//! The program: the demo and synthetic archives.

use clap::{Args, Parser, Subcommand};
use std::io::{self, Write};
use std::process::ExitCode;
use wavesplat::error::{Error, Result};
use wavesplat::sample::SampleType;
use wavesplat_tools::demo;
use wavesplat_tools::output::{Format, Shape, Target};
use wavesplat_tools::synth::{Kind, Synth};

const EXAMPLES: &str = "\
Examples:
  wavesplat-tools demo
  wavesplat-tools synth moving --dims 128x128x64x100 -o moving.npy
  wavesplat-tools synth sparse --dims 256x256x256x500 --dtype u8 -o frames/
  wavesplat-tools synth noise --dims 64x64x64x10 --format raw -o - | wc -c
  wavesplat-tools demo --frames-only -o eddy/

wavesplat's own instruments: the demo and synthetic archives.";

#[derive(Parser)]
#[command(version, about = EXAMPLES, long_about = None, subcommand_required = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Eddy currents in an aluminium plate under a passing magnet
    Demo(Demo),
    /// Write a synthetic archive
    Synth(SynthArgs),
}

#[derive(Args)]
struct Demo {
    /// Write the frames of |J| (A/m^2, f32) as frame_0000.npy and so on, and stop
    #[arg(long)]
    frames_only: bool,
    /// The folder to write to
    #[arg(short, long, value_name = "DIR", default_value = "demo-output")]
    output: std::path::PathBuf,
}

#[derive(Args)]
struct SynthArgs {
    /// What the frames show
    kind: Kind,
    /// Voxels along x, y, z and the number of frames
    #[arg(long, value_name = "NXxNYxNZxNT", value_parser = parse_dims)]
    dims: [usize; 4],
    /// The type of the samples: u8, i8, u16, i16, u32, i32, f16, f32, f64
    #[arg(long, default_value = "f32")]
    dtype: SampleType,
    /// Another seed is another archive of the same kind
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// npy or raw, where the output's name does not tell
    #[arg(long)]
    format: Option<Format>,
    /// FILE.npy, FILE.raw, a folder (exists, or ends with /) for a file per frame, or - for standard output
    #[arg(short, long)]
    output: String,
}

/// Reads `NXxNYxNZxNT`.
fn parse_dims(text: &str) -> std::result::Result<[usize; 4], String> {
    let wrong = || format!("{text:?} is not four positive numbers like 64x64x32x100");
    let numbers: Vec<usize> =
        text.split('x').map(str::parse).collect::<std::result::Result<_, _>>().map_err(|_| wrong())?;
    let dims: [usize; 4] = numbers.try_into().map_err(|_| wrong())?;
    let bytes = dims.iter().try_fold(8_usize, |product, n| product.checked_mul(*n));
    match bytes {
        Some(0) => Err(wrong()),
        Some(_) => Ok(dims),
        None => Err(format!("{text} is more than can be counted")),
    }
}

fn demo(args: &Demo) -> Result<()> {
    if args.frames_only {
        return demo::write_frames(&args.output, demo::FRAMES);
    }
    let files = demo::Files { folder: args.output.clone() };
    let table = demo::run(&files, &mut |step| {
        let _ = writeln!(io::stderr().lock(), "{step} ..."); // progress that nobody reads is no error
    })?;
    let figure = files.figure();
    wavesplat::cli::print(&format!("\n{table}\nFigure 5 is {}.\n", figure.display()))
}

fn synth(args: &SynthArgs) -> Result<()> {
    let [nx, ny, nz, frames] = args.dims;
    let shape = Shape { dims: [nx, ny, nz], frames, ty: args.dtype };
    let synth = Synth { kind: args.kind, shape, seed: args.seed };
    Target::parse(&args.output, args.format)?.write(&shape, |frame, bytes| synth.fill(frame, bytes))
}

fn report(error: &Error) -> ExitCode {
    // Nothing is left to do when even the message cannot be written.
    let _ = writeln!(io::stderr().lock(), "error: {error}");
    ExitCode::from(error.exit_code())
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(args) => demo(&args),
        Command::Synth(args) => synth(&args),
    };
    result.map_or_else(|e| report(&e), |()| ExitCode::SUCCESS)
}
