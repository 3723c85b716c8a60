//! `diff`: compares two pictures or two stacks of pictures. Two frames are in memory at a time.

mod heat;
pub(crate) mod load;
mod report;
mod ssim;

pub use report::{HeatMap, PixelPosition, Report, Statistics, WorstFrame};

use load::{Shape, Stack};
use ssim::{Picture, Scope, ssim};
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::inputs::spare_inputs;
use wavesplat::base::sample::SampleType;
use wavesplat_cli as cli;
use wavesplat_core::base::output::Output;
use wavesplat_demo::differences::Differences;

// Each paragraph is one line, which is broken to fit the terminal.
const HELP: &str = "\
A and B are PNGs (grey or RGB, with or without alpha, 8 or 16 bit), .npy arrays of (H,W), (F,H,W) or (F,H,W,C), or folders \
or quoted patterns of PNGs, which are frames in natural order. Frames, sizes, channels and types must be the same, but that \
floats may have different sizes. Numbers are in the units of the files.

NaN is background. What is background in both is left out. What is background in one alone is counted, makes the largest \
difference infinite, and is left out of all means.

PSNR: 20 log10(peak / root mean square). The peak is A's range, of all frames, for floats, else that of the type: 255 or \
65535.
SSIM: Wang et al. 2004; Gaussian windows of 11x11 pixels, sigma 1.5, K1 0.01, K2 0.03, that lie inside and are free of \
background, of the same peak; the mean over windows, then channels, then frames. Alpha is a channel as any other.

The heat map shows, of each pixel, the channel that differs most: blue is no difference, red the scale or more and \
background in one alone, black background in both. Of a stack it has up to 16 frames, evenly spread. Where it would have \
more than 64 Mi pixels it is shrunk, and each pixel shows the largest difference of those it stands for.

With --json, null stands for what is infinite or not defined; \"identical\" and \"background_in_one\" tell which.

Exit codes: 0 done, 1 reading or writing failed, 2 usage, also two that cannot be compared, 3 a damaged file or one of \
another kind, 4 above --fail-above, or a file changed while it was being read.";

/// The arguments of `diff`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// A PNG, an .npy, or a folder or pattern of PNGs: the reference
    pub a: PathBuf,
    /// The pictures to compare with it
    pub b: PathBuf,
    /// Draw |A - B| as a picture, blue to red
    #[arg(short, long, value_name = "HEAT.png")]
    pub output: Option<PathBuf>,
    /// Replace an existing heat map
    #[arg(long, requires = "output")]
    pub force: bool,
    /// The difference that is red [default: the largest that is finite]
    #[arg(long, value_name = "MAX", requires = "output", value_parser = above_zero)]
    pub scale: Option<f64>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// End with exit code 4 if the largest absolute difference is above X
    #[arg(long, value_name = "X", value_parser = not_negative)]
    pub fail_above: Option<f64>,
}

fn finite(text: &str, is_right: impl Fn(f64) -> bool, words: &str) -> std::result::Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|n| n.is_finite() && is_right(*n));
    number.ok_or_else(|| format!("{text:?} is not a number {words}"))
}

/// Reads a finite number above 0.
///
/// # Errors
/// Anything else; the message quotes it.
pub fn above_zero(text: &str) -> std::result::Result<f64, String> {
    finite(text, |n| n > 0.0, "above 0")
}

fn not_negative(text: &str) -> std::result::Result<f64, String> {
    finite(text, |n| n >= 0.0, "of 0 or more")
}

/// Compares, draws if requested, and prints the result.
///
/// # Errors
/// Those of [`compare`]; a largest difference above `fail_above`, after everything is printed.
pub fn run(args: &Args) -> Result<()> {
    let report = compare(args)?;
    let json = || serde_json::to_string_pretty(&report).map(|text| text + "\n");
    let text = if args.json { json().map_err(|e| Error::usage(format!("--json: {e}")))? } else { report.text() };
    cli::print(&text)?;
    match args.fail_above {
        Some(most) if report.all.largest > most => {
            let what = format!("differs from A by {}: more than {most}", report.all.largest_text());
            Err(Error::BoundMissed { path: args.b.clone(), what })
        }
        _ => Ok(()),
    }
}

