//! `wavesplat convert`

use super::several;
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Note, Result};
use wavesplat::base::output::{Output, STANDARD};
use wavesplat::cli::{
    CommonArgs, InputArgs, MaxError, Pair, RemoteArgs, SelectArgs, advice, note_text, share, spare_inputs,
    transfer_function,
};
use wavesplat::colour::TransferFunction;
use wavesplat::convert::shard::{Shard, sharded};
use wavesplat::convert::{
    Basis, Bound, ConvertConfig, ConvertReport, MissingPolicy, PartialFile, SchemeConstraint, SpatialPredictor,
    Stencil, open_partial, resume,
};
use wavesplat::file::CoefficientFile;
use wavesplat::file::repack::{RepackReport, repack};
use wavesplat::file::resume::{self, Earlier};
use wavesplat::source::{Archive, FrameSource, extensions};

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
  wavesplat convert frames/ -o coloured.wspl --transfer-function viridis
  wavesplat convert run.nc -o run_%n.wspl --variable u,v,w
  wavesplat convert old.wspl -o new.wspl
  wavesplat convert frames/ --scan scan.json --shard 3/16 -o part-3.wspl",
    after_help = after_help()
)]
pub(crate) struct ConvertArgs {
    /// Frames: files in order, a folder, a pattern in quotes, one 4-D file, or - for standard input; or a coefficient
    /// file, to repack it in this version's format, with the same samples
    #[arg(required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// Coefficient file to write, or - for standard output. With several variables, %n in the name becomes the
    /// variable's name
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub(super) output: PathBuf,
    /// Replace an existing file; discard what an earlier run left unfinished, unless --resume continues it
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Continue an unfinished earlier run of this command. The file gets the bytes of an uninterrupted run
    #[arg(long, help_heading = "Output")]
    resume: bool,
    /// Largest allowed error, as a share of what the bound refers to; 0 keeps every bit [default: 0.01]
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
    range: Option<Pair>,
    /// What to do with NaN, infinities and the missing value: reject them, or keep them as they are [default: error;
    /// mask with --missing-value, and for files that declare a missing value]
    #[arg(long, value_enum, help_heading = ERROR_BOUND)]
    missing: Option<MissingName>,
    /// Clamp decoded samples to the window's original minimum and maximum, so that non-negative data stay non-negative.
    /// Pictures from coefficients are not affected
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", default_value = "false", hide_default_value = true, hide_possible_values = true, action = clap::ArgAction::Set, help_heading = ERROR_BOUND)]
    clip: bool,
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
    #[command(flatten)]
    select: SelectArgs,
    /// Convert only the I-th of N shards, each a run of whole windows; wavesplat merge joins them. Needs --scan,
    /// --range or --max-error
    #[arg(long, value_name = "I/N", help_heading = SHARDS)]
    shard: Option<Shard>,
    /// File written by wavesplat scan: the value range of all frames, which the tolerance refers to
    #[arg(long, value_name = "FILE", help_heading = SHARDS)]
    scan: Option<PathBuf>,
    /// Number of consecutive windows that may reuse the previous window's coding. A shard is a whole number of such
    /// chains, so a smaller number allows more shards but converts more slowly
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1024), help_heading = SHARDS)]
    chain: u32,
    #[command(flatten)]
    pub(super) input: InputArgs,
    /// Convert every sample to a colour first, and store red, green and blue, 0 to 1: a colour map's name or a transfer
    /// function's file. The tolerance is then a share of full brightness
    #[arg(long, value_name = "F", help_heading = CODING)]
    transfer_function: Option<String>,
    /// Transform along time
    #[arg(long, value_enum, default_value = "auto", help_heading = CODING)]
    basis: BasisName,
    /// Prediction of coefficients in space [default: none for haar and multi, else auto]
    #[arg(long, value_enum, help_heading = CODING)]
    space: Option<SpaceName>,
    /// Frames in a window: a power of two for haar [default: 32], one more for multi [default: 33]
    #[arg(long, value_name = "T", help_heading = CODING)]
    window: Option<usize>,
    /// Block edge in voxels [default: up to 48, up to 32 without a pyramid; less for long windows]
    #[arg(long, value_name = "N", help_heading = CODING)]
    block: Option<usize>,
    /// Compression level of zstd
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(i32).range(1..=19), help_heading = CODING)]
    level: i32,
    #[command(flatten)]
    pub(super) common: CommonArgs,
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
enum BasisName {
    /// Haar wavelets
    Haar,
    /// The multiwavelet of Geronimo, Hardin and Massopust
    Multi,
    /// Orthonormal functions learned from the window's own series
    Learned,
    /// No transform along time: samples are predicted in space and time
    Pyramid,
    /// learned or pyramid, whichever variant makes a few sample boxes of the window smallest
    Auto,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SpaceName {
    /// No prediction: each series by itself
    None,
    /// From two neighbours along an axis
    Linear,
    /// From four neighbours along an axis
    Cubic,
    /// linear or cubic, whichever makes a few sample boxes smaller
    Auto,
}

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

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MissingName {
    /// Reject the input, and name the first one
    Error,
    /// Keep them; they add nothing to pictures
    Mask,
}

pub(crate) fn run(args: &ConvertArgs) -> Result<()> {
    args.common.start()?;
    match several::commands(args)? {
        Some(commands) => commands.iter().try_for_each(run_one),
        None => run_one(args),
    }
}

fn run_one(args: &ConvertArgs) -> Result<()> {
    if let Some(file) = args.input.coefficients(&args.inputs, &RemoteArgs::default())? {
        return args.repack(&file);
    }
    let config = args.config()?;
    let source = args.select.narrow(args.input.open(&args.inputs, &args.common)?)?;
    let (mut source, config) = args.sharded(source, config)?;
    spare_inputs(&args.inputs, &args.output)?;
    refuse_other_format(&args.output)?;
    let config = args.of_archive(config, source.as_mut())?;
    if args.resume && !args.force && args.output.is_file() {
        return args.check_complete(&config, source.archive());
    }
    let (out, begun) = resume::open(&args.output, args.force, Earlier::by(args.force, args.resume))?;
    let begun = begun.map(|complete| PartialFile { complete, first_window: 0, description: None });
    finish(source.as_mut(), &config, begun, &args.output, out, &args.common, &|| Ok(()))
}

/// An error if the output has the extension of a format of frames, which would mislead readers of the file.
fn refuse_other_format(output: &Path) -> Result<()> {
    let extension = output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if !extensions().any(|known| known == extension) {
        return Ok(());
    }
    let what = format!("a coefficient file is named .wspl, not .{extension}; wavesplat extract writes other formats");
    Err(Error::usage(format!("{}: {what}", output.display())))
}

/// Converts the remaining frames, and commits the output if `still` confirms that the file it replaces is unchanged.
pub(crate) fn finish(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    begun: Option<PartialFile>,
    name: &Path,
    mut out: Output,
    common: &CommonArgs,
    still: &dyn Fn() -> Result<()>,
) -> Result<()> {
    let report = resume(source, config, begun, name, &mut out, &common.progress("convert", "blocks"));
    let report = report.inspect_err(|error| {
        if let Some(part) =
            out.part().filter(|_| out.is_kept() && !error.is_usage() && !matches!(error, Error::Changed { .. }))
        {
            common
                .note(format_args!("{}: the finished windows are kept; --resume continues after them", part.display()));
        }
    })?;
    out.commit_if(|part| resume::check(part).and_then(|()| still()))?;
    common.note(summary(&report, config.bound));
    report.warnings.iter().for_each(|warning| common.note(format_args!("warning: {}", note_text(warning))));
    common.report(&Reported::of(&report), name == Path::new(STANDARD))
}

/// The keys of `--json`.
#[derive(Serialize)]
struct Reported<'a> {
    #[serde(flatten)]
    report: &'a ConvertReport,
    warnings: Vec<Warning<'a>>,
}

