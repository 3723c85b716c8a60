//! Pictures for a page that asks for them: facts about a scene, a page with them, and pictures by request.

use super::plan::Plan;
use super::plan::config::{frames_of, render_config};
use super::plan::modes::{self, mode_name};
use super::plan::opened::Opened;
use super::plan::opening::{Opening, opening_of};
use super::plan::ranges::distribution;
use super::plan::ranges::distribution_of_frames;
use super::reporter::Caller;
use super::request::{PictureRequest, option};
use super::series::series_csv;
use super::session::Session;
use super::values::{ModeName, PointSpec, ViewAngles};
use super::view_request::{Saved, ViewRequest};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use wavesplat_core::base::address::public_name;
use wavesplat_core::base::cancel::CancelToken;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;
use wavesplat_core::base::position::AxisPosition;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::base::temporary::TemporaryFolder;
use wavesplat_core::colour::Distribution;
use wavesplat_engine::render::annotate::AxisLabels;
use wavesplat_engine::render::page::{self, Planes};
use wavesplat_engine::render::sink::{BlockOfFrames, PageEncoder, Sink, SinkConfig};
use wavesplat_engine::render::{Mode, Pixel, render};

/// A viewer: open inputs, and the settings that no request of the page changes.
#[derive(Debug)]
pub struct ViewerSession {
    pub(super) session: Session,
    pub(super) base: PictureRequest,
    /// Words for how the inputs are opened.
    input_words: Vec<String>,
    /// Bytes of memory for answers.
    answers: usize,
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
    /// The frame and the mode that are shown first.
    opening: usize,
    mode: &'static str,
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
    /// Most numbers of an answer.
    numbers: usize,
    maps: BTreeMap<String, String>,
    /// Where a page without a server finds the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<FileOfPage>,
}

/// A file that a page opens by itself.
#[derive(Debug, Serialize)]
pub(super) struct FileOfPage {
    /// Its name.
    pub(super) name: String,
    /// Its address, and that of the program, if they are not within the page.
    pub(super) url: Option<String>,
    pub(super) program: Option<String>,
    /// Its length in bytes.
    pub(super) length: u64,
    /// The settings of all pictures.
    pub(super) request: PictureRequest,
    /// A picture of what the page shows first, which shows until the program has started.
    pub(super) preview: Option<Preview>,
    /// Bytes of memory for coarse pictures, and for others.
    pub(super) memory: [usize; 2],
}

/// A square picture with all of the volume.
#[derive(Debug, Serialize)]
pub(super) struct Preview {
    /// A packed answer, in base64.
    answer: String,
    /// Pixels of a world unit.
    scale: f64,
}

/// The head of an answer, which comes before its blocks.
#[derive(Serialize)]
struct Answer<'a> {
    about: &'a page::About,
    /// The blocks that follow, and their lengths in bytes.
    blocks: Vec<(BlockOfFrames, usize)>,
    /// Bytes of one more block after the others, with the largest error of each pixel.
    errors: Option<usize>,
    /// The opacities of a composite, at shares of its range.
    opacity: Option<Vec<(f64, f64)>>,
}

/// A histogram of values.
#[derive(Debug, Serialize)]
pub(super) struct Histogram {
    /// The least and the largest value.
    range: Option<(f64, f64)>,
    /// How many values lie in each of equal parts of the range.
    counts: Vec<usize>,
    /// A value with a surface: halfway from the most common value to the farther end of the values, without rare ones.
    surface: Option<f64>,
}

impl ViewerSession {
    /// A viewer of some inputs; `base` has the settings of all pictures. The commands that it gives have `input_words` for
    /// how the inputs are opened.
    pub fn new(session: &Session, base: PictureRequest, input_words: Vec<String>) -> Self {
        let answers = session.memory / ANSWERS_SHARE;
        let session = session.with_memory(session.memory - answers).keeping_decoded();
        Self { session, base: PictureRequest { output: PAGE.into(), ..base }, input_words, answers }
    }

    /// Bytes of memory for finished answers until they are sent. Pictures in the making take the rest.
    pub fn memory_of_answers(&self) -> usize {
        self.answers
    }

    /// Opens a file that has changed again for the next picture.
    pub fn reopen_after(&self, error: &Error) {
        if error.exit_code() == 4 {
            self.session.reopen();
        }
    }

