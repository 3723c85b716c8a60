//! The options of `wavesplat convert`, and the request that they make.

use super::given::GivenOptions;
use crate::choice::choice;
use crate::{CommonArgs, InputArgs, Numbers, Pair, SelectArgs};
use clap::{Arg, Args, ValueEnum};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::base::values::share;
use wavesplat_core::source::follow::RunEnd;
use wavesplat_core::wavelet::AnyBasis;
use wavesplat_engine::convert::shard::Shard;
use wavesplat_engine::convert::{BestFor, Bound, ConvertRequest, MaxError, MissingPolicy, SpatialPredictor};
use wavesplat_format::Keep;
use wavesplat_formats::extensions;
use wavesplat_jobs::picture::open_colours;

/// Convert frames to a coefficient file
#[derive(Debug, Clone, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat convert frames/ -o run.wspl
  wavesplat convert 'frames/step_*.vti' -o run.wspl --tolerance 0.001
  wavesplat convert run.raw --dims 256x256x128x400 --dtype f32 -o run.wspl
  simulation | wavesplat convert - --dims 64x64x64 --dtype f32 -o run.wspl
  wavesplat convert frames/ -o run.wspl --resume
  wavesplat convert frames/ -o run.wspl --follow 10min
  wavesplat convert frames/ -o coloured.wspl --transfer-function viridis
  wavesplat convert run.nc -o run_%n.wspl --variable u,v,w
  wavesplat convert old.wspl -o new.wspl
  wavesplat convert frames/ --scan scan.json --shard 3/16 -o part-3.wspl",
    after_help = "--help lists all options.",
    after_long_help = after_help(),
    mut_args(hidden_in_short_help)
)]
pub(crate) struct ConvertArgs {
    #[command(flatten)]
    pub(super) given: GivenOptions, // before the others take their values
    /// Frames: files in order, a folder, a pattern in quotes, one 4-D file, or - for standard input; or a coefficient
    /// file, to repack it in this version's format, with the same samples
    #[arg(required = true)]
    pub(crate) inputs: Vec<PathBuf>,
    /// Coefficient file to write, or - for standard output. With several variables, %n in the name becomes the
    /// variable's name
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub(crate) output: PathBuf,
    /// Replace an existing file; discard what an earlier run left unfinished, unless --resume continues it
    #[arg(long, help_heading = "Output")]
    pub(super) force: bool,
    /// Continue an unfinished earlier run of this command. The file gets the bytes of an uninterrupted run
    #[arg(long, help_heading = "Output")]
    pub(super) resume: bool,
    /// Largest allowed error, as a share of what the bound refers to, like 0.01 or 1%; 0 keeps every bit [default: 1%]
    #[arg(long, value_name = "X", value_parser = share, allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    tolerance: Option<f64>,
    /// Largest allowed error in the samples' unit, instead of --tolerance, for --bound pointwise and rms; 0 keeps every
    /// bit. NAME=X,NAME=X gives one for each variable
    #[arg(long, value_name = "X", allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    max_error: Option<MaxError>,
    /// Error that the tolerance limits
    #[arg(long, value_enum, default_value = "pointwise", help_heading = ERROR_BOUND)]
    bound: BoundName,
    /// Value range that the tolerance refers to, instead of the range of the frames so far; for --bound pointwise and
    /// rms. With --transfer-function: the values of its first and last colour [default: its own, or the range of all
    /// frames]
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    pub(super) range: Option<Pair>,
    /// What to do with NaN, infinities and the missing value: reject them, or keep them as they are [default: error;
    /// mask with --missing-value, and for files that declare a missing value]
    #[arg(long, value_parser = choice::<MissingPolicy>(), help_heading = ERROR_BOUND)]
    missing: Option<MissingPolicy>,
    /// Keep more than the bound; may be repeated. `range`: no sample beyond the extremes of its window. `sign`: no sample
    /// changes its sign. `side=V,V...`: every sample stays below, at or above these values, so that isosurfaces of them
    /// have the same pieces and holes. `sum`: sums of each block and frame are those of the source. `difference=E`:
    /// changes from frame to frame are off by at most E. `gradient=E`, `laplacian=E`: the same for derivatives in space.
    /// `curl=E`, `divergence=E`: the same if every component of the vector is converted with it. `relative=S@F`: samples
    /// of magnitude F or more are off by at most S times their magnitude
    #[arg(long, value_name = "WHAT", value_parser = Keep::parse, allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    keep: Vec<Keep>,
    /// A value that means "missing"
    #[arg(long, value_name = "V", allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    missing_value: Option<f64>,
    /// For --bound relative: samples smaller than this may be off by as much as a sample of this size. Choose the
    /// magnitude below which values do not matter. With 0, zeros must come back as zeros, and values near zero take most
    /// of the file [default: 0]
    #[arg(long, value_name = "V", allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    floor: Option<f64>,
    /// For --bound sampled: number of random pixels on each of three faces [default: 300]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    samples: Option<u32>,
    /// For --bound sampled: seed of the random pixels [default: 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = ERROR_BOUND)]
    seed: Option<u64>,
    /// Convert frames as they appear, until the run that writes them has ended: nothing new has come for a time like 10min, or a file
    /// exists. INPUTS is a folder, a pattern or a list, whose files are complete when they have stayed the same for two seconds; or a
    /// file that raw frames are appended to, or a named pipe
    #[arg(long, value_name = "TIME|FILE", help_heading = "Input")]
    pub(super) follow: Option<RunEnd>,
    #[command(flatten)]
    pub(super) select: SelectArgs,
    /// Convert only the I-th of N shards, each a run of whole windows; wavesplat merge joins them. Needs --scan,
    /// --range or --max-error
    #[arg(long, value_name = "I/N", help_heading = SHARDS)]
    pub(super) shard: Option<Shard>,
    /// File written by wavesplat scan: the value range of all frames, which the tolerance refers to
    #[arg(long, value_name = "FILE", help_heading = SHARDS)]
    pub(super) scan: Option<PathBuf>,
    /// Number of consecutive windows that may reuse the previous window's coding. A shard is a whole number of such
    /// chains, so a smaller number allows more shards but converts more slowly
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = SHARDS)]
    chain: u32,
    #[command(flatten)]
    pub(crate) input: InputArgs,
    /// Convert every sample to a colour first, and store red, green and blue, 0 to 1: a colour map's name or a transfer
    /// function's file. The tolerance is then a share of full brightness
    #[arg(long, value_name = "F", help_heading = CODING)]
    pub(super) transfer_function: Option<String>,
    /// Transform along time
    #[arg(long, value_parser = choice::<AnyBasis>(), default_value = "auto", help_heading = CODING)]
    basis: AnyBasis,
    /// Prediction of coefficients in space [default: none for haar and multi, else auto]
    #[arg(long, value_parser = choice::<SpatialPredictor>(), help_heading = CODING)]
    space: Option<SpatialPredictor>,
    /// What the file is made best for, by --window and --block where they are not given [default: all]
    #[arg(long, value_name = "WHAT", value_parser = choice::<BestFor>(), help_heading = CODING)]
    best_for: Option<BestFor>,
    /// Frames in a window: a power of two for haar, one more for multi [default: 32; up to 1024 for 256 voxels or less]
    #[arg(long, value_name = "T", help_heading = CODING)]
    window: Option<usize>,
    /// Block edge in voxels [default: up to 48, up to 32 without a pyramid; more for thin volumes, less for long windows]
    #[arg(long, value_name = "N", help_heading = CODING)]
    block: Option<usize>,
    /// Compression level of zstd
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(i32).range(1..=19), help_heading = CODING)]
    pub(super) level: i32,
    #[command(flatten)]
    pub(crate) common: CommonArgs,
}

