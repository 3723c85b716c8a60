//! `wavesplat-render`: renders pictures from coefficient files, or from frames by the conventional method.
#![allow(missing_docs)] // clap takes an option's comment as its help

mod along;
mod colouring;
mod colours;
mod generate;
mod provenance;
mod ranges;
mod sinks;
mod targets;

use along::{AlongArgs, ModeName};
use clap::{Parser, ValueEnum};
use colouring::ColouredPictures;
use colours::ColourArgs;
use generate::Program;
use serde::Serialize;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use targets::{Targets, parse_depth, parse_format, refuse_video};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Grid;
use wavesplat::base::output::{Output, STANDARD};
use wavesplat::cli::{
    self, CommonArgs, FrameList, InputArgs, Pair, RegionSpec, Triple, Whole, share, spare_inputs, transfer_function,
};
use wavesplat::colour::TransferFunction;
use wavesplat::convert::range_bound;
use wavesplat::file::{CoefficientFile, setting};
use wavesplat::render::annotate::{Annotation, room};
use wavesplat::render::sink::{Depth, PictureFormat, Provenance, Sink};
use wavesplat::render::{
    CoefficientScene, FrameScene, Limit, Quantity, RenderConfig, RenderReport, Scene, SplatSource, default_splat_error,
    least_memory, render,
};
use wavesplat::source::Archive;
use wavesplat::view::camera::{Camera, View};
use wavesplat::view::footprint::Kernel;
use wavesplat_format::Metadata;

