//! The default range of colours, taken from small pictures of an overview.

use super::modes::unit;
use super::pixels::{Pixels, is_of_means, rays};
use super::range_rules::{at_least_noticeable, not_below_zero, robust_range, tissue_end};
use crate::picture::distributions::{Distributions, Sampled};
use crate::picture::reporter::Reporter;
use crate::picture::values::BeyondSpec;
use std::sync::Arc;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::progress::{Progress, Silent};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::colour::{Clear, Common, Distribution, Norm, TransferFunction};
use wavesplat_core::source::ArraySource;
use wavesplat_core::view::footprint::Kernel;
use wavesplat_engine::render::sink::RayLengths;
use wavesplat_engine::render::{
    FrameScene, Mode, OverviewRequest, RenderConfig, RenderReport, Rendered, Scene, Thinning,
};
use wavesplat_engine::render::{check, render, stride};

/// The largest number of pixels used to find a range.
const MOST_PIXELS: usize = 1 << 20;

/// The longer side of small pictures.
const PIXELS: f64 = 64.0;

/// The largest distance of neighbours in an overview, in pixels of small pictures.
const PIXELS_APART: f64 = 1.0;

/// The least standard deviation of the kernel of an overview, in its spacings. It is less than for pictures to look at,
/// since a wide kernel averages extremes away.
const SIGMA: f64 = 0.5;

/// The splat error of small pictures; it is small compared with what they leave out.
const SPLAT_ERROR: f64 = 0.02;

/// A range is taken from at least `LEAST_FRAMES` frames, and from up to `MOST_FRAMES` as long as these have no more
/// than `MOST_SAMPLES` samples.
const LEAST_FRAMES: usize = 4;
const MOST_FRAMES: usize = 16;
const MOST_SAMPLES: usize = 5 << 20;

/// The largest number of views to look at.
const MOST_VIEWS: usize = 16;

/// Bytes of the memory budget for each sample of an overview, which then takes at most a quarter of the budget.
const MEMORY_SHARE: usize = 32;

/// The largest number of samples of a distribution.
const MOST_OF_DISTRIBUTION: usize = 1 << 20;

/// An overview of a few frames of one channel, as [`Scene::overview`] gives it.
pub(in crate::picture) struct Overview {
    stride: usize,
    frames: Vec<usize>,
    samples: Vec<f32>,
}

impl Overview {
    /// The samples of some of its frames, if it has them with this stride.
    fn of_frames(&self, stride: usize, frames: &[usize]) -> Option<Vec<f32>> {
        let of_frame = self.samples.len() / self.frames.len().max(1);
        let place = |frame: &usize| self.frames.binary_search(frame).ok();
        let places: Vec<usize> = frames.iter().map(place).collect::<Option<_>>()?;
        let samples = || places.iter().flat_map(|n| &self.samples[n * of_frame..][..of_frame]);
        (self.stride == stride).then(|| samples().copied().collect())
    }
}

/// How samples are distributed, in an overview of a few frames; `None` if the scene has no overview. If an overview
/// is `held` that has these samples, they are taken from it.
pub(in crate::picture) fn distribution(
    scene: &mut dyn Scene,
    distributions: &Distributions,
    config: &RenderConfig,
    held: Option<&Overview>,
    reporter: &dyn Reporter,
) -> Result<Option<Arc<Distribution>>> {
    let sampled = sampled(scene, config, spread(scene, LEAST_FRAMES))?;
    distributions.get(sampled, |of| match held.and_then(|held| held.of_frames(of.thinning.stride, &of.frames)) {
        Some(samples) => Ok(Some(Distribution::new(samples))),
        None => found(scene, config, of, reporter),
    })
}

/// The same for these frames.
pub(in crate::picture) fn distribution_of_frames(
    scene: &mut dyn Scene,
    distributions: &Distributions,
    config: &RenderConfig,
    frames: Vec<usize>,
    reporter: &dyn Reporter,
) -> Result<Option<Arc<Distribution>>> {
    distributions.get(sampled(scene, config, frames)?, |of| found(scene, config, of, reporter))
}

/// The samples to take of some frames.
fn sampled(scene: &dyn Scene, config: &RenderConfig, frames: Vec<usize>) -> Result<Sampled> {
    let small = small(config);
    let region = small.region.unwrap_or(Region { start: [0; 3], end: scene.grid().dims });
    Ok(Sampled { thinning: thinning_of_distribution(scene, &small)?, frames, region })
}

