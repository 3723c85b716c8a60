//! A band of a picture while blocks are splatted into it, by footprints or by way of a lattice, and its tiles once they are.

use super::RenderReport;
use super::amounts::{BlockPlanes, Room};
use super::eye::Eye;
use super::lap;
use super::lattice::{Cells, Gather, Lattice, Placed, Work};
use super::splat::{Place, Splats, TILE, Tile};
use super::terms::{Layout, Terms};
use crate::error::Result;
use crate::wavelet::Lane;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Where blocks come from.
pub(super) trait Blocks: Sync {
    /// The terms of a block.
    fn terms(&self, block: usize) -> Result<Terms>;

    /// The same, plane by plane.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;
}

/// A band of a picture.
pub(super) struct Canvas<'a> {
    eye: &'a Eye,
    rows: Range<usize>,
    planes: usize,
    sums: Sums<'a>,
}

enum Sums<'a> {
    Tiles(Vec<Tile>),
    Cells(&'a Lattice, Cells),
}

impl<'a> Canvas<'a> {
    /// Some rows of a picture with all planes at zero.
    pub(super) fn new(eye: &'a Eye, rows: Range<usize>, layout: &Layout) -> Self {
        let (width, planes) = (eye.camera.size[0], layout.planes());
        let tile = |place| Tile::new(place, planes, layout.order);
        let sums = match &eye.lattice {
            Some(lattice) => Sums::Cells(lattice, lattice.cells_of(width, &rows, planes)),
            None => Sums::Tiles(Place::cover(width, rows.clone(), TILE).into_iter().map(tile).collect()),
        };
        Self { eye, rows, planes, sums }
    }

    /// Splats blocks in order, `batch` at a time.
    pub(super) fn splat(
        &mut self,
        blocks: &[usize],
        batch: usize,
        source: &dyn Blocks,
        report: &mut RenderReport,
    ) -> Result<()> {
        match &mut self.sums {
            Sums::Tiles(tiles) => splat_into_tiles(self.eye, tiles, (blocks, batch), source, report),
            Sums::Cells(lattice, cells) => splat_into_cells(self.eye, lattice, cells, (blocks, batch), source, report),
        }
    }

    /// Calls `finish` for every tile with its pixels in some pictures as large as the whole.
    pub(super) fn finish<T: Send>(&self, pictures: &mut [T], finish: impl Fn(Finished<'_>, &mut Pixels<'_, T>) + Sync) {
        let width = self.eye.camera.size[0];
        let side = self.eye.lattice.as_ref().map_or(TILE, Lattice::tile);
        let columns = width.div_ceil(side);
        let places = Place::cover(width, self.rows.clone(), side);
        let bands = self.by_rows_of_tiles(pictures, side);
        places.par_chunks(columns).zip(bands).enumerate().for_each(|(n, (places, planes))| {
            let mut pixels = Pixels { planes, width, top: places[0].y.start };
            for (i, place) in places.iter().enumerate() {
                let sums = match &self.sums {
                    Sums::Tiles(tiles) => OfTile::Tile(&tiles[n * columns + i]),
                    Sums::Cells(lattice, cells) => OfTile::Gather(lattice.gather(cells, place)),
                };
                finish(Finished { place, planes: self.planes, sums }, &mut pixels);
            }
        });
    }

    /// For every row of tiles its rows of every picture.
    fn by_rows_of_tiles<'p, T>(&self, pictures: &'p mut [T], side: usize) -> Vec<Vec<&'p mut [T]>> {
        let [width, height] = self.eye.camera.size;
        let mut bands: Vec<Vec<&mut [T]>> = Vec::new();
        bands.resize_with(self.rows.len().div_ceil(side), Vec::new);
        for picture in pictures.chunks_exact_mut(width * height) {
            let rows = picture[self.rows.start * width..self.rows.end * width].chunks_mut(side * width);
            bands.iter_mut().zip(rows).for_each(|(band, rows)| band.push(rows));
        }
        bands
    }
}

/// A tile that has all its blocks.
pub(super) struct Finished<'a> {
    pub(super) place: &'a Place,
    planes: usize,
    sums: OfTile<'a>,
}

