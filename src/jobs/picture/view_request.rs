//! A request of the viewer's page. The page is not trusted: it may set a few fields, and can name no file.

use super::request::PictureRequest;
use serde::Deserialize;
use serde_json::{Map, Value};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::colour::NAMES;

/// The fields that a page may set.
const FIELDS: [&str; 18] = [
    "annotate",
    "center",
    "clear",
    "colormap",
    "frames",
    "iso",
    "lod",
    "mode",
    "norm",
    "opacity",
    "range",
    "scale",
    "shade",
    "size",
    "slice",
    "theme",
    "transfer_function",
    "view",
];

/// Most pixels along a side of a picture.
const MOST_PIXELS: usize = 4096;
/// Most surfaces, slices, opacities, views or ranges of frames.
const MOST_PLACES: usize = 16;

/// A request for pictures.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewRequest {
    /// Fields of a [`PictureRequest`]. Others are as the viewer was started with.
    look: Map<String, Value>,
    /// Whether to bound the error of every pixel.
    #[serde(default)]
    pub(super) certify: bool,
    /// Whether to answer in few bytes, for slow networks.
    #[serde(default)]
    pub(super) packed: bool,
}

impl ViewRequest {
    /// Reads a request.
    ///
    /// # Errors
    /// A text that is no request, or one for too much.
    pub fn read(json: &[u8]) -> Result<Self> {
        let mut request: Self = serde_json::from_slice(json).map_err(|e| wrong(format!("not a request: {e}")))?;
        request.look.retain(|_, value| !value.is_null());
        request.look.iter().try_for_each(|(name, value)| check_field(name, value))?;
        let [width, height] = PictureRequest::default().with(&request.look)?.size.0;
        if [width, height].iter().any(|side| !(1..=MOST_PIXELS).contains(side)) {
            return Err(wrong(format!("size: sides are 1 to {MOST_PIXELS} pixels")));
        }
        Ok(request)
    }

    /// The request for pictures that draws this, with the other settings of `base`.
    ///
    /// # Errors
    /// A base that is no JSON, such as one with paths that are no Unicode.
    pub fn applied_to(&self, base: &PictureRequest) -> Result<PictureRequest> {
        Ok(PictureRequest { certify: self.certify, ..base.with(&self.look)? })
    }
}

fn check_field(name: &str, value: &Value) -> Result<()> {
    let places = value.as_array().map_or(0, Vec::len).max(value.as_str().map_or(0, |text| text.split(',').count()));
    let is_colours = ["colormap", "transfer_function"].contains(&name);
    match () {
        () if !FIELDS.contains(&name) => Err(wrong(format!("unknown field `{name}`"))),
        () if places > MOST_PLACES => Err(wrong(format!("{name}: at most {MOST_PLACES} places"))),
        () if is_colours && !value.as_str().is_some_and(|map| NAMES.contains(&map)) => {
            Err(wrong(format!("{name}: takes one of {}", NAMES.join(" "))))
        }
        () => Ok(()),
    }
}

fn wrong(what: String) -> Error {
    Error::setting("request", what)
}
