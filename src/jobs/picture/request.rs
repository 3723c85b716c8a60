//! The request for pictures.

use super::values::{
    BeyondSpec, ClearSpec, Convention, Detail, Exaggeration, HexColour, ModeName, PointSpec, SliceSpec, SurfaceList,
    Theme, ViewAngles,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use wavesplat_core::base::choice;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::base::position::RegionSpec;
use wavesplat_core::base::values::{FrameList, Pair, Triple, Whole};
use wavesplat_core::colour::{Norm, Opacities};
use wavesplat_engine::render::annotate::Parts;
use wavesplat_engine::render::sink::{Depth, PictureFormat};
use wavesplat_engine::render::{Limit, Quantity, SplatSource};

/// What a user asks of pictures, before a file is open. Fields have the names, values and defaults of the options of
/// `wavesplat-render`, whose help explains them. As JSON, every field may be left out, and takes the text that its option
/// takes, or a number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PictureRequest {
    /// The file of the pictures, a pattern like `frame_%04d.png`, or `-` for standard output.
    #[serde(skip)]
    pub output: PathBuf,
    /// Azimuth and elevation of each view, in degrees; none for the usual one.
    pub view: Vec<ViewAngles>,
    /// Views around the vertical axis for each view.
    pub orbit: u32,
    /// Whether the frames are spread over the views.
    pub over_time: bool,
    /// A file of camera positions over time.
    pub key_frames: Option<PathBuf>,
    /// Degrees by which the picture is turned counter-clockwise.
    pub roll: f64,
    /// Width and height in pixels.
    pub size: Whole<2>,
    /// Pixels per world unit; by default, the volume fits.
    pub scale: Option<f64>,
    /// The world point in the middle; by default, the volume's centre.
    pub center: Option<Triple>,
    /// The factor by which heights are drawn taller.
    pub exaggerate: Exaggeration,
    /// The frames; by default all.
    pub frames: Option<FrameList>,
    /// The voxels; by default all.
    pub region: Option<RegionSpec>,
    /// Planes through the volume.
    pub slice: Vec<SliceSpec>,
    /// The side of a patient at the right of slices.
    #[serde(with = "choice")]
    pub convention: Convention,
    /// Attenuation per world unit of depth.
    pub tau: f64,
    /// Standard deviation of the kernel in world units; by default 0.75 of the largest spacing, or along the ray 0.75 voxels of each axis.
    pub sigma: Option<f64>,
    /// Error that splatting may add, as a share of the range.
    pub splat_error: Option<f64>,
    /// The level of detail.
    pub lod: Detail,
    /// Whether an estimated splat error is enough.
    pub fast: bool,
    /// Error that pictures may have, as a share of the range.
    pub tolerance: Option<f64>,
    /// The error that the tolerance limits.
    #[serde(with = "choice")]
    pub error: Limit,
    /// The file for pictures of the certified error.
    pub error_image: Option<PathBuf>,
    /// Whether pictures come with an error bound for every pixel, for the caller.
    #[serde(skip)]
    pub certify: bool,
    /// What a pixel of a projection shows.
    #[serde(with = "choice")]
    pub quantity: Quantity,
    /// How the samples along a ray make a pixel; by default, other fields imply it.
    #[serde(with = "choice::optional")]
    pub mode: Option<ModeName>,
    /// Name or file of the colours of samples.
    pub transfer_function: Option<String>,
    /// Opacities at shares of the range.
    pub opacity: Option<Opacities>,
    /// Length over which the opacities apply, in world units.
    pub opacity_unit: Option<f64>,
    /// Isosurfaces.
    pub iso: Option<SurfaceList>,
    /// Whether a composite is shaded.
    pub shade: bool,
    /// Degrees by which the lamp stands to the right of the viewer, and above.
    pub light: Option<Pair>,
    /// Slices per voxel along the ray.
    pub slices: Option<usize>,
    /// Name or file of the colours of values.
    pub colormap: Option<String>,
    /// The values of the first and the last colour.
    pub range: Option<Pair>,
    /// How values are spread over the range.
    #[serde(with = "choice")]
    pub norm: Norm,
    /// Values that show the background.
    pub clear: ClearSpec,
    /// The value that short rays meet beyond the volume.
    pub beyond: BeyondSpec,
    /// The background; by default that of the theme.
    pub background: Option<HexColour>,
    /// The parts that are drawn around the volume.
    pub annotate: Option<Parts>,
    /// A title above the volume.
    pub title: Option<String>,
    /// The label of the colour bar, instead of the values' name and unit.
    pub bar_title: Option<String>,
    /// Colours of background and letters.
    #[serde(with = "choice")]
    pub theme: Theme,
    /// What is splatted.
    #[serde(with = "choice")]
    pub method: SplatSource,
    /// A value that means "missing" in frames.
    pub missing_value: Option<f64>,
    /// Whether damaged blocks are shown as missing samples.
    pub skip_damaged: bool,
    /// The format of the pictures; by default that of the output's extension.
    #[serde(with = "choice::optional")]
    pub format: Option<PictureFormat>,
    /// Bits per colour channel of a PNG.
    #[serde(with = "choice")]
    pub depth: Depth,
    /// Frames per second of a movie.
    pub fps: f64,
    /// Time of the data per second of a movie; sets the frames per second.
    pub speed: Option<f64>,
    /// The file for the report.
    pub sidecar: Option<PathBuf>,
    /// Whether any existing files are replaced.
    pub force: bool,
    /// Points whose time series are written instead of pictures.
    pub probe: Vec<PointSpec>,
    /// Regions whose time series are written instead of pictures.
    pub probe_region: Vec<RegionSpec>,
    /// Whether a partial sum is written instead of pictures.
    pub partial: bool,
    /// Whether the inputs are partial sums.
    pub sum: bool,
}