enum OfTile<'a> {
    Tile(&'a Tile),
    Gather(Gather<'a>),
}

impl Finished<'_> {
    /// The planes that may have sums.
    pub(super) fn used(&self) -> Vec<usize> {
        match &self.sums {
            OfTile::Tile(_) => (0..self.planes).collect(),
            OfTile::Gather(gather) => gather.used().to_vec(),
        }
    }

    /// The planes at `count` pixels from `first` on, into the first lanes of `planes`.
    pub(super) fn load(&mut self, first: usize, count: usize, planes: &mut [Lane]) {
        match &mut self.sums {
            OfTile::Tile(tile) => tile.load(first, count, planes),
            OfTile::Gather(gather) => gather.load(first, count, planes),
        }
    }

    /// The same where there is one plane only.
    pub(super) fn load_one(&mut self, first: usize, count: usize) -> Lane {
        let mut planes = [Lane::default()];
        match &mut self.sums {
            OfTile::Tile(tile) => tile.load(first, count, &mut planes),
            OfTile::Gather(gather) => planes[0] = gather.load_one(first, count),
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

impl<T: Copy> Pixels<'_, T> {
    /// Puts neighbouring pixels of a row into a picture.
    pub(super) fn put(&mut self, picture: usize, [x, y]: [usize; 2], pixels: &[T]) {
        self.planes[picture][(y - self.top) * self.width + x..][..pixels.len()].copy_from_slice(pixels);
    }
}

/// Footprints of all voxels, tile by tile.
fn splat_into_tiles(
    eye: &Eye,
    tiles: &mut [Tile],
    blocks: (&[usize], usize),
    source: &dyn Blocks,
    report: &mut RenderReport,
) -> Result<()> {
    let Eye { grid, camera, footprint, clip, .. } = eye;
    let project = |block: usize| {
        let terms = source.terms(block)?;
        let held = [terms.coefficients, terms.bytes_read];
        Ok((Splats::new(terms, &eye.blocks.region(block), clip, grid, camera, footprint), held))
    };
    in_batches(blocks, report, project, |splats| {
        tiles.par_iter_mut().for_each(|tile| splats.iter().for_each(|(s, _)| tile.splat(s, footprint)));
        Ok(())
    })
}

/// Amounts of all voxels, plane by plane.
fn splat_into_cells(
    eye: &Eye,
    lattice: &Lattice,
    cells: &mut Cells,
    blocks: (&[usize], usize),
    source: &dyn Blocks,
    report: &mut RenderReport,
) -> Result<()> {
    // Used again: memory fresh from the system costs as much as what it is for.
    let spare = Mutex::default();
    let place = |block: usize| {
        let planes = source.planes(block)?;
        let held = planes.held();
        Ok(((lattice.placed(&eye.blocks.region(block), &eye.clip), planes), held))
    };
    in_batches(blocks, report, place, |blocks| add_planes(cells, blocks, &spare))
}

type BlockInCells<'a> = ((Placed, Box<dyn BlockPlanes + 'a>), [u64; 2]);

/// Adds blocks to every plane of cells.
fn add_planes(cells: &mut Cells, blocks: &[BlockInCells<'_>], spare: &Mutex<Vec<(Room, Work)>>) -> Result<()> {
    let spare = || spare.lock().unwrap_or_else(PoisonError::into_inner);
    cells.planes_mut().into_par_iter().enumerate().try_for_each(|(plane, mut sums)| {
        let (mut room, mut work) = spare().pop().unwrap_or_default();
        for ((placed, block), _) in blocks {
            placed.add(block.plane(plane, &mut room)?, &mut sums, &mut work);
        }
        spare().push((room, work));
        Ok(())
    })
}

/// Makes something of every block, in order and `batch` at a time, each with its coefficients and the bytes read for them,
/// and adds it.
fn in_batches<T: Send>(
    (blocks, batch): (&[usize], usize),
    report: &mut RenderReport,
    make: impl Fn(usize) -> Result<(T, [u64; 2])> + Sync,
    mut add: impl FnMut(&[(T, [u64; 2])]) -> Result<()>,
) -> Result<()> {
    let mut clock = Instant::now();
    for blocks in blocks.chunks(batch) {
        let made = blocks.par_iter().map(|block| make(*block)).collect::<Result<Vec<_>>>()?;
        lap(&mut clock, &mut report.decode_seconds);
        add(&made)?;
        for (_, [coefficients, bytes_read]) in &made {
            report.coefficients += coefficients;
            report.bytes_read += bytes_read;
        }
        lap(&mut clock, &mut report.splat_seconds);
    }
    Ok(())
}
