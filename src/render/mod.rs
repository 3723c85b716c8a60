//! A scene to pictures (method.md section 6): splat the planes of a group of frames, then invert every pixel.
//!
//! ```text
//! for some views                               plan: as many as fit in memory
//!   for each group of frames of a window       plan: as many as fit
//!     for each band of rows
//!       for each batch of blocks               scene: read, decode            (workers)
//!         every plane of every view takes it   lattice: amounts -> cells      (one owner per plane)
//!       every tile inverts its pixels          lattice: cells -> planes of pixels
//!                                              finish: planes -> frames, then / weights; certificate
//!     give the finished frames to the sink
//! ```
//!
//! Where footprints are less work, where the lattice of the view is not near enough, and where pictures are certified, every
//! tile splats the terms of the batch itself (`splat`). All planes go the same way, weights and what is missing included, so
//! that means stay means.

mod amounts;
pub mod annotate;
mod canvas;
mod certificate;
mod coded;
mod coefficients;
mod expectation;
mod eye;
mod finish;
mod frames;
mod lattice;
mod place;
mod plan;
mod reading;
mod scene;
pub mod sink;
mod slabs;
mod splat;
mod terms;
mod uncut;
mod weights;

pub use coefficients::{CoefficientScene, What};
pub use expectation::Expectation;
pub use frames::FrameScene;
pub use scene::{LeftOut, Scene};

use crate::camera::View;
use crate::colour::TransferFunction;
use crate::error::{Error, Result};
use crate::footprint::{Kernel, Method};
use crate::progress::Progress;
use crate::volume::Region;
use amounts::BlockPlanes;
use canvas::{Blocks, Canvas};
use eye::Eye;
use finish::Finish;
use plan::Budget;
use scene::{Contents, Group, Read};
use serde::Serialize;
use std::borrow::Cow;
use std::time::{Duration, Instant};
use weights::Weights;

/// What a pixel means (method.md section 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// g, the weighted mean along the ray; NaN is background (eq 12).
    Mean,
    /// I, the emission: value times length (eq 4).
    Emission,
}

/// What becomes of what lies along a ray.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Mode {
    /// It is summed up: the quantity that is asked for.
    #[default]
    Projection,
    /// It is coloured, and hides what is behind (method.md section 7).
    Composite {
        /// Colour and opacity of every value.
        transfer: TransferFunction,
        /// World units of a path that has such an opacity; by default the largest spacing.
        unit: Option<f64>,
        /// Slabs that the volume is cut into; by default each is about as thick as the largest spacing.
        slabs: Option<usize>,
    },
    /// The largest value is taken.
    Mip {
        /// As of [`Self::Composite`].
        slabs: Option<usize>,
    },
}

impl Mode {
    /// What the numbers of a pixel are.
    pub fn pixel(&self) -> Pixel {
        if matches!(self, Self::Composite { .. }) { Pixel::Light } else { Pixel::Value }
    }

    /// How many slabs are asked for.
    fn slabs(&self) -> Option<usize> {
        match self {
            Self::Projection => None,
            Self::Composite { slabs, .. } | Self::Mip { slabs } => *slabs,
        }
    }
}

/// How to render.
#[derive(Debug, Clone)]
pub struct RenderConfig {
    /// What becomes of what lies along a ray.
    pub mode: Mode,
    /// From where; pictures of all views are equally large.
    pub views: Vec<View>,
    /// The kernel.
    pub kernel: Kernel,
    /// What a pixel means.
    pub quantity: Quantity,
    /// Which frames, ascending.
    pub frames: Vec<usize>,
    /// Which voxels; by default all.
    pub region: Option<Region>,
    /// What splatting may add to the error: of an emission relative to the image of the largest |v| at the brightest
    /// place of the plane of the picture, of a mean relative to the value range where weights sum to as much as there, and
    /// elsewhere in inverse proportion to that sum. 0 asks for the exact method.
    pub splat_error: f64,
    /// How far off the picture may be, in the unit of samples, so that less is read and splatted; none: as near as the
    /// file is. Of an emission: as far as where all samples are off by so much.
    pub allowed: Option<f64>,
    /// Which error that limits.
    pub limited: Limit,
    /// Whether each picture comes with a bound on the error of every pixel.
    pub certify: bool,
    /// Bytes that may be allocated.
    pub memory: usize,
    /// Bytes of these that the sink takes for itself.
    pub reserved: usize,
}