/// The distribution of samples in an overview, if the scene has one.
fn found(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    of: &Sampled,
    reporter: &dyn Reporter,
) -> Result<Option<Distribution>> {
    let request =
        OverviewRequest { thinning: of.thinning, frames: &of.frames, memory: config.memory, region: of.region };
    let samples = scene.overview(&request, reporter.progress("overview", "steps").as_ref())?;
    Ok(samples.map(Distribution::new))
}

/// How to thin a scene for a distribution.
fn thinning_of_distribution(scene: &dyn Scene, small: &RenderConfig) -> Result<Thinning> {
    let mut thinning = thinning(scene, small)?;
    while voxels(&thinning) * LEAST_FRAMES > MOST_OF_DISTRIBUTION && thinning.stride < 64 {
        thinning.stride *= 2;
    }
    Ok(thinning)
}

/// The settings of small pictures.
fn small(config: &RenderConfig) -> RenderConfig {
    let views = spread_over(config.views.len(), MOST_VIEWS).into_iter().map(|view| config.views[view]).collect();
    let mut small = RenderConfig { views, paired: false, certify: false, ..config.clone() };
    if matches!(config.mode, Mode::Planes { .. }) {
        return small; // planes are small already: their blocks are the work, and not their pixels
    }
    for view in &mut small.views {
        let shrink = (PIXELS / view.size[0].max(view.size[1]) as f64).min(1.0);
        view.size = view.size.map(|n| ((n as f64 * shrink).ceil() as usize).max(1));
        view.scale = view.scale.map(|s| s * shrink);
    }
    small.mode = match config.mode {
        Mode::Projection | Mode::Planes { .. } => config.mode.clone(),
        // The colours of a composite are those of its samples, and the largest samples along rays are enough to find
        // where they end.
        Mode::Composite { .. } | Mode::Iso { .. } | Mode::Mip { .. } => Mode::Mip { slices: None },
    };
    small
}

/// The same pictures, less exact.
fn rough(small: &RenderConfig) -> RenderConfig {
    let fast = matches!(small.mode, Mode::Projection);
    RenderConfig { fast, splat_error: small.splat_error.max(SPLAT_ERROR), ..small.clone() }
}

/// At most `count` frames, spread over the archive.
fn spread(scene: &dyn Scene, count: usize) -> Vec<usize> {
    spread_over(scene.frames().unwrap_or(1), count)
}

/// At most `count` of the numbers below `all`, from the first to the last.
pub(super) fn spread_over(all: usize, count: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = (0..count).map(|i| i * all.saturating_sub(1) / (count - 1)).collect();
    chosen.dedup();
    chosen
}

/// The number of samples to take.
fn most_samples(small: &RenderConfig) -> usize {
    MOST_SAMPLES.min(small.memory / MEMORY_SHARE)
}

/// The number of frames of `voxels` voxels in which to look for a range.
fn frames_of(voxels: usize, small: &RenderConfig) -> usize {
    (most_samples(small) / voxels).clamp(LEAST_FRAMES, MOST_FRAMES)
}

/// The progress of small pictures.
fn progress<'a>(stage: &'static str, small: &RenderConfig, reporter: &'a dyn Reporter) -> Box<dyn Progress + 'a> {
    reporter.progress(stage, unit(&small.mode))
}

/// The pixels of small pictures of a few frames.
fn pixels_of_frames(scene: &mut dyn Scene, small: &RenderConfig, reporter: &dyn Reporter) -> Result<Pixels> {
    let frames = spread(scene, frames_of(scene.grid().whole().voxels(), small));
    let mut pixels = Pixels::default();
    pictures(
        scene,
        &RenderConfig { frames, ..small.clone() },
        progress("range", small, reporter).as_ref(),
        &mut pixels,
    )?;
    Ok(pixels)
}

/// The pixels of small pictures of an overview, and the overview; none if the scene has none, or the volume is too small for
/// one.
fn pixels_of_overview(
    scene: &mut dyn Scene,
    small: &RenderConfig,
    reporter: &dyn Reporter,
) -> Result<Option<(Pixels, Overview)>> {
    if matches!(small.mode, Mode::Planes { .. }) {
        return Ok(None);
    }
    let thinning = thinning(scene, small)?;
    if thinning.stride == 1 {
        return Ok(None);
    }
    let frames = spread(scene, frames_of(voxels(&thinning), small));
    let region = small.region.unwrap_or(Region { start: [0; 3], end: scene.grid().dims });
    let request = OverviewRequest { thinning, frames: &frames, memory: small.memory, region };
    let Some(overview) = scene.overview(&request, reporter.progress("overview", "steps").as_ref())? else {
        return Ok(None);
    };
    let (grid, mut pixels) = (thinning.grid(scene.grid()), Pixels::default());
    let config = overview_config(&request, &grid, small, size_of_val(&overview[..]));
    for samples in overview.chunks_exact(request.samples()) {
        let bytes = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        let mut frames = FrameScene::new(Box::new(ArraySource::new(grid, SampleType::F32, bytes)?), None);
        // One bar for each channel would look like a restart.
        match scene.channels() {
            1 => pictures(&mut frames, &config, progress("range", small, reporter).as_ref(), &mut pixels)?,
            _ => pictures(&mut frames, &config, &Silent, &mut pixels)?,
        };
    }
    let stride = thinning.stride;
    Ok(Some((pixels, Overview { stride, frames, samples: overview })))
}

