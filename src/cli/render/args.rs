//! The arguments of `wavesplat-render`.

use super::groups::{AnnotationArgs, ColourArgs, MotionArgs, PartialArgs, SampleArgs, SeriesArgs, SliceArgs};
use crate::choice::choice;
use crate::{CommonArgs, InputArgs, RemoteArgs};
use clap::Parser;
use std::path::PathBuf;
use wavesplat_core::base::address::is_address;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::position::RegionSpec;
use wavesplat_core::base::values::{FrameList, Triple, Whole, share};
use wavesplat_engine::render::sink::{Depth, PictureFormat};
use wavesplat_engine::render::{Limit, Quantity, SplatSource};
use wavesplat_jobs::picture::values::{Detail, Exaggeration, ViewAngles};
use wavesplat_jobs::picture::{Inputs, MOST_VIEWS, PictureRequest, Session};

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
  wavesplat-render run.wspl --orbit 120 --over-time -o turning.mp4
  wavesplat-render run.wspl --frames ::8 --format sheet --colormap maps.json#Fast -o sheet.png
  wavesplat-render run.wspl --annotate -o run.mp4
  wavesplat-render run.wspl --annotate --orbit 4 -o run.html
  wavesplat-render run.wspl --tolerance 0.05 --error-image error.npy -o values.npy
  wavesplat-render run.wspl --slice x=0.5,z=0.25 --frames 10 -o slices.png
  wavesplat-render run.wspl --probe 0.5,0.5,0.5 -o series.svg
  wavesplat-render frames/ --method direct -o frame_%04d.png
  wavesplat-render run.wspl --region 0:32,:,: --partial -o part-1.wpart
  wavesplat-render --sum part-1.wpart part-2.wpart -o picture.png",
    after_help = "\
An .npy holds float32 values (frames, height, width) in units of --quantity, with NaN for background; of composites and isosurfaces \
(frames, height, width, 4), light and opacity; with --colormap uint8 colours. A PNG stores its render settings as text, an .exr as comments. \
View 0,0 looks along -y with z up. Azimuth turns the camera about z, counter-clockwise seen from above: 90,0 looks \
along x. A tau of about 1 / the volume's depth makes the near side stand out."
)]
pub struct Cli {
    /// Coefficient file; --method direct also takes frames, --sum takes parts
    #[arg(required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// File to write, a pattern like frame_%04d.png, or - for standard output. %v or %03v becomes the number of the
    /// view; a file name without a pattern takes all views of one frame, one after another
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    pub(super) output: PathBuf,
    /// Replace any existing files. Without it, only pictures and reports that wavesplat-render made are replaced: .png,
    /// .apng, .exr and .json say so
    #[arg(long, help_heading = "Output")]
    pub(super) force: bool,
    /// Azimuth and elevation in degrees, or a name: top, bottom, front, back, left, right, iso, north, south, east or
    /// west; repeat for more views. The views of one run share its reading, and need %v in the file name [default:
    /// 30,30; one --slice is seen face-on]
    #[arg(long, value_name = "AZ,EL", allow_hyphen_values = true, help_heading = "View")]
    pub(super) view: Vec<ViewAngles>,
    /// Render N views for each view, evenly spaced around the vertical axis, starting with it; all use the smallest of
    /// their scales
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_VIEWS)), help_heading = "View")]
    pub(super) orbit: u32,
    /// Turn the picture counter-clockwise by this many degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "View")]
    pub(super) roll: f64,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", help_heading = "View")]
    pub(super) size: Whole<2>,
    /// Pixels per world unit [default: fit the whole volume]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "View")]
    pub(super) scale: Option<f64>,
    /// World point in the middle of the picture [default: the volume's centre]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "View")]
    pub(super) center: Option<Triple>,
    /// Draw heights this many times as tall: a number, or auto: more than 1 if the volume is nearly flat, and any for a single
    /// section whose heights are uneven or in another unit; a note names it
    #[arg(long, value_name = "Z", default_value = "auto", help_heading = "View")]
    pub(super) exaggerate: Exaggeration,
    /// Render only these frames: ranges a:b:step or numbers, separated by commas
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true, help_heading = "View")]
    pub(super) frames: Option<FrameList>,
    /// Render only these voxels: x0:x1,y0:y1,z0:z1, as numbers, shares like 10%:50%, or coordinates like @30:@45m
    #[arg(long, value_name = "BOX", allow_hyphen_values = true, help_heading = "View")]
    pub(super) region: Option<RegionSpec>,
    /// Attenuation per world unit of depth. Pixels whose weights sum to less than 1 % of the view's largest are
    /// background
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_hyphen_values = true, help_heading = "Kernel")]
    pub(super) tau: f64,
    /// Standard deviation of the kernel in world units [default: 0.75 of the largest spacing; for composites, surfaces and
    /// largest values 0.75 voxels along each axis]
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "Kernel")]
    pub(super) sigma: Option<f64>,
    /// Error that splatting may add; more is faster. For means it is a share of the value range, at pixels with the
    /// view's largest weights (elsewhere in inverse proportion to the weights); for emissions, a share of the brightest
    /// pixel that the largest sample could give. 0 uses the exact method [default: --tolerance or the file's tolerance,
    /// at most 1e-3]
    #[arg(long, value_name = "E", value_parser = share, allow_hyphen_values = true, help_heading = "Kernel")]
    pub(super) splat_error: Option<f64>,
    /// Level of detail: read and splat only every 2^N-th voxel along each axis, with a wider kernel. auto takes the
    /// coarsest level whose voxels are no larger than a pixel. The picture shows the coarser lattice; error bounds do
    /// not cover the voxels left out
    #[arg(long, value_name = "N", default_value = "0", help_heading = "Kernel")]
    pub(super) lod: Detail,
    /// Quick look: twice as fast, but the splat error is only estimated, not bounded
    #[arg(long, help_heading = "Kernel")]
    pub(super) fast: bool,
    /// Read and splat less: pictures may be off by this share of the value range (for emissions: samples may). With
    /// --error certified, at least the file's largest sample error
    #[arg(long, value_name = "X", value_parser = share, allow_hyphen_values = true, help_heading = "Error")]
    pub(super) tolerance: Option<f64>,
    /// Error that --tolerance limits; both are reported
    #[arg(long, value_parser = choice::<Limit>(), default_value = "certified", help_heading = "Error")]
    pub(super) error: Limit,
    /// Also write pictures of the certified error: an upper bound, per pixel, on the difference from a picture of the
    /// original samples drawn with the uncut kernel; for a composite or surfaces, on that of light and opacity from the
    /// same drawing of them (a file or pattern like -o; .npy in units of the picture, colours from 0 to the largest error of small pictures)
    #[arg(long, value_name = "OUT", help_heading = "Error")]
    pub(super) error_image: Option<PathBuf>,
    /// Quantity that a pixel shows
    #[arg(long, value_parser = choice::<Quantity>(), default_value = "mean", help_heading = "Along the ray")]
    pub(super) quantity: Quantity,
    #[command(flatten)]
    pub(super) motion: MotionArgs,
    #[command(flatten)]
    pub(super) colour: ColourArgs,
    #[command(flatten)]
    pub(super) around: AnnotationArgs,
    #[command(flatten)]
    pub(super) samples: SampleArgs,
    #[command(flatten)]
    pub(super) slices: SliceArgs,
    #[command(flatten)]
    pub(super) series: SeriesArgs,
    #[command(flatten)]
    pub(super) partial: PartialArgs,
    /// Render from coefficients, or frame by frame (the conventional method)
    #[arg(long, value_parser = choice::<SplatSource>(), default_value = "coefficients", help_heading = "Input")]
    pub(super) method: SplatSource,
    /// Picture format: png, npy, y4m, rgb24, gray16, apng (an animated PNG), sheet (all pictures in one PNG), mp4,
    /// webm and gif (by ffmpeg, which must be installed), html (a web page with all pictures, colours and a time slider, to
    /// open from disk or to send), or exr if it was built in [default: by the extension of OUT; png for -]
    #[arg(long, value_parser = PictureFormat::named, help_heading = "Output")]
    pub(super) format: Option<PictureFormat>,
    /// Bits per channel of a PNG: 8, or 16 (with --colormap grey, a single channel)
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = Depth::named, help_heading = "Output")]
    pub(super) depth: Depth,
    /// Also write the --json report to a file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) sidecar: Option<PathBuf>,
    /// A value that means "missing" in frames, besides NaN and infinities
    #[arg(long, value_name = "V", allow_hyphen_values = true, help_heading = "Input")]
    pub(super) missing_value: Option<f64>,
    /// Show damaged and lost blocks of a coefficient file as missing samples, and render the rest; exit code 3. No
    /// error is certified then
    #[arg(long, help_heading = "Input")]
    pub(super) skip_damaged: bool,
    #[command(flatten)]
    pub(super) input: InputArgs,
    #[command(flatten)]
    pub(super) remote: RemoteArgs,
    #[command(flatten)]
    pub(super) common: CommonArgs,
}

