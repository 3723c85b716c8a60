//! A request of the viewer's page. It may hold only numbers and known names, since the page is not trusted.

use super::request::PictureRequest;
use super::values::{AxisPosition, ClearSpec, Detail, ModeName, SliceSpec, SurfaceList, Theme, ViewAngles};
use serde::Deserialize;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::values::{Numbers, Whole};
use wavesplat_core::colour::{NAMES, Norm, Opacities, OpacityPoints};
use wavesplat_engine::render::annotate::Parts;

/// Most pixels along a side, most frames, and most surfaces or slices of a request.
const MOST_PIXELS: usize = 4096;
const MOST_FRAMES: usize = 4096;
const MOST_PLACES: usize = 16;

/// A request for pictures. It holds only numbers and known names, and never names a file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewRequest {
    mode: ViewMode,
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
enum ViewMode {
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

impl ViewRequest {
    /// Reads a request.
    ///
    /// # Errors
    /// A text that is no request, or one for too much.
    pub fn read(json: &[u8]) -> Result<Self> {
        let request: Self =
            serde_json::from_slice(json).map_err(|e| Error::setting("request", format!("not a request: {e}")))?;
        request.check().map_or(Ok(request), |what| Err(Error::setting("request", what)))
    }

    /// The problem with the request, if there is one.
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

    /// The request for pictures that draws this, with the other settings of `base`.
    pub fn applied_to(&self, base: &PictureRequest) -> PictureRequest {
        let [azimuth, elevation] = self.view;
        let [first, end] = self.frames;
        let mode = self.mode;
        let colours_samples = matches!(mode, ViewMode::Composite | ViewMode::Iso);
        let mut request = PictureRequest {
            view: vec![ViewAngles([azimuth, elevation])],
            scale: Some(short(self.scale)),
            center: Some(Numbers(self.center.map(short))),
            size: Whole(self.size),
            frames: Some((first..end).into()),
            shade: self.shade && mode == ViewMode::Composite,
            certify: self.certify,
            ..base.clone()
        };
        match mode {
            ViewMode::Mean => {}
            ViewMode::Mip => request.mode = Some(ModeName::Mip),
            ViewMode::Composite => request.mode = Some(ModeName::Composite),
            ViewMode::Iso => (request.mode, request.iso) = (Some(ModeName::Iso), SurfaceList::at_values(&self.iso)),
            ViewMode::Slice => request.mode = Some(ModeName::Slice),
        }
        if matches!(mode, ViewMode::Slice | ViewMode::Composite) {
            request.slice = self.slices.iter().map(|(axis, share)| slice(*axis, *share)).collect();
        }
        if let Some(map) = &self.map {
            let colours = if colours_samples { &mut request.transfer_function } else { &mut request.colormap };
            *colours = Some(map.clone());
        }
        if let Some(range) = self.range {
            request.range = Some(Numbers(range.map(short)));
        }
        if let Some(points) = self.opacity.as_ref().filter(|_| mode == ViewMode::Composite) {
            let points = points.iter().map(|[share, opacity]| (*share, *opacity)).collect();
            request.opacity = Some(Opacities::Points(OpacityPoints(points)));
        }
        if self.log && !colours_samples {
            request.norm = Norm::Log;
        }
        if let Some(clear) = self.clear.as_ref().filter(|_| !colours_samples && mode != ViewMode::Slice) {
            request.clear = clear_spec(clear);
        }
        if self.lod > 0 {
            request.lod = Detail::Level(self.lod);
        }
        if self.annotate {
            request.annotate = Some(Parts { bounds: true, axes: true, ..Parts::NONE });
        }
        if self.light {
            request.theme = Theme::Light;
        }
        request
    }

    /// As [`Self::applied_to`], for all other frames too if their values determine the colours.
    pub(super) fn applied_for_colours(&self, base: &PictureRequest) -> PictureRequest {
        let request = self.applied_to(base);
        let frames = if self.range.is_none() { base.frames.clone() } else { request.frames.clone() };
        PictureRequest { frames, ..request }
    }
}

/// A slice at a share of an axis.
fn slice(axis: Axis, share: f64) -> SliceSpec {
    SliceSpec { axis: axis.name().into(), position: AxisPosition::Share(share) }
}

fn clear_spec(clear: &[f64]) -> ClearSpec {
    match clear {
        [lo, hi] => ClearSpec::Values(Numbers([short(*lo), short(*hi)])),
        _ => ClearSpec::Nothing,
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
