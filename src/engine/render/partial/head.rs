//! The head of a partial sum: its settings, its sources, and where its records lie.

use crate::render::annotate::AxisLabels;
use crate::render::config::{Limit, Mode, Quantity, RenderConfig};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_core::view::footprint::Kernel;

/// The version of the format.
pub(super) const SCHEMA: u32 = 1;

/// The most voxels along an axis. A head with a larger number is refused, so a wrong number costs no time.
const MOST_ALONG: usize = 1 << 20;
/// The most boxes of voxels of a picture.
pub(super) const MOST_BOXES: usize = 1 << 14;
/// The most views.
const MOST_VIEWS: usize = 1 << 16;

/// The settings that all partial sums of a picture share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureSetup {
    /// Identifies the archive, whole or in shards.
    pub archive: String,
    /// Frames of the archive.
    pub frames: usize,
    /// Numbers of a sample: 1, or 3 for colours.
    pub channels: usize,
    /// The lattice that is drawn.
    pub grid: Grid,
    /// Voxels of a block along x, y, z.
    pub block: [usize; 3],
    /// The lattice of all voxels, whatever the level of detail.
    pub whole: Grid,
    /// The level of detail.
    pub lod: u32,
    /// The factor by which heights are drawn taller.
    pub exaggeration: f64,
    /// Whether decoded samples are splatted instead of coefficients.
    pub direct: bool,
    /// What pixels show.
    pub quantity: Quantity,
    /// The kernel.
    pub kernel: Kernel,
    /// The requested splat error.
    pub splat_error: f64,
    /// Whether the splat error is an estimate. Files of the first version call it `quick`.
    #[serde(rename = "quick")]
    pub fast: bool,
    /// The tolerance of pictures as a share of the range, and in the unit of the samples.
    pub tolerance: Option<(f64, f64)>,
    /// The views, with pictures of one size.
    pub views: Vec<View>,
    /// The frame of each view, if each shows one frame alone.
    pub paired: Option<Vec<usize>>,
    /// Name and unit of the values.
    pub values: String,
    /// The axes of all voxels.
    pub axes: [AxisLabels; 3],
    /// The unit of times, perhaps since a date, and its calendar.
    pub time_unit: String,
    /// The calendar of dates.
    pub calendar: Option<String>,
}

/// A coefficient file that a partial sum was made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartialSource {
    /// Its id.
    pub file: String,
    /// The first of its frames, and the end (exclusive), as the archive numbers them.
    pub frames: [usize; 2],
    /// The times of these frames, or none.
    pub times: Vec<f64>,
}

/// The head of a partial sum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Head {
    /// The version of the format.
    pub(super) schema: u32,
    /// Name and version of the program.
    pub software: String,
    /// What all partial sums of a picture share.
    pub look: PictureSetup,
    /// The voxels of the sum: boxes of the lattice that is drawn, without overlap.
    pub boxes: Vec<Region>,
    /// The files that it was made of.
    pub sources: Vec<PartialSource>,
    /// Error bound of every splatted sample.
    pub sample_error: f64,
    /// The damage that was left out, if there was any.
    pub damage: Option<String>,
    /// The weights of views.
    pub(super) weights: Vec<WeightRecord>,
    /// The sums of pictures.
    pub(super) pictures: Vec<PictureRecord>,
}

/// Where the weights of a view lie.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WeightRecord {
    pub(super) view: usize,
    pub(super) place: RecordSpan,
}

/// Where the sums of a picture lie.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PictureRecord {
    pub(super) view: usize,
    pub(super) frame: usize,
    /// Whether it has planes of missing weights.
    pub(super) missing: bool,
    pub(super) place: RecordSpan,
}

/// Where a packed record lies, with its checksum.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RecordSpan {
    pub(super) offset: u64,
    pub(super) bytes: u64,
    pub(super) checksum: u64,
}

impl PictureSetup {
    /// Pixels of a picture.
    pub(super) fn pixels(&self) -> usize {
        self.views[0].size[0] * self.views[0].size[1]
    }

    /// Planes of a picture.
    pub(super) fn planes(&self, missing: bool) -> usize {
        self.channels * (1 + usize::from(missing))
    }

    /// How the grid is cut into blocks.
    pub(super) fn blocks(&self) -> BlockGrid {
        BlockGrid { dims: self.grid.dims, edges: self.block }
    }

    /// The settings of pictures of these views.
    pub(super) fn config(&self, views: &[usize], frames: Vec<usize>, memory: usize) -> RenderConfig {
        RenderConfig {
            mode: Mode::Projection,
            views: views.iter().map(|view| self.views[*view]).collect(),
            kernel: self.kernel,
            quantity: self.quantity,
            frames,
            paired: self.paired.is_some(),
            region: None,
            splat_error: self.splat_error,
            fast: self.fast,
            allowed: self.tolerance.map(|(_, allowed)| allowed),
            error: Limit::Certified,
            certify: false,
            memory,
        }
    }

    /// The first setting in which another setup differs.
    pub(super) fn difference(&self, other: &Self) -> Option<String> {
        if self == other {
            return None;
        }
        let object = |setup: &Self| serde_json::to_value(setup).ok().and_then(|value| value.as_object().cloned());
        let (own, other) = (object(self)?, object(other)?);
        let named = |key: &String| match key.as_str() {
            "archive" | "frames" | "channels" | "block" | "values" | "axes" | "time_unit" | "calendar" => {
                "their archive".into()
            }
            "whole" | "grid" => "lattice".into(),
            "kernel" => "sigma or tau".into(),
            "paired" => "frames of views".into(),
            "direct" => "method".into(),
            "quick" => "fast".into(),
            key => key.replace('_', " "),
        };
        own.iter().find(|(key, value)| other.get(*key).unwrap_or(&Value::Null) != *value).map(|(key, _)| named(key))
    }

