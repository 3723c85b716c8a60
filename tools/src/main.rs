//! The program: the demo, the gallery, synthetic archives, differences of pictures and the benchmark.

use clap::{Args, CommandFactory, Parser, Subcommand};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::sample::SampleType;
use wavesplat_cli::InputArgs;
use wavesplat_cli::error_text;
use wavesplat_demo::eddy::Plate;
use wavesplat_demo::experiment::{self, Demo as Experiment};
use wavesplat_demo::output::{Format, Shape, Target};
use wavesplat_tools::bench::size::{self, Peers, Subject};
use wavesplat_tools::bench::{self, plan::Sweep, sanity, speed};
use wavesplat_tools::diff;
use wavesplat_tools::gallery::{self, Gallery};
use wavesplat_tools::synth::{Kind, Synth};

const EXAMPLES: &str = "\
Examples:
  wavesplat-tools demo
  wavesplat-tools synth moving --dims 128x128x64x100 -o moving.npy
  wavesplat-tools synth sparse --dims 256x256x256x500 --dtype u8 -o frames/
  wavesplat-tools synth noise --dims 64x64x64x10 --format raw -o - | wc -c
  wavesplat-tools demo --frames-only -o eddy/
  wavesplat-tools gallery
  wavesplat-tools gallery demo mine.npy 'frames/*.vti' --spacing 1,1,2 -o pictures
  wavesplat-tools diff before.png after.png -o difference.png
  wavesplat-tools diff exact.npy lossy.npy --fail-above 1e-3 --json
  wavesplat-tools bench -o bench-output
  wavesplat-tools bench --quick -o quick
  wavesplat-tools bench size --peers python3 -o sizes
  wavesplat-tools bench size mine.npy --tolerances 1e-2,1e-3
  wavesplat-tools bench speed -o speed
  wavesplat-tools bench speed --against other/target/release -o speed

wavesplat's own instruments: the demo, the gallery, synthetic archives, differences of pictures and the benchmark.";

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
    /// Pictures of archives in every mode, on one sheet
    Gallery(Box<GalleryArgs>),
    /// Write a synthetic archive
    Synth(SynthArgs),
    /// Compare two pictures or two stacks of pictures
    Diff(diff::Args),
    /// Measure run time against error, compared with the conventional method; an interrupted run resumes
    Bench(Box<BenchArgs>),
    /// One measured stage of the benchmark
    #[command(hide = true)]
    BenchStep {
        /// The name of the measurement
        name: String,
        /// Its settings, as JSON
        task: String,
    },
}

#[derive(Args)]
struct Demo {
    /// Write the frames of |J| (A/m^2, f32) as frame_0000.npy and so on, and stop
    #[arg(long)]
    frames_only: bool,
    /// The folder to write to
    #[arg(short, long, value_name = "DIR", default_value = experiment::FOLDER)]
    output: PathBuf,
}