/// The options that `-h` shows: those that most people need. `--help` shows all.
const IN_SHORT_HELP: [&str; 13] = [
    "inputs",
    "output",
    "force",
    "resume",
    "tolerance",
    "max_error",
    "missing_value",
    "frames",
    "dims",
    "dtype",
    "variable",
    "threads",
    "memory",
];

/// Hides most options in the short help. Man pages leave out the text of a hidden option, unless it is a long one.
fn hidden_in_short_help(arg: Arg) -> Arg {
    if IN_SHORT_HELP.contains(&arg.get_id().as_str()) {
        return arg;
    }
    let help = arg.get_help().cloned().unwrap_or_default();
    arg.hide_short_help(true).long_help(help)
}

/// The headings of the help.
const ERROR_BOUND: &str = "Error bound";
const SHARDS: &str = "Several machines";
const CODING: &str = "How it is coded (the defaults are good)";

/// The end of the help.
fn after_help() -> String {
    let extensions: Vec<String> = extensions().map(|ending| format!(".{ending}")).collect();
    format!("Inputs: {}; headerless data with --dims and --dtype.\n\n{NOTES}", extensions.join(" "))
}

const NOTES: &str = "\
A stopped or killed run leaves its finished windows in run.wspl.part; run.wspl itself appears only when it is complete. \
With --resume, the same command continues there (converted frames are read again and compared); a program that writes into a \
pipe must start from its first frame again.