/// An error that can be limited.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Limit {
    /// The largest of any sample, and so of any pixel of a mean.
    #[default]
    Certified,
    /// The root mean square over the pixels of a window's pictures of a view, as it is estimated.
    Expected,
}

impl RenderConfig {
    /// Width and height of the pictures.
    fn size(&self) -> [usize; 2] {
        self.views[0].size
    }

    /// Whether it depends on the view what is read of a file.
    fn chooses_by_view(&self) -> bool {
        self.allowed.is_some() && self.limited == Limit::Expected
    }

    fn check(&self) -> Result<()> {
        if self.views.is_empty() || self.views.iter().any(|view| view.size != self.size()) {
            return Err(Error::usage("takes one view or more, with pictures of one size"));
        }
        if self.mode == Mode::Projection {
            return Ok(());
        }
        let refused = [
            (self.kernel.tau != 0.0, "--tau: attenuates projections; what hides what is the transfer function's"),
            (self.certify, "--error-image: certifies projections alone"),
            (self.chooses_by_view(), "--error expected: is of projections alone"),
            (self.quantity != Quantity::Mean, "--quantity: is of projections alone"),
        ];
        refused.iter().find(|(wrong, _)| *wrong).map_or(Ok(()), |(_, what)| Err(Error::usage(*what)))
    }
}

/// What a rendering did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RenderReport {
    /// Frames rendered, of every view.
    pub frames: usize,
    /// How each view was splatted.
    pub views: Vec<ViewReport>,
    /// Blocks that the scene holds, over all windows touched and their channels; as what follows up to the parts, each time counted that frames
    /// are rendered together, from views that are.
    pub blocks: u64,
    /// Blocks that were decoded, each time counted.
    pub blocks_read: u64,
    /// Blocks left out because they hold nothing in the region.
    pub blocks_empty: u64,
    /// Blocks left out because no pixel of any view sees them.
    pub blocks_outside: u64,
    /// Blocks left out because they lie so deep that what they add is within the splat error.
    pub blocks_dimmed: u64,
    /// Tiles of all slabs, of every group of frames.
    pub tiles: u64,
    /// Those among them that are clear whatever their blocks hold.
    pub tiles_clear: u64,
    /// Tiles of pictures that became opaque in all frames of a group, so that what is behind was left out.
    pub tiles_opaque: u64,
    /// What a looser tolerance left out of the blocks in the region, over all windows touched.
    pub left_out: LeftOut,
    /// What of these blocks was not read because it is of frames that were not asked for.
    pub other_frames: LeftOut,
    /// No sample that was splatted is further from the source's.
    pub certified_sample_error: f64,
    /// Of all views, the root mean square of what each view reports; NaN unless these are projections.
    pub expected_error: f64,
    /// The largest error that a pixel may have, if pictures are certified.
    pub certified_error: Option<f64>,
    /// Stored bytes that were read of blocks.
    pub bytes_read: u64,
    /// Nonzero coefficients splatted, each time counted.
    pub coefficients: u64,
    /// Seconds spent on the sums of weights.
    pub weight_seconds: f64,
    /// Seconds spent reading and decoding.
    pub decode_seconds: f64,
    /// Seconds spent splatting.
    pub splat_seconds: f64,
    /// Seconds spent on pixels: from a lattice, by the inverse transform and the division by weights.
    pub inverse_seconds: f64,
    /// Seconds from beginning to end, without the sink.
    pub seconds: f64,
}

/// How a view was splatted.
#[derive(Debug, Clone, Serialize)]
pub struct ViewReport {
    /// Degrees, as asked for.
    pub azimuth: f64,
    /// Degrees, as asked for.
    pub elevation: f64,
    /// Pixels per world unit.
    pub scale: f64,
    /// The splat method.
    pub method: &'static str,
    /// The slabs that the volume is cut into.
    pub slabs: Option<usize>,
    /// Its stated error, in the terms of the splat error that was asked for.
    pub stated_splat_error: f64,
    /// An estimate of the root mean square, over the pixels that are not background, of their errors, but for those of
    /// splatting; in the pictures' unit.
    pub expected_error: f64,
}

impl RenderReport {
    /// Adds what a group says of its blocks.
    fn add(&mut self, contents: &Contents) {
        self.blocks_empty += contents.empty;
        self.left_out += contents.left_out;
        self.other_frames += contents.other_frames;
        self.certified_sample_error = self.certified_sample_error.max(contents.certified);
    }

