//! `wavesplat-render`: pictures from coefficient files, or from frames by the conventional method.
#![allow(missing_docs)] // clap takes an option's comment as its help

use clap::{Parser, ValueEnum};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use wavesplat::camera::View;
use wavesplat::cli::{self, CommonArgs, FrameList, InputArgs, Pair, RegionSpec, Triple, Whole};
use wavesplat::error::{Error, Result};
use wavesplat::file::CoefficientFile;
use wavesplat::footprint::Kernel;
use wavesplat::output::STANDARD;
use wavesplat::progress::Silent;
use wavesplat::render::colour::{self, ColourMap};
use wavesplat::render::sink::{PictureFormat, Sink, SinkConfig};
use wavesplat::render::{CoefficientScene, FrameScene, Quantity, RenderConfig, Scene, What, render};

/// Render pictures of time-varying volumes.
#[derive(Debug, Parser)]
#[command(
    name = "wavesplat-render",
    version,
    arg_required_else_help = true,
    after_help = "\
Examples:
  wavesplat-render run.wspl -o frame_%04d.png
  wavesplat-render run.wspl --view 45,20 --frames 10 --colormap turbo -o picture.png
  wavesplat-render run.wspl -o values.npy --size 800x600
  wavesplat-render run.wspl -o - --format y4m | ffmpeg -i - run.mp4
  wavesplat-render frames/ --method direct -o frame_%04d.png
