//! Divides the work so that memory stays within its budget.
//!
//! The number of views and frames rendered together, the rows of a band and the blocks decoded together do not change
//! any pixel.

use super::config::RenderConfig;
use super::layout::Layout;
use super::scene::Scene;
use super::splat::ViewSetup;
use super::splat::footprints::Splats;
use super::splat::sparse_terms::SparseTerms;
use super::splat::tile_rect::TILE;
use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::base::memory;
use std::ops::Range;

/// The memory of views that are rendered together.
#[derive(Debug)]
pub(super) struct Budget<'a> {
    setups: &'a [ViewSetup],
    /// Bytes left for pictures, planes and blocks, after the weights.
    available: usize,
    size: [usize; 2],
    /// Bytes of a pixel and frame in the finished pictures of all views.
    pixel_bytes: usize,
    /// Bytes of a pixel in the copy of a frame that interleaves its channels; 0 for one channel.
    together: usize,
    /// The largest block.
    block: Region,
    block_bytes: usize,
}

/// What is kept of every pixel until the sink takes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kept {
    /// Its value, and perhaps its error.
    Value,
    /// The sums that make its value: emission and missing weights.
    Sums,
}

impl Kept {
    /// Bytes of a pixel and frame of a view, and bytes of its copy that interleaves channels.
    fn bytes(self, channels: usize, config: &RenderConfig) -> [usize; 2] {
        let values = channels * (1 + usize::from(config.certify)) * size_of::<f32>();
        match self {
            Self::Value => [values, if channels > 1 { values } else { 0 }],
            Self::Sums => [2 * channels * size_of::<f64>(), 0],
        }
    }
}

/// The sums of weights for every pixel: as splatted, uncut, and beyond the cut.
const WEIGHT_BYTES: usize = 3 * size_of::<f64>();

impl<'a> Budget<'a> {
    /// The least memory in bytes with which each view can be rendered alone.
    pub(super) fn least((config, kept): (&RenderConfig, Kept), scene: &dyn Scene, setups: &[ViewSetup]) -> usize {
        let planes = scene.most_planes(1, config);
        let least = |setup: &ViewSetup| {
            let setups = std::slice::from_ref(setup);
            fixed(config, setups) + Budget::new((config, kept), scene, setups).bytes(1, planes, TILE)
        };
        setups.iter().map(least).max().unwrap_or(0)
    }

    /// An error unless the settings allow `least` bytes.
    pub(super) fn check(config: &RenderConfig, least: usize) -> Result<()> {
        if least <= config.memory {
            return Ok(());
        }
        let ([width, height], mib) = (config.size(), least.div_ceil(1 << 20));
        let threads = rayon::current_num_threads();
        let pictures = format!("pictures of {width}x{height} pixels of this volume");
        Err(Error::setting(
            "memory",
            format!("{pictures} need at least {mib}MiB with {threads} thread(s), without the memory of the sink"),
        ))
    }

    /// The budget for pictures from these views.
    fn new((config, kept): (&RenderConfig, Kept), scene: &dyn Scene, setups: &'a [ViewSetup]) -> Self {
        let [of_a_view, together] = kept.bytes(scene.channels(), config);
        let (size, pixel_bytes) = (config.size(), setups.len() * of_a_view);
        let available = config.memory.saturating_sub(fixed(config, setups));
        let (block, block_bytes) = (scene.blocks().region(0), scene.block_bytes());
        Self { setups, available, size, pixel_bytes, together, block, block_bytes }
    }

    /// The budget for as many of the first views as fit together: whole pictures of all views, and as many frames at a
    /// time as the first view has alone. One view if the selection of blocks depends on the view.
    pub(super) fn of_most((config, kept): (&RenderConfig, Kept), scene: &dyn Scene, setups: &'a [ViewSetup]) -> Self {
        let most = if config.chooses_by_view() { 1 } else { setups.len() };
        Self::of_first((config, kept), scene, &setups[..most], config.size()[1])
    }

    /// The budget for as many of the first views as fit together with `rows` rows of all pictures.
    fn of_first(
        (config, kept): (&RenderConfig, Kept),
        scene: &dyn Scene,
        setups: &'a [ViewSetup],
        rows: usize,
    ) -> Self {
        let alone = Self::new((config, kept), scene, &setups[..1]);
        let frames = alone.frames(scene, config, most_frames(scene, &config.frames));
        let planes = scene.most_planes(frames, config);
        let fits = |budget: &Self| budget.bytes(frames, planes, rows) <= budget.available;
        let several = |count: usize| Some(Self::new((config, kept), scene, &setups[..count])).filter(fits);
        let (mut best, mut least, mut most) = (alone, 1, setups.len());
        while least < most {
            let middle = least.midpoint(most + 1);
            match several(middle) {
                Some(budget) => (best, least) = (budget, middle),
                None => most = middle - 1,
            }
        }
        best
    }