    /// The page that shows a scene of these [`Self::facts`].
    pub fn page(facts: &str, nonce: &str) -> Result<String> {
        let mut page = Vec::new();
        let written = page::write_asking(&mut page, nonce, "wavesplat", facts, page::Engine::Server);
        let text = written.and_then(|()| String::from_utf8(page).map_err(std::io::Error::other));
        text.map_err(|e| Error::io(Path::new("page"), "writing", e))
    }

    /// The facts about the scene for the page, as JSON.
    pub fn facts(&self) -> Result<String> {
        self.facts_with(None)
    }

    /// The same for a page that opens the file by itself.
    pub(super) fn facts_with(&self, mut file: Option<FileOfPage>) -> Result<String> {
        let known = self.known()?;
        if let Some(file) = &mut file {
            file.preview = self.preview(&known)?;
        }
        serde_json::to_string(&Facts { file, ..known }).map_err(|e| Error::setting("facts", e.to_string()))
    }

    /// A small picture of what the page shows first. None if the page chooses a surface or a slice.
    fn preview(&self, Facts { mode, opening, center: [x, y, z], radius, .. }: &Facts) -> Result<Option<Preview>> {
        const SIDE: f64 = 256.0;
        if [ModeName::Iso, ModeName::Slice].iter().any(|chosen| chosen.name() == *mode) {
            return Ok(None);
        }
        let scale = 0.95 * SIDE / (2.0 * radius); // the page repeats its edge, which is beyond the volume
        let request = json!({ "packed": true, "look": {
            "mode": mode, "frames": opening.to_string(), "size": format!("{SIDE}x{SIDE}"), "scale": scale,
            "view": ["30,30"], "center": format!("{x},{y},{z}"), "shade": false,
        }});
        let answer = self.pictures(&ViewRequest::read(request.to_string().as_bytes())?, &CancelToken::default())?;
        Ok(Some(Preview { answer: page::base64(&answer), scale }))
    }

    fn known(&self) -> Result<Facts> {
        // The page gives a view with every request: a section is not stretched as it would be face-on.
        let base = PictureRequest { view: vec![ViewAngles([0.0; 2])], ..self.base.clone() };
        let Opened { mut scene, file, annotation, axes, .. } = Opened::new(&self.session, &base, &Caller(&Silent))?;
        let grid = file.as_ref().map_or(*scene.grid(), |file| file.whole_grid());
        let sides: [f64; 3] = std::array::from_fn(|axis| grid.spacing[axis] * grid.dims[axis] as f64);
        let middle = |axis: usize| grid.origin[axis] + (sides[axis] - grid.spacing[axis]) / 2.0;
        let frames = frames_of(&self.base, scene.frames().unwrap_or(0))?;
        let opening = opening_of(scene.as_mut(), file.as_deref(), &frames, self.session.memory, &Silent)?;
        Ok(Facts {
            live: true,
            title: self.session.paths().first().map(|input| shown_name(input)).unwrap_or_default(),
            labels: (0..scene.frames().unwrap_or(0)).map(|frame| annotation.stamp(frame)).collect(),
            opening: opening.frame,
            mode: self.first_mode(opening).name(),
            values: annotation.values,
            center: [0, 1, 2].map(middle),
            radius: sides.iter().map(|side| side * side).sum::<f64>().sqrt() / 2.0,
            dims: grid.dims,
            origin: grid.origin,
            spacing: grid.spacing,
            axes: axes.labels(),
            range: file.as_ref().map(|file| file.source_range()),
            coarsest: file.as_ref().map_or(0, |file| file.coarsest_detail()),
            numbers: (self.session.memory / BYTES_PER_NUMBER / 4).min(MOST_NUMBERS),
            maps: page::maps()?,
            file: None,
        })
    }

    /// The mode that the viewer was started with, or else the one that shows its first frame best.
    fn first_mode(&self, opening: Opening) -> ModeName {
        let is_given = self.base.mode.is_some() || self.base.iso.is_some() || !self.base.slice.is_empty();
        if is_given {
            return mode_name(&self.base);
        }
        let takes =
            |mode: &ModeName| modes::check(&PictureRequest { mode: Some(*mode), ..self.base.clone() }, false).is_ok();
        [opening.mode, ModeName::Composite].into_iter().find(takes).unwrap_or(ModeName::Projection)
    }