An .npy holds float32 (frames, height, width) in units of --quantity, NaN for background; with --colormap, uint8 colours.
The eye looks along -y with z up at 0,0; azimuth turns it about z, counter-clockwise seen from above: at 90,0 it looks
along x. A tau of about 1 / the volume's depth lets the near side stand out."
)]
struct Cli {
    /// Coefficient file; for --method direct also frames
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// File to write, a pattern as frame_%04d.png, or - for standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Replace existing files
    #[arg(long)]
    force: bool,
    /// Azimuth and elevation in degrees
    #[arg(long, value_name = "AZ,EL", default_value = "30,30", allow_hyphen_values = true, help_heading = "View")]
    view: Pair,
    /// Degrees by which the picture turns counter-clockwise
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "View")]
    roll: f64,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", help_heading = "View")]
    size: Whole<2>,
    /// Pixels per world unit [default: the whole volume fits]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "View")]
    scale: Option<f64>,
    /// World point in the middle of the picture [default: the volume's centre]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "View")]
    center: Option<Triple>,
    /// Only these frames: ranges a:b:step or numbers, with commas between them
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Only these voxels: x0:x1,y0:y1,z0:z1
    #[arg(long, value_name = "BOX")]
    region: Option<RegionSpec>,
    /// Attenuation per world unit of depth; where weights sum to less than 1 % of the view's largest is background
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "Kernel")]
    tau: f64,
    /// Standard deviation of the kernel in world units [default: 0.75 of the largest spacing]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "Kernel")]
    sigma: Option<f64>,
    /// What splatting may add to the error, relative to the range; 0 asks for the exact method
    /// [default: a tenth of the file's tolerance; 1e-4 for frames]
    #[arg(long, value_name = "E", allow_hyphen_values = true, help_heading = "Kernel")]
    splat_error: Option<f64>,
    /// What a pixel means
    #[arg(long, value_enum, default_value = "mean")]
    quantity: QuantityName,
    /// Colour map: viridis turbo rainbow grey plasma inferno magma [default: viridis]
    #[arg(long, value_name = "NAME", help_heading = "Colour")]
    colormap: Option<String>,
    /// Values of the first and the last colour [default: those of small pictures
    /// of 16 frames of the archive]
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, help_heading = "Colour")]
    range: Option<Pair>,
    /// Colour of the background, as ffffff
    #[arg(long, value_name = "RRGGBB", default_value = "000000", value_parser = parse_colour, help_heading = "Colour")]
    background: colour::Rgb,
    /// From coefficients, or frame by frame (the conventional method)
    #[arg(long, value_enum, default_value = "coefficients")]
    method: MethodName,
    /// png, npy, y4m, rgb24 or gray16 [default: by the ending of OUT; png for -]
    #[arg(long, value_parser = parse_format)]
    format: Option<PictureFormat>,
    /// Frames a second of a y4m
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: u32,
    /// A value that means "missing" in frames, besides NaN and infinities
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    missing_value: Option<f64>,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum QuantityName {
    /// The weighted mean along the ray, in the samples' unit
    Mean,
    /// The sum along the ray: value times length
    Emission,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MethodName {
    /// Splat coefficients once for all frames of a window
    Coefficients,
    /// Splat every frame
    Direct,
}

fn main() -> ExitCode {
    cli::main(|cli: Cli| cli.run())
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        let format = self.format.map_or_else(|| format_of(&self.output), Ok)?;
        let (mut scene, tolerance) = self.scene()?;
        let config = self.config(scene.as_ref(), tolerance)?;
        let colours = self.colours(scene.as_mut(), &config, format)?;
        let mut sink = Sink::open(
            &self.output,
            SinkConfig {
                format,
                size: config.view.size,
                frames: config.frames.clone(),
                fps: self.fps,
                colours,
                coloured_array: self.colormap.is_some(),
                force: self.force,
            },
        )?;
        let progress = self.common.progress("frames");
        let report = render(scene.as_mut(), &config, &progress, &mut |frame, picture| sink.picture(frame, picture))?;
        sink.finish()?;
        self.common.detail(format_args!(
            "{} frames by {} in {:.3} s: weights {:.3}, decode {:.3}, splat {:.3}, inverse {:.3}; {} coefficients",
            report.frames,
            report.method,
            report.seconds,
            report.weight_seconds,
            report.decode_seconds,
            report.splat_seconds,
            report.inverse_seconds,
            report.coefficients
        ));
        self.common.report(&report, self.output == Path::new(STANDARD))
    }

    /// What is rendered, and the tolerance that it was converted with.
    fn scene(&self) -> Result<(Box<dyn Scene>, Option<f64>)> {
        let coefficients = self.method == MethodName::Coefficients;
        if let [only] = self.inputs.as_slice()
            && (coefficients || only.extension().is_some_and(|e| e == "wspl"))
        {
            if only == Path::new(STANDARD) {
                return Err(Error::usage("-: a coefficient file is read from its end, so not from a pipe"));
            }
            self.input.refuse_for_coefficients()?;
            let file = CoefficientFile::open(only, self.input.access()).map_err(|e| hint_at_frames(only, e))?;
            let tolerance = file.metadata().tolerance;
            let what = if coefficients { What::Coefficients } else { What::Samples };
            return Ok((Box::new(CoefficientScene::new(file, what)), Some(tolerance)));
        }
        if coefficients {
            return Err(Error::usage(format!("takes one coefficient file; {FRAMES_HINT}")));
        }
        if self.inputs == [PathBuf::from(STANDARD)] {
            return Err(Error::usage("--method direct reads frames more than once, so not from standard input"));
        }
        let source = self.input.open(&self.inputs, &self.common)?;
        Ok((Box::new(FrameScene::new(source, self.missing_value)), None))
    }

    fn config(&self, scene: &dyn Scene, tolerance: Option<f64>) -> Result<RenderConfig> {
        let grid = scene.grid();
        let default_error = tolerance.map_or(1e-4, |t| t / 10.0);
        let splat_error = self.splat_error.unwrap_or(default_error);
        if !(splat_error.is_finite() && splat_error >= 0.0) {
            return Err(Error::usage("--splat-error: takes a number of 0 or more"));
        }
        let all = scene.frames().unwrap_or(0);
        Ok(RenderConfig {
            view: View {
                azimuth: self.view.0[0],
                elevation: self.view.0[1],
                roll: self.roll,
                size: self.size.0,
                scale: self.scale,
                center: self.center.map(|c| c.0),
            },
            kernel: Kernel::new(self.sigma, self.tau, grid)?,
            quantity: match self.quantity {
                QuantityName::Mean => Quantity::Mean,
                QuantityName::Emission => Quantity::Emission,
            },
            frames: self.frames.as_ref().map_or(Ok((0..all).collect()), |f| f.resolve(all))?,
            region: self.region.map(|r| r.resolve(grid)).transpose()?,
            splat_error,
            memory: self.common.memory.0,
        })
    }

    /// Colours over the given range, or over that of small pictures of frames spread over the archive: the same for
    /// every frame, whichever are asked for.
    fn colours(&self, scene: &mut dyn Scene, config: &RenderConfig, format: PictureFormat) -> Result<ColourMap> {
        let values_only = format == PictureFormat::Npy && self.colormap.is_none();
        let range = match self.range {
            Some(range) => (range.0[0], range.0[1]),
            None if values_only => (0.0, 1.0),
            None => {
                let (lo, hi) = picture_range(scene, config)?;
                self.common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
                (lo, hi)
            }
        };
        ColourMap::new(self.colormap.as_deref().unwrap_or("viridis"), range, self.background)
    }
}

