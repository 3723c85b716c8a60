//! Finds the visible tiles of slabs from the value ranges of blocks and their opacity (eq 30), and the blocks that
//! these tiles need.

use super::blend::Blend;
use crate::base::grid::Region;
use crate::render::scene::Selection;
use crate::render::splat::TileRect;
use crate::render::splat::ViewSetup;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The tiles of all slabs of a view.
pub(in crate::render) struct Visible {
    /// Pixels per side of a tile.
    side: usize,
    columns: usize,
    tiles: usize,
    /// Whether a tile of a slab is visible: slab * tiles + tile.
    needed: Vec<bool>,
    /// Tiles that are opaque in all frames.
    closed: Vec<AtomicBool>,
    /// The slabs and tiles that each block reaches.
    blocks: Vec<Reached>,
}

/// The slabs and tiles that a block reaches.
struct Reached {
    block: usize,
    slabs: Range<usize>,
    /// Columns and rows of tiles.
    tiles: [Range<usize>; 2],
}

impl Visible {
    /// Bytes of a tile of a slab.
    pub(in crate::render) const BYTES: usize = size_of::<(f64, f64)>() + size_of::<bool>();
    /// Bytes of a block.
    pub(in crate::render) const BLOCK_BYTES: usize = size_of::<Reached>() + size_of::<(usize, (f64, f64))>();

    /// The visible tiles of a batch in the slabs of a view. A mean lies between the smallest and the largest value of
    /// all blocks that reach its tile. So a tile is invisible if no value between these is visible.
    pub(in crate::render) fn new<B: Blend>(selection: &Selection, slabs: &[ViewSetup], blend: &B) -> Self {
        let setup = &slabs[0];
        let side = setup.backend.tile();
        let [columns, rows] = setup.camera.size.map(|pixels| pixels.div_ceil(side));
        let tiles = columns * rows;
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); tiles * slabs.len()];
        let mut blocks = Vec::new();
        for (block, (lo, hi)) in selection.ranges.iter().copied() {
            let region = setup.blocks.region(block);
            for part in parts(&region) {
                for at in Reached::new(block, &part, slabs, side).indices(columns, tiles) {
                    ranges[at] = (ranges[at].0.min(lo), ranges[at].1.max(hi));
                }
            }
            blocks.push(Reached::new(block, &region, slabs, side));
        }
        let needed = ranges.into_iter().map(|range| range.0 <= range.1 && blend.shows(range)).collect();
        let closed = (0..tiles).map(|_| AtomicBool::new(false)).collect();
        Self { side, columns, tiles, needed, closed, blocks }
    }

    /// Whether the tile at `rect` of a slab is visible and not yet hidden.
    pub(in crate::render) fn is_open(&self, slab: usize, rect: &TileRect) -> bool {
        self.can_show(slab, self.tile(rect))
    }

    fn can_show(&self, slab: usize, tile: usize) -> bool {
        self.needed[slab * self.tiles + tile] && !self.closed[tile].load(Relaxed)
    }

    /// Marks a tile as opaque in all frames.
    pub(in crate::render) fn close(&self, rect: &TileRect) {
        self.closed[self.tile(rect)].store(true, Relaxed);
    }

    fn tile(&self, rect: &TileRect) -> usize {
        rect.y.start / self.side * self.columns + rect.x.start / self.side
    }

    /// Whether any tile in these rows of a slab is visible and not yet hidden.
    pub(in crate::render) fn any(&self, slab: usize, rows: &Range<usize>) -> bool {
        let tiles = rows.start / self.side * self.columns..rows.end.div_ceil(self.side) * self.columns;
        tiles.into_iter().any(|tile| self.can_show(slab, tile))
    }

    /// The blocks that reach such a tile of these slabs in these rows.
    pub(in crate::render) fn blocks(&self, slabs: &[usize], rows: &Range<usize>) -> Vec<usize> {
        let within = rows.start / self.side..rows.end.div_ceil(self.side);
        let needs = |b: &&Reached| {
            slabs.iter().filter(|slab| b.slabs.contains(slab)).any(|slab| {
                let rows = b.tiles[1].start.max(within.start)..b.tiles[1].end.min(within.end);
                rows.into_iter()
                    .any(|row| b.tiles[0].clone().any(|column| self.can_show(*slab, row * self.columns + column)))
            })
        };
        self.blocks.iter().filter(needs).map(|b| b.block).collect()
    }

    /// Number of tiles of all slabs, of invisible tiles among them, and of tiles that became opaque.
    pub(in crate::render) fn counts(&self) -> [u64; 3] {
        let clear = self.needed.iter().filter(|needed| !**needed).count();
        let closed = self.closed.iter().filter(|closed| closed.load(Relaxed)).count();
        [self.needed.len(), clear, closed].map(|n| n as u64)
    }
}

impl Reached {
    /// The slabs and tiles that the voxels of a region reach.
    fn new(block: usize, region: &Region, slabs: &[ViewSetup], side: usize) -> Self {
        let (setup, region) = (&slabs[0], region.intersect(&slabs[0].clip));
        let tiles = setup.pixels_reached(&region).map(|pixels| pixels.start / side..pixels.end.div_ceil(side));
        let slabs =
            if region.is_empty() { 0..0 } else { reached(slabs, setup.camera.depths_of(&setup.grid.crop(&region))) };
        Self { block, slabs, tiles }
    }

    /// The indices of its tiles among the tiles of all slabs.
    fn indices(&self, columns: usize, tiles: usize) -> impl Iterator<Item = usize> + '_ {
        let of_slab = move |slab: usize| {
            let row = move |row: usize| self.tiles[0].clone().map(move |column| slab * tiles + row * columns + column);
            self.tiles[1].clone().flat_map(row)
        };
        self.slabs.clone().flat_map(of_slab)
    }
}

/// The slabs that the kernels of voxels between two depths reach.
fn reached(slabs: &[ViewSetup], [nearest, farthest]: [f64; 2]) -> Range<usize> {
    let ends = |setup: &ViewSetup| setup.slab.map_or([f64::NEG_INFINITY, f64::INFINITY], |slab| slab.reached_from());
    let first = slabs.partition_point(|setup| ends(setup)[1] < nearest);
    first..slabs.partition_point(|setup| ends(setup)[0] <= farthest).max(first)
}

/// Cuts a region into parts. Seen at an angle, a part reaches few pixels and few slabs.
fn parts(region: &Region) -> Vec<Region> {
    const A_SIDE: usize = 4;
    let dims = region.dims();
    let cut = |axis: usize, n: usize| region.start[axis] + dims[axis] * n / A_SIDE;
    let part = |n: usize| {
        let index = [n % A_SIDE, n / A_SIDE % A_SIDE, n / (A_SIDE * A_SIDE)];
        let [start, end] = [0, 1].map(|more| std::array::from_fn(|axis| cut(axis, index[axis] + more)));
        Region { start, end }
    };
    (0..A_SIDE.pow(3)).map(part).filter(|part| !part.is_empty()).collect()
}