    /// The pictures of a request: their description, then blocks of their numbers, as `engine/render/page/web/live.js`
    /// reads them.
    ///
    /// # Errors
    /// Those of rendering, more numbers than fit in memory, or [`Error::Cancelled`].
    pub(super) fn pictures(&self, view: &ViewRequest, work: &CancelToken) -> Result<Vec<u8>> {
        let request = view.applied_to(&self.base)?;
        let session = if view.ahead { self.session.ahead() } else { self.session.clone() };
        let mut plan = Plan::new(&session, &self.with_frames_for_colours(&request), &Caller(work))?;
        let wanted = frames_of(&request, plan.scene.frames().unwrap_or(0))?;
        plan.config.frames.retain(|frame| wanted.binary_search(frame).is_ok());
        if plan.config.frames.is_empty() {
            return Err(Error::setting("frames", "the viewer shows none of these"));
        }
        let sink = SinkConfig { shown: plan.config.shown(), ..plan.sinks(&request).config()? };
        check_memory(&sink, plan.config.memory)?;
        Answer::encode(&mut plan, sink, view.packed, work)
    }

    /// The request for all frames of the viewer if their values determine the colours.
    fn with_frames_for_colours(&self, request: &PictureRequest) -> PictureRequest {
        let decides = if request.range.is_none() { &self.base } else { request };
        PictureRequest { frames: decides.frames.clone(), ..request.clone() }
    }

    /// The time series of a point, in the format of `probe`: lines of comma-separated values. X, Y and Z are shares of
    /// the axes.
    ///
    /// # Errors
    /// Inputs that are no coefficient file, or reads that fail.
    pub(super) fn series(&self, shares: [f64; 3], work: &CancelToken) -> Result<Vec<u8>> {
        let probe = vec![PointSpec(shares.map(AxisPosition::Share))];
        series_csv(&self.session, &PictureRequest { probe, ..self.base.clone() }, &Caller(work))
    }

    /// How common samples of a frame are, or samples of some frames.
    ///
    /// # Errors
    /// A frame that the archive lacks, or those of rendering.
    pub(super) fn histogram(&self, frame: Option<usize>, work: &CancelToken) -> Result<Histogram> {
        let frames = frame.map_or(self.base.frames.clone(), |frame| Some((frame..frame + 1).into()));
        let (request, caller) = (PictureRequest { frames, ..self.base.clone() }, Caller(work));
        let Opened { mut scene, file, distributions, colours, axes, .. } =
            Opened::new(&self.session, &request, &caller)?;
        let all = scene.frames().unwrap_or(0);
        let memory = self.session.memory;
        let config = render_config(&request, scene.as_ref(), file.as_deref(), &axes, colours.as_ref(), all, memory)?;
        let samples = match frame {
            Some(frame) => distribution_of_frames(scene.as_mut(), &distributions, &config, vec![frame], &caller)?,
            None => distribution(scene.as_mut(), &distributions, &config, None, &caller)?,
        };
        Ok(samples
            .as_deref()
            .map_or_else(|| Histogram { range: None, counts: Vec::new(), surface: None }, Histogram::new))
    }

    /// The file of the pictures of a request, made in memory; ffmpeg alone needs a file for a movie.
    pub(super) fn save(&self, view: &ViewRequest, saved: Saved, work: &CancelToken) -> Result<Vec<u8>> {
        if saved != Saved::Movie {
            let (out, bytes) = Output::to_memory(saved.name(), self.session.memory);
            self.write(view, saved, out, work)?;
            return Ok(bytes.try_recv().unwrap_or_default());
        }
        let folder = TemporaryFolder::new()?;
        let path = folder.path().join(saved.name());
        self.write(view, saved, Output::create(&path, true)?, work)?;
        std::fs::read(&path).map_err(|e| Error::io(&path, "reading", e))
    }

    /// Writes the pictures of a request.
    fn write(&self, view: &ViewRequest, saved: Saved, out: Output, work: &CancelToken) -> Result<()> {
        let output = saved.name().into();
        let request = PictureRequest { output, certify: false, ..view.applied_to(&self.base)? };
        let mut plan = Plan::new(&self.session, &request, &Caller(work))?;
        let config = SinkConfig { shown: plan.config.shown(), ..plan.sinks(&request).config()? };
        let mut sink = Sink::to_output(out, config)?;
        render(plan.scene.as_mut(), &plan.config, work, &mut |rendered| sink.picture(&rendered))?;
        sink.finish()
    }

