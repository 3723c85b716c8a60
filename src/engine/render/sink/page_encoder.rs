//! Pictures as a web page takes them: a description, and blocks of pictures.

use super::{Depth, Rendered, SinkConfig, png};
use crate::render::annotate::{Annotation, angles_of};
use crate::render::page::{About, Planes, Sequence, opening, spread};
use crate::render::{Picture, Pixel, ViewReport};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::colour::{Norm, Rgb};

/// Most pictures of a block, and most bytes of their numbers.
const PICTURES: usize = 32;
const BLOCK_BYTES: usize = 64 << 20;

/// Steps of a colour scale that codes resolve: colours are off by less than one of 256 steps where they change nine times
/// as fast as greys do.
const STEPS: f64 = 5000.0;
/// The same for light.
const STEPS_OF_LIGHT: f64 = 550.0;

/// Values below this share of a logarithmic range are shown as this.
const FLOOR: f64 = 1e-2;

/// The description of pictures, and those that wait for their block.
pub struct PageEncoder {
    config: SinkConfig,
    annotation: Annotation,
    about: About,
    /// The sequence of the waiting pictures.
    sequence: usize,
    waiting: Planes,
    /// How many pictures of each sequence are already in blocks.
    given: Vec<usize>,
    /// How much there is to see in each picture of the first sequence.
    spreads: Vec<f64>,
}

/// Which pictures a block has.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct BlockOfFrames {
    pub(crate) sequence: usize,
    /// The first of its pictures in the sequence.
    pub(crate) first: usize,
    pub(crate) count: usize,
}

/// Takes the pictures of a complete block.
pub(crate) type Give<'a> = dyn FnMut(BlockOfFrames, Planes) -> Result<()> + 'a;

/// The most memory that the pictures of a block take.
pub(super) fn memory(size: [usize; 2], pictures: usize) -> usize {
    let picture = size[0].saturating_mul(size[1]).saturating_mul(Pixel::Light.numbers() * size_of::<f32>());
    picture.saturating_mul(pictures.min(PICTURES)).min(BLOCK_BYTES.max(picture))
}

/// Pictures in a block, if each has so many bytes.
fn per_block(picture: usize) -> usize {
    (BLOCK_BYTES / picture.max(1)).clamp(1, PICTURES)
}

impl PageEncoder {
    /// An encoder without frames.
    pub fn new(config: SinkConfig) -> Result<Self> {
        let annotation = config.annotation.clone().unwrap_or_default();
        let about = About::new(config.pixel, config.size, &config.colours, &annotation)?;
        let views = config.shown.iter().map(|(view, _)| view + 1).max().unwrap_or(0);
        let about = About {
            fps: config.fps,
            sequences: sequences(&config.shown),
            backdrops: vec![None; views],
            rays: vec![None; views],
            beyond: config.weighing.as_ref().map_or(0.0, |weighing| weighing.beyond),
            settings: serde_json::to_value(&*config.provenance).unwrap_or_default(),
            ..about
        };
        let about = about.with_times(&annotation);
        let (waiting, given) = (no_pictures(&config), vec![0; about.sequences.len()]);
        Ok(Self { config, annotation, about, sequence: 0, waiting, given, spreads: Vec::new() })
    }

    /// The description of the pictures, complete after the last one.
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Adds the picture of a rendering. Gives the block that it completes, and the one before if the sequence changes.
    pub fn picture(&mut self, rendered: &Rendered<'_>, give: &mut Give<'_>) -> Result<()> {
        let Some(picture) = self.config.shown_of(rendered) else { return Ok(()) };
        let holds = |sequence: &Sequence| sequence.pictures.contains(&(rendered.view, rendered.frame));
        let Some(sequence) = self.about.sequences.iter().position(holds) else { return Ok(()) };
        self.see(rendered, sequence)?;
        if sequence != self.sequence {
            self.rest(give)?;
            self.sequence = sequence;
        }
        self.push(picture);
        if self.waiting.pictures() == per_block(size_of_val(picture)) { self.rest(give) } else { Ok(()) }
    }

    /// Takes note of how much there is to see in a picture of the first sequence, so that the page opens well.
    pub(super) fn look(&mut self, rendered: &Rendered<'_>) {
        let holds = |sequence: &Sequence| sequence.pictures.contains(&(rendered.view, rendered.frame));
        if let Some(picture) =
            self.config.shown_of(rendered).filter(|_| self.about.sequences.first().is_some_and(holds))
        {
            self.spreads.push(spread(picture));
        }
    }