    /// Turns sums over the frames of each view into root mean squares, and all these into one.
    fn sum_up_expected_errors(&mut self) {
        let (frames, views) = (self.frames.max(1) as f64, self.views.len() as f64);
        self.views.iter_mut().for_each(|view| view.expected_error = (view.expected_error / frames).sqrt());
        let squares: f64 = self.views.iter().map(|view| view.expected_error * view.expected_error).sum();
        self.expected_error = (squares / views).sqrt();
    }
}

impl ViewReport {
    fn new(view: &View, eye: &Eye) -> Self {
        let &View { azimuth, elevation, .. } = view;
        let (scale, method, stated_splat_error) = (eye.camera.scale, eye.method.name, eye.stated_error);
        Self { azimuth, elevation, scale, method, slabs: None, stated_splat_error, expected_error: 0.0 }
    }
}

/// What the numbers of a pixel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixel {
    /// A value.
    Value,
    /// Red, green and blue, each as a value is.
    Channels,
    /// Red, green and blue of the light that comes out, 0 to 1, and the opacity of all that is there.
    Light,
}

impl Pixel {
    /// How many there are.
    pub fn numbers(self) -> usize {
        match self {
            Self::Value => 1,
            Self::Channels => 3,
            Self::Light => 4,
        }
    }
}

/// A finished picture: as many numbers as the scene has channels for each of `width * height` pixels, row by row.
pub type Picture<'a> = &'a [f32];

/// A frame as it was rendered.
#[derive(Debug, Clone, Copy)]
pub struct Rendered<'a> {
    /// The number of the view.
    pub view: usize,
    /// That of the frame.
    pub frame: usize,
    /// The quantity asked for.
    pub picture: Picture<'a>,
    /// If pictures are certified, a bound on the error of every pixel, in the same unit: against the picture of the
    /// source's samples splatted without a cut and without rounding. NaN is background.
    pub error: Option<Picture<'a>>,
}

/// Renders all frames from all views, giving each to `sink`; those of one view come in order.
pub fn render(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let eyes = eyes(scene, config)?;
    let mut report = RenderReport { frames: config.frames.len(), ..Default::default() };
    report.views = config.views.iter().zip(&eyes).map(|(view, eye)| ViewReport::new(view, eye)).collect();
    let mut sink_time = Duration::ZERO;
    let mut sink = |rendered: Rendered<'_>| {
        let writing = Instant::now();
        sink(rendered)?;
        sink_time += writing.elapsed();
        Ok(())
    };
    if config.mode == Mode::Projection {
        project(scene, config, &eyes, progress, &mut report, &mut sink)?;
    } else {
        cut_and_blend(scene, config, &eyes, progress, &mut report, &mut sink)?;
    }
    progress.finish();
    report.sum_up_expected_errors();
    report.seconds = (started.elapsed() - sink_time).as_secs_f64();
    Ok(report)
}

/// Renders projections, of as many views together as there is memory for.
fn project(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    eyes: &[Eye],
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    progress.start(Some((eyes.len() * config.frames.len()) as u64));
    let mut sink = |rendered: Rendered<'_>| {
        progress.advance(1);
        sink(rendered)
    };
    let mut first = 0;
    while first < eyes.len() {
        let budget = Budget::of_most(config, scene, &eyes[first..]);
        render_views(scene, config, (&budget, first), report, &mut sink)?;
        first += budget.eyes().len();
    }
    Ok(())
}

/// Renders pictures of slabs, view by view; progress is in rows of pixels of slabs.
fn cut_and_blend(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    eyes: &[Eye],
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let views = eyes.iter().map(|eye| slabs::cut(eye, config)).collect::<Result<Vec<_>>>()?;
    let all: usize = views.iter().map(|slabs| slabs.eyes.len()).sum();
    progress.start(Some((all * config.frames.len() * config.size()[1]) as u64));
    for (view, slabs) in views.iter().enumerate() {
        let mut sink = |frame, picture: &[f32]| sink(Rendered { view, frame, picture, error: None });
        report.views[view].slabs = Some(slabs.eyes.len());
        report.views[view].expected_error = f64::NAN;
        slabs::render_view(scene, config, slabs, progress, report, &mut sink)?;
    }
    Ok(())
}

/// An error if [`render`] would refuse to begin.
pub fn check(scene: &dyn Scene, config: &RenderConfig) -> Result<()> {
    eyes(scene, config).map(|_| ())
}

