//! Groups of options: the camera over time, colours, what is drawn around, samples along a ray, slices, time series and
//! partial sums.

use crate::choice::choice;
use clap::Args;
use std::path::PathBuf;
use wavesplat_core::base::position::RegionSpec;
use wavesplat_core::base::values::Pair;
use wavesplat_core::colour::{Norm, Opacities};
use wavesplat_engine::render::annotate::Parts;
use wavesplat_jobs::picture::values::{
    BeyondSpec, ClearSpec, Convention, HexColour, ModeName, PointSpec, SliceSpec, SurfaceList, Theme,
};
use wavesplat_jobs::picture::{check_fps, check_speed};

/// Options for the camera over time, and for the speed of movies.
#[derive(Debug, Args)]
pub(super) struct MotionArgs {
    /// Turn the camera while time passes: one picture for each view of --orbit or --view, with the frames spread over
    /// the views
    #[arg(long, help_heading = "View")]
    pub(super) over_time: bool,
    /// Move the camera from frame to frame, along a CSV file with the columns frame,azimuth,elevation and perhaps zoom;
    /// views between its lines are interpolated smoothly
    #[arg(long, value_name = "FILE", help_heading = "View")]
    pub(super) key_frames: Option<PathBuf>,
    /// Frames per second of a movie, y4m or apng
    #[arg(long, value_name = "N", default_value_t = 25.0, value_parser = parse_fps, help_heading = "Output")]
    pub(super) fps: f64,
    /// Time of the data per second of a movie, in the unit of the data's times; sets --fps
    #[arg(long, value_name = "TIME", value_parser = parse_speed, help_heading = "Output")]
    pub(super) speed: Option<f64>,
}

/// Options for colours.
#[derive(Debug, Args)]
pub(super) struct ColourArgs {
    /// Colour map: viridis plasma inferno magma cividis turbo coolwarm grey rainbow, or a file: ParaView's .json
    /// (FILE#NAME selects one of several maps) or .csv with value,red,green,blue [default: viridis]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Colour")]
    pub(super) colormap: Option<String>,
    /// Values of the first and the last colour [default: a file's own, or the range in small pictures of up to
    /// 16 frames, without a few extreme values that would take most of the colours; symmetric about 0 with coolwarm]
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, help_heading = "Colour")]
    pub(super) range: Option<Pair>,
    /// Map values to colours linearly, or by their logarithm (down to a ten-thousandth of the largest)
    #[arg(long, value_parser = choice::<Norm>(), default_value = "linear", help_heading = "Colour")]
    pub(super) norm: Norm,
    /// For means and largest values: the range of values that show the background, as LO,HI, auto or none. auto takes
    /// the least value, or 0, if many pixels of small pictures are near it
    #[arg(long, value_name = "LO,HI", default_value = "auto", allow_hyphen_values = true, help_heading = "Colour")]
    pub(super) clear: ClearSpec,
    /// Means in colours: rays shorter than the longest one are filled up with this value, so that the rim of a volume does
    /// not stand out. auto is the value of empty space, or the median; with --range 0, or the middle if 0 is not in it;
    /// none shows plain means
    #[arg(long, value_name = "V", default_value = "auto", allow_hyphen_values = true, help_heading = "Colour")]
    pub(super) beyond: BeyondSpec,
    /// Background colour, like ffffff [default: that of the theme]
    #[arg(long, value_name = "RRGGBB", help_heading = "Colour")]
    pub(super) background: Option<HexColour>,
}

/// Options for what is drawn around the volume.
#[derive(Debug, Args)]
pub(super) struct AnnotationArgs {
    /// Draw the box of the volume, values along its axes, a colour bar and the time of each frame; or only the given
    /// parts: all, none, box, axes, triad (arrows along x, y and z), scale (a line of a round length), bar and time
    #[arg(
        long,
        value_name = "PARTS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "box,axes,bar,time",
        help_heading = "Colour"
    )]
    pub(super) annotate: Option<Parts>,
    /// Draw a title above the volume
    #[arg(long, value_name = "TEXT", help_heading = "Colour")]
    pub(super) title: Option<String>,
    /// Label of the colour bar, instead of the name and the unit of the values
    #[arg(long, value_name = "TEXT", help_heading = "Colour")]
    pub(super) bar_title: Option<String>,
    /// Colours of background and letters
    #[arg(long, value_parser = choice::<Theme>(), default_value = "dark", help_heading = "Colour")]
    pub(super) theme: Theme,
}

