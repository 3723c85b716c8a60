//! A request of the viewer's page. The page is not trusted: it may set a few fields, and can name no file.

use super::request::{PictureRequest, wrong};
use serde::Deserialize;
use serde_json::{Map, Value};
use wavesplat_core::base::error::Result;
use wavesplat_core::colour::NAMES;

/// The fields that a page may set.
const FIELDS: [&str; 19] = [
    "annotate",
    "beyond",
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
/// Most surfaces, slices, opacities or ranges of frames.
const MOST_ITEMS: usize = 16;
/// Longest text of a field, in bytes.
const MOST_LETTERS: usize = 1000;

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
    /// Whether the page asks before its user does.
    #[serde(default)]
    pub(super) ahead: bool,
    /// The file that is asked for, if one is.
    pub(super) file: Option<Saved>,
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

    /// The request for pictures that draws this, with the other settings of `base`. The page alone chooses the mode,
    /// with its surfaces and slices.
    ///
    /// # Errors
    /// A base with paths that are no Unicode.
    pub fn applied_to(&self, base: &PictureRequest) -> Result<PictureRequest> {
        let base = PictureRequest { mode: None, iso: None, slice: Vec::new(), ..base.clone() };
        Ok(PictureRequest { certify: self.certify, ..base.with(&self.look)? })
    }
}

/// A kind of file that the page saves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum Saved {
    /// One picture.
    #[serde(rename = "picture.png")]
    Picture,
    /// A page of all frames.
    #[serde(rename = "page.html")]
    Page,
    /// A movie of all frames.
    #[serde(rename = "movie.mp4")]
    Movie,
}

impl Saved {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture.png",
            Self::Page => "page.html",
            Self::Movie => "movie.mp4",
        }
    }
}

fn check_field(name: &str, value: &Value) -> Result<()> {
    let texts = || value.as_array().into_iter().flatten().chain([value]).filter_map(Value::as_str);
    let items = texts().map(|text| text.split(',').count()).sum::<usize>();
    let most = if name == "view" { 2 } else { MOST_ITEMS }; // the angles of a view
    if !FIELDS.contains(&name) {
        return Err(wrong(format!("unknown field `{name}`")));
    }
    if items > most || texts().any(|text| text.len() > MOST_LETTERS) {
        return Err(wrong(format!("{name}: takes at most {most} parts and {MOST_LETTERS} letters")));
    }
    let is_colours = ["colormap", "transfer_function"].contains(&name);
    if is_colours && !value.as_str().is_some_and(|map| NAMES.contains(&map)) {
        return Err(wrong(format!("{name}: takes one of {}", NAMES.join(" "))));
    }
    Ok(())
}