    /// Gives the waiting pictures.
    pub fn rest(&mut self, give: &mut Give<'_>) -> Result<()> {
        let waiting = std::mem::replace(&mut self.waiting, no_pictures(&self.config));
        let (count, given) = (waiting.pictures(), &mut self.given);
        self.about.opening = opening(&self.spreads, self.spreads.len() / 2);
        if count == 0 {
            return Ok(());
        }
        let block = BlockOfFrames { sequence: self.sequence, first: given[self.sequence], count };
        given[self.sequence] += count;
        give(block, waiting)
    }

    fn push(&mut self, picture: Picture<'_>) {
        let floor = FLOOR * self.config.colours.range().0;
        let log = |value: f32| libm::log(f64::from(value).max(floor)) as f32;
        let is_log = is_log(&self.config);
        self.waiting.push(picture, |value| if is_log && !value.is_nan() { log(value) } else { value });
    }

    /// Describes a view at its first picture.
    fn see(&mut self, rendered: &Rendered<'_>, sequence: usize) -> Result<()> {
        let Some(view) = rendered.views.get(rendered.view) else { return Ok(()) };
        let sequence = &mut self.about.sequences[sequence];
        if sequence.label.is_empty() {
            sequence.label = angles_of(view);
        }
        if self.about.backdrops[rendered.view].is_none() {
            self.about.backdrops[rendered.view] = self.backdrop(view)?;
        }
        let weighing = self.config.weighing.as_ref();
        self.about.rays[rendered.view] = weighing.and_then(|weighing| weighing.rays.seen(view, self.config.size));
        Ok(())
    }

    /// The backdrop of a view: a PNG that lies behind its pictures. `None` if nothing is drawn there.
    fn backdrop(&self, view: &ViewReport) -> Result<Option<String>> {
        let (size, background) = (self.config.size, self.config.colours.background());
        let mut pixels = vec![background; size[0] * size[1]];
        self.annotation.draw_still(&mut pixels, size, background, view);
        let is_drawn = pixels.iter().any(|pixel| *pixel != background);
        is_drawn.then(|| self.address(&pixels)).transpose()
    }

    /// The address of a PNG that it contains whole.
    fn address(&self, pixels: &[Rgb]) -> Result<String> {
        let eight = SinkConfig { depth: Depth::Eight, ..self.config.clone() };
        let mut file = Vec::new();
        let packed = png::write(&eight, self.config.size, &[], pixels.as_flattened(), &mut file);
        packed.map_err(|e| Error::io(Path::new("page"), "packing a PNG", e))?;
        Ok(format!("data:image/png;base64,{}", BASE64.encode(file)))
    }

    /// The step of codes, in the unit of the numbers.
    pub fn step(&self) -> f32 {
        let (lo, hi) = self.config.colours.range();
        let step = match self.config.pixel {
            Pixel::Light => 1.0 / STEPS_OF_LIGHT,
            Pixel::Value if is_log(&self.config) => libm::log(hi / lo) / STEPS,
            Pixel::Value | Pixel::Channels => (hi - lo) / STEPS,
        };
        (step as f32).max(f32::MIN_POSITIVE)
    }
}

fn no_pictures(config: &SinkConfig) -> Planes {
    Planes::new(config.size, config.pixel.numbers(), is_log(config))
}

/// Whether numbers are logarithms of values.
fn is_log(config: &SinkConfig) -> bool {
    config.pixel == Pixel::Value && config.colours.norm() == Norm::Log
}

/// The pictures of each view; all pictures in one sequence if each has a view and a frame of its own.
fn sequences(shown: &[(usize, usize)]) -> Vec<Sequence> {
    let is_moving = shown.len() > 1 && shown.windows(2).all(|two| two[0].0 < two[1].0) && shown[0].1 != shown[1].1;
    if is_moving {
        return vec![Sequence { label: "moving".into(), pictures: shown.to_vec() }];
    }
    let mut found: Vec<Sequence> = Vec::new();
    for &(view, frame) in shown {
        match found.iter_mut().find(|sequence| sequence.pictures[0].0 == view) {
            Some(sequence) => sequence.pictures.push((view, frame)),
            None => found.push(Sequence { label: String::new(), pictures: vec![(view, frame)] }),
        }
    }
    found
}
