//! Divides the work so that memory stays within its budget.
//!
//! The number of views and frames rendered together, the rows of a band and the blocks decoded together do not change
//! any pixel.

use crate::render::batches::{Layout, Scene, in_batch};
use crate::render::config::RenderConfig;
use crate::render::splat::footprints::Splats;
use crate::render::splat::sparse_terms::SparseTerms;
use crate::render::splat::tile_rect::TILE;
use crate::render::splat::{DoubleRoom, ViewSetup};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::memory;

/// The memory of views that are rendered together.
#[derive(Debug)]
pub(super) struct Budget<'a> {
    setups: &'a [ViewSetup],
    /// Bytes that do not depend on how the work is divided.
    fixed: usize,
    /// Bytes left for pictures, planes and blocks.
    available: usize,
    size: [usize; 2],
    /// Bytes of a pixel and frame in the finished pictures of all views.
    pixel_bytes: usize,
    /// Bytes of a pixel in the copy of a frame that interleaves its channels; 0 for one channel.
    together: usize,
    /// The largest block.
    block: Region,
    block_bytes: usize,
    /// The largest number of planes of a band that needed sums in f64 so far.
    doubles: AtomicUsize,
}

/// Planes of a band: all of them, and those of all views that have sums in f64 as well.
#[derive(Debug, Clone, Copy)]
struct Planes {
    all: usize,
    doubles: usize,
}

/// A band of rows to splat, the blocks to decode at a time, and the room for sums in f64.
#[derive(Debug)]
pub(super) struct BandPlan {
    pub(super) rows: Range<usize>,
    pub(super) blocks: usize,
    pub(super) room: DoubleRoom,
}