/// How to thin a scene for small pictures.
fn thinning(scene: &dyn Scene, small: &RenderConfig) -> Result<Thinning> {
    let edge = scene.blocks().edges.into_iter().fold(0, usize::max);
    let most = most_samples(small);
    let mut thinning = Thinning { blocks: scene.blocks(), stride: stride(scene.grid(), small, PIXELS_APART)? };
    // From then on, a block has one voxel.
    while voxels(&thinning) * scene.channels() * LEAST_FRAMES > most && thinning.stride < edge {
        thinning.stride *= 2;
    }
    Ok(thinning)
}

/// The settings of small pictures of an overview, which takes `bytes` twice.
fn overview_config(request: &OverviewRequest<'_>, grid: &Grid, small: &RenderConfig, bytes: usize) -> RenderConfig {
    let sigma = small.kernel.sigma.max(SIGMA * grid.largest_spacing());
    RenderConfig {
        kernel: Kernel { sigma, ..small.kernel },
        frames: (0..request.frames.len()).collect(),
        region: small.region.map(|region| request.thinning.region(&region)),
        allowed: None,
        memory: small.memory.saturating_sub(2 * bytes),
        ..small.clone()
    }
}

/// The number of voxels in a frame of an overview.
fn voxels(thinning: &Thinning) -> usize {
    thinning.blocks().dims.iter().product()
}

/// Renders small pictures, and adds their pixels.
fn pictures(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    pixels: &mut Pixels,
) -> Result<RenderReport> {
    let count = config.frames.len() * config.views.iter().map(|view| view.size[0] * view.size[1]).sum::<usize>();
    let step = count.div_ceil(MOST_PIXELS).max(1);
    let rays = is_of_means(config).then(|| rays(config, scene.grid()));
    render(scene, config, progress, &mut |rendered| {
        pixels.add(&rendered, step, rays.as_ref(), config.views[rendered.view].size);
        Ok(())
    })
}

/// What is known of the samples without looking at them.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::picture) struct KnownSamples {
    /// The least one.
    pub(in crate::picture) least: Option<f64>,
    /// Whether they are of a body, where greys and the range of tissue are usual.
    pub(in crate::picture) are_of_body: bool,
}

/// Which ranges are needed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::picture) struct Needed {
    pub(in crate::picture) pictures: bool,
    /// The value beyond the volume, with which means are weighed.
    pub(in crate::picture) beyond: BeyondSpec,
    pub(in crate::picture) errors: bool,
}

/// The ranges of the pictures and of their errors.
pub(in crate::picture) struct Ranges {
    pub(in crate::picture) values: (f64, f64),
    /// The smallest value above 0, if there is one.
    positive: Option<f64>,
    pub(in crate::picture) errors: (f64, f64),
    /// The value beyond the volume, if means are weighed with it.
    pub(in crate::picture) beyond: Option<f64>,
    /// The values of small pictures, before they are weighed.
    all: Distribution,
    /// The overview that they show, if there is one.
    overview: Option<Overview>,
}

impl Default for Ranges {
    fn default() -> Self {
        Self {
            values: (0.0, 1.0),
            positive: Some(1.0),
            errors: (0.0, 1.0),
            beyond: None,
            all: Distribution::default(),
            overview: None,
        }
    }
}

impl Ranges {
    /// The ranges in small pictures, if any are needed: of pictures, or of their errors. The frames of the pictures are
    /// spread over the archive, so the ranges do not depend on the frames to render. If the pictures are empty, the
    /// range is (0, 1). Errors begin at 0.
    pub(in crate::picture) fn small(
        scene: &mut dyn Scene,
        config: &RenderConfig,
        needed: Needed,
        reporter: &dyn Reporter,
    ) -> Result<Self> {
        let mut ranges = Self::default();
        if !needed.pictures && !needed.errors {
            return Ok(ranges);
        }
        check(scene, config)?; // before small pictures are rendered, so that errors name the full size
        let small = small(config);
        if needed.pictures {
            let rough = rough(&small);
            match pixels_of_overview(scene, &rough, reporter)? {
                Some((pixels, overview)) => {
                    ranges.set_values(pixels, needed.beyond);
                    ranges.overview = Some(overview).filter(|_| scene.channels() == 1);
                }
                None => ranges.set_values(pixels_of_frames(scene, &rough, reporter)?, needed.beyond),
            }
        }
        if needed.errors {
            let (frames, mode) = (spread(scene, LEAST_FRAMES), config.mode.clone());
            let certified = RenderConfig { certify: true, frames, mode, ..small };
            let report = pictures(
                scene,
                &certified,
                progress("range of errors", &certified, reporter).as_ref(),
                &mut Pixels::default(),
            )?;
            ranges.errors.1 = report.certified_error.filter(|e| *e > 0.0).unwrap_or(1.0);
        }
        Ok(ranges)
    }

