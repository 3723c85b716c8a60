//! `wavesplat extract`

use crate::{CommonArgs, FrameList, RegionSpec, RemoteArgs};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::mapped::Access;
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::CHANNELS;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_jobs::axes::Axes;
use wavesplat_jobs::extract::{self, ExtractConfig, ExtractReport, OutputOfExtraction, SampleFormat, SampleOrder};

/// Decode a coefficient file back to samples
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat extract run.wspl -o run.npy
  wavesplat extract run.wspl --frames 10:20 --region 0:32,:,5:6 -o part.npy
  wavesplat extract run.wspl -o - --format raw | python analyse.py
  wavesplat extract run.wspl -o run.pvd
  wavesplat extract run.wspl --lod 2 -o coarse.nc
  wavesplat extract run.wspl -o run.nc
  wavesplat extract coloured.wspl --channel red -o red.npy",
    after_help = "\
Formats, by the ending of OUT:
  .npy   NumPy array (frames, z, y, x), with one header for all frames
  .raw   only the samples, little-endian
  .nrrd  NRRD with x y z t, or x y z for one frame
  .nhdr  NRRD header, with the samples in a .raw beside it
  .vti   VTK image data: one file for each frame, numbered as in out_%04d.vti
  .pvd   ParaView list of .vti files and their times; the files are in a folder beside it
  .nc    NetCDF (time, z, y, x) with times and positions: CDF-2, or CDF-5 for unsigned samples
The samples keep their type, but f16 becomes f32 in formats without it. Positions, times and
units are written if the format can store them."
)]
pub(crate) struct ExtractArgs {
    /// Coefficient file
    file: PathBuf,
    /// File to write, a pattern like out_%04d.vti if each frame has its own file, or - for standard output
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Extract only these frames: ranges a:b:step or numbers, separated by commas
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Extract only these voxels: x0:x1,y0:y1,z0:z1, as numbers, shares like 10%:50%, or coordinates like @30:@45m
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    region: Option<RegionSpec>,
    /// Extract every 2^N-th voxel along each axis, from fewer bytes. --region counts all voxels
    #[arg(long, value_name = "N", default_value_t = 0)]
    lod: u32,
    /// Channel of a file of colours: red, green or blue
    #[arg(long, value_name = "NAME", value_parser = parse_channel)]
    channel: Option<usize>,
    /// Format: npy raw nrrd nhdr vti pvd nc nii nii.gz mha vtr zarr [default: by the extension of OUT; npy for -]
    #[arg(long, value_parser = parse_format, help_heading = "Output")]
    format: Option<SampleFormat>,
    /// Extract damaged and lost blocks as missing samples (NaN, or the declared value, or 0), and the rest; exit code 3
    #[arg(long)]
    skip_damaged: bool,
    /// Read the file instead of mapping it
    #[arg(long)]
    no_mmap: bool,
    #[command(flatten)]
    remote: RemoteArgs,
    #[command(flatten)]
    common: CommonArgs,
}

/// The report of `--json`.
#[derive(Debug, Serialize)]
struct Extracted {
    #[serde(flatten)]
    report: ExtractReport,
    /// The written files; `-` is standard output.
    files: Vec<PathBuf>,
}

pub(crate) fn run(args: &ExtractArgs) -> Result<()> {
    args.common.start()?;
    let format = args.format.map_or_else(|| format_of(&args.output), Ok)?;
    let access = Access::unless(args.no_mmap);
    let mut file = args.remote.open(&args.file, access)?.with_detail(args.lod)?;
    if args.skip_damaged {
        file = file.skip_damaged()?;
    }
    let config = ExtractConfig {
        frames: args.frames.as_ref().map_or(Ok((0..file.frames()).collect()), |f| f.resolve(file.frames()))?,
        region: args.region(&file)?,
        channel: args.channel(&file)?,
        order: SampleOrder::default(),
        memory: args.common.memory.0,
    };
    let output = OutputOfExtraction::new(&file, config, &args.output, format)?;
    let paths = output.paths();
    let notes = output.notes();
    let report = output.write(args.force, &args.common.progress("extract", "frames"))?;
    notes.iter().for_each(|note| args.common.note(note));
    args.common.detail_read(report.file_bytes_read, report.file_bytes);
    args.common.report(&Extracted { report, files: paths }, args.output == Path::new(STANDARD))?;
    file.refuse_skipped()
}

impl ExtractArgs {
    /// The chosen voxels.
    fn region(&self, file: &CoefficientFile) -> Result<Region> {
        let Some(region) = &self.region else { return Ok(file.grid.whole()) };
        let region = Axes::from_file(file)?.region("region", region)?.every(1 << self.lod);
        if region.is_empty() {
            return Err(Error::usage(format!("--region: holds no voxel with --lod {}", self.lod)));
        }
        Ok(region)
    }

    /// The chosen channel; for a file of colours one must be named.
    fn channel(&self, file: &CoefficientFile) -> Result<usize> {
        let name = self.file.display();
        match (file.colour_transform(), self.channel) {
            (Some(_), Some(channel)) => Ok(channel),
            (None, None) => Ok(0),
            (Some(_), None) => {
                let channels = CHANNELS.join(", ");
                Err(Error::usage(format!("{name}: holds colours; choose a channel with --channel, one of {channels}")))
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

fn parse_format(text: &str) -> std::result::Result<SampleFormat, String> {
    let names = || SampleFormat::all().into_iter().map(SampleFormat::name).collect::<Vec<_>>().join(" ");
    SampleFormat::named(text).ok_or_else(|| format!("one of {}", names()))
}

fn format_of(path: &Path) -> Result<SampleFormat> {
    let for_output = SampleFormat::named("npy").filter(|_| path == Path::new(STANDARD));
    let named = || extract::format_of(path).map_err(|e| Error::usage(format!("{e} or give --format")));
    for_output.map_or_else(named, Ok)
}