impl Default for PictureRequest {
    fn default() -> Self {
        Self {
            output: PathBuf::new(),
            view: Vec::new(),
            orbit: 1,
            over_time: false,
            key_frames: None,
            roll: 0.0,
            size: Whole([512, 512]),
            scale: None,
            center: None,
            exaggerate: Exaggeration::Auto,
            frames: None,
            region: None,
            slice: Vec::new(),
            convention: Convention::Neurological,
            tau: 0.0,
            sigma: None,
            splat_error: None,
            lod: Detail::Level(0),
            fast: false,
            tolerance: None,
            error: Limit::Certified,
            error_image: None,
            certify: false,
            quantity: Quantity::Mean,
            mode: None,
            transfer_function: None,
            opacity: None,
            opacity_unit: None,
            iso: None,
            shade: false,
            light: None,
            slices: None,
            colormap: None,
            range: None,
            norm: Norm::Linear,
            clear: ClearSpec::Auto,
            beyond: BeyondSpec::Auto,
            background: None,
            annotate: None,
            title: None,
            bar_title: None,
            theme: Theme::Dark,
            method: SplatSource::Coefficients,
            missing_value: None,
            skip_damaged: false,
            format: None,
            depth: Depth::Eight,
            fps: 25.0,
            speed: None,
            sidecar: None,
            force: false,
            probe: Vec::new(),
            probe_region: Vec::new(),
            partial: false,
            sum: false,
        }
    }
}

impl PictureRequest {
    /// Reads a request from JSON.
    ///
    /// # Errors
    /// A text that is no JSON object, an unknown field, a wrong value, or fields that exclude one another.
    pub fn from_json(json: &str) -> Result<Self> {
        let given: Map<String, Value> = serde_json::from_str(json).map_err(wrong)?;
        let request = Self::default().with(&given)?;
        let pairs = given.keys().flat_map(|a| given.keys().map(move |b| (a, b)));
        if let Some((a, b)) = pairs.into_iter().find(|(a, b)| exclude(a, b)) {
            return Err(wrong(format!("`{a}` cannot be used with `{b}`")));
        }
        request.check().map(|()| request)
    }

