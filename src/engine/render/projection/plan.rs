//! Divides the work so that memory stays within its budget.
//!
//! The number of views and frames rendered together, the pixels of a band and the blocks decoded together do not change
//! any pixel.

use crate::render::batches::{Layout, Scene, Share, in_batch};
use crate::render::config::RenderConfig;
use crate::render::splat::footprints::Splats;
use crate::render::splat::sparse_terms::SparseTerms;
use crate::render::splat::tile_rect::{TILE, TileRect, WIDEST};
use crate::render::splat::{DoubleRoom, ViewSetup};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::memory;

/// The memory of views that are rendered together.
#[derive(Debug, Clone)]
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
    /// The largest number of planes of a band that needed sums in f64 so far, in all batches.
    doubles: Arc<AtomicUsize>,
}

/// Planes of a band: all of them, and those of all views that have sums in f64 as well.
#[derive(Debug, Clone, Copy)]
struct Planes {
    all: usize,
    doubles: usize,
}

/// A band to splat, the blocks to decode at a time, and the room for sums in f64.
#[derive(Debug)]
pub(super) struct BandPlan {
    pub(super) rect: TileRect,
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

/// The sums of weights for every pixel: as splatted, and uncut.
const WEIGHT_BYTES: usize = 2 * size_of::<f64>();
/// The weights of a pixel beyond the cut, if pictures are certified.
const BEYOND_BYTES: usize = size_of::<f64>();

impl<'a> Budget<'a> {
    /// The least memory in bytes with which each view can be rendered alone.
    pub(super) fn least(config: &RenderConfig, kept: Kept, scene: &dyn Scene, setups: &[ViewSetup]) -> usize {
        let planes = scene.most_planes(1, config);
        let least = |setup: &ViewSetup| {
            let setups = std::slice::from_ref(setup);
            let budget = Budget::new(config, kept, scene, setups);
            let bands = budget.bytes(1, budget.all_double(planes), budget.smallest(), 1);
            let alone = fixed(config, setups) + bands.max(budget.bytes_while_ones());
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
        let block_bytes = scene.block_bytes(most_frames(scene, &config.frames), config);
        let block = scene.blocks().region(0);
        let doubles = Arc::default();
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
        let (size, alone) = (config.size(), Self::new(config, kept, scene, &setups[..1]));
        let frames = alone.frames(scene, config, most_frames(scene, &config.frames));
        let planes = scene.most_planes(frames, config);
        let fits = |budget: &Self| budget.fits(frames, budget.planes(planes), size);
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

    /// Bytes of the pictures of `frames` frames, bands of `size` pixels, and some blocks.
    fn bytes(&self, frames: usize, planes: Planes, size: [usize; 2], blocks: usize) -> usize {
        self.picture_bytes(frames) + self.band_bytes(planes, size) + blocks * self.block_bytes(planes.all)
    }

    /// Whether [`Self::bytes`] fit with one block; and also the smallest band, should all planes need sums in f64.
    fn fits(&self, frames: usize, planes: Planes, size: [usize; 2]) -> bool {
        let all_double = self.bytes(frames, self.all_double(planes.all), self.smallest(), 1);
        self.bytes(frames, planes, size, 1).max(all_double) <= self.available
    }

    /// Bytes to splat ones, in addition to those that are kept of them.
    fn bytes_while_ones(&self) -> usize {
        let of_view = |setup: &ViewSetup| {
            let (backend, threads) = (&setup.backend, rayon::current_num_threads());
            let numbers = threads * (backend.scratch(&self.block, 1) + backend.kept(&self.block) + self.block.voxels());
            backend.bytes_while_ones(self.size) + numbers * size_of::<f64>()
        };
        self.setups.iter().map(of_view).max().unwrap_or(0)
    }

    /// Bytes that splatting ones takes, with all that does not depend on bands.
    pub(super) fn planned_for_ones(&self) -> usize {
        self.fixed + self.bytes_while_ones()
    }

    /// The size of the smallest band.
    fn smallest(&self) -> [usize; 2] {
        [self.size[0].min(WIDEST), self.size[1].min(TILE)]
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

    /// Bytes of bands of `size` pixels, and of the scratch of all threads.
    fn band_bytes(&self, planes: Planes, size: [usize; 2]) -> usize {
        let of_views = |bytes: &dyn Fn(&ViewSetup) -> usize| self.setups.iter().map(bytes).sum::<usize>();
        let bands = of_views(&|setup| setup.backend.band_bytes(size, planes.all));
        let scratch = self.setups.iter().map(|setup| setup.backend.scratch(&self.block, planes.all)).max().unwrap_or(0);
        let threads = rayon::current_num_threads();
        // A thread may begin a plane in f64 in each view before it sees that there is no room; and it filters one.
        let more = threads * self.setups.len();
        let doubles = planes.doubles * self.double_bytes(size) + more * self.plane_bytes(size);
        bands + doubles + threads * scratch * size_of::<f64>()
    }

    /// Bytes of a plane in f64 of a band of `size` pixels, in the view where it takes most.
    fn plane_bytes(&self, size: [usize; 2]) -> usize {
        self.setups.iter().map(|setup| setup.backend.double_bytes(size)).max().unwrap_or(0)
    }

    /// Bytes of such a plane with what all threads copy of it to gather tiles.
    fn double_bytes(&self, size: [usize; 2]) -> usize {
        let copied = self.setups.iter().map(|setup| setup.backend.copied_bytes()).max().unwrap_or(0);
        self.plane_bytes(size) + rayon::current_num_threads() * copied
    }

    /// How many of some frames, the first ones, to render together, and the budget for them.
    pub(super) fn share(&self, scene: &mut dyn Scene, frames: &[usize], config: &RenderConfig) -> Result<Share<Self>> {
        let block_bytes = scene.block_bytes_of(frames, config)?(frames.len());
        let budget = Self { block_bytes, ..self.clone() };
        Ok(Share { frames: budget.frames(scene, config, frames.len()), memory: budget })
    }

    /// How many of `most` frames to render together.
    fn frames(&self, scene: &dyn Scene, config: &RenderConfig, most: usize) -> usize {
        let size = self.size.map(|n| n.min(PREFERRED_SIDE));
        let fits = |f: &usize| self.fits(*f, self.planes(scene.most_planes(*f, config)), size);
        (1..=most).rev().find(fits).unwrap_or(1)
    }

    /// Splits some pixels into as few bands as fit, of nearly equal size. Bands begin at the first pixel of a tile.
    pub(super) fn split(&self, layout: &Layout, rect: &TileRect) -> Vec<TileRect> {
        let planes = self.planes(layout.planes());
        let [columns, rows] = [rect.x.len().div_ceil(WIDEST), rect.y.len().div_ceil(TILE)];
        let size = |across: usize, down: usize| {
            [rect.x.len().min(columns.div_ceil(across) * WIDEST), rect.y.len().min(rows.div_ceil(down) * TILE)]
        };
        let fewest = |across: usize| {
            let down = (1..=rows).find(|down| self.fits(layout.frames, planes, size(across, *down)))?;
            Some((across * down, size(across, down)))
        };
        let bands = (1..=columns).filter_map(fewest).min_by_key(|(bands, _)| *bands);
        rect.cover(bands.map_or([WIDEST, TILE], |(_, size)| size))
    }

    /// The plan of a band of these pixels.
    pub(super) fn plan(&self, layout: &Layout, rect: TileRect) -> BandPlan {
        let (size, all) = (rect.size(), layout.planes());
        let blocks = self.blocks_at_a_time(layout, size);
        let used = self.bytes(layout.frames, Planes { all, doubles: 0 }, size, blocks);
        let left = self.available.saturating_sub(used) / self.double_bytes(size).max(1);
        // The smallest band fits with all planes in f64.
        let doubles = self.all_double(all).doubles;
        let most = if self.is_smallest(size) { doubles } else { left.min(doubles) };
        BandPlan { rect, blocks, room: DoubleRoom::new(most) }
    }

    fn is_smallest(&self, size: [usize; 2]) -> bool {
        size[0] <= WIDEST && size[1] <= TILE
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
        self.fixed + self.bytes(layout.frames, planes, band.rect.size(), band.blocks)
    }

    /// How many blocks to decode at a time while a band of `size` pixels is splatted.
    fn blocks_at_a_time(&self, layout: &Layout, size: [usize; 2]) -> usize {
        let all = layout.planes();
        let planes = if self.is_smallest(size) { self.all_double(all) } else { self.planes(all) };
        let used = self.bytes(layout.frames, planes, size, 0);
        // The lattice reads its blocks plane by plane, so few blocks stay in the caches.
        let most = if self.setups.iter().any(|setup| setup.backend.is_lattice()) {
            rayon::current_num_threads()
        } else {
            memory::MOST_BLOCKS
        };
        (self.available.saturating_sub(used) / self.block_bytes(layout.planes())).clamp(1, most)
    }
}

/// The preferred least width and height of a band: a block that reaches over a band's edge is decoded for both bands.
const PREFERRED_SIDE: usize = 128;

/// Bytes that do not depend on how the work is divided, weights included.
fn fixed(config: &RenderConfig, setups: &[ViewSetup]) -> usize {
    let [width, height] = config.size();
    let ones = |setup: &ViewSetup| setup.backend.ones_bytes(config.size());
    let weights = WEIGHT_BYTES + if config.certify { BEYOND_BYTES } else { 0 };
    memory::FIXED + setups.len() * width * height * weights + setups.iter().map(ones).sum::<usize>()
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