/// What is worth knowing, and what to type.
#[derive(Serialize)]
struct Warning<'a> {
    text: &'a str,
    remedy: Option<String>,
}

impl<'a> Reported<'a> {
    fn of(report: &'a ConvertReport) -> Self {
        let warning =
            |note: &'a Note| Warning { text: &note.text, remedy: note.remedy.as_ref().map(|r| advice(r).into()) };
        Self { report, warnings: report.warnings.iter().map(warning).collect() }
    }
}

impl ConvertArgs {
    /// Checks that the output is complete, so that nothing is left to do.
    fn check_complete(&self, config: &ConvertConfig, archive: &Archive) -> Result<()> {
        let name = self.output.display();
        if !resume::is_complete(&self.output, &open_partial(config, archive)?, archive)? {
            let what = "is complete, but with other settings or frames; --force replaces it, append adds frames";
            return Err(Error::usage(format!("{name}: {what}")));
        }
        self.common.note(format_args!("{name}: is complete already"));
        Ok(())
    }

    /// The frames of a shard, and the range of all frames that a scan found.
    fn sharded(
        &self,
        source: Box<dyn FrameSource>,
        config: ConvertConfig,
    ) -> Result<(Box<dyn FrameSource>, ConvertConfig)> {
        let mut config = config;
        if let Some(path) = &self.scan {
            if config.range.is_some() || self.max_error.is_some() {
                return Err(Error::usage(
                    "--scan: gives the range that a tolerance refers to; leave --range and --max-error out",
                ));
            }
            self.refuse_range("--scan")?;
            let range = super::scan::read(path)?.range_of(source.archive()).map_err(|what| Error::input(path, what))?;
            config.range = Some(range);
        }
        let Some(shard) = self.shard else { return Ok((source, config)) };
        self.refuse_range("--shard")?;
        if config.range.is_none() && self.max_error.is_none() {
            let what = "--shard: the tolerance refers to the range of all frames, which a shard does not know";
            return Err(Error::usage(format!("{what}: give --scan, --range or --max-error")));
        }
        let (source, settings) = sharded(source, shard, (config.window, config.chain))?;
        config.settings.extend(settings);
        Ok((source, config))
    }