#[derive(Args)]
struct GalleryArgs {
    /// Archives, one name each: plume, demo, or frames as wavesplat convert takes them
    #[arg(value_name = "ARCHIVE", default_values = gallery::USUAL)]
    archives: Vec<String>,
    /// The folder of gallery.png, banner.png and the coefficient files
    #[arg(short, long, value_name = "DIR", default_value = "gallery-output")]
    output: PathBuf,
    #[command(flatten)]
    input: InputArgs,
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

#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
struct BenchArgs {
    #[command(subcommand)]
    other: Option<OtherBench>,
    /// The folder of results.json, results.md and the figures
    #[arg(short, long, value_name = "DIR", default_value = "bench-output")]
    output: PathBuf,
    /// Small volumes and few points, to check in seconds that everything works
    #[arg(long)]
    quick: bool,
    /// Start again and discard existing results
    #[arg(long)]
    force: bool,
    /// Voxels along x, y, z and the number of frames, 33 or more [default: 64x64x64x33]
    #[arg(long, value_name = "NXxNYxNZxNT", value_parser = parse_dims)]
    dims: Option<[usize; 4]>,
    /// Pixels a side of the pictures [default: 256]
    #[arg(long, value_name = "N")]
    size: Option<usize>,
    /// Kinds of archives, separated by commas [default: all]
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    kinds: Option<Vec<Kind>>,
    /// Tolerances, separated by commas [default: 1e-1 to 1e-6 by tens]
    #[arg(long, value_name = "E", value_delimiter = ',', value_parser = parse_tolerance)]
    tolerances: Option<Vec<f64>>,
    /// Number of repetitions of every time [default: 3]
    #[arg(long, value_name = "N")]
    repeats: Option<usize>,
    /// The date to write into the results [default: today]
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<String>,
}

#[derive(Subcommand)]
enum OtherBench {
    /// Print file sizes under a hard bound, conversion and decoding times on one core, and the same of other coders
    Size(SizeArgs),
    /// Print the seconds of the programs, beside another build's
    Speed(SpeedArgs),
}

/// Other coders.
#[derive(Args)]
struct PeerArgs {
    /// Also measure other programs, run by this Python. It needs the packages of tools/peers/requirements.txt
    #[arg(long, value_name = "PYTHON")]
    peers: Option<PathBuf>,
    /// Script that Python runs [default: tools/peers/peers.py of the sources]
    #[arg(long, value_name = "FILE", requires = "peers")]
    script: Option<PathBuf>,
}

impl PeerArgs {
    fn given(&self) -> Option<Peers> {
        let script = || self.script.clone().unwrap_or_else(Peers::usual_script);
        self.peers.clone().map(|python| Peers { python, script: script() })
    }
}

#[derive(Args)]
struct SpeedArgs {
    /// Archives (t, z, y, x), each one .npy
    #[arg(value_name = "INPUT.npy")]
    inputs: Vec<PathBuf>,
    /// Kinds of synthetic archives to make, separated by commas [default: smooth,moving,sparse where there are no
    /// inputs]
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    kinds: Option<Vec<Kind>>,
    /// Size of the synthetic archives
    #[arg(long, value_name = "NXxNYxNZxNT", default_value = "128x128x128x32", value_parser = parse_dims)]
    dims: [usize; 4],
    /// Pixels a side of the pictures
    #[arg(long, value_name = "N", default_value_t = 512)]
    size: usize,
    /// Tolerance of the files, as a share of the value range
    #[arg(long, value_name = "E", default_value = "1e-2", value_parser = parse_tolerance)]
    tolerance: f64,
    /// Threads of the programs
    #[arg(long, value_name = "N", default_value_t = 1)]
    threads: usize,
    /// Number of rounds through all commands; the shortest time counts
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeats: usize,
    /// Folder of the programs to measure [default: that of this program]
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
    /// Also measure the programs in this folder, in turns
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// The folder of speed.md
    #[arg(short, long, value_name = "DIR", default_value = "bench-output")]
    output: PathBuf,
    /// The date to write into the results [default: today]
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<String>,
}

impl SpeedArgs {
    fn config(&self) -> Result<speed::Config> {
        let usual = if self.inputs.is_empty() { vec![Kind::Smooth, Kind::Moving, Kind::Sparse] } else { Vec::new() };
        let here = this_program()?.parent().map(Into::into).unwrap_or_default();
        Ok(speed::Config {
            inputs: self.inputs.clone(),
            kinds: self.kinds.clone().unwrap_or(usual),
            dims: self.dims,
            tolerance: self.tolerance,
            size: self.size,
            threads: self.threads,
            repeats: self.repeats,
            programs: self.programs.clone().unwrap_or(here),
            against: self.against.clone(),
            output: self.output.clone(),
            date: self.date.clone(),
        })
    }
}

#[derive(Args)]
struct SizeArgs {
    /// Archives (t, z, y, x), each one .npy; held in memory whole
    #[arg(value_name = "INPUT.npy")]
    inputs: Vec<PathBuf>,
    /// Archives to make [default: the usual ones where there are no inputs]
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    kinds: Option<Vec<Subject>>,
    #[command(flatten)]
    peers: PeerArgs,
    /// The folder of size.json and size.md
    #[arg(short, long, value_name = "DIR", default_value = "bench-output")]
    output: PathBuf,
    /// Shares of the value range, separated by commas
    #[arg(long, value_name = "E", value_delimiter = ',', default_value = "1e-2,1e-3,1e-4", value_parser = parse_tolerance)]
    tolerances: Vec<f64>,
    /// Number of rounds through all coders; the shortest time counts
    #[arg(long, value_name = "N", default_value_t = 3)]
    repeats: usize,
    /// Use small archives, to check in seconds that everything works
    #[arg(long)]
    small: bool,
    /// The date to write into the results [default: today]
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<String>,
}

impl SizeArgs {
    fn config(&self) -> Result<size::Config> {
        Ok(size::Config {
            inputs: self.inputs.clone(),
            subjects: self.kinds.clone(),
            small: self.small,
            tolerances: self.tolerances.clone(),
            repeats: self.repeats,
            peers: self.peers.given(),
            output: self.output.clone(),
            program: this_program()?,
            date: self.date.clone(),
        })
    }
}

impl BenchArgs {
    fn sweep(&self) -> Sweep {
        let usual = if self.quick { Sweep::quick() } else { Sweep::default() };
        Sweep {
            dims: self.dims.unwrap_or(usual.dims),
            size: self.size.unwrap_or(usual.size),
            kinds: self.kinds.clone().unwrap_or(usual.kinds),
            tolerances: self.tolerances.clone().unwrap_or(usual.tolerances),
            repeats: self.repeats.unwrap_or(usual.repeats),
            ..usual
        }
    }
}

/// Parses a tolerance for which there is something to measure.
fn parse_tolerance(text: &str) -> std::result::Result<f64, String> {
    diff::above_zero(text)
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

/// Prints progress on standard error; ignores errors of a closed stream.
fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

fn demo(args: &Demo) -> Result<()> {
    if args.frames_only {
        return experiment::write_frames(&args.output, Plate::default(), experiment::FRAMES);
    }
    let all = Experiment::new(args.output.clone());
    wavesplat_cli::print(&experiment::run(&all, &mut |step| say(&format!("{step} ...")))?)
}

fn gallery(args: &GalleryArgs) -> Result<()> {
    let GalleryArgs { archives, output, input } = args;
    let all = Gallery { archives: archives.clone(), input: input.clone(), folder: output.clone(), side: gallery::SIDE };
    all.draw(&mut |step| say(&format!("{step} ...")))?;
    wavesplat_cli::print(&format!("{}\n{}\n", all.sheet().display(), all.banner().display()))
}

fn synth(args: &SynthArgs) -> Result<()> {
    let [nx, ny, nz, frames] = args.dims;
    let shape = Shape { dims: [nx, ny, nz], frames, ty: args.dtype };
    let synth = Synth { kind: args.kind, shape, seed: args.seed };
    Target::parse(&args.output, args.format)?.write(&shape, |frame, bytes| synth.fill(frame, bytes))
}

fn this_program() -> Result<PathBuf> {
    std::env::current_exe().map_err(|e| Error::io("wavesplat-tools", "finding this program", e))
}

fn bench_size(args: &SizeArgs) -> Result<()> {
    let (results, tables) = size::run(&args.config()?, &mut say)?;
    wavesplat_cli::print(&tables)?;
    let wrong = size::complaints(&results);
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Error::BoundMissed { path: args.output.clone(), what: format!("THE BOUND IS MISSED\n{}", wrong.join("\n")) })
}

fn bench_speed(args: &SpeedArgs) -> Result<()> {
    wavesplat_cli::print(&speed::run(&args.config()?, &mut say)?)
}

fn bench(args: &BenchArgs) -> Result<()> {
    let program = this_program()?;
    let (output, date) = (args.output.clone(), args.date.clone());
    let config = bench::Config { sweep: args.sweep(), output, program, force: args.force, date };
    let results = bench::run(&config, &mut say)?;
    let wrong = sanity::complaints(&results.points);
    if !wrong.is_empty() {
        return Err(Error::BoundMissed { path: args.output.clone(), what: wrong.join("\n") });
    }
    wavesplat_cli::print(&format!("{}\n", args.output.join("results.md").display()))
}

fn report(error: &Error) -> ExitCode {
    // If even the message cannot be written, nothing more can be done.
    let _ = writeln!(io::stderr().lock(), "{}", error_text(error, &Cli::command()));
    ExitCode::from(error.exit_code())
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(args) => demo(&args),
        Command::Gallery(args) => gallery(&args),
        Command::Synth(args) => synth(&args),
        Command::Diff(args) => diff::run(&args),
        Command::Bench(args) => match &args.other {
            Some(OtherBench::Size(args)) => bench_size(args),
            Some(OtherBench::Speed(args)) => bench_speed(args),
            None => bench(&args),
        },
        Command::BenchStep { name, task } => {
            bench::run_step(&name, &task).and_then(|answer| wavesplat_cli::print(&answer))
        }
    };
    result.map_or_else(|e| report(&e), |()| ExitCode::SUCCESS)
}