/// Render pictures of time-varying volumes.
#[derive(Debug, Parser)]
#[command(
    name = "wavesplat-render",
    version,
    arg_required_else_help = true,
    before_help = "\
Examples:
  wavesplat-render run.wspl -o frame_%04d.png
  wavesplat-render run.wspl --view 45,20 --frames 10 --colormap turbo -o picture.png
  wavesplat-render run.wspl -o values.npy --size 800x600 --sidecar values.json
  wavesplat-render run.wspl --orbit 36 --frames 10 -o turn_%02v.png
  wavesplat-render run.wspl --orbit 90 --frames 10 --annotate -o turntable.apng
  wavesplat-render run.wspl --frames ::8 --format sheet --colormap maps.json#Fast -o sheet.png
  wavesplat-render run.wspl -o - --format y4m | ffmpeg -i - run.mp4
  wavesplat-render run.wspl --tolerance 0.05 --error-image error.npy -o values.npy
  wavesplat-render frames/ --method direct -o frame_%04d.png",
    after_help = "\
An .npy holds float32 values (frames, height, width) in units of --quantity, with NaN for background; with --colormap it \
holds uint8 colours. A PNG stores its render settings as text, an .exr as comments. \
View 0,0 looks along -y with z up. Azimuth turns the camera about z, counter-clockwise seen from above: 90,0 looks \
along x. A tau of about 1 / the volume's depth makes the near side stand out."
)]
struct Cli {
    /// Coefficient file; --method direct also takes frames
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// File to write, a pattern like frame_%04d.png, or - for standard output. %v or %03v becomes the number of the
    /// view; a file name without a pattern takes all views of one frame, one after another
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Replace existing files
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Azimuth and elevation in degrees; repeat for more views. The views of one run share its reading, and need %v in
    /// the file name
    #[arg(
        long = "view",
        value_name = "AZ,EL",
        default_value = "30,30",
        allow_hyphen_values = true,
        help_heading = "View"
    )]
    views: Vec<Pair>,
    /// Render N views for each view, evenly spaced around the vertical axis, starting with it; all use the smallest of
    /// their scales
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=3600), help_heading = "View")]
    orbit: u32,
    /// Turn the picture counter-clockwise by this many degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "View")]
    roll: f64,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", help_heading = "View")]
    size: Whole<2>,
    /// Pixels per world unit [default: fit the whole volume]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "View")]
    scale: Option<f64>,
    /// World point in the middle of the picture [default: the volume's centre]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "View")]
    center: Option<Triple>,
    /// Render only these frames: ranges a:b:step or numbers, separated by commas
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true, help_heading = "View")]
    frames: Option<FrameList>,
    /// Render only these voxels: x0:x1,y0:y1,z0:z1
    #[arg(long, value_name = "BOX", help_heading = "View")]
    region: Option<RegionSpec>,
    /// Attenuation per world unit of depth. Pixels whose weights sum to less than 1 % of the view's largest are
    /// background
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "Kernel")]
    tau: f64,
    /// Standard deviation of the kernel in world units [default: 0.75 of the largest spacing]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "Kernel")]
    sigma: Option<f64>,
    /// Error that splatting may add; more is faster. For means it is a share of the value range, at pixels with the
    /// view's largest weights (elsewhere in inverse proportion to the weights); for emissions, a share of the brightest
    /// pixel that the largest sample could give. 0 uses the exact method [default: half of --tolerance or the file's
    /// tolerance, at most 1e-3]
    #[arg(long, value_name = "E", allow_hyphen_values = true, help_heading = "Kernel")]
    splat_error: Option<f64>,
    /// Read and splat less: pictures may be off by this share of the value range (emissions: as if samples were). At
    /// least the file's largest sample error, or see --error
    #[arg(long, value_name = "X", value_parser = share, allow_hyphen_values = true, help_heading = "Error")]
    tolerance: Option<f64>,
    /// Error that --tolerance limits; both are reported
    #[arg(long, value_enum, default_value = "certified", help_heading = "Error")]
    error: ErrorName,
    /// Also write pictures of the certified error: no pixel is further than this from the picture of the source's
    /// samples, splatted without a cut (a file or pattern like -o; .npy in units of --quantity, colours from 0 to the
    /// largest error of small pictures)
    #[arg(long, value_name = "OUT", help_heading = "Error")]
    error_image: Option<PathBuf>,
    /// Quantity that a pixel shows
    #[arg(long, value_enum, default_value = "mean", help_heading = "Along the ray")]
    quantity: QuantityName,
    #[command(flatten)]
    colour: ColourArgs,
    #[command(flatten)]
    along: AlongArgs,
    /// Render from coefficients, or frame by frame (the conventional method)
    #[arg(long, value_enum, default_value = "coefficients", help_heading = "Input")]
    method: MethodName,
    /// Picture format: png, npy, y4m, rgb24, gray16, apng (an animated PNG), sheet (all pictures in one PNG), or exr if
    /// it was built in [default: by the extension of OUT; png for -]
    #[arg(long, value_parser = parse_format, help_heading = "Output")]
    format: Option<PictureFormat>,
    /// Bits per channel of a PNG: 8, or 16 (with --colormap grey, a single channel)
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = parse_depth, help_heading = "Output")]
    depth: Depth,
    /// Also write the --json report to a file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    sidecar: Option<PathBuf>,
    /// Frames per second of a y4m or apng
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = "Output")]
    fps: u32,
    /// A value that means "missing" in frames, besides NaN and infinities
    #[arg(long, value_name = "V", allow_hyphen_values = true, help_heading = "Input")]
    missing_value: Option<f64>,
    /// Show damaged and lost blocks of a coefficient file as missing samples, and render the rest; exit code 3. No
    /// error is certified then
    #[arg(long, conflicts_with_all = ["error_image", "tolerance"], help_heading = "Input")]
    skip_damaged: bool,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum QuantityName {
    /// The weighted mean along the ray, in the samples' unit
    Mean,
    /// The sum along the ray: value times length
    Emission,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ErrorName {
    /// The largest error of any sample, guaranteed
    Certified,
    /// The root mean square error over the pixels, estimated
    Expected,
}

impl From<ErrorName> for Limit {
    fn from(name: ErrorName) -> Self {
        match name {
            ErrorName::Certified => Self::Certified,
            ErrorName::Expected => Self::Expected,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MethodName {
    /// Splat coefficients once for all frames of a window
    Coefficients,
    /// Splat every frame
    Direct,
}

fn main() -> ExitCode {
    cli::main(Program::run)
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        let Opened { mut scene, file, annotation, colours } = self.scene()?;
        let metadata = file.as_ref().map(|file| file.metadata());
        let mut config = self.config(scene.as_ref(), metadata, colours.as_ref())?;
        let targets = self.targets(&config)?;
        config.memory = self.memory_besides_sinks(scene.as_ref(), &targets, &config)?;
        let colours = self.without_extremes(scene.as_mut(), &mut config, colours)?;
        let targets = (&targets.0, targets.1.as_ref());
        let colouring = self.colouring(scene.as_mut(), &config, targets, colours.as_ref())?;
        let provenance = self.provenance(scene.as_ref(), &config, (file.as_deref(), &annotation.times), &colouring);
        let mut sinks = self.sinks(&config, targets, &colouring, (&provenance, annotation))?;
        let unit = if config.mode.is_projection() { "pictures" } else { "rows of slabs" };
        let progress = self.common.progress("render", unit);
        let report = render(scene.as_mut(), &config, &progress, &mut |rendered| sinks.picture(&rendered))?;
        sinks.finish()?;
        self.common.detail(summary(&report));
        self.note_errors(&report);
        let (file_bytes_read, file_bytes) = file.as_ref().map(|f| (f.bytes_read(), f.bytes())).unzip();
        if let (Some(read), Some(bytes)) = (file_bytes_read, file_bytes) {
            self.common.detail(format_args!("{read} of the file's {bytes} bytes were read"));
        }
        let coloured = colouring.coloured();
        let reported = Reported { report: &report, picture: &provenance, coloured, file_bytes_read, file_bytes };
        self.report(&reported)?;
        file.map_or(Ok(()), |file| file.refuse_skipped())
    }

    /// Prints notes on the errors of pictures.
    fn note_errors(&self, report: &RenderReport) {
        let RenderReport { certified_sample_error, expected_error, left_out, .. } = report;
        if self.tolerance.is_some() && self.along.mode != ModeName::Projection {
            self.common.note(format_args!(
                "no sample is off by more than {certified_sample_error:.4e}; {} coefficients left out",
                left_out.coefficients
            ));
        } else if self.tolerance.is_some() {
            self.common.note(format_args!(
                "no sample is off by more than {certified_sample_error:.4e}; pixels are expected to be by \
                 {expected_error:.4e} (root mean square); {} coefficients left out",
                left_out.coefficients
            ));
        }
        if let Some(error) = report.certified_error {
            self.common.note(format_args!("no pixel is off by more than {error:.4e}"));
        }
    }

    /// Writes the sidecar and prints the report, if asked for.
    fn report(&self, reported: &Reported<'_>) -> Result<()> {
        if let Some(path) = &self.sidecar {
            let mut out = Output::create(path, self.force)?;
            out.write_all(cli::report_text(reported)?.as_bytes()).map_err(|e| Error::io(path, "writing", e))?;
            out.commit()?;
        }
        self.common.report(reported, self.output == Path::new(STANDARD))
    }

    /// The memory that is left for rendering, in bytes. An error if it does not suffice.
    fn memory_besides_sinks(
        &self,
        scene: &dyn Scene,
        (pictures, errors): &(Targets, Option<Targets>),
        config: &RenderConfig,
    ) -> Result<usize> {
        let errors = errors.as_ref().map_or(Ok(0), |errors| errors.memory(self.depth, config))?;
        let taken = pictures.memory(self.depth, config)? + errors;
        let needed = least_memory(scene, config)? + taken;
        if needed > config.memory {
            let ([width, height], mib) = (self.size.0, needed.div_ceil(1 << 20));
            let what = format!("pictures of {width}x{height} pixels of this volume need at least {mib}MiB");
            return Err(Error::setting("memory", what));
        }
        Ok(config.memory - taken)
    }

    /// The files for pictures and for their errors. No file may be written twice, and no input may be overwritten.
    fn targets(&self, config: &RenderConfig) -> Result<(Targets, Option<Targets>)> {
        if self.format.is_none() {
            refuse_video(&self.inputs, &self.output)?;
        }
        let pictures = Targets::new(&self.output, self.format, config)?;
        self.colour.check(pictures.format)?;
        let errors = self.error_image.as_ref().map(|path| Targets::new(path, None, config)).transpose()?;
        if self.error_image.as_deref() == Some(Path::new(STANDARD)) {
            return Err(Error::usage("--error-image: takes a file of its own"));
        }
        let are_png = [Some(&pictures), errors.as_ref()].into_iter().flatten().any(|targets| targets.format.is_png());
        if self.depth == Depth::Sixteen && !are_png {
            let what = "is of png, apng and sheet; gray16 has 16 bits, npy and exr have floats";
            return Err(Error::usage(format!("--depth 16: {what}")));
        }
        let mut written = HashSet::new();
        if let Some(path) = &self.sidecar {
            self.check_sidecar(path)?;
            written.insert(path.clone());
        }
        for targets in [Some(&pictures), errors.as_ref()].into_iter().flatten() {
            for name in &targets.names {
                spare_inputs(&self.inputs, name)?;
                let paths = Sink::paths(name, targets.format, &config.frames)?;
                if let Some(twice) = paths.into_iter().find(|path| !written.insert(path.clone())) {
                    let what = "would be written twice: --error-image takes a file of its own, as does --sidecar, and every picture a name";
                    return Err(Error::usage(format!("{}: {what}", twice.display())));
                }
            }
        }
        Ok((pictures, errors))
    }

    fn check_sidecar(&self, path: &Path) -> Result<()> {
        if path == Path::new(STANDARD) {
            return Err(Error::usage("--sidecar: takes a file of its own; --json prints"));
        }
        spare_inputs(&self.inputs, path)?;
        Output::check(path, self.force)
    }

    /// Opens the scene to render, and its file.
    fn scene(&self) -> Result<Opened> {
        let coefficients = self.method == MethodName::Coefficients;
        if let [only] = self.inputs.as_slice()
            && (coefficients || only.extension().is_some_and(|e| e == "wspl"))
        {
            if only == Path::new(STANDARD) {
                return Err(Error::usage("-: a coefficient file is read from its end, so it cannot come from a pipe"));
            }
            self.input.refuse_for_coefficients()?;
            self.along.check(false, self.colour.is_asked())?;
            let file = CoefficientFile::open_with(only, self.input.access()).map_err(|e| hint_at_frames(only, e))?;
            let file = Arc::new(if self.skip_damaged { file.skip_damaged()? } else { file });
            let what = if coefficients { SplatSource::Coefficients } else { SplatSource::Samples };
            let unit = setting(file.metadata(), "time-units").map(String::from);
            let annotation = Annotation { times: file.metadata().times.clone(), unit };
            let colours = self.along.of_file(self.colour.range, &file)?;
            let scene = Box::new(CoefficientScene::new(file.clone(), what));
            return Ok(Opened { scene, file: Some(file), annotation, colours });
        }
        if self.skip_damaged {
            return Err(Error::usage("--skip-damaged: is for a coefficient file"));
        }
        if coefficients {
            return Err(Error::usage(format!("takes one coefficient file; {FRAMES_HINT}")));
        }
        if self.inputs == [PathBuf::from(STANDARD)] {
            return Err(Error::usage(
                "--method direct reads frames more than once, so they cannot come from standard input",
            ));
        }
        self.along.check(true, self.colour.is_asked())?;
        let mut source = self.input.open(&self.inputs, &self.common)?;
        let Archive { times, units, .. } = source.archive().clone();
        let annotation = Annotation { times, unit: units.times };
        let missing_value = source.archive().missing_value(self.missing_value);
        let colours = match self.along.colours() {
            Some(name) => {
                let inputs = self.inputs.as_slice();
                Some(transfer_function(
                    name,
                    self.colour.range,
                    (inputs, source.as_mut()),
                    missing_value,
                    &self.common,
                )?)
            }
            None => None,
        };
        let before = colours.clone().filter(|_| self.along.mode == ModeName::Projection);
        let scene = match before {
            Some(colours) => FrameScene::coloured(source, missing_value, colours),
            None => FrameScene::new(source, missing_value),
        };
        Ok(Opened { scene: Box::new(scene), file: None, annotation, colours })
    }

    fn config(
        &self,
        scene: &dyn Scene,
        file: Option<&Metadata>,
        colours: Option<&TransferFunction>,
    ) -> Result<RenderConfig> {
        let grid = scene.grid();
        let allowed = self.tolerance.map(|t| self.allowed(t, file)).transpose()?;
        let tolerance = self.tolerance.or(file.map(|m| m.tolerance));
        let splat_error = self.splat_error.unwrap_or(default_splat_error(tolerance));
        if !(splat_error.is_finite() && splat_error >= 0.0) {
            return Err(Error::usage("--splat-error: takes a number of 0 or more"));
        }
        let all = scene.frames().unwrap_or(0);
        Ok(RenderConfig {
            views: self.views(grid)?,
            kernel: Kernel::new(self.sigma, self.tau, grid)?,
            quantity: match self.quantity {
                QuantityName::Mean => Quantity::Mean,
                QuantityName::Emission => Quantity::Emission,
            },
            frames: self.frames.as_ref().map_or(Ok((0..all).collect()), |f| f.resolve(all))?,
            region: self.region.map(|r| r.resolve(grid)).transpose()?,
            splat_error,
            allowed,
            limited: self.error.into(),
            certify: self.error_image.is_some(),
            mode: self.along.mode(colours)?,
            memory: self.common.memory.0,
        })
    }

    /// All views, including those of orbits.
    fn views(&self, grid: &Grid) -> Result<Vec<View>> {
        let orbits = self.views.iter().map(|first| self.orbit(first.0, grid));
        Ok(orbits.collect::<Result<Vec<_>>>()?.concat())
    }

    /// The views of an orbit, with a common scale. Unless a scale or a centre is given, the volume fits beside the annotation.
    fn orbit(&self, [azimuth, elevation]: [f64; 2], grid: &Grid) -> Result<Vec<View>> {
        let (roll, size, center) = (self.roll, self.size.0, self.center.map(|c| c.0));
        let first = View { azimuth, elevation, roll, size, scale: self.scale, center };
        let fits = self.scale.is_none() && center.is_none() && self.colour.annotate;
        let margin = if fits { room(size) } else { 0 };
        if self.orbit == 1 && margin == 0 {
            return Ok(vec![first]);
        }
        let turned = |n| (azimuth + f64::from(n) * 360.0 / f64::from(self.orbit)).rem_euclid(360.0);
        let turned = |n| if self.orbit == 1 { azimuth } else { turned(n) };
        let mut views: Vec<View> = (0..self.orbit).map(|n| View { azimuth: turned(n), ..first }).collect();
        let narrow = |view: &View| Camera::new(&View { size: [size[0] - margin, size[1]], ..*view }, grid);
        let cameras = views.iter().map(narrow).collect::<Result<Vec<_>>>()?;
        let scale = cameras.iter().map(|camera| camera.scale).fold(f64::INFINITY, f64::min);
        for (view, camera) in views.iter_mut().zip(&cameras) {
            view.scale = Some(scale);
            if margin > 0 {
                view.center = Some(camera.beside(margin as f64 / 2.0 / scale));
            }
        }
        Ok(views)
    }

    /// The allowed sample error under a looser tolerance, in the unit of the samples.
    fn allowed(&self, tolerance: f64, file: Option<&Metadata>) -> Result<f64> {
        let Some(file) = file.filter(|_| self.method == MethodName::Coefficients) else {
            return Err(Error::usage("--tolerance: leaves out coefficients, so it needs --method coefficients"));
        };
        if !(0.0..=1.0).contains(&tolerance) {
            return Err(Error::usage("--tolerance: a share of the value range, 0 to 1; 2 % is 0.02"));
        }
        let allowed = range_bound(tolerance, file.range());
        let reached = file.windows.iter().map(|w| w.reached).fold(0.0, f64::max);
        if allowed < reached && self.error == ErrorName::Certified {
            let least = reached / (file.range().1 - file.range().0);
            let what = "the file itself is up to";
            return Err(Error::usage(format!("--tolerance {tolerance:e}: {what} {least:.3e} of its range off")));
        }
        Ok(allowed)
    }
}

const FRAMES_HINT: &str = "convert frames first, or render them as they are with --method direct";

/// Adds a hint to the error for a file without coefficients.
fn hint_at_frames(path: &Path, error: Error) -> Error {
    let foreign = matches!(&error, Error::CoefficientFile { source: wavesplat_format::Error::Foreign(_), .. });
    let named_so = path.extension().is_some_and(|e| e == "wspl");
    if !named_so && (foreign || path.is_dir()) {
        return Error::usage(format!("{}: not a coefficient file; {FRAMES_HINT}", path.display()));
    }
    error
}

/// The scene to render.
struct Opened {
    scene: Box<dyn Scene>,
    /// The coefficient file of the scene.
    file: Option<Arc<CoefficientFile>>,
    /// The times of frames.
    annotation: Annotation,
    /// The colours of samples, applied before splatting or along the ray.
    colours: Option<TransferFunction>,
}

/// The report of `--json`.
#[derive(Serialize)]
struct Reported<'a> {
    #[serde(flatten)]
    report: &'a RenderReport,
    #[serde(flatten)]
    coloured: ColouredPictures,
    /// The settings stored in every picture; `views` has those of each view.
    picture: &'a Provenance,
    /// Bytes read of the coefficient file, including its directory, and its size.
    file_bytes_read: Option<u64>,
    file_bytes: Option<u64>,
}

fn summary(r: &RenderReport) -> String {
    let times = [r.weight_seconds, r.decode_seconds, r.splat_seconds, r.inverse_seconds];
    let [weights, decode, splat, inverse] = times.map(|t| format!("{t:.3}"));
    let mut methods: Vec<&str> = r.views.iter().map(|view| view.method).collect();
    methods.sort_unstable();
    methods.dedup();
    format!(
        "{} view(s) of {} frames by {} in {:.3} s: weights {weights}, decode {decode}, splat {splat}, inverse {inverse}; \
         {} coefficients, {} left out",
        r.views.len(),
        r.frames,
        methods.join(" and "),
        r.seconds,
        r.coefficients,
        r.left_out.coefficients
    )
}