    /// An error for bounds that refer to no range, which frames of other shards may change.
    fn refuse_range(&self, option: &str) -> Result<()> {
        match self.bound {
            BoundName::Pointwise | BoundName::Rms => Ok(()),
            _ => Err(Error::usage(format!("{option}: needs --bound pointwise or rms"))),
        }
    }

    /// Rewrites a coefficient file in this version's format.
    fn repack(&self, file: &CoefficientFile) -> Result<()> {
        self.refuse_for_coefficients(file.path())?;
        spare_inputs(&self.inputs, &self.output)?;
        refuse_other_format(&self.output)?;
        let mut out = Output::create(&self.output, self.force)?;
        let progress = self.common.progress("convert", "blocks");
        let report = repack(file, self.level, self.common.memory.0, &self.output, &mut out, &progress)?;
        out.commit_if(resume::check)?;
        let RepackReport { frames, input_bytes, output_bytes, .. } = report;
        self.common.note(format_args!("{frames} frames, {input_bytes} -> {output_bytes} bytes, with the same samples"));
        self.common.report(&report, self.output == Path::new(STANDARD))
    }

    /// An error if an option is given that has no effect on a coefficient file.
    fn refuse_for_coefficients(&self, path: &Path) -> Result<()> {
        let given = [
            (self.tolerance.is_some(), "--tolerance"),
            (self.max_error.is_some(), "--max-error"),
            (!matches!(self.bound, BoundName::Pointwise), "--bound"),
            (self.range.is_some(), "--range"),
            (self.missing.is_some(), "--missing"),
            (self.missing_value.is_some(), "--missing-value"),
            (self.floor.is_some(), "--floor"),
            (self.clip, "--clip"),
            (self.samples.is_some(), "--samples"),
            (self.seed.is_some(), "--seed"),
            (self.transfer_function.is_some(), "--transfer-function"),
            (!matches!(self.basis, BasisName::Auto), "--basis"),
            (self.space.is_some(), "--space"),
            (self.window.is_some(), "--window"),
            (self.block.is_some(), "--block"),
            (self.select.frames.is_some(), "--frames"),
            (self.select.region.is_some(), "--region"),
            (self.shard.is_some(), "--shard"),
            (self.scan.is_some(), "--scan"),
            (self.resume, "--resume"),
        ];
        match given.into_iter().find(|(given, _)| *given) {
            Some((_, name)) => Err(Error::usage(format!(
                "{}: is a coefficient file, whose samples stay as they are; {name} is for frames",
                path.display()
            ))),
            None => self.input.refuse_for_coefficients(),
        }
    }

