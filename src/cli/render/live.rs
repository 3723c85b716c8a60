//! Pictures for a page that asks for them: facts about a scene, a page with them, and pictures by request.

use super::args::Cli;
use super::look::Look;
use super::ranges;
use super::scene::Opened;
use super::work::Work;
use super::{Prepared, parsed};
use crate::base::error::{Error, Result};
use crate::render::annotate::AxisLabels;
use crate::render::page::{self, Planes};
use crate::render::sink::{Film, Place};
use crate::render::{Pixel, render};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::Path;

/// Options that no request changes, and what they apply to.
#[derive(Debug, Clone)]
pub struct Scenery {
    /// Coefficient file or frames.
    pub inputs: Vec<OsString>,
    /// Other options of `wavesplat-render`.
    pub options: Vec<OsString>,
}

/// What a page is told before it asks for pictures.
#[derive(Debug, Serialize)]
struct Facts {
    live: bool,
    /// The name of the file.
    title: String,
    /// Name and unit of the values.
    values: String,
    /// The time of each frame.
    labels: Vec<String>,
    /// The point in the middle of the volume as it is drawn, and half of its diagonal.
    center: [f64; 3],
    radius: f64,
    /// Voxels along x, y and z, the place of the first, and their distance.
    dims: [usize; 3],
    origin: [f64; 3],
    spacing: [f64; 3],
    /// The meaning of x, y and z.
    axes: [AxisLabels; 3],
    /// The least and the largest sample, if the file says.
    range: Option<(f64, f64)>,
    /// The coarsest level of detail.
    coarsest: u32,
    maps: BTreeMap<String, String>,
}

/// What stands before the blocks of an answer.
#[derive(Serialize)]
struct Answer<'a> {
    about: &'a page::About,
    /// The blocks behind this, and their lengths in bytes.
    blocks: Vec<(Place, usize)>,
    /// The largest error of each pixel, as one more block of this many bytes behind the others.
    errors: Option<usize>,
}

impl Scenery {
    /// The program that does what options say.
    fn program(&self, options: &[String], output: &Path) -> Result<Cli> {
        let mut words = self.options.clone();
        words.extend(options.iter().map(OsString::from));
        words.extend(["-o".into(), output.into(), "--".into()]);
        words.extend(self.inputs.iter().cloned());
        parsed(words)
    }

    /// The page that shows a scene of these [`Self::facts`].
    pub fn page(facts: &str, nonce: &str) -> Result<String> {
        page::live(nonce, facts).map_err(|e| Error::io(Path::new("page"), "writing", e))
    }

    /// What the page is told about the scene, as JSON.
    pub fn facts(&self) -> Result<String> {
        serde_json::to_string(&self.known()?).map_err(|e| Error::usage(e.to_string()))
    }

    fn known(&self) -> Result<Facts> {
        let cli = self.program(&[], Path::new(PAGE))?;
        let Opened { scene, file, annotation, axes, .. } = cli.scene()?;
        let grid = file.as_ref().map_or(*scene.grid(), |file| file.whole_grid());
        let sides: [f64; 3] = std::array::from_fn(|axis| grid.spacing[axis] * grid.dims[axis] as f64);
        let middle = |axis: usize| grid.origin[axis] + (sides[axis] - grid.spacing[axis]) / 2.0;
        let name = self.inputs.first().and_then(|input| Path::new(input).file_name());
        Ok(Facts {
            live: true,
            title: name.unwrap_or_default().to_string_lossy().into_owned(),
            labels: (0..scene.frames().unwrap_or(0)).map(|frame| annotation.stamp(frame)).collect(),
            values: annotation.values,
            center: [0, 1, 2].map(middle),
            radius: sides.iter().map(|side| side * side).sum::<f64>().sqrt() / 2.0,
            dims: grid.dims,
            origin: grid.origin,
            spacing: grid.spacing,
            axes: axes.labels(),
            range: file.as_ref().map(|file| file.source_range()),
            coarsest: file.as_ref().map_or(0, |file| file.coarsest_detail()),
            maps: page::maps()?,
        })
    }