    /// The ranges of pictures of a few of some frames. `render` gives them.
    pub(in crate::picture) fn from_pictures(
        frames: &[usize],
        beyond: BeyondSpec,
        rays: &RayLengths,
        size: [usize; 2],
        render: impl FnOnce(&[usize], &mut dyn FnMut(&Rendered<'_>)) -> Result<()>,
    ) -> Result<Self> {
        let some: Vec<usize> = spread_over(frames.len(), MOST_FRAMES).into_iter().map(|n| frames[n]).collect();
        let (mut ranges, mut pixels) = (Self::default(), Pixels::default());
        render(&some, &mut |rendered| {
            let step = (rendered.picture.len() * some.len()).div_ceil(MOST_PIXELS).max(1);
            pixels.add(rendered, step, Some(rays), size);
        })?;
        ranges.set_values(pixels, beyond);
        Ok(ranges)
    }

    fn set_values(&mut self, pixels: Pixels, beyond: BeyondSpec) {
        self.all = Distribution::new(pixels.values.clone());
        self.beyond = self.beyond(beyond);
        let weighed = self.beyond.map(|beyond| Distribution::new(pixels.weighed(beyond)));
        let values = weighed.as_ref().unwrap_or(&self.all).values();
        if !values.is_empty() {
            self.values = robust_range(values);
            self.positive = values.iter().find(|v| **v > 0.0).map(|v| f64::from(*v));
        }
    }

    /// The value beyond the volume: that of empty space, or the median.
    fn beyond(&self, spec: BeyondSpec) -> Option<f64> {
        let values = self.all.values();
        match spec {
            BeyondSpec::Nothing => None,
            BeyondSpec::Value(value) => Some(value),
            BeyondSpec::Auto if values.is_empty() => None,
            BeyondSpec::Auto => {
                let empty = Clear::empty_space(&self.all, robust_range(values)).map(|(_, empty)| empty.value);
                Some(empty.unwrap_or_else(|| values[values.len() / 2].into()))
            }
        }
    }

    /// The overview that the ranges were found in, if there is one.
    pub(in crate::picture) fn into_overview(self) -> Option<Overview> {
        self.overview
    }

    /// The values that show the background, if small pictures have much empty space.
    pub(in crate::picture) fn clear(&self, range: (f64, f64)) -> Option<(Clear, Common)> {
        Clear::empty_space(&self.all, range)
    }

    /// The colours over the range of all values, up to the largest value of small pictures. Extreme values that would
    /// take most of the colours do not count.
    pub(in crate::picture) fn stretch(&self, colours: &TransferFunction) -> Result<TransferFunction> {
        let ((lo, hi), most) = (colours.range(), self.values.1);
        if !(0.0 < most && most < hi) {
            return Ok(colours.clone());
        }
        let lo = match lo {
            ..0.0 => lo * most / hi,
            _ if lo < most => lo,
            _ => 0.5 * most, // no pixel reaches the least value
        };
        colours.over((lo, most))
    }

    /// The range from 0 to the largest value.
    pub(in crate::picture) fn up_from_zero(&self) -> (f64, f64) {
        (0.0, self.values.1)
    }

    /// The default range of colours.
    pub(in crate::picture) fn automatic(
        &self,
        norm: Norm,
        map: &TransferFunction,
        known: KnownSamples,
    ) -> Result<(f64, f64)> {
        const DECADES: f64 = 1e-4;
        let (lo, mut hi) = self.values;
        if known.are_of_body {
            hi = tissue_end(self.all.values()).unwrap_or(hi);
        }
        if norm == Norm::Log {
            let least =
                self.positive.ok_or_else(|| Error::value("norm", "log", "no value is above 0; give `norm` linear"))?;
            return Ok((least.max(hi * DECADES), hi));
        }
        Ok(if lo < hi { map.suitable(at_least_noticeable(not_below_zero((lo, hi), known.least))) } else { (lo, hi) })
    }
}
