//! A band of a picture while blocks are splatted into it, by footprints or by way of a lattice, and its tiles once they are.

use super::RenderReport;
use super::lap;
use super::lattice::{CellPlane, Cells, Gather, Lattice, Placed, Rectangle, Work};
use super::plane_values::{BlockPlanes, Scratch};
use super::sparse_terms::{Layout, SparseTerms};
use super::splat::{Splats, Tile};
use super::tile_rect::{TILE, TileRect};
use super::view_setup::ViewSetup;
use crate::base::error::Result;
use crate::wavelet::Lane;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Where blocks come from.
pub(super) trait Blocks: Sync {
    /// What a block adds to the planes.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;
}

/// A band of a picture.
pub(super) struct BandAccumulator<'a> {
    band: Band<'a>,
    planes: usize,
    sums: Sums<'a>,
}

/// Some rows of the picture of a view.
#[derive(Clone)]
struct Band<'a> {
    setup: &'a ViewSetup,
    rows: Range<usize>,
}

impl Band<'_> {
    /// Whether a block is to be splatted here.
    fn sees(&self, block: usize) -> bool {
        self.setup.sees(block, &self.rows)
    }
}

enum Sums<'a> {
    Tiles(Vec<Tile>),
    Cells(&'a Lattice, Cells),
}

impl<'a> BandAccumulator<'a> {
    /// Some rows of a picture with all planes at zero.
    pub(super) fn new(setup: &'a ViewSetup, rows: Range<usize>, layout: &Layout) -> Self {
        let (width, planes) = (setup.camera.size[0], layout.planes());
        let tile = |place| Tile::new(place, planes, layout.order);
        let sums = match &setup.lattice {
            Some(lattice) => Sums::Cells(lattice, lattice.cells_of(width, &rows, planes)),
            None => Sums::Tiles(TileRect::cover(width, rows.clone(), TILE).into_iter().map(tile).collect()),
        };
        Self { band: Band { setup, rows }, planes, sums }
    }

    /// Calls `finish` for every tile with its pixels in some pictures as large as the whole.
    pub(super) fn finish<T: Send>(
        &self,
        pictures: &mut [T],
        finish: impl Fn(ResolvedTile<'_>, &mut Pixels<'_, T>) + Sync,
    ) {
        Self::finish_layers(std::slice::from_ref(self), 1, pictures, |_, _| true, finish);
    }

    /// The same for the same rows of several pictures that look alike, layers one behind the other: of every tile first those
    /// that are `wanted` of the first few layers together, then of the next.
    pub(super) fn finish_layers<T: Send>(
        layers: &[Self],
        together: usize,
        pictures: &mut [T],
        wanted: impl Fn(usize, &TileRect) -> bool + Sync,
        finish: impl Fn(ResolvedTile<'_>, &mut Pixels<'_, T>) + Sync,
    ) {
        let Some(Self { band, .. }) = layers.first() else { return };
        let (width, side) = (band.setup.camera.size[0], band.setup.tile());
        let columns = width.div_ceil(side);
        let places = TileRect::cover(width, band.rows.clone(), side);
        let bands = layers[0].by_rows_of_tiles(pictures, side);
        places.par_chunks(columns).zip(bands).enumerate().for_each(|(n, (places, planes))| {
            let mut pixels = Pixels { planes, width, top: places[0].y.start };
            for (i, place) in places.iter().enumerate() {
                for first in (0..layers.len()).step_by(together) {
                    let some = first..layers.len().min(first + together);
                    let some: Vec<&Self> = some.filter(|n| wanted(*n, place)).map(|n| &layers[n]).collect();
                    if !some.is_empty() {
                        finish(ResolvedTile::new(&some, place, n * columns + i), &mut pixels);
                    }
                }
            }
        });
    }

    /// For every row of tiles its rows of every picture.
    fn by_rows_of_tiles<'p, T>(&self, pictures: &'p mut [T], side: usize) -> Vec<Vec<&'p mut [T]>> {
        let [width, height] = self.band.setup.camera.size;
        let mut bands: Vec<Vec<&mut [T]>> = Vec::new();
        bands.resize_with(self.band.rows.len().div_ceil(side), Vec::new);
        for picture in pictures.chunks_exact_mut(width * height) {
            let rows = picture[self.band.rows.start * width..self.band.rows.end * width].chunks_mut(side * width);
            bands.iter_mut().zip(rows).for_each(|(band, rows)| band.push(rows));
        }
        bands
    }
}

/// A tile that has all its blocks, in one layer or more.
pub(super) struct ResolvedTile<'a> {
    pub(super) place: &'a TileRect,
    pub(super) layers: usize,
    /// Of a layer.
    planes: usize,
    sums: TileSums<'a>,
}

