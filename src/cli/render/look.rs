//! A request of the viewer, and the options of `wavesplat-render` that draw it.

use crate::base::error::{Error, Result};
use crate::colour::NAMES;
use serde::Deserialize;

/// Most pixels along a side, most frames, and most surfaces or slices of a request.
const MOST_PIXELS: usize = 4096;
const MOST_FRAMES: usize = 4096;
const MOST_PLACES: usize = 16;

/// A request for pictures. It holds only numbers and known names, and never names a file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    mode: LookMode,
    /// Azimuth and elevation in degrees.
    view: [f64; 2],
    /// Pixels per world unit.
    scale: f64,
    /// The world point in the middle.
    center: [f64; 3],
    /// Width and height in pixels.
    size: [usize; 2],
    /// The level of detail: every 2^lod-th voxel.
    #[serde(default)]
    lod: u32,
    /// The first frame, and the end (exclusive).
    frames: [usize; 2],
    /// The values of the first and the last colour.
    range: Option<[f64; 2]>,
    #[serde(default)]
    log: bool,
    /// The least and the largest value that show the background; none are clear if this is empty.
    clear: Option<Vec<f64>>,
    /// The name of the colours.
    map: Option<String>,
    /// Shares of the range, and their opacities.
    opacity: Option<Vec<[f64; 2]>>,
    #[serde(default)]
    shade: bool,
    /// Values of isosurfaces.
    #[serde(default)]
    iso: Vec<f64>,
    /// Places of slices along x, y or z, as shares of the axis.
    #[serde(default)]
    slices: Vec<(Axis, f64)>,
    /// Whether to draw the box and the axes.
    #[serde(default)]
    annotate: bool,
    #[serde(default)]
    light: bool,
    /// Whether to bound the error of every pixel.
    #[serde(default)]
    pub(super) certify: bool,
    /// Whether to answer in few bytes, for slow networks.
    #[serde(default)]
    pub(super) packed: bool,
}

/// How the samples along a ray make a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum LookMode {
    Mean,
    Mip,
    Composite,
    Iso,
    Slice,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Axis {
    X,
    Y,
    Z,
}

impl Look {
    /// Reads a request.
    ///
    /// # Errors
    /// A text that is no request, or one for too much.
    pub fn read(json: &[u8]) -> Result<Self> {
        let look: Self = serde_json::from_slice(json).map_err(|e| Error::usage(format!("not a request: {e}")))?;
        look.check().map_or(Ok(look), |what| Err(Error::usage(what)))
    }

    /// What is wrong with the request, if anything is.
    fn check(&self) -> Option<String> {
        let places = self.iso.len().max(self.slices.len()).max(self.opacity.as_ref().map_or(0, Vec::len));
        let [first, end] = self.frames;
        let map = self.map.as_deref().filter(|map| !NAMES.contains(map));
        match () {
            () if self.size.iter().any(|side| !(1..=MOST_PIXELS).contains(side)) => {
                Some(format!("size: sides are 1 to {MOST_PIXELS} pixels"))
            }
            () if first >= end || end - first > MOST_FRAMES => Some(format!("frames: 1 to {MOST_FRAMES} of them")),
            () if places > MOST_PLACES => Some(format!("at most {MOST_PLACES} surfaces, slices or opacities")),
            () => map.map(|map| format!("map: '{map}' is not one of {}", NAMES.join(" "))),
        }
    }

    /// Refuses pictures of more numbers than half of the memory takes.
    pub(super) fn check_memory(&self, numbers: usize, memory: usize) -> Result<()> {
        let numbers = self.size[0] * self.size[1] * numbers * (self.frames[1] - self.frames[0]);
        let bytes = numbers.saturating_mul(2 * size_of::<f32>());
        if bytes <= memory / 2 {
            return Ok(());
        }
        Err(Error::setting(
            "memory",
            format!("{memory} bytes are too few for this many frames at once: they take {bytes}"),
        ))
    }

    /// Whether a frame is wanted.
    pub(super) fn wants(&self, frame: usize) -> bool {
        (self.frames[0]..self.frames[1]).contains(&frame)
    }

    /// The options of `wavesplat-render` that draw this, and all other frames too if their values determine the colours.
    pub(super) fn options_of_colours(&self) -> Vec<String> {
        let mut options = self.options();
        if self.range.is_none() {
            options.retain(|option| !option.starts_with("--frames="));
        }
        options
    }

    /// The options of `wavesplat-render` that draw this.
    pub fn options(&self) -> Vec<String> {
        let [azimuth, elevation] = self.view;
        let [width, height] = self.size;
        let [x, y, z] = self.center.map(short);
        let [first, end] = self.frames;
        let mut options = vec![
            format!("--view={azimuth},{elevation}"),
            format!("--scale={}", short(self.scale)),
            format!("--center={x},{y},{z}"),
            format!("--size={width}x{height}"),
            if end == first + 1 { format!("--frames={first}") } else { format!("--frames={first}:{end}") },
        ];
        options.extend(self.mode_options());
        options.extend(self.colour_options());
        if self.lod > 0 {
            options.push(format!("--lod={}", self.lod));
        }
        if self.annotate {
            options.push("--annotate=box,axes".into());
        }
        if self.light {
            options.push("--theme=light".into());
        }
        options
    }

    fn mode_options(&self) -> Vec<String> {
        let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let mut options = match self.mode {
            LookMode::Mean => vec![],
            LookMode::Mip => vec!["--mode=mip".into()],
            LookMode::Composite => vec!["--mode=composite".into()],
            LookMode::Iso => vec![format!("--iso={}", list(&self.iso))],
            LookMode::Slice => vec!["--mode=slice".into()],
        };
        if matches!(self.mode, LookMode::Slice | LookMode::Composite) {
            let place = |(axis, share): &(Axis, f64)| format!("--slice={}={}%", axis.name(), 100.0 * share);
            options.extend(self.slices.iter().map(place));
        }
        if self.shade && matches!(self.mode, LookMode::Composite) {
            options.push("--shade".into());
        }
        options
    }

    fn colour_options(&self) -> Vec<String> {
        let is_of_samples = matches!(self.mode, LookMode::Composite | LookMode::Iso);
        let option = if is_of_samples { "--transfer-function" } else { "--colormap" };
        let mut options: Vec<String> = self.map.iter().map(|map| format!("{option}={map}")).collect();
        options.extend(self.range.map(|range| range.map(short)).map(|[lo, hi]| format!("--range={lo},{hi}")));
        if is_of_samples {
            let points = |points: &Vec<[f64; 2]>| {
                points.iter().map(|[share, opacity]| format!("{share}:{opacity}")).collect::<Vec<_>>().join(",")
            };
            let opacity = self.opacity.as_ref().filter(|_| self.mode == LookMode::Composite).map(points);
            options.extend(opacity.map(|points| format!("--opacity={points}")));
            return options;
        }
        if self.log {
            options.push("--norm=log".into());
        }
        if self.mode != LookMode::Slice {
            options.extend(self.clear.as_ref().map(|clear| match clear[..] {
                [lo, hi] => format!("--clear={},{}", short(lo), short(hi)),
                _ => "--clear=none".into(),
            }));
        }
        options
    }
}

/// A number with nine significant digits: a picture of 4096 pixels shows no more.
fn short(number: f64) -> f64 {
    format!("{number:.8e}").parse().unwrap_or(number)
}

impl Axis {
    fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }
}