/// All views, for each of which there is memory enough.
fn eyes(scene: &dyn Scene, config: &RenderConfig) -> Result<Vec<Eye>> {
    config.check()?;
    if scene.channels() > 1 && config.mode != Mode::Projection {
        return Err(Error::usage("--mode: the samples are colours already, of which only projections are made"));
    }
    let eye = |view: &View| uncut::without_what_is_dim(Eye::new(scene, config, view)?, config);
    let eyes = config.views.iter().map(eye).collect::<Result<Vec<_>>>()?;
    match config.mode {
        Mode::Projection => Budget::check(config, scene, &eyes)?,
        _ => eyes.iter().try_for_each(|eye| Budget::check(config, scene, &slabs::cut(eye, config)?.eyes))?,
    }
    Ok(eyes)
}

/// Renders all frames from views that go together, the first of which is number `first_view`.
fn render_views(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (budget, first_view): (&Budget<'_>, usize),
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let mut clock = Instant::now();
    let looks = budget.eyes().iter().map(|eye| Look::new(eye, config, budget)).collect::<Result<Vec<_>>>()?;
    let expectations: Vec<_> = looks.iter().map(|look| Expectation::new(look, config)).collect();
    lap(&mut clock, &mut report.weight_seconds);
    let (mut rest, count) = (config.frames.as_slice(), scene.channels());
    while let Some(first) = rest.first() {
        let most = plan::in_group(scene, *first, rest);
        let (now, later) = rest.split_at(budget.frames(scene, config, most));
        let channel = |channel| render_channel(scene, config, (now, channel), (&looks, &expectations), budget, report);
        let channels = (0..count).map(channel).collect::<Result<Vec<_>>>()?;
        for (i, view) in (first_view..).take(looks.len()).enumerate() {
            let expected = channels.iter().map(|views| views[i].1).sum::<f64>() / count as f64;
            // Frame by frame, so that it is the same however frames are grouped.
            now.iter().for_each(|_| report.views[view].expected_error += expected);
            let pictures: Vec<&Pictures> = channels.iter().map(|views| &views[i].0).collect();
            Pictures::give(&pictures, (view, now), sink)?;
        }
        rest = later;
    }
    Ok(())
}

/// Renders a channel of some frames from some views, again where more is found than its layout has room for: of each view the
/// pictures, and the mean square of the errors that are expected.
fn render_channel(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (frames, channel): (&[usize], usize),
    (looks, expectations): (&[Look<'_>], &[Expectation<'_>]),
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<(Pictures, f64)>> {
    loop {
        let before = report.clone();
        let group = scene.group(frames, channel, config, &expectations[0])?;
        let pictures = render_group(group.as_ref(), looks, config, budget, report)?;
        let expected = |expectation| group.expected(&looks[0].eye.clip, expectation);
        let expected = expectations.iter().map(expected).collect::<Result<Vec<_>>>()?;
        match group.finish()? {
            Read::AsExpected => return Ok(pictures.into_iter().zip(expected).collect()),
            Read::Otherwise => *report = before,
        }
    }
}

/// What splatting may add by default to pictures of a file of such a tolerance, or of frames: half of that, at most 1e-3.
pub fn default_splat_error(tolerance: Option<f64>) -> f64 {
    tolerance.map_or(f64::INFINITY, |t| t / 2.0).min(1e-3)
}

/// The cheapest splat method within an error.
pub fn splat_method(quantity: Quantity, error: f64) -> Method {
    Method::within(most_splat_error(quantity, error))
}

/// What splatting may be off by.
fn most_splat_error(quantity: Quantity, error: f64) -> f64 {
    match quantity {
        Quantity::Emission => error,
        // A pixel that is not background must keep some of its weights.
        Quantity::Mean => error.min(0.9 * eye::BACKGROUND),
    }
}

/// Adds the seconds since `clock` to a stage, and restarts it.
fn lap(clock: &mut Instant, stage: &mut f64) {
    *stage += clock.elapsed().as_secs_f64();
    *clock = Instant::now();
}

impl Blocks for &dyn Group {
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        Group::planes(*self, block)
    }
}

/// A view, and its sums of weights.
#[derive(Debug)]
struct Look<'a> {
    eye: &'a Eye,
    weights: Weights,
}