enum TileSums<'a> {
    Tiles(Vec<&'a Tile>),
    Gather(Gather<'a>),
}

impl<'a> ResolvedTile<'a> {
    /// The tile with such a number in some layers that look alike.
    fn new(layers: &[&'a BandAccumulator<'a>], place: &'a TileRect, number: usize) -> Self {
        let (mut tiles, mut cells) = (Vec::new(), Vec::new());
        for layer in layers {
            match &layer.sums {
                Sums::Tiles(of_band) => tiles.push(&of_band[number]),
                Sums::Cells(lattice, of_band) => cells.push((*lattice, of_band)),
            }
        }
        let planes = layers[0].planes;
        let sums = match cells.first() {
            Some((lattice, _)) => {
                let cells: Vec<&Cells> = cells.iter().map(|(_, cells)| *cells).collect();
                TileSums::Gather(lattice.gather((&cells, planes), place))
            }
            None => TileSums::Tiles(tiles),
        };
        Self { place, layers: layers.len(), planes, sums }
    }

    /// The planes that may have sums, counted through all layers.
    pub(super) fn used(&self) -> Vec<usize> {
        match &self.sums {
            TileSums::Tiles(_) => (0..self.layers * self.planes).collect(),
            TileSums::Gather(gather) => gather.used().to_vec(),
        }
    }

    /// The planes of all layers at `count` pixels from `first` on, into the first lanes of `planes`.
    pub(super) fn load(&mut self, first: usize, count: usize, planes: &mut [Lane]) {
        match &mut self.sums {
            TileSums::Tiles(tiles) => {
                let of_layers = planes.chunks_exact_mut(self.planes.max(1)); // of none there is nothing to load
                tiles.iter().zip(of_layers).for_each(|(tile, planes)| tile.load(first, count, planes));
            }
            TileSums::Gather(gather) => gather.load(first, count, planes),
        }
    }

    /// The same where there is one plane only.
    pub(super) fn load_one(&mut self, first: usize, count: usize) -> Lane {
        let mut planes = [Lane::default()];
        match &mut self.sums {
            TileSums::Tiles(tiles) => tiles[0].load(first, count, &mut planes),
            TileSums::Gather(gather) => planes[0] = gather.load_one(first, count),
        }
        planes[0]
    }
}

/// The rows of some pictures that a row of tiles is in.
pub(super) struct Pixels<'a, T> {
    planes: Vec<&'a mut [T]>,
    width: usize,
    top: usize,
}

impl<T> Pixels<'_, T> {
    /// Neighbouring pixels of a row of a picture.
    pub(super) fn at(&mut self, picture: usize, [x, y]: [usize; 2], count: usize) -> &mut [T] {
        &mut self.planes[picture][(y - self.top) * self.width + x..][..count]
    }
}

impl<T: Copy> Pixels<'_, T> {
    /// Puts neighbouring pixels of a row into a picture.
    pub(super) fn put(&mut self, picture: usize, [x, y]: [usize; 2], pixels: &[T]) {
        self.at(picture, [x, y], pixels.len()).copy_from_slice(pixels);
    }
}