/// Options for the samples along a ray.
#[derive(Debug, Args)]
pub(super) struct SampleArgs {
    /// How the samples along a ray make a pixel [default: iso with --iso, slice with --slice, else projection]
    #[arg(long, value_parser = choice::<ModeName>(), help_heading = "Along the ray")]
    pub(super) mode: Option<ModeName>,
    /// Colours and opacities of a composite: a colour map's name or a file. For a projection with --method direct,
    /// samples are turned into these colours before they are splatted. --range gives the values of its first and last
    /// colour [default: viridis; its own values, or those of all frames]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Along the ray")]
    pub(super) transfer_function: Option<String>,
    /// Opacities of a composite at shares of the range, like 0:0,50%:10%,1:0.8, or at values, like @280:0.1; or auto: empty space (the
    /// least value or 0), or else the most common value, is transparent, and rare values are opaque [default: the file's, or auto]
    #[arg(long, value_name = "AT:A,...", allow_hyphen_values = true, help_heading = "Along the ray")]
    pub(super) opacity: Option<Opacities>,
    /// Length in world units over which the opacities apply [default: the largest spacing]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = "Along the ray")]
    pub(super) opacity_unit: Option<f64>,
    /// Isosurfaces: V, V:RRGGBB or V:RRGGBB:OPACITY, with commas between. V is a value like 280 or @280, or a share of the
    /// range such as 40% [default: 50%; colours of
    /// --transfer-function; opaque if there is one, else 0.6]
    #[arg(long, value_name = "V,...", allow_hyphen_values = true, help_heading = "Along the ray")]
    pub(super) iso: Option<SurfaceList>,
    /// Shade a composite by the gradient of the samples, so that it looks solid
    #[arg(long, help_heading = "Along the ray")]
    pub(super) shade: bool,
    /// Direction of the light for --shade and isosurfaces: degrees to the right of the viewer, and degrees above
    /// [default: -30,40]
    #[arg(long, value_name = "AZ,EL", allow_hyphen_values = true, help_heading = "Along the ray")]
    pub(super) light: Option<Pair>,
    /// Slices per voxel along the ray, and cells per voxel across it [default: by the kernel and the scale, mostly 2]
    #[arg(long, value_name = "N", help_heading = "Along the ray")]
    pub(super) slices: Option<usize>,
}

/// Options for slices.
#[derive(Debug, Args)]
pub(super) struct SliceArgs {
    /// Show the samples on a plane across an axis, alone or within --mode composite. For more planes, repeat the option
    /// or separate them with commas. AXIS is x, y, z or the data's own name, like lat. PLACE is a share like 0.3 (with
    /// a point, 0.0 to 1.0) or 30%, a voxel like #12, or else a coordinate like 45, -500 or 120m; @0.3 is always a
    /// coordinate. A single slice is seen face-on, and three across all axes side by side, unless --view is given
    #[arg(long, value_name = "AXIS=PLACE", value_delimiter = ',', allow_hyphen_values = true, help_heading = "View")]
    pub(super) slice: Vec<SliceSpec>,
    /// Which side of a patient slices show at the right
    #[arg(long, value_parser = choice::<Convention>(), default_value = "neurological", help_heading = "View")]
    pub(super) convention: Convention,
}

/// Options for time series.
#[derive(Debug, Args)]
pub(super) struct SeriesArgs {
    /// Write the time series of a point instead of pictures, to a .csv or .svg file, or as csv to -; repeat the option
    /// for more points. X, Y and Z are places as in --slice: shares like 0.5, voxels like #12, or coordinates like 45
    /// or 120m. Values between voxels are interpolated linearly
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "Time series")]
    pub(super) probe: Vec<PointSpec>,
    /// Write the mean, the least and the largest value of a box like that of --region over time instead of pictures; repeat
    /// it for more boxes
    #[arg(long, value_name = "BOX", allow_hyphen_values = true, help_heading = "Time series")]
    pub(super) probe_region: Vec<RegionSpec>,
}

/// Options for pictures in parts.
#[derive(Debug, Args)]
pub(super) struct PartialArgs {
    /// Instead of pictures, write a file for --sum: the sums over the voxels of --region, or over the frames of a
    /// shard. Framing and splatting are those of the whole volume. Projections only
    #[arg(long, help_heading = "Parts")]
    pub(super) partial: bool,
    /// Add the files that --partial wrote, and make pictures of the sums; with --partial, write one file of the sums.
    /// Give --annotate and --title to the parts too, since they move the volume aside
    #[arg(long, help_heading = "Parts")]
    pub(super) sum: bool,
}

fn parse_fps(text: &str) -> Result<f64, String> {
    let fps = text.parse().unwrap_or(f64::NAN);
    check_fps(fps).map(|()| fps)
}

fn parse_speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().unwrap_or(f64::NAN);
    check_speed(speed).map(|()| speed)
}