impl<'a> Look<'a> {
    fn new(eye: &'a Eye, config: &RenderConfig, budget: &Budget<'_>) -> Result<Self> {
        Ok(Self { weights: Weights::new(eye, config, budget)?, eye })
    }

    /// Where nothing is weighed.
    fn of_no_weights(eye: &'a Eye) -> Self {
        Self { eye, weights: Weights::default() }
    }
}

/// The pictures of a channel of a group from one view.
struct Pictures {
    pixels: usize,
    /// Those of the frames, and if they are certified, those of their errors.
    all: Vec<f32>,
}

impl Pictures {
    /// Gives the frames of all channels to the sink, the channels of each pixel side by side.
    fn give(
        channels: &[&Self],
        (view, frames): (usize, &[usize]),
        sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
    ) -> Result<()> {
        for (i, frame) in frames.iter().enumerate() {
            let of = |i: usize| Self::together(channels, i);
            let (picture, error) = (of(i), of(frames.len() + i));
            sink(Rendered {
                view,
                frame: *frame,
                picture: picture.as_deref().unwrap_or_default(),
                error: error.as_deref(),
            })?;
        }
        Ok(())
    }

    /// The picture of a number, of all channels; none if there are not so many.
    fn together<'a>(channels: &[&'a Self], i: usize) -> Option<Cow<'a, [f32]>> {
        let of = |channel: &&'a Self| channel.all.get(i * channel.pixels..(i + 1) * channel.pixels);
        let [first, others @ ..] = channels else { return None };
        let first = of(first)?;
        if others.is_empty() {
            return Some(first.into());
        }
        let others: Vec<&[f32]> = others.iter().filter_map(of).collect();
        let pixel = |(at, value): (usize, &f32)| std::iter::once(*value).chain(others.iter().map(move |c| c[at]));
        Some(first.iter().enumerate().flat_map(pixel).collect())
    }
}

/// Renders all frames of a group from some views.
fn render_group(
    group: &dyn Group,
    looks: &[Look<'_>],
    config: &RenderConfig,
    budget: &Budget<'_>,
    report: &mut RenderReport,
) -> Result<Vec<Pictures>> {
    let layout = group.layout();
    let blocks = blocks_to_read(group, looks, report)?;
    let finish: Vec<Finish<'_>> = looks.iter().map(|look| Finish::new(group, look, config)).collect();
    let empty = |finish: &Finish<'_>| vec![f32::NAN; finish.planes() * budget.pixels()];
    let mut pictures: Vec<Vec<f32>> = finish.iter().map(empty).collect();
    for rows in budget.bands(&layout) {
        let mut canvases: Vec<_> = looks.iter().map(|look| Canvas::new(look.eye, rows.clone(), &layout)).collect();
        canvas::splat(&mut canvases, &blocks, budget.batch(&layout, rows.len()), &group, report)?;
        let mut clock = Instant::now();
        for ((canvas, finish), pictures) in canvases.into_iter().zip(&finish).zip(&mut pictures) {
            canvas.finish(pictures, |tile, pixels| finish.tile(tile, pixels));
        }
        lap(&mut clock, &mut report.inverse_seconds);
    }
    if config.certify {
        let of_errors = pictures.iter().flat_map(|all| &all[layout.frames * budget.pixels()..]);
        let largest = of_errors.map(|e| f64::from(*e)).fold(report.certified_error.unwrap_or(0.0), f64::max);
        report.certified_error = Some(largest);
    }
    Ok(pictures.into_iter().map(|all| Pictures { pixels: budget.pixels(), all }).collect())
}

/// The blocks of a group that a pixel sees, and a word in the report on the others.
fn blocks_to_read(group: &dyn Group, looks: &[Look<'_>], report: &mut RenderReport) -> Result<Vec<usize>> {
    let eye = looks[0].eye;
    let all_rows = 0..eye.camera.size[1];
    let contents = group.blocks(&eye.clip)?;
    report.add(&contents);
    let mut blocks = contents.blocks;
    let held = blocks.len();
    blocks.retain(|b| looks.iter().any(|look| look.eye.reaches(*b, &all_rows)));
    let reached = blocks.len();
    blocks.retain(|b| looks.iter().any(|look| look.eye.sees(*b, &all_rows)));
    report.blocks += eye.blocks.len() as u64;
    report.blocks_outside += (held - reached) as u64;
    report.blocks_dimmed += (reached - blocks.len()) as u64;
    Ok(blocks)
}