    /// The views.
    pub(super) fn setups(&self) -> &'a [ViewSetup] {
        self.setups
    }

    /// Pixels of a picture.
    pub(super) fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Bytes of the pictures of `frames` frames, bands of `rows` rows, and one block.
    fn bytes(&self, frames: usize, planes: usize, rows: usize) -> usize {
        self.picture_bytes(frames) + self.band_bytes(planes, rows) + self.block_bytes(planes)
    }

    /// Bytes of a block, with its sparse terms and their projections in each view that takes footprints, and its cells of
    /// ones in each other view.
    fn block_bytes(&self, planes: usize) -> usize {
        let footprints = self.setups.iter().filter(|setup| !setup.backend.is_lattice()).count();
        let terms = if footprints > 0 { SparseTerms::most_bytes(planes) } else { 0 };
        let kept: usize = self.setups.iter().map(|setup| setup.backend.kept(&self.block)).sum();
        self.block_bytes + self.block.voxels() * (terms + footprints * Splats::BYTES) + kept * size_of::<f64>()
    }

    /// Bytes of a batch's finished pictures.
    fn picture_bytes(&self, frames: usize) -> usize {
        (frames * self.pixel_bytes + self.together) * self.pixels()
    }

    /// Bytes of bands of `rows` rows with all planes, and of the scratch of all threads.
    fn band_bytes(&self, planes: usize, rows: usize) -> usize {
        let band = |planes: usize| move |setup: &ViewSetup| setup.backend.band_sums(self.size[0], rows, planes);
        let scratch = self.setups.iter().map(|setup| setup.backend.scratch(&self.block, planes)).max().unwrap_or(0);
        let (bands, threads) = (self.setups.iter().map(band(planes)).sum::<usize>(), rayon::current_num_threads());
        // A thread filters one plane of a lattice in f64, out of place.
        let filtered = self.setups.iter().map(band(1)).max().unwrap_or(0);
        let numbers = bands + threads * (scratch + filtered);
        numbers * size_of::<f64>()
    }

    /// How many of `most` frames to render together.
    pub(super) fn frames(&self, scene: &dyn Scene, config: &RenderConfig, most: usize) -> usize {
        let rows = self.size[1].min(FEW_ROWS * TILE);
        let fits = |f: &usize| self.bytes(*f, scene.most_planes(*f, config), rows) <= self.available;
        (1..=most).rev().find(fits).unwrap_or(1)
    }

    /// The bands of rows to splat one after another, each as tall as fits.
    pub(super) fn bands(&self, layout: &Layout) -> Vec<Range<usize>> {
        let rows = |tiles: usize| (tiles * TILE).min(self.size[1]);
        let fits = |tiles: &usize| self.bytes(layout.frames, layout.planes(), rows(*tiles)) <= self.available;
        let rows = rows((1..=self.size[1].div_ceil(TILE)).rev().find(fits).unwrap_or(1));
        (0..self.size[1]).step_by(rows).map(|y| y..y.saturating_add(rows).min(self.size[1])).collect()
    }

    /// How many blocks to decode at a time while a band of `rows` is splatted.
    pub(super) fn batch(&self, layout: &Layout, rows: usize) -> usize {
        let used = self.picture_bytes(layout.frames) + self.band_bytes(layout.planes(), rows);
        // The lattice reads its blocks plane by plane, so few blocks stay in the caches.
        let most = if self.setups.iter().any(|setup| setup.backend.is_lattice()) {
            rayon::current_num_threads()
        } else {
            memory::MOST_BLOCKS
        };
        (self.available.saturating_sub(used) / self.block_bytes(layout.planes())).clamp(1, most)
    }
}

/// The preferred minimum height of a band, in tiles: a block that reaches over a band's edge is decoded for both bands.
const FEW_ROWS: usize = 4;

/// Bytes that do not depend on how the work is divided, weights included.
fn fixed(config: &RenderConfig, setups: &[ViewSetup]) -> usize {
    let [width, height] = config.size();
    let ones = |setup: &ViewSetup| setup.backend.ones(width, height) * size_of::<f64>();
    memory::FIXED + setups.len() * width * height * WEIGHT_BYTES + setups.iter().map(ones).sum::<usize>()
}

/// The largest number of requested frames in one batch.
fn most_frames(scene: &dyn Scene, mut frames: &[usize]) -> usize {
    let mut most = 0;
    while let Some(first) = frames.first() {
        let (batch, later) = frames.split_at(in_batch(scene, *first, frames));
        (most, frames) = (most.max(batch.len()), later);
    }
    most
}

/// How many of `frames` belong to the same batch as the first.
pub(super) fn in_batch(scene: &dyn Scene, first: usize, frames: &[usize]) -> usize {
    let end = scene.batch_end(first);
    frames.partition_point(|f| *f < end)
}