/// Splats blocks in order, `batch` at a time, each into all canvases that see it. It is decoded once for those that take
/// footprints, and once for those that have a lattice.
pub(super) fn splat(
    accumulators: &mut [BandAccumulator<'_>],
    blocks: &[usize],
    batch: usize,
    source: &dyn Blocks,
    report: &mut RenderReport,
) -> Result<()> {
    let (mut tiles, mut cells) = (Vec::new(), Vec::new());
    let count = accumulators.first().map_or(0, |accumulator| accumulator.planes);
    for BandAccumulator { band, sums, .. } in accumulators {
        match sums {
            Sums::Tiles(of_band) => tiles.push((band.clone(), of_band)),
            Sums::Cells(lattice, of_band) => cells.push((band.clone(), (*lattice, of_band))),
        }
    }
    let (bands, tiles): (Vec<_>, Vec<_>) = tiles.into_iter().unzip();
    splat_into_tiles((&bands, count), tiles, (blocks, batch), source, report)?;
    let (bands, cells): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
    splat_into_cells(&bands, cells, (blocks, batch), source, report)
}

/// Footprints of all voxels, tile by tile with so many planes.
fn splat_into_tiles(
    (bands, count): (&[Band<'_>], usize),
    mut tiles: Vec<&mut Vec<Tile>>,
    blocks: (&[usize], usize),
    source: &dyn Blocks,
    report: &mut RenderReport,
) -> Result<()> {
    let project = |block: usize| {
        let planes = source.planes(block)?;
        let terms = SparseTerms::of(planes.as_ref(), count)?;
        let splats = |band: &Band<'_>| band.sees(block).then(|| Splats::new(&terms, block, band.setup));
        let (seen, held) = (bands.iter().map(splats).collect(), planes.held());
        Ok(BlockInBands { block: terms, seen, held })
    };
    in_batches(bands, blocks, report, project, |blocks| {
        for (n, tiles) in tiles.iter_mut().enumerate() {
            let footprint = &bands[n].setup.footprint;
            tiles.par_iter_mut().for_each(|tile| {
                for BlockInBands { block: terms, seen, .. } in blocks {
                    seen[n].iter().for_each(|splats| tile.splat(splats, terms, footprint));
                }
            });
        }
        Ok(())
    })
}

/// Amounts of all voxels, plane by plane.
fn splat_into_cells(
    bands: &[Band<'_>],
    cells: Vec<(&Lattice, &mut Cells)>,
    blocks: (&[usize], usize),
    source: &dyn Blocks,
    report: &mut RenderReport,
) -> Result<()> {
    // Used again: memory fresh from the system costs as much as what it is for.
    let spare = Mutex::default();
    let (lattices, mut cells): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
    let there: Vec<Rectangle> = cells.iter().map(|cells| cells.rectangle()).collect();
    let place = |block: usize| {
        let planes = source.planes(block)?;
        let placed = |n: usize| {
            let (setup, seen) = (bands[n].setup, bands[n].sees(block));
            let slab = setup.slab.as_ref();
            seen.then(|| lattices[n].placed(&setup.blocks.region(block), (&setup.clip, slab), &there[n]))
        };
        let (seen, held) = ((0..bands.len()).map(placed).collect(), planes.held());
        Ok(BlockInBands { block: planes, seen, held })
    };
    in_batches(bands, blocks, report, place, |blocks| add_planes(&mut cells, blocks, &spare))
}

/// A block that has been read, where it is in every band that sees it, its coefficients and the bytes read for them.
struct BlockInBands<B, S> {
    block: B,
    seen: Vec<Option<S>>,
    held: [u64; 2],
}

/// Adds blocks to every plane of cells.
fn add_planes(
    cells: &mut [&mut Cells],
    blocks: &[BlockInBands<Box<dyn BlockPlanes + '_>, Placed>],
    spare: &Mutex<Vec<(Scratch, Work)>>,
) -> Result<()> {
    let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
    by_planes(cells).into_par_iter().enumerate().try_for_each(|(plane, mut bands)| {
        let (mut room, mut work) = spare().pop().unwrap_or_default();
        for BlockInBands { block, seen, .. } in blocks {
            let amounts = block.plane(plane, &mut room)?;
            for (sums, placed) in bands.iter_mut().zip(seen) {
                placed.iter().for_each(|placed| placed.add(amounts, sums, &mut work));
            }
        }
        spare().push((room, work));
        Ok(())
    })
}

/// For every plane its cells in all bands.
fn by_planes<'a>(cells: &'a mut [&mut Cells]) -> Vec<Vec<CellPlane<'a>>> {
    let mut planes: Vec<Vec<CellPlane<'_>>> = Vec::new();
    for of_band in cells {
        let of_band = of_band.planes_mut();
        planes.resize_with(of_band.len(), Vec::new);
        planes.iter_mut().zip(of_band).for_each(|(plane, sums)| plane.push(sums));
    }
    planes
}

/// Makes something of every block that a band sees, in order and `batch` at a time, and adds it.
fn in_batches<B: Send, S: Send>(
    bands: &[Band<'_>],
    (blocks, batch): (&[usize], usize),
    report: &mut RenderReport,
    make: impl Fn(usize) -> Result<BlockInBands<B, S>> + Sync,
    mut add: impl FnMut(&[BlockInBands<B, S>]) -> Result<()>,
) -> Result<()> {
    let mut clock = Instant::now();
    let seen: Vec<usize> = blocks.iter().copied().filter(|b| bands.iter().any(|band| band.sees(*b))).collect();
    for blocks in seen.chunks(batch) {
        let provenance = blocks.par_iter().map(|block| make(*block)).collect::<Result<Vec<_>>>()?;
        lap(&mut clock, &mut report.decode_seconds);
        add(&provenance)?;
        for BlockInBands { held: [coefficients, bytes_read], .. } in &provenance {
            report.coefficients += coefficients;
            report.bytes_read += bytes_read;
        }
        lap(&mut clock, &mut report.splat_seconds);
    }
    report.blocks_read += seen.len() as u64;
    Ok(())
}