impl Cli {
    /// The request that the options make.
    pub(super) fn request(&self) -> PictureRequest {
        let Self { motion, colour, around, samples, slices, series, partial, .. } = self;
        PictureRequest {
            output: self.output.clone(),
            force: self.force,
            view: self.view.clone(),
            orbit: self.orbit,
            roll: self.roll,
            size: self.size,
            scale: self.scale,
            center: self.center,
            exaggerate: self.exaggerate,
            frames: self.frames.clone(),
            region: self.region.clone(),
            tau: self.tau,
            sigma: self.sigma,
            splat_error: self.splat_error,
            lod: self.lod,
            fast: self.fast,
            tolerance: self.tolerance,
            error: self.error,
            error_image: self.error_image.clone(),
            quantity: self.quantity,
            method: self.method,
            format: self.format,
            depth: self.depth,
            sidecar: self.sidecar.clone(),
            missing_value: self.missing_value,
            skip_damaged: self.skip_damaged,
            over_time: motion.over_time,
            key_frames: motion.key_frames.clone(),
            fps: motion.fps,
            speed: motion.speed,
            colormap: colour.colormap.clone(),
            range: colour.range,
            norm: colour.norm,
            clear: colour.clear,
            beyond: colour.beyond,
            convention: slices.convention,
            background: colour.background,
            annotate: around.annotate,
            title: around.title.clone(),
            bar_title: around.bar_title.clone(),
            theme: around.theme,
            mode: samples.mode,
            transfer_function: samples.transfer_function.clone(),
            opacity: samples.opacity.clone(),
            opacity_unit: samples.opacity_unit,
            iso: samples.iso.clone(),
            shade: samples.shade,
            light: samples.light,
            slices: samples.slices,
            slice: slices.slice.clone(),
            probe: series.probe.clone(),
            probe_region: series.probe_region.clone(),
            partial: partial.partial,
            sum: partial.sum,
            certify: false,
        }
    }

    /// What pictures are made of.
    ///
    /// # Errors
    /// Options that do not apply to a coefficient file, or a list of times that cannot be read.
    pub(super) fn session(&self) -> Result<Session> {
        let remote =
            if self.inputs.iter().any(|path| is_address(path)) { self.remote.options()? } else { Default::default() };
        let frames = self.input.open_options(self.common.stream_memory())?;
        let session = Session::new(Inputs { paths: self.inputs.clone(), frames, remote }, self.common.memory.0);
        if !self.partial.sum && session.coefficient_path(self.method).is_some() {
            self.input.refuse_for_coefficients()?;
        }
        Ok(session)
    }

    /// Words for how the inputs are opened.
    pub(super) fn input_words(&self) -> Vec<String> {
        let remote = self.remote.words().into_iter().map(|word| word.to_string_lossy().into_owned());
        self.input.words().into_iter().chain(remote).collect()
    }
}