    /// This request with other values of some fields.
    pub(super) fn with(&self, given: &Map<String, Value>) -> Result<Self> {
        for (name, value) in given {
            let alone = Map::from_iter([(name.clone(), value.clone())]);
            serde_json::from_value::<Self>(alone.into()).map_err(|e| wrong(format!("`{name}`: {e}")))?;
        }
        let mut fields = self.fields()?;
        fields.extend(given.clone());
        let changed: Self = serde_json::from_value(fields.into()).map_err(wrong)?;
        // JSON has no NaN.
        let missing_value = changed.missing_value.or(self.missing_value);
        Ok(Self { output: self.output.clone(), certify: self.certify, missing_value, ..changed })
    }

    /// An error unless all numbers are within their limits.
    fn check(&self) -> Result<()> {
        if !(1..=MOST_VIEWS).contains(&self.orbit) {
            return Err(Error::setting("orbit", format!("takes 1 to {MOST_VIEWS} views, not {}", self.orbit)));
        }
        check_fps(self.fps).map_err(|what| Error::setting("fps", what))?;
        self.speed.map_or(Ok(()), |speed| check_speed(speed).map_err(|what| Error::setting("speed", what)))
    }

    /// The options of `wavesplat-render` that ask for the same.
    ///
    /// # Errors
    /// Paths that are no Unicode.
    pub fn words(&self) -> Result<Vec<String>> {
        let usual = Self::default().fields()?;
        let given = self.fields()?.into_iter().filter(|(name, value)| usual.get(name) != Some(value));
        Ok(given.flat_map(|(name, value)| words_of(&name, &value)).collect())
    }

    /// Whether time series are asked for instead of pictures.
    pub(super) fn is_for_series(&self) -> bool {
        !self.probe.is_empty() || !self.probe_region.is_empty()
    }

    /// Whether anything is drawn around the volume.
    pub(super) fn is_annotated(&self) -> bool {
        self.annotate.is_some() || self.title.is_some() || self.bar_title.is_some()
    }

    /// Whether data goes to standard output.
    pub(super) fn writes_to_stdout(&self) -> bool {
        self.output == Path::new(STANDARD)
    }

    fn fields(&self) -> Result<Map<String, Value>> {
        serde_json::to_value(self).and_then(serde_json::from_value).map_err(wrong)
    }
}

/// The error of a text that is no request.
pub(super) fn wrong(what: impl Display) -> Error {
    Error::setting("request", what.to_string())
}

/// The most views of an orbit.
pub const MOST_VIEWS: u32 = 3600;

/// The least and the largest number of frames per second.
pub(crate) const SLOWEST: f64 = 0.02;
pub(crate) const FASTEST: f64 = 1000.0;

/// An error that says which numbers are allowed, unless this is a valid frame rate.
pub fn check_fps(fps: f64) -> std::result::Result<(), String> {
    let is_sound = (SLOWEST..=FASTEST).contains(&fps);
    if is_sound { Ok(()) } else { Err(format!("a number from {SLOWEST} to {FASTEST}")) }
}

/// An error that says which numbers are allowed, unless this is a valid speed of time.
pub fn check_speed(speed: f64) -> std::result::Result<(), String> {
    if speed.is_finite() && speed > 0.0 { Ok(()) } else { Err("a number above 0".into()) }
}

/// Fields for how finished pictures are coloured and written.
const FINISH: [&str; 13] = [
    "colormap",
    "range",
    "norm",
    "clear",
    "beyond",
    "background",
    "bar_title",
    "theme",
    "format",
    "depth",
    "fps",
    "speed",
    "sidecar",
];

