//! `wavesplat extract`

use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use wavesplat::cli::{CommonArgs, FrameList, RegionSpec, spare_inputs};
use wavesplat::error::{Error, Result};
use wavesplat::extract::{ExtractConfig, check_memory, extract};
use wavesplat::file::CoefficientFile;
use wavesplat::mapped::Access;
use wavesplat::npy;
use wavesplat::output::{Output, STANDARD};
use wavesplat::source::CHANNELS;

/// Decode frames back to samples
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  wavesplat extract run.wspl -o run.npy
  wavesplat extract run.wspl --frames 10:20 --region 0:32,:,5:6 -o part.npy
  wavesplat extract run.wspl -o - --format raw | python analyse.py
  wavesplat extract coloured.wspl --channel red -o red.npy
The samples keep their type. An .npy holds (frames, z, y, x), with one header for all frames.")]
pub(crate) struct ExtractArgs {
    /// Coefficient file
    file: PathBuf,
    /// File to write, or - for standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Only these frames: ranges a:b:step or numbers, with commas between them
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Only these voxels: x0:x1,y0:y1,z0:z1
    #[arg(long, value_name = "BOX")]
    region: Option<RegionSpec>,
    /// Of a file of colours: red, green or blue
    #[arg(long, value_name = "NAME", value_parser = parse_channel)]
    channel: Option<usize>,
    /// npy or raw [default: by the ending of OUT; npy for -]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// Take damaged and lost blocks for missing samples (NaN, or the declared value, or 0) and give the rest; exit code 3
    #[arg(long)]
    skip_damaged: bool,
    /// Read the file instead of mapping it
    #[arg(long)]
    no_mmap: bool,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// NumPy array
    Npy,
    /// Samples alone, little-endian
    Raw,
}

pub(crate) fn run(args: &ExtractArgs) -> Result<()> {
    args.common.start()?;
    let format = args.format.map_or_else(|| format_of(&args.output), Ok)?;
    let access = Access::unless(args.no_mmap);
    let mut file = CoefficientFile::open(&args.file, access)?;
    if args.skip_damaged {
        file = file.skip_damaged()?;
    }
    let config = ExtractConfig {
        frames: args.frames.as_ref().map_or(Ok((0..file.frames()).collect()), |f| f.resolve(file.frames()))?,
        region: args.region.map_or(Ok(file.grid.whole()), |r| r.resolve(&file.grid))?,
        channel: args.channel(&file)?,
        memory: args.common.memory.0,
    };
    check_memory(&file, &config)?;
    spare_inputs(std::slice::from_ref(&args.file), &args.output)?;
    let mut out = Output::create(&args.output, args.force)?;
    if format == Format::Npy {
        let [x, y, z] = config.region.dims();
        let header = npy::write_header(file.sample(), &[config.frames.len(), z, y, x], &mut out);
        header.map_err(|e| Error::io(&args.output, "writing", e))?;
    }
    let report = extract(&file, &config, &args.output, &mut out, &args.common.progress("frames"))?;
    out.commit()?;
    args.common.detail(format_args!(
        "{} bytes were read of the file, which has {}",
        report.file_bytes_read, report.file_bytes
    ));
    args.common.report(&report, args.output == Path::new(STANDARD))?;
    file.refuse_skipped()
}

impl ExtractArgs {
    /// The channel that is meant; of a file of colours one must be named.
    fn channel(&self, file: &CoefficientFile) -> Result<usize> {
        let name = self.file.display();
        match (file.painter(), self.channel) {
            (Some(_), Some(channel)) => Ok(channel),
            (None, None) => Ok(0),
            (Some(_), None) => {
                let channels = CHANNELS.join(", ");
                Err(Error::usage(format!("{name}: holds colours, of which --channel chooses one of {channels}")))
            }
            (None, Some(_)) => {
                Err(Error::usage(format!("--channel: is for a file of colours, and {name} holds values")))
            }
        }
    }
}

/// A channel by its name or number.
fn parse_channel(text: &str) -> std::result::Result<usize, String> {
    let number = text.parse().ok().filter(|number| *number < CHANNELS.len());
    let found = CHANNELS.iter().position(|name| *name == text).or(number);
    found.ok_or_else(|| format!("one of {}", CHANNELS.join(", ")))
}

fn format_of(path: &Path) -> Result<Format> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("npy") => Ok(Format::Npy),
        Some("raw" | "bin") => Ok(Format::Raw),
        None if path == Path::new(STANDARD) => Ok(Format::Npy),
        _ => Err(Error::usage(format!("{}: the ending says neither .npy nor .raw; give --format", path.display()))),
    }
}
