//! `wavesplat convert`

use clap::{Args, ValueEnum};
use std::path::PathBuf;
use wavesplat::bound::Bound;
use wavesplat::cli::{CommonArgs, FrameRange, InputArgs, Pair, RegionSpec, narrow};
use wavesplat::convert::{ConvertConfig, ConvertReport, MissingPolicy, convert, least_memory};
use wavesplat::error::{Error, Result};
use wavesplat::output::{Output, STANDARD};
use wavesplat::source::Archive;
use wavesplat::wavelet::Basis;

/// Convert frames to a coefficient file
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  wavesplat convert frames/ -o run.wspl
  wavesplat convert 'frames/step_*.vti' -o run.wspl --basis multi --tolerance 0.001
  wavesplat convert run.raw --dims 256x256x128x400 --dtype f32 -o run.wspl
  simulation | wavesplat convert - --dims 64x64x64 --dtype f32 -o run.wspl
Inputs: .npy, .nrrd/.nhdr, .vti, .pvd, headerless data with --dims and --dtype.
The bound of each window is tolerance x (max - min of all frames up to its end), so a pipe needs no second pass;
--range fixes the range instead.")]
pub(crate) struct ConvertArgs {
    /// Frame files in order, a folder, a pattern in quotes, one 4-D file, or - for standard input
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Coefficient file to write, or - for standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Temporal basis
    #[arg(long, value_enum, default_value = "haar")]
    basis: BasisName,
    /// Frames in a window: a power of two for haar [default: 32], one more for multi [default: 33]
    #[arg(long, value_name = "T")]
    window: Option<usize>,
    /// Largest error as a share of the value range; 0 keeps every bit
    #[arg(long, value_name = "X", default_value_t = 0.01, allow_hyphen_values = true)]
    tolerance: f64,
    /// What is guaranteed: every sample, or the root mean square of each voxel in each window
    #[arg(long, value_enum, default_value = "pointwise")]
    bound: BoundName,
    /// Value range that the tolerance refers to, instead of that of the frames so far
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true)]
    range: Option<Pair>,
    /// NaN, infinities and the missing value: refuse them, or keep them as they are
    #[arg(long, value_enum, default_value = "error")]
    missing: MissingName,
    /// A value that means "missing"
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    missing_value: Option<f64>,
    /// Only these frames: a:b, a:b:step, the end left out
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// Only these voxels: x0:x1,y0:y1,z0:z1
    #[arg(long, value_name = "BOX")]
    region: Option<RegionSpec>,
    /// Voxels a side of a block [default: 32, less for long windows]
    #[arg(long, value_name = "N")]
    block: Option<usize>,
    /// zstd level
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(i32).range(1..=19))]
    level: i32,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum BasisName {
    /// Haar wavelets
    Haar,
    /// The multiwavelet of Geronimo, Hardin and Massopust
    Multi,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum BoundName {
    /// Every sample is within the bound
    Pointwise,
    /// The root of each series' mean squared error is
    Rms,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MissingName {
    /// Refuse, naming the first
    Error,
    /// Keep as they are; they are splatted as nothing
    Mask,
}

pub(crate) fn run(args: &ConvertArgs) -> Result<()> {
    args.common.start()?;
    let config = args.config()?;
    let mut source = narrow(args.input.open(&args.inputs, &args.common)?, args.frames, args.region)?;
    args.check_stream_memory(&config, source.archive())?;
    let mut out = Output::create(&args.output, args.force)?;
    let progress = args.common.progress("blocks");
    let report = convert(source.as_mut(), &config, &args.output, &mut out, &progress)?;
    out.commit()?;
    args.common.note(summary(&report));
    args.common.report(&report, args.output == PathBuf::from(STANDARD))
}

impl ConvertArgs {
    fn config(&self) -> Result<ConvertConfig> {
        if !(self.tolerance.is_finite() && self.tolerance >= 0.0) {
            return Err(Error::usage("--tolerance: takes a number of 0 or more"));
        }
        let range = self.range.map(|r| (r.0[0], r.0[1]));
        if range.is_some_and(|(lo, hi)| lo > hi) {
            return Err(Error::usage("--range: the lower end comes first"));
        }
        let (basis, window) = match self.basis {
            BasisName::Haar => (Basis::Haar, 32),
            BasisName::Multi => (Basis::Multi, 33),
        };
        Ok(ConvertConfig {
            basis,
            window: self.window.unwrap_or(window),
            tolerance: self.tolerance,
            bound: match self.bound {
                BoundName::Pointwise => Bound::Pointwise,
                BoundName::Rms => Bound::Rms,
            },
            range,
            missing: match self.missing {
                MissingName::Error => MissingPolicy::Error,
                MissingName::Mask => MissingPolicy::Mask,
            },
            missing_value: self.missing_value,
            block: self.block,
            level: self.level,
            memory: self.common.memory.0 - if self.is_streamed() { self.common.stream_memory() } else { 0 },
            settings: self.settings(),
        })
    }

    fn is_streamed(&self) -> bool {
        self.inputs == [PathBuf::from(STANDARD)]
    }

    /// An error if what the stream leaves of the memory is too little, with the whole that is needed.
    fn check_stream_memory(&self, config: &ConvertConfig, archive: &Archive) -> Result<()> {
        let least = if self.is_streamed() { least_memory(config, archive)? } else { 0 };
        if least > config.memory {
            let least = (least + least.div_ceil(3)).div_ceil(1 << 20); // the stream has a quarter
            let what = format!("--memory: windows of {} frames from a pipe need {least}MiB", config.window);
            return Err(Error::usage(what));
        }
        Ok(())
    }

    /// What `verify --against` must know to read the same samples again.
    fn settings(&self) -> Vec<(String, String)> {
        let frames = self.frames.map(|f| ("frames".to_string(), f.to_string()));
        let region = self.region.map(|r| ("region".to_string(), r.to_string()));
        let variable = self.input.variable.clone().map(|v| ("variable".to_string(), v));
        [frames, region, variable].into_iter().flatten().collect()
    }
}

fn summary(r: &ConvertReport) -> String {
    let ratio = r.input_bytes as f64 / r.output_bytes as f64;
    let rate = r.input_bytes as f64 / r.seconds / 1e6;
    format!(
        "{} frames, {} -> {} bytes ({ratio:.1}x) in {:.2} s ({rate:.0} MB/s); {:.4} coefficients per sample; \
         largest error {:e} of {:e} allowed",
        r.frames, r.input_bytes, r.output_bytes, r.seconds, r.coefficients_per_sample, r.reached, r.delta
    )
}