/// The numbers stored for every pixel until the sink takes it.
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
    pub(super) fn least(config: &RenderConfig, kept: Kept, scene: &dyn Scene, setups: &[ViewSetup]) -> usize {
        let planes = scene.most_planes(1, config);
        let least = |setup: &ViewSetup| {
            let setups = std::slice::from_ref(setup);
            let budget = Budget::new(config, kept, scene, setups);
            let alone = fixed(config, setups) + budget.bytes(1, budget.all_double(planes), TILE, 1);
            memory::least(|memory| alone + scene.shared_bytes(memory))
        };
        setups.iter().map(least).max().unwrap_or(0)
    }

    /// The budget for pictures from these views.
    fn new(config: &RenderConfig, kept: Kept, scene: &dyn Scene, setups: &'a [ViewSetup]) -> Self {
        let [of_a_view, together] = kept.bytes(scene.channels(), config);
        let (size, pixel_bytes) = (config.size(), setups.len() * of_a_view);
        let fixed = fixed(config, setups) + scene.shared_bytes(config.memory);
        let available = config.memory.saturating_sub(fixed);
        let (block, block_bytes) = (scene.blocks().region(0), scene.block_bytes());
        let doubles = AtomicUsize::new(0);
        Self { setups, fixed, available, size, pixel_bytes, together, block, block_bytes, doubles }
    }

    /// The budget for as many of the first views as fit together: whole pictures of all views, and as many frames at a
    /// time as the first view has alone. One view if the selection of blocks depends on the view.
    pub(super) fn for_most_views(
        config: &RenderConfig,
        kept: Kept,
        scene: &dyn Scene,
        setups: &'a [ViewSetup],
    ) -> Self {
        let (rows, alone) = (config.size()[1], Self::new(config, kept, scene, &setups[..1]));
        let frames = alone.frames(scene, config, most_frames(scene, &config.frames));
        let planes = scene.most_planes(frames, config);
        let fits = |budget: &Self| budget.fits(frames, budget.planes(planes), rows);
        let several = |count: usize| Some(Self::new(config, kept, scene, &setups[..count])).filter(fits);
        let (mut best, mut least) = (alone, 1);
        let mut most = if config.chooses_by_view() { 1 } else { setups.len() };
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

    /// Width and height of a picture.
    pub(super) fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Pixels of a picture.
    pub(super) fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The planes of a band, with as many in f64 as have been seen.
    fn planes(&self, all: usize) -> Planes {
        Planes { all, doubles: self.doubles.load(Relaxed).min(all * self.setups.len()) }
    }

    /// The planes of a band if all have sums in f64.
    fn all_double(&self, all: usize) -> Planes {
        Planes { all, doubles: all * self.setups.len() }
    }

    /// Bytes of the pictures of `frames` frames, bands of `rows` rows, and some blocks.
    fn bytes(&self, frames: usize, planes: Planes, rows: usize, blocks: usize) -> usize {
        self.picture_bytes(frames) + self.band_bytes(planes, rows) + blocks * self.block_bytes(planes.all)
    }

    /// Whether [`Self::bytes`] fit with one block; and also the lowest band, should all planes need sums in f64.
    fn fits(&self, frames: usize, planes: Planes, rows: usize) -> bool {
        let (bytes, lowest) =
            (self.bytes(frames, planes, rows, 1), self.bytes(frames, self.all_double(planes.all), TILE, 1));
        bytes.max(lowest) <= self.available
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

    /// Bytes of bands of `rows` rows, and of the scratch of all threads.
    fn band_bytes(&self, planes: Planes, rows: usize) -> usize {
        let of_views = |bytes: &dyn Fn(&ViewSetup) -> usize| self.setups.iter().map(bytes).sum::<usize>();
        let bands = of_views(&|setup| setup.backend.band_bytes(self.size[0], rows, planes.all));
        let scratch = self.setups.iter().map(|setup| setup.backend.scratch(&self.block, planes.all)).max().unwrap_or(0);
        let threads = rayon::current_num_threads();
        // A thread may begin a plane in f64 in each view before it sees that there is no room; and it filters one.
        let more = threads * self.setups.len();
        bands + (planes.doubles + more) * self.double_bytes(rows) + threads * scratch * size_of::<f64>()
    }

    /// Bytes of a plane in f64 of a band of `rows` rows, in the view where it takes most.
    fn double_bytes(&self, rows: usize) -> usize {
        self.setups.iter().map(|setup| setup.backend.double_bytes(self.size[0], rows)).max().unwrap_or(0)
    }

    /// How many of `most` frames to render together.
    pub(super) fn frames(&self, scene: &dyn Scene, config: &RenderConfig, most: usize) -> usize {
        let rows = self.size[1].min(FEW_ROWS * TILE);
        let fits = |f: &usize| self.fits(*f, self.planes(scene.most_planes(*f, config)), rows);
        (1..=most).rev().find(fits).unwrap_or(1)
    }

    /// The next band of rows to splat: splits the rows from `start` on into as few bands as fit, of nearly equal height.
    pub(super) fn band(&self, layout: &Layout, start: usize) -> BandPlan {
        let left = self.size[1] - start;
        let rows = |tiles: usize| (tiles * TILE).min(left);
        let fits = |tiles: &usize| self.fits(layout.frames, self.planes(layout.planes()), rows(*tiles));
        let most = rows((1..=left.div_ceil(TILE)).rev().find(fits).unwrap_or(1));
        let rows = rows(left.div_ceil(left.div_ceil(most)).div_ceil(TILE));
        self.plan(layout, start..start + rows)
    }

    /// The plan of a band of these rows.
    pub(super) fn plan(&self, layout: &Layout, rows: Range<usize>) -> BandPlan {
        let (blocks, all) = (self.blocks_at_a_time(layout, rows.len()), layout.planes());
        let used = self.bytes(layout.frames, Planes { all, doubles: 0 }, rows.len(), blocks);
        let left = self.available.saturating_sub(used) / self.double_bytes(rows.len()).max(1);
        // The lowest band fits with all planes in f64.
        let doubles = self.all_double(all).doubles;
        let most = if rows.len() <= TILE { doubles } else { left.min(doubles) };
        BandPlan { rows, blocks, room: DoubleRoom::new(most) }
    }

    /// Learns from a splatted band how many planes need sums in f64. If it had too little room, it shows only some of
    /// them: then the next band gets room for twice as many.
    pub(super) fn learn(&self, band: &BandPlan) {
        let seen = if band.room.is_exceeded() { 2 * band.room.used() } else { band.room.used() };
        self.doubles.fetch_max(seen, Relaxed);
    }

    /// Bytes that a splatted band had, with all that does not depend on bands.
    pub(super) fn granted_bytes(&self, layout: &Layout, band: &BandPlan) -> usize {
        let planes = Planes { all: layout.planes(), doubles: band.room.granted() };
        self.fixed + self.bytes(layout.frames, planes, band.rows.len(), band.blocks)
    }

    /// How many blocks to decode at a time while a band of `rows` is splatted.
    fn blocks_at_a_time(&self, layout: &Layout, rows: usize) -> usize {
        let all = layout.planes();
        let planes = if rows <= TILE { self.all_double(all) } else { self.planes(all) };
        let used = self.bytes(layout.frames, planes, rows, 0);
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
    let ones = |setup: &ViewSetup| setup.backend.ones_bytes(width, height);
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
