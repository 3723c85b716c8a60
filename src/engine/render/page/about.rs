//! The data that a page needs to show its pictures: colours, times and texts.

use crate::render::Pixel;
use crate::render::annotate::Annotation;
use crate::render::ray_lengths::SeenRays;
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::Serialize;
use std::collections::BTreeMap;
use wavesplat_core::base::error::Result;
use wavesplat_core::colour::{NAMES, Norm, Rgb, Scale, TransferFunction};

/// Colours of a map that a page gets; it interpolates between them.
const COLOURS: u32 = 512;

/// The data for the script of a page. Texts from files are data here, and never become markup.
#[derive(Debug, Clone, Serialize)]
pub struct About {
    pub(crate) title: String,
    /// Name and unit of the values.
    pub(crate) values: String,
    /// Width and height in pixels.
    pub(crate) size: [usize; 2],
    /// The meaning of a pixel's numbers.
    pub(crate) kind: &'static str,
    pub(crate) background: Rgb,
    /// The values of the first and the last colour.
    pub(crate) range: (f64, f64),
    /// Whether colours are spread by the logarithm of values.
    pub(crate) log: bool,
    /// The least and the largest value that show the background, and the distance from them at which colours are full.
    pub(crate) clear: Option<[f64; 3]>,
    /// Colours at even shares, in base64, of the map of the pictures and of all named ones.
    pub(crate) maps: BTreeMap<String, String>,
    /// The map of the pictures.
    pub(crate) map: String,
    /// Pictures per second.
    pub(crate) fps: f64,
    /// The time of each frame.
    pub(crate) labels: BTreeMap<usize, String>,
    pub(crate) sequences: Vec<Sequence>,
    /// The picture of a sequence that is shown first.
    pub(crate) opening: usize,
    /// The backdrop of each view, which lies behind its pictures, as the address of a PNG.
    pub(crate) backdrops: Vec<Option<String>>,
    /// The rays of each view, by whose lengths its values are weighed before they are coloured.
    pub(crate) rays: Vec<Option<SeenRays>>,
    /// The value beyond the volume, with which values are weighed.
    pub(crate) beyond: f32,
    /// How the pictures were made.
    pub(crate) settings: serde_json::Value,
}

/// Pictures that follow one another.
#[derive(Debug, Clone, Serialize)]
pub struct Sequence {
    pub(crate) label: String,
    /// View and frame of each picture.
    pub(crate) pictures: Vec<(usize, usize)>,
}

impl About {
    /// The description of pictures in these colours, still without pictures.
    pub(crate) fn new(pixel: Pixel, size: [usize; 2], colours: &Scale, annotation: &Annotation) -> Result<Self> {
        let map = colours.map().name().unwrap_or("own").to_string();
        let mut maps = maps()?;
        maps.insert(map.clone(), table(colours.map(), colours.background()));
        Ok(Self {
            title: annotation.title.clone(),
            values: annotation.values.clone(),
            size,
            kind: kind(pixel),
            background: colours.background(),
            range: colours.range(),
            log: colours.norm() == Norm::Log,
            clear: colours.clear().map(|clear| [clear.lo, clear.hi, clear.fade]),
            maps,
            map,
            fps: 25.0,
            labels: BTreeMap::new(),
            sequences: Vec::new(),
            opening: 0,
            backdrops: Vec::new(),
            rays: Vec::new(),
            beyond: 0.0,
            settings: serde_json::Value::Null,
        })
    }

    /// The same for a page that knows the named maps.
    pub fn without_maps(&self) -> Self {
        let mut maps = self.maps.clone();
        maps.retain(|name, _| !NAMES.contains(&name.as_str()));
        Self { maps, ..self.clone() }
    }

    /// Names the frames of the pictures by their times.
    pub(crate) fn with_times(mut self, annotation: &Annotation) -> Self {
        let frames = self.sequences.iter().flat_map(|sequence| &sequence.pictures).map(|(_, frame)| *frame);
        self.labels = frames.map(|frame| (frame, annotation.stamp(frame))).collect();
        self
    }
}

/// The colours of all named maps.
pub fn maps() -> Result<BTreeMap<String, String>> {
    let named = |name: &str| Ok((name.to_string(), table(&TransferFunction::open(name)?.over((0.0, 1.0))?, [0; 3])));
    NAMES.into_iter().map(named).collect()
}

/// Colours at even shares of the range, two bytes for each number, in base64.
fn table(map: &TransferFunction, background: Rgb) -> String {
    let background = || background.map(|number| f64::from(number) / 255.0);
    let at = |i| map.colour(f64::from(i) / f64::from(COLOURS)).unwrap_or_else(background);
    let deep = |number: f64| ((number * 65535.0).round() as u16).to_le_bytes();
    BASE64.encode((0..=COLOURS).flat_map(at).flat_map(deep).collect::<Vec<u8>>())
}

fn kind(pixel: Pixel) -> &'static str {
    match pixel {
        Pixel::Value => "value",
        Pixel::Channels => "channels",
        Pixel::Light => "light",
    }
}