/// Compares two stacks, and draws the heat map if requested.
///
/// # Errors
/// Files are absent, damaged, of another kind or do not match; the output cannot be written, has no extension of a PNG
/// or would replace an input.
pub fn compare(args: &Args) -> Result<Report> {
    let (a, b) = (Stack::open(&args.a)?, Stack::open(&args.b)?);
    check_alike(args, &a.shape, &b.shape)?;
    if let Some(path) = &args.output {
        check_output(path, &[a.paths(), b.paths()].concat())?;
        Output::check(path, args.force)?;
    }
    let mut report = measure_all(args, &a, &b)?;
    if let Some(path) = &args.output {
        let scale = args.scale.unwrap_or_else(|| usual_scale(&report));
        heat::draw(&a, &b, scale, (path, args.force))?;
        report.heat_map = Some(HeatMap { path: path.clone(), scale });
    }
    Ok(report)
}

fn check_alike(args: &Args, a: &Shape, b: &Shape) -> Result<()> {
    let both_floats = a.sample.is_float() && b.sample.is_float();
    let as_a = Shape { sample: if both_floats { a.sample } else { b.sample }, ..*b };
    if as_a == *a {
        return Ok(());
    }
    let what = format!("is {}; expected {}, as {}", b.text(), a.text(), args.a.display());
    Err(Error::usage(format!("{}: {what}", args.b.display())))
}

fn check_output(path: &Path, inputs: &[PathBuf]) -> Result<()> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return Err(Error::usage(format!(
            "{}: a heat map is a PNG; expected a name that ends in .png",
            path.display()
        )));
    }
    spare_inputs(inputs, path)
}

/// The largest finite difference; 1 if there is none, so that the bar has a scale.
fn usual_scale(report: &Report) -> f64 {
    let largest = report.all.largest_compared;
    if largest > 0.0 && largest.is_finite() { largest } else { 1.0 }
}

fn measure_all(args: &Args, a: &Stack, b: &Stack) -> Result<Report> {
    let (shape, scope) = (a.shape, scope(a)?);
    let (mut all, mut worst, mut similar) = (Differences::default(), None, (0.0, 0_u64));
    for frame in 0..shape.frames {
        let (found, ssim) = measure_frame(&a.read(frame)?, &b.read(frame)?, &shape, scope);
        all.join(&found, frame as u64 * shape.numbers() as u64);
        similar = ssim.map_or(similar, |s| (similar.0 + s, similar.1 + 1));
        worst = worst.filter(|(_, before, _)| !is_worse(&found, before)).or(Some((frame, found, ssim)));
    }
    let ssim = (similar.1 > 0).then(|| similar.0 / similar.1 as f64);
    let worst = worst.filter(|_| shape.frames > 1).map(|(frame, found, ssim)| WorstFrame {
        frame,
        figures: Statistics::of(&found, frame, &shape, scope.peak, ssim),
    });
    let figures = Statistics::of(&all, 0, &shape, scope.peak, ssim);
    Ok(report_of(args, &shape, scope.peak, figures, worst))
}

fn measure_frame(a: &[f64], b: &[f64], shape: &Shape, scope: Scope) -> (Differences, Option<f64>) {
    let picture = |values| Picture { values, width: shape.width, channels: shape.channels };
    (Differences::of(a, b), ssim(picture(a), picture(b), scope))
}

fn is_worse(found: &Differences, before: &Differences) -> bool {
    let key = |d: &Differences| [d.largest(), d.in_one as f64, d.squares];
    key(found) > key(before)
}

fn report_of(args: &Args, shape: &Shape, peak: f64, all: Statistics, worst: Option<WorstFrame>) -> Report {
    Report {
        schema: 1,
        a: args.a.clone(),
        b: args.b.clone(),
        samples: shape.sample.name(),
        frames: shape.frames,
        width: shape.width,
        height: shape.height,
        channels: shape.channels,
        peak,
        all,
        worst,
        heat_map: None,
    }
}

/// The values that A has, for floats, or may have.
fn scope(a: &Stack) -> Result<Scope> {
    let (lowest, highest) = match a.shape.sample {
        SampleType::F16 | SampleType::F32 | SampleType::F64 => range(a)?,
        ty => (sample_limit(ty, f64::NEG_INFINITY), sample_limit(ty, f64::INFINITY)),
    };
    let peak = (highest - lowest).max(0.0); // 0 where there is no value
    Ok(Scope { peak, middle: if peak > 0.0 { lowest + peak / 2.0 } else { 0.0 } })
}

fn sample_limit(ty: SampleType, beyond: f64) -> f64 {
    wavesplat::base::sample::round_to(ty, beyond)
}

/// The smallest and the largest finite number of all frames.
fn range(a: &Stack) -> Result<(f64, f64)> {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for frame in 0..a.shape.frames {
        let numbers = a.read(frame)?.into_iter().filter(|v| v.is_finite());
        range = numbers.fold(range, |(lowest, highest), v| (v.min(lowest), v.max(highest)));
    }
    Ok(range)
}
