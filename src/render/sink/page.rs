//! A web page that holds its pictures, and opens from a disk without a server.

use super::{Depth, Picture, Rendered, SinkConfig};
use crate::base::error::{Error, Result};
use crate::base::output::Output;
use crate::colour::Norm;
use crate::render::annotate::{Annotation, angles_of};
use crate::render::page::{self, About, Planes, Sequence};
use crate::render::{Pixel, ViewReport};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;

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

/// A page in work.
pub(super) struct Page {
    out: Output,
    about: About,
    annotation: Annotation,
    nonce: String,
    block: Waiting,
    /// How many pictures of each sequence are written.
    written: Vec<usize>,
}

/// Pictures of a sequence that wait for their block to be written.
struct Waiting {
    sequence: usize,
    planes: Planes,
}

/// The most memory that the pictures of a block take.
pub(super) fn memory(size: [usize; 2], pictures: usize) -> usize {
    let picture = size[0].saturating_mul(size[1]).saturating_mul(Pixel::Light.numbers() * size_of::<f32>());
    picture.saturating_mul(pictures.min(PICTURES)).min(BLOCK_BYTES.max(picture))
}

/// Pictures in a block, if each has so many bytes.
fn per_block(picture: usize) -> usize {
    (BLOCK_BYTES / picture.max(1)).clamp(1, PICTURES)
}

impl Page {
    /// Begins the page.
    pub(super) fn new(mut out: Output, config: &SinkConfig) -> Result<Self> {
        let annotation = config.annotation.clone().unwrap_or_default();
        let about = About::new(config.pixel, config.size, &config.colours, &annotation)?;
        let about = About {
            fps: config.fps,
            sequences: sequences(&config.shown),
            backdrops: vec![None; config.shown.iter().map(|(view, _)| view + 1).max().unwrap_or(0)],
            settings: serde_json::to_value(&*config.provenance).unwrap_or_default(),
            ..about
        };
        let about = about.with_times(&annotation);
        let nonce = page::nonce(&about);
        let begun = page::begin(&mut out, (&config.provenance.software, &nonce), &about);
        begun.map_err(|e| Error::io(out.path(), "writing", e))?;
        let block = Waiting { sequence: 0, planes: Planes::new(config.size, config.pixel.numbers(), is_log(config)) };
        let written = vec![0; about.sequences.len()];
        Ok(Self { out, about, annotation, nonce, block, written })
    }

    /// Adds a picture. Writes the block that it completes, and the one before if the sequence changes.
    pub(super) fn picture(&mut self, config: &SinkConfig, rendered: &Rendered<'_>, picture: Picture<'_>) -> Result<()> {
        let holds = |sequence: &Sequence| sequence.pictures.contains(&(rendered.view, rendered.frame));
        let Some(sequence) = self.about.sequences.iter().position(holds) else { return Ok(()) };
        self.see(config, rendered, sequence)?;
        if sequence != self.block.sequence {
            self.write(config)?;
            self.block.sequence = sequence;
        }
        let is_log = is_log(config);
        let floor = FLOOR * config.colours.range().0;
        let log = |value: f32| libm::log(f64::from(value).max(floor)) as f32;
        self.block.planes.push(picture, |value| if is_log && !value.is_nan() { log(value) } else { value });
        if self.block.planes.pictures() == per_block(size_of_val(picture)) { self.write(config) } else { Ok(()) }
    }

    /// Describes a view at its first picture.
    fn see(&mut self, config: &SinkConfig, rendered: &Rendered<'_>, sequence: usize) -> Result<()> {
        let Some(view) = rendered.views.get(rendered.view) else { return Ok(()) };
        let at = (rendered.view, rendered.frame);
        let sequence = &mut self.about.sequences[sequence];
        if sequence.pictures[0] == at && sequence.label.is_empty() {
            sequence.label = angles_of(view);
        }
        if self.about.backdrops[rendered.view].is_none() {
            self.about.backdrops[rendered.view] = self.backdrop(config, view)?;
        }
        Ok(())
    }

    /// Writes the waiting pictures.
    fn write(&mut self, config: &SinkConfig) -> Result<()> {
        let Waiting { sequence, planes } = &mut self.block;
        let empty = Planes::new(config.size, config.pixel.numbers(), is_log(config));
        let planes = std::mem::replace(planes, empty);
        let place = (*sequence, self.written[*sequence], planes.pictures());
        if planes.pictures() == 0 {
            return Ok(());
        }
        self.written[*sequence] += planes.pictures();
        let written = planes.coded(step(config)).and_then(|block| page::write_block(&mut self.out, place, &block));
        written.map_err(|e| Error::io(self.out.path(), "writing", e))
    }

    /// What lies behind the pictures of a view, if anything does.
    fn backdrop(&self, config: &SinkConfig, view: &ViewReport) -> Result<Option<String>> {
        let mut pixels = vec![config.colours.background(); config.size[0] * config.size[1]];
        self.annotation.draw_still(&mut pixels, (config.size, config.colours.background()), view);
        if pixels.iter().all(|pixel| *pixel == config.colours.background()) {
            return Ok(None);
        }
        let mut file = Vec::new();
        let eight = SinkConfig { depth: Depth::Eight, ..config.clone() };
        let packed = super::png::write(&eight, config.size, &[], pixels.as_flattened(), &mut file);
        packed.map_err(|e| Error::io(self.out.path(), "packing what lies behind pictures", e))?;
        Ok(Some(format!("data:image/png;base64,{}", BASE64.encode(file))))
    }

    /// Writes the rest, and gives the file its final name.
    pub(super) fn finish(mut self, config: &SinkConfig) -> Result<()> {
        self.write(config)?;
        let ended = page::end(&mut self.out, &self.nonce, &self.about);
        ended.map_err(|e| Error::io(self.out.path(), "writing", e))?;
        self.out.commit()
    }
}

/// Whether codes are those of logarithms.
fn is_log(config: &SinkConfig) -> bool {
    config.pixel == Pixel::Value && config.colours.norm() == Norm::Log
}

/// The step of codes, in the unit of the numbers.
fn step(config: &SinkConfig) -> f32 {
    let (lo, hi) = config.colours.range();
    let step = match config.pixel {
        Pixel::Light => 1.0 / STEPS_OF_LIGHT,
        Pixel::Value if is_log(config) => libm::log(hi / lo) / STEPS,
        Pixel::Value | Pixel::Channels => (hi - lo) / STEPS,
    };
    (step as f32).max(f32::MIN_POSITIVE)
}

/// The pictures of each view; all pictures in one sequence if each has a view of its own.
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