    fn config(&self) -> Result<ConvertConfig> {
        self.refuse_with_max_error()?;
        let window = if matches!(self.basis, BasisName::Multi) { 33 } else { 32 };
        Ok(ConvertConfig {
            coding: self.coding()?,
            chain: self.chain as usize,
            window: self.window.unwrap_or(window),
            tolerance: self.tolerance.unwrap_or(TOLERANCE),
            max_error: None, // may depend on the variable
            bound: self.bound()?,
            range: self.range()?,
            missing: match (self.missing, self.missing_value) {
                (Some(MissingName::Error), _) | (None, None) => MissingPolicy::Error,
                (Some(MissingName::Mask), _) | (None, Some(_)) => MissingPolicy::Mask,
            },
            missing_value: self.missing_value,
            refuse_fill: true,
            clip: self.clip,
            colours: None, // may depend on the frames
            block: self.block,
            level: self.level,
            memory: self.common.memory.0,
            settings: self.settings(),
        })
    }

    /// Completes a configuration with settings of the archive and of its frames.
    fn of_archive(&self, config: ConvertConfig, source: &mut dyn FrameSource) -> Result<ConvertConfig> {
        let declared = source.archive().missing.is_some();
        let missing_value = source.archive().missing_value(config.missing_value);
        let missing = if self.missing.is_none() && declared { MissingPolicy::Mask } else { config.missing };
        let max_error =
            self.max_error.as_ref().map(|error| error.of(source.archive().variable.as_deref())).transpose()?;
        Ok(ConvertConfig { colours: self.colours(source, missing_value)?, max_error, missing, missing_value, ..config })
    }

    /// An error if an option is given that means nothing beside an error in the samples' unit.
    fn refuse_with_max_error(&self) -> Result<()> {
        let for_samples = matches!(self.bound, BoundName::Pointwise | BoundName::Rms);
        let given = [
            (
                self.tolerance.is_some(),
                "--tolerance: is a share of a range, and --max-error is in the samples' unit; give one",
            ),
            (
                self.transfer_function.is_some(),
                "--max-error: is in the samples' unit, and --transfer-function codes colours",
            ),
            (self.range.is_some(), "--range: the tolerance refers to it, and --max-error to no range; give one"),
            (
                !for_samples,
                "--max-error: needs --bound pointwise or rms; the others are shares of the samples themselves",
            ),
        ];
        let refused = given.into_iter().find(|(given, _)| *given && self.max_error.is_some());
        refused.map_or(Ok(()), |(_, what)| Err(Error::usage(what)))
    }