    /// The pictures of a request: their description, then blocks of their numbers. `web/live.js` reads it.
    ///
    /// # Errors
    /// Those of rendering, more numbers than fit in memory, or [`Error::Cancelled`].
    pub fn pictures(&self, look: &Look, work: &Work) -> Result<Vec<u8>> {
        let cli = self.program(&look.options_of_colours(), Path::new(PAGE))?;
        let Prepared { mut scene, mut config, targets, colouring, provenance, annotation, .. } = cli.prepared()?;
        config.certify = look.certify;
        config.frames.retain(|frame| look.wants(*frame));
        if config.frames.is_empty() {
            return Err(Error::usage("frames: the archive has none of these"));
        }
        let mut sink = cli.sink_config(&config, &targets.0, &colouring, (&provenance, annotation))?;
        sink.shown = config.shown();
        look.check_memory(sink.pixel.numbers(), config.memory)?;
        let (size, pixel, failed) = (sink.size, sink.pixel, |e| Error::io(Path::new("page"), "writing", e));
        let (mut film, mut blocks, mut errors) = (Film::new(sink)?, Vec::new(), Planes::new(size, 1, false));
        let step = film.step();
        let packed = |planes: Planes| if look.packed { planes.coded(step) } else { planes.raw() }.map_err(failed);
        let mut give = |place: Place, planes: Planes| {
            blocks.push((place, packed(planes)?));
            Ok(())
        };
        render(scene.as_mut(), &config, work, &mut |rendered| {
            if let Some(error) = rendered.error.filter(|_| pixel == Pixel::Value) {
                errors.push(error, |value| value);
            }
            film.picture(&rendered, &mut give)
        })?;
        film.rest(&mut give)?;
        let errors = (errors.pictures() > 0).then(|| errors.raw().map_err(failed)).transpose()?;
        let answer = Answer {
            about: &film.about().without_maps(),
            blocks: blocks.iter().map(|(place, block)| (*place, block.len())).collect(),
            errors: errors.as_ref().map(Vec::len),
        };
        let head = page::headed(&answer).map_err(failed)?;
        Ok(blocks.into_iter().map(|(_, block)| block).chain(errors).fold(head, |mut all, block| {
            all.extend(block);
            all
        }))
    }

    /// The time series of a point, as `--probe` writes it: lines of comma-separated values. X, Y and Z are shares of the
    /// axes.
    ///
    /// # Errors
    /// Inputs that are no coefficient file, or reads that fail.
    pub fn series(&self, shares: [f64; 3]) -> Result<Vec<u8>> {
        let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), "creating a folder", e))?;
        let path = folder.path().join("series.csv");
        let pictures = |word: &OsString| word.to_string_lossy().starts_with("--method=");
        let options = self.options.iter().filter(|word| !pictures(word)).cloned().collect();
        let probe = Self { options, ..self.clone() };
        let [x, y, z] = shares.map(|share| 100.0 * share);
        probe.program(&[format!("--probe={x}%,{y}%,{z}%")], &path)?.probe()?;
        std::fs::read(&path).map_err(|e| Error::io(&path, "reading", e))
    }

    /// How many samples of some frames lie in each of 64 equal parts of the range of all.
    ///
    /// # Errors
    /// Those of rendering.
    pub fn histogram(&self, _: &Work) -> Result<Vec<usize>> {
        let cli = self.program(&[], Path::new(PAGE))?;
        let Prepared { mut scene, config, .. } = cli.prepared()?;
        let samples = ranges::distribution(scene.as_mut(), &config, &cli.common)?;
        let mut counts = vec![0; BARS];
        let samples = samples.as_ref().map_or(&[][..], |samples| samples.values());
        if let [first, .., last] = *samples {
            let bar = |value: f32| (f64::from(value - first) / f64::from(last - first) * BARS as f64) as usize;
            samples.iter().for_each(|value| counts[bar(*value).min(BARS - 1)] += 1);
        }
        Ok(counts)
    }

    /// The file of the pictures of a request.
    pub fn save(&self, look: &Look, saved: Saved, work: &Work) -> Result<Vec<u8>> {
        let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), "creating a folder", e))?;
        let path = folder.path().join(saved.name());
        let cli = self.program(&look.options(), &path)?;
        let Prepared { mut scene, config, targets, colouring, provenance, annotation, .. } = cli.prepared()?;
        let mut sinks = cli.sinks(&config, (&targets.0, None), &colouring, (&provenance, annotation))?;
        render(scene.as_mut(), &config, work, &mut |rendered| sinks.picture(&rendered))?;
        sinks.finish()?;
        std::fs::read(&path).map_err(|e| Error::io(&path, "reading", e))
    }

    /// The command that draws a request.
    pub fn command(&self, look: &Look, saved: Saved) -> String {
        let words =
            |words: &[OsString]| words.iter().map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>();
        let mut all = words(&self.inputs);
        all.extend(
            words(&self.options).into_iter().filter(|word| !IMPLIED.iter().any(|start| word.starts_with(start))),
        );
        all.extend(look.options());
        all.extend(["-o".into(), saved.name().into()]);
        all.iter().fold("wavesplat-render".into(), |line, word| line + " " + &quoted(word))
    }
}

/// A kind of file that the page saves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Saved {
    /// One picture.
    Picture,
    /// A page of all frames.
    Page,
    /// A movie of all frames.
    Movie,
}

impl Saved {
    const NAMES: [(&'static str, Self); 3] =
        [("picture.png", Self::Picture), ("page.html", Self::Page), ("movie.mp4", Self::Movie)];

    /// The kind of a file of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::NAMES.into_iter().find(|(known, _)| *known == name).map(|(_, saved)| saved)
    }

    fn name(self) -> &'static str {
        Self::NAMES.into_iter().find(|(_, saved)| *saved == self).map_or("picture.png", |(name, _)| name)
    }
}

/// Parts of a histogram.
const BARS: usize = 64;

/// Options that a command need not repeat.
const IMPLIED: [&str; 2] = ["--method=coefficients", "--memory="];

/// The format of the pictures of a page. No file of this name is written.
const PAGE: &str = "live.html";

/// A word as shells take it.
fn quoted(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-_=.,/:%@+".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