/// Whether a request has a field of this name.
pub fn is_field(name: &str) -> bool {
    static FIELDS: LazyLock<Map<String, Value>> =
        LazyLock::new(|| PictureRequest::default().fields().unwrap_or_default());
    FIELDS.contains_key(name)
}

/// Whether two fields cannot be given together.
pub fn exclude(a: &str, b: &str) -> bool {
    a != b && (excludes(a, b) || excludes(b, a))
}

fn excludes(field: &str, other: &str) -> bool {
    match field {
        "lod" | "skip_damaged" => ["error_image", "tolerance"].contains(&other),
        "fast" => ["splat_error", "error_image"].contains(&other),
        "slice" => ["sigma", "splat_error"].contains(&other),
        "key_frames" => ["view", "orbit", "over_time"].contains(&other),
        "speed" => other == "fps",
        "probe" | "probe_region" => {
            is_other(other, &["probe", "probe_region", "frames", "force", "missing_value", "skip_damaged"])
        }
        "partial" => FINISH.contains(&other) || other == "error_image",
        // A sum takes from its parts what else they have.
        "sum" => !FINISH.contains(&other) && is_other(other, &["partial", "frames", "force", "annotate", "title"]),
        _ => false,
    }
}

/// Whether a name is that of a field which is not among some. Inputs and how they are read are no fields.
fn is_other(name: &str, fields: &[&str]) -> bool {
    !fields.contains(&name) && is_field(name)
}

/// The name of the option of a field.
pub(crate) fn option(field: &str) -> String {
    field.replace('_', "-")
}

fn words_of(name: &str, value: &Value) -> Vec<String> {
    let option = format!("--{}", option(name));
    match value {
        Value::Null | Value::Bool(false) => Vec::new(),
        Value::Bool(true) => vec![option],
        Value::Array(all) => all.iter().flat_map(|value| words_of(name, value)).collect(),
        Value::String(text) => vec![format!("{option}={text}")],
        other => vec![format!("{option}={other}")],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_takes_the_texts_of_options_and_gives_them_back() {
        let json = r#"{"view": ["top", "10,-20.5"], "size": "60x40", "frames": "2:9:3", "range": "-1.0,2.5", "depth": 16,
            "lod": 1, "iso": "0.5,40%:ff0000", "slice": ["z=#3"], "annotate": "box,axes", "shade": true}"#;
        let request = PictureRequest::from_json(json).expect("a request");
        let words = [
            "annotate=box,axes",
            "depth=16",
            "frames=2:9:3",
            "iso=0.5,40%:ff0000",
            "lod=1",
            "range=-1.0,2.5",
            "shade",
            "size=60x40",
            "slice=z=#3",
            "view=180,90",
            "view=10,-20.5",
        ];
        let mut all = request.words().expect("plain paths");
        all.sort();
        let mut expected = words.map(|word| ["--", word].concat());
        expected.sort();
        assert_eq!(all, expected);
        assert_eq!(PictureRequest::from_json("{}").expect("all defaults"), PictureRequest::default());
    }

    #[test]
    fn json_that_is_no_request_is_refused_with_the_name_of_the_field() {
        for (json, named) in [
            ("", "request"),
            ("[]", "request"),
            (r#"{"nonsense": 1}"#, "nonsense"),
            (r#"{"output": "/tmp/a"}"#, "output"),
            (r#"{"size": "large"}"#, "size"),
            (r#"{"orbit": 0}"#, "orbit"),
            (r#"{"orbit": 3601}"#, "orbit"),
            (r#"{"orbit": -1}"#, "orbit"),
            (r#"{"fps": 0}"#, "fps"),
            (r#"{"speed": -1}"#, "speed"),
            (r#"{"lod": 1, "tolerance": 0.1}"#, "tolerance"),
            (r#"{"probe": ["0,0,0"], "colormap": "grey"}"#, "colormap"),
        ] {
            let error = PictureRequest::from_json(json).expect_err(json).to_string();
            assert!(error.contains(named), "{json}: {error}");
        }
    }
}