    /// The colours for samples, if samples are turned into colours.
    fn colours(&self, source: &mut dyn FrameSource, missing_value: Option<f64>) -> Result<Option<TransferFunction>> {
        let Some(name) = &self.transfer_function else { return Ok(None) };
        spare_inputs(&[PathBuf::from(name)], &self.output)?;
        let inputs = (self.inputs.as_slice(), source);
        transfer_function(name, self.range, inputs, missing_value, &self.common).map(Some)
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

    fn range(&self) -> Result<Option<(f64, f64)>> {
        let of_samples = self.range.filter(|_| self.transfer_function.is_none());
        let Some((lo, hi)) = of_samples.map(|r| (r.0[0], r.0[1])) else { return Ok(None) };
        let refused = match self.bound {
            BoundName::Relative => "--range: with --bound relative the tolerance refers to each sample, not to a range",
            BoundName::Sampled => "--range: with --bound sampled the tolerance refers to pixels, not to a range",
            BoundName::Pointwise | BoundName::Rms if lo > hi => "--range: give the lower end first",
            BoundName::Pointwise | BoundName::Rms => return Ok(Some((lo, hi))),
        };
        Err(Error::usage(refused))
    }

    fn coding(&self) -> Result<SchemeConstraint> {
        let basis = match self.basis {
            BasisName::Haar => Some(Basis::Haar),
            BasisName::Multi => Some(Basis::Multi),
            BasisName::Learned => Some(Basis::Learned),
            BasisName::Pyramid => Some(Basis::Samples),
            BasisName::Auto => None,
        };
        let space = match self.space {
            None => return Ok(basis.map_or(SchemeConstraint::AUTO, SchemeConstraint::from)),
            Some(SpaceName::None) if matches!(self.basis, BasisName::Pyramid | BasisName::Auto) => {
                return Err(Error::usage("--space none: takes --basis haar, multi or learned"));
            }
            Some(SpaceName::None) => SpatialPredictor::Alone,
            Some(SpaceName::Linear) => SpatialPredictor::Pyramid(Stencil::Linear),
            Some(SpaceName::Cubic) => SpatialPredictor::Pyramid(Stencil::Cubic),
            Some(SpaceName::Auto) => SpatialPredictor::Any,
        };
        Ok(SchemeConstraint { basis, space })
    }

    /// The settings that `append` and `verify --against` need to read the same samples again.
    fn settings(&self) -> Vec<(String, String)> {
        let frames = self.select.frames.map(|f| ("frames".to_string(), f.to_string()));
        let region = self.select.region.map(|r| ("region".to_string(), r.to_string()));
        let given = [frames, region].into_iter().flatten();
        given.chain(self.input.settings().map(|(name, value)| (name.to_string(), value))).collect()
    }
}

/// The default tolerance.
const TOLERANCE: f64 = 0.01;

/// The default number of pixels on each face, as in the paper.
const SAMPLES: u32 = 300;

fn summary(r: &ConvertReport, bound: Bound) -> String {
    let ratio = r.input_bytes as f64 / r.output_bytes as f64;
    let new = (r.frames - r.frames_before) as f64 / r.frames as f64;
    let rate = new * r.input_bytes as f64 / r.seconds / 1e6;
    let unit = r.promise.units.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    let errors = match bound {
        Bound::Pointwise => format!("largest error {:.4e} of {:.4e}{unit} allowed", r.reached, r.delta),
        Bound::Relative { .. } => {
            let tolerance = r.promise.tolerance;
            let relative = r.share * tolerance;
            format!(
                "largest relative error {relative:.4e} of {tolerance:.4e} allowed, largest error {:.4e}{unit}",
                r.reached
            )
        }
        Bound::Rms | Bound::Sampled { .. } => {
            format!("rms error of every series within {:.4e}, largest single error {:.4e}{unit}", r.delta, r.reached)
        }
    };
    let estimate = r.promise.caution();
    let before = if r.frames_before > 0 { format!(", {} of them from before", r.frames_before) } else { String::new() };
    format!(
        "{} frames{before}, {} -> {} bytes ({ratio:.1}x) in {:.2} s ({rate:.0} MB/s); {:.4} coefficients per sample; {errors}{estimate}",
        r.frames, r.input_bytes, r.output_bytes, r.seconds, r.coefficients_per_sample
    )
}