    /// The command that draws a request.
    ///
    /// # Errors
    /// Those of [`ViewRequest::applied_to`].
    pub(super) fn command(&self, view: &ViewRequest, saved: Saved) -> Result<String> {
        let request = PictureRequest { certify: false, ..view.applied_to(&self.base)? };
        let inputs = self.session.paths().iter().map(|path| path.to_string_lossy().into_owned());
        let words =
            request.words()?.into_iter().chain(view.certify.then(|| format!("--{}=error.npy", option("error_image"))));
        let all = inputs.chain(self.input_words.iter().cloned()).chain(words).chain(["-o".into(), saved.name().into()]);
        Ok(all.fold("wavesplat-render".into(), |line, word| line + " " + &quoted(&word)))
    }
}

impl Answer<'_> {
    /// Renders planned pictures, and encodes them for the page: in few bytes if they are to be packed.
    fn encode(plan: &mut Plan, sink: SinkConfig, packs: bool, work: &CancelToken) -> Result<Vec<u8>> {
        let (size, pixel, failed) = (sink.size, sink.pixel, |e| Error::io(Path::new("page"), "writing", e));
        let (mut encoder, mut blocks) = (PageEncoder::new(sink)?, Vec::new());
        let mut errors = Planes::new(size, 1, false);
        let step = encoder.step();
        let packed = |planes: Planes| if packs { planes.coded(step) } else { planes.raw() }.map_err(failed);
        let mut give = |frames: BlockOfFrames, planes: Planes| {
            blocks.push((frames, packed(planes)?));
            Ok(())
        };
        render(plan.scene.as_mut(), &plan.config, work, &mut |rendered| {
            if let Some(error) = rendered.error.filter(|_| pixel == Pixel::Value) {
                errors.push(error, |value| value);
            }
            encoder.picture(&rendered, &mut give)
        })?;
        encoder.rest(&mut give)?;
        let errors = (errors.pictures() > 0).then(|| errors.raw().map_err(failed)).transpose()?;
        let answer = Answer {
            about: &encoder.about().without_maps(),
            blocks: blocks.iter().map(|(frames, block)| (*frames, block.len())).collect(),
            errors: errors.as_ref().map(Vec::len),
            opacity: opacities(&plan.config.mode),
        };
        let head = page::headed(&answer).map_err(failed)?;
        Ok(blocks.into_iter().map(|(_, block)| block).chain(errors).fold(head, |mut all, block| {
            all.extend(block);
            all
        }))
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
        let of_rank = |share: f64| f64::from(values[((values.len() - 1) as f64 * share) as usize]);
        let [least, most] = [RARE, 1.0 - RARE].map(of_rank);
        // Where all other values are rare, they are all that there is to see.
        let [least, most] = if least == most { [lo, hi] } else { [least, most] };
        let end = if most - common >= common - least { most } else { least };
        Self { range, counts, surface: Some((common + end) / 2.0) }
    }
}

/// The name of an input in a page: that of the file, without its folder or host.
pub(super) fn shown_name(input: &Path) -> String {
    public_name(input).file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Refuses pictures of more numbers than half of the memory takes.
fn check_memory(sink: &SinkConfig, memory: usize) -> Result<()> {
    let numbers = sink.size[0] * sink.size[1] * sink.pixel.numbers();
    let bytes = numbers.saturating_mul(sink.shown.len()).saturating_mul(BYTES_PER_NUMBER);
    if bytes <= memory / 2 {
        return Ok(());
    }
    let what = format!("{memory} bytes are too few for this many frames at once: they take {bytes}");
    Err(Error::setting("memory", what))
}

/// The opacities of a composite, at shares of its range.
fn opacities(mode: &Mode) -> Option<Vec<(f64, f64)>> {
    let Mode::Composite { transfer, .. } = mode else { return None };
    let (lo, hi) = transfer.range();
    Some(transfer.opacity_points().iter().map(|(value, opacity)| ((value - lo) / (hi - lo), *opacity)).collect())
}

/// One part in so many of the memory holds finished answers.
const ANSWERS_SHARE: usize = 8;

/// Bytes that a number of an answer takes: as a picture, and in the answer.
const BYTES_PER_NUMBER: usize = 2 * size_of::<f32>();
/// Most numbers that a page asks for at once.
const MOST_NUMBERS: usize = 1 << 24;

/// The share of samples at either end that are rare: a surface of them alone would hardly be seen.
const RARE: f64 = 0.002;

/// Parts of a histogram: many more than a page draws, for it may draw a part of the range.
const BARS: usize = 2048;

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
