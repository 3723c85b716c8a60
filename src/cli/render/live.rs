//! Pictures for a page that asks for them: facts about a scene, a page with them, and pictures by request.

use super::args::Cli;
use super::look::Look;
use super::ranges;
use super::scene::Opened;
use super::work::Work;
use super::{Prepared, parsed};
use crate::base::address::public_name;
use crate::base::error::{Error, Result};
use crate::cli::remote::KeptOpen;
use crate::colour::Distribution;
use crate::render::annotate::AxisLabels;
use crate::render::page::{self, Planes};
use crate::render::sink::{Film, Place};
use crate::render::{Mode, Pixel, render};
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
    /// The remote file of the pictures.
    pub(crate) open: KeptOpen,
}

/// The facts about the scene that a page gets before it asks for pictures.
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

/// The head of an answer, which comes before its blocks.
#[derive(Serialize)]
struct Answer<'a> {
    about: &'a page::About,
    /// The blocks that follow, and their lengths in bytes.
    blocks: Vec<(Place, usize)>,
    /// Bytes of one more block after the others, with the largest error of each pixel.
    errors: Option<usize>,
    /// The opacities of a composite, at shares of its range.
    opacity: Option<Vec<(f64, f64)>>,
}

/// A histogram of values.
#[derive(Debug, Serialize)]
pub struct Histogram {
    /// The least and the largest value.
    range: Option<(f64, f64)>,
    /// How many values lie in each of equal parts of the range.
    counts: Vec<usize>,
    /// A value with a surface: halfway from the most common value to the end that is farther from it.
    surface: Option<f64>,
}

impl Scenery {
    /// The program that does what options say.
    fn program(&self, options: &[String], output: &Path) -> Result<Cli> {
        let mut words = self.options.clone();
        words.extend(options.iter().map(OsString::from));
        words.extend(["-o".into(), output.into(), "--".into()]);
        words.extend(self.inputs.iter().cloned());
        let cli: Cli = parsed(words)?;
        Ok(Cli { remote: cli.remote.clone().sharing(self.open.clone()), ..cli })
    }

    /// Opens a remote file that has changed again for the next picture.
    pub fn reopen_after(&self, error: &Error) {
        if error.exit_code() == 4 {
            self.open.forget();
        }
    }

    /// The page that shows a scene of these [`Self::facts`].
    pub fn page(facts: &str, nonce: &str) -> Result<String> {
        page::live(nonce, facts).map_err(|e| Error::io(Path::new("page"), "writing", e))
    }

    /// The facts about the scene for the page, as JSON.
    pub fn facts(&self) -> Result<String> {
        serde_json::to_string(&self.known()?).map_err(|e| Error::usage(e.to_string()))
    }

    fn known(&self) -> Result<Facts> {
        let cli = self.program(&[], Path::new(PAGE))?;
        let Opened { scene, file, annotation, axes, .. } = cli.scene()?;
        let grid = file.as_ref().map_or(*scene.grid(), |file| file.whole_grid());
        let sides: [f64; 3] = std::array::from_fn(|axis| grid.spacing[axis] * grid.dims[axis] as f64);
        let middle = |axis: usize| grid.origin[axis] + (sides[axis] - grid.spacing[axis]) / 2.0;
        let name = self.inputs.first().map(|input| public_name(Path::new(input)));
        let name = name.as_deref().and_then(Path::file_name);
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
            opacity: opacities(&config.mode),
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

    /// How common samples of a frame are, or samples of some frames.
    ///
    /// # Errors
    /// A frame that the archive lacks, or those of rendering.
    pub fn histogram(&self, frame: Option<usize>) -> Result<Histogram> {
        let mut options = vec!["--range=0,1".into(), "--clear=none".into()]; // no small pictures are needed
        options.extend(frame.map(|frame| format!("--frames={frame}")));
        let cli = self.program(&options, Path::new(PAGE))?;
        let Prepared { mut scene, config, .. } = cli.prepared()?;
        let samples = match frame {
            Some(frame) => ranges::distribution_of(scene.as_mut(), (&config, &[frame]), &cli.common)?,
            None => ranges::distribution(scene.as_mut(), &config, &cli.common)?,
        };
        Ok(samples
            .as_ref()
            .map_or_else(|| Histogram { range: None, counts: Vec::new(), surface: None }, Histogram::new))
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
        all.extend(look.certify.then(|| "--error-image=error.npy".into()));
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

impl Histogram {
    fn new(samples: &Distribution) -> Self {
        let (values, mut counts) = (samples.values(), vec![0; BARS]);
        let range = values.first().zip(values.last()).map(|(lo, hi)| (f64::from(*lo), f64::from(*hi)));
        let Some((lo, hi)) = range else { return Self { range, counts, surface: None } };
        let bar = |value: f32| ((f64::from(value) - lo) / (hi - lo) * BARS as f64) as usize;
        values.iter().for_each(|value| counts[bar(*value).min(BARS - 1)] += 1);
        let common = samples.empty((lo, hi)).or_else(|| samples.common((lo, hi))).map_or(lo, |common| common.value);
        let end = if hi - common >= common - lo { hi } else { lo };
        Self { range, counts, surface: Some((common + end) / 2.0) }
    }
}

/// The opacities of a composite, at shares of its range.
fn opacities(mode: &Mode) -> Option<Vec<(f64, f64)>> {
    let Mode::Composite { transfer, .. } = mode else { return None };
    let (lo, hi) = transfer.range();
    Some(transfer.opacity_points().iter().map(|(value, opacity)| ((value - lo) / (hi - lo), *opacity)).collect())
}

/// Parts of a histogram: many more than a page draws, for it may draw a part of the range.
const BARS: usize = 2048;

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