const FRAMES_HINT: &str = "convert frames first, or render them as they are with --method direct";

/// Says what to do about a file that holds no coefficients.
fn hint_at_frames(path: &Path, error: Error) -> Error {
    let foreign = matches!(&error, Error::CoefficientFile { source: wavesplat_format::Error::Foreign(_), .. });
    let named_so = path.extension().is_some_and(|e| e == "wspl");
    if !named_so && (foreign || path.is_dir()) {
        return Error::usage(format!("{}: not a coefficient file; {FRAMES_HINT}", path.display()));
    }
    error
}

/// The range of small pictures of a few frames; (0, 1) if they show nothing.
fn picture_range(scene: &mut dyn Scene, config: &RenderConfig) -> Result<(f64, f64)> {
    const PIXELS: f64 = 64.0;
    const FRAMES: usize = 16;
    let mut small = config.clone();
    let shrink = (PIXELS / small.view.size[0].max(small.view.size[1]) as f64).min(1.0);
    small.view.size = small.view.size.map(|n| ((n as f64 * shrink).ceil() as usize).max(1));
    small.view.scale = small.view.scale.map(|s| s * shrink);
    let last = scene.frames().unwrap_or(1).saturating_sub(1);
    small.frames = (0..FRAMES).map(|i| i * last / (FRAMES - 1)).collect();
    small.frames.dedup();
    let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
    render(scene, &small, &Silent, &mut |_, picture| {
        (lo, hi) = picture.iter().fold((lo, hi), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        Ok(())
    })?;
    Ok(if lo <= hi { (f64::from(lo), f64::from(hi)) } else { (0.0, 1.0) })
}

fn parse_colour(text: &str) -> std::result::Result<colour::Rgb, String> {
    let wrong = || "takes six hexadecimal digits, as ffffff".to_string();
    let digits = text.trim_start_matches('#');
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6).ok_or_else(wrong)?;
    Ok([(number >> 16) as u8, (number >> 8) as u8, number as u8])
}

fn parse_format(text: &str) -> std::result::Result<PictureFormat, String> {
    let found = PictureFormat::NAMES.into_iter().find(|(name, _)| *name == text);
    found.map(|(_, format)| format).ok_or_else(|| "one of png npy y4m rgb24 gray16".into())
}

fn format_of(path: &Path) -> Result<PictureFormat> {
    if path == Path::new(STANDARD) {
        return Ok(PictureFormat::Png);
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    parse_format(ending).map_err(|names| {
        Error::usage(format!("-o {}: the ending says no format; give --format, {names}", path.display()))
    })
}