    /// An error unless pictures can be made of it.
    fn check(&self) -> Result<(), String> {
        let dims = |grid: &Grid| grid.dims.iter().all(|n| (1..=MOST_ALONG).contains(n));
        let sound = |grid: &Grid| {
            dims(grid)
                && grid.spacing.iter().all(|step| step.is_finite() && *step > 0.0)
                && grid.origin.iter().all(|at| at.is_finite())
        };
        ensure(sound(&self.grid) && sound(&self.whole), "has no sound lattice")?;
        ensure(self.block.iter().all(|edge| *edge > 0), "has no blocks")?;
        ensure((1..=MOST_VIEWS).contains(&self.views.len()), "has no sound number of views")?;
        let size = self.views[0].size;
        let pixels = size[0].checked_mul(size[1]).filter(|pixels| (1..=1 << 40).contains(&(*pixels as u64)));
        ensure(pixels.is_some() && self.views.iter().all(|view| view.size == size), "has no sound size of pictures")?;
        ensure(matches!(self.channels, 1 | 3), "has neither values nor colours")?;
        ensure(self.lod < 32 && self.exaggeration.is_finite() && self.exaggeration > 0.0, "has no sound lattice")?;
        let one_per_view = |frames: &Vec<usize>| frames.len() == self.views.len() && frames.is_sorted();
        ensure(self.paired.as_ref().is_none_or(one_per_view), "has no frame for each view")?;
        let all: Vec<usize> = (0..self.views.len()).collect();
        let config = self.config(&all, self.paired.clone().unwrap_or_default(), 0);
        let kernel = Kernel::new(Some(self.kernel.sigma), self.kernel.tau, &self.grid).map(drop);
        let cameras = || self.views.iter().try_for_each(|view| Camera::new(view, &self.grid).map(drop));
        let sound = config.check(None).and(kernel).and_then(|()| cameras());
        sound.map_err(|e| format!("has settings of no picture: {e}"))?;
        let labels = |(axis, n): (&AxisLabels, &usize)| axis.at.len() == *n && axis.at.iter().all(|at| at.is_finite());
        ensure(self.axes.iter().zip(&self.whole.dims).all(labels), "has no sound axes")
    }
}

impl Head {
    /// An error unless all numbers are sound. Records end before `end`.
    pub(super) fn check(&self, end: u64) -> Result<(), String> {
        self.look.check()?;
        let lattice = self.look.grid.whole();
        let within = |voxels: &Region| lattice.contains(voxels) && (0..3).all(|a| voxels.start[a] < voxels.end[a]);
        ensure(
            (1..=MOST_BOXES).contains(&self.boxes.len()) && self.boxes.iter().all(within),
            "has voxels beyond its lattice",
        )?;
        let sound = |source: &PartialSource| {
            let ([first, behind], times) = (source.frames, &source.times);
            let one_per_frame = times.is_empty() || times.len() == behind - first.min(behind);
            first < behind && behind <= self.look.frames && one_per_frame && times.iter().all(|time| time.is_finite())
        };
        ensure(!self.sources.is_empty() && self.sources.iter().all(sound), "has frames beyond its archive")?;
        let held =
            |frame: usize| self.sources.iter().any(|source| (source.frames[0]..source.frames[1]).contains(&frame));
        let paired =
            |record: &PictureRecord| self.look.paired.as_ref().is_none_or(|frames| frames[record.view] == record.frame);
        let sound =
            |record: &PictureRecord| record.view < self.look.views.len() && held(record.frame) && paired(record);
        ensure(self.pictures.iter().all(sound), "has pictures of no view or frame of its own")?;
        ensure(
            self.weights.iter().all(|record| record.view < self.look.views.len()),
            "has weights of no view of its own",
        )?;
        let before_end = |span: &RecordSpan| span.offset.checked_add(span.bytes).is_some_and(|behind| behind <= end);
        let weights = self.weights.iter().map(|record| &record.place);
        let mut spans = weights.chain(self.pictures.iter().map(|record| &record.place));
        ensure(spans.all(before_end), "has records beyond its end")?;
        ensure(self.sample_error >= 0.0, "has no sound error")
    }

    /// The labels of all frames of the archive. Frames that no source holds get the time of the last frame before them
    /// that a source holds, or of the first one.
    pub(super) fn time_labels(setup: &PictureSetup, sources: &[PartialSource]) -> TimeLabels {
        let mut times: Vec<Option<f64>> = vec![None; sources.iter().map(|source| source.frames[1]).max().unwrap_or(0)];
        for PartialSource { frames: [first, behind], times: own, .. } in sources {
            times[*first..*behind].iter_mut().zip(own).for_each(|(to, time)| *to = Some(*time));
        }
        let mut last = times.iter().copied().flatten().next();
        let fill = |time: Option<f64>| {
            last = time.or(last);
            last
        };
        let known: Option<Vec<f64>> = times.into_iter().map(fill).collect();
        TimeLabels::new(known.unwrap_or_default(), Some(&setup.time_unit), setup.calendar.as_deref())
    }
}

fn ensure(holds: bool, otherwise: &str) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise.into()) }
}