The bound of each window is tolerance x (max - min of all frames up to its end), so a pipe needs no second pass; \
--range sets a fixed range instead. --bound relative refers to each sample itself: for fields above the floor, every pixel of \
every view is then within the tolerance of its own value, plus the error of splatting (a share of the range: \
wavesplat-render --splat-error). --bound sampled is AN ESTIMATE, NOT A GUARANTEE: pixels darker \
than the mean, and single frames, may be off by many times the tolerance.";

#[derive(Debug, Clone, Copy, ValueEnum)]
enum BoundName {
    /// Every sample: error <= tolerance x value range
    Pointwise,
    /// The root mean square of each voxel's errors in each window <= tolerance x value range
    Rms,
    /// Every sample v: error <= tolerance x max(|v|, floor)
    Relative,
    /// The paper's rule, AN ESTIMATE, NOT A GUARANTEE: as rms, but relative to the mean absolute value of random
    /// pixels. The relative error of most pixels, but not all, stays below the tolerance
    Sampled,
}

impl ConvertArgs {
    /// The request that these options make.
    pub(super) fn request(&self) -> Result<ConvertRequest> {
        let colours = self.transfer_function.as_deref().map(|name| open_colours("transfer_function", name));
        Ok(ConvertRequest {
            tolerance: self.tolerance,
            max_error: self.max_error.clone(),
            bound: self.bound()?,
            range: self.range()?,
            missing: self.missing,
            missing_value: self.missing_value,
            keep: Keep::joined(&self.keep).map_err(|what| Error::setting("keep", what))?,
            transfer_function: colours.transpose()?,
            basis: self.basis,
            space: self.space,
            best_for: self.best_for,
            window: self.window,
            block: self.block,
            level: self.level,
            chain: self.chain as usize,
            shard: self.shard,
            scan: self.scan.clone(),
            measures: self.is_reported(),
            memory: self.common.memory.0,
            input: self.settings(),
        })
    }

    /// Whether more than a summary is shown of a file that can be read again.
    fn is_reported(&self) -> bool {
        (self.common.json || self.common.verbose) && self.output != Path::new(STANDARD)
    }

    fn bound(&self) -> Result<Bound> {
        if self.floor.is_some() && !matches!(self.bound, BoundName::Relative) {
            return Err(Error::usage("--floor: needs --bound relative"));
        }
        if (self.samples.is_some() || self.seed.is_some()) && !matches!(self.bound, BoundName::Sampled) {
            return Err(Error::usage("--samples and --seed: need --bound sampled"));
        }
        let floor = self.floor.unwrap_or(0.0);
        if !(floor.is_finite() && floor >= 0.0) {
            return Err(Error::usage("--floor: takes a finite number of 0 or more, in the units of the samples"));
        }
        Ok(match self.bound {
            BoundName::Pointwise => Bound::Pointwise,
            BoundName::Rms => Bound::Rms,
            BoundName::Relative => Bound::Relative { floor: floor.abs() }, // no -0
            BoundName::Sampled => {
                Bound::Sampled { samples: self.samples.unwrap_or(SAMPLES), seed: self.seed.unwrap_or(0) }
            }
        })
    }

    /// The range that the tolerance refers to.
    fn range(&self) -> Result<Option<(f64, f64)>> {
        let Some(Numbers([lo, hi])) = self.range.filter(|_| self.transfer_function.is_none()) else { return Ok(None) };
        let refers_to = match self.bound {
            BoundName::Relative => "relative the tolerance refers to each sample",
            BoundName::Sampled => "sampled the tolerance refers to pixels",
            BoundName::Pointwise | BoundName::Rms => return Ok(Some((lo, hi))),
        };
        Err(Error::usage(format!("--range: with --bound {refers_to}, not to a range")))
    }

    /// The settings that `append` and `verify --against` need to read the same samples again.
    fn settings(&self) -> Vec<(String, String)> {
        let frames = self.select.frames.map(|f| ("frames".to_string(), f.to_string()));
        let region = self.select.region.as_ref().map(|r| ("region".to_string(), r.to_string()));
        let given = [frames, region].into_iter().flatten();
        given.chain(self.input.settings().map(|(name, value)| (name.to_string(), value))).collect()
    }
}

/// The default number of pixels on each face, as in the paper.
const SAMPLES: u32 = 300;
