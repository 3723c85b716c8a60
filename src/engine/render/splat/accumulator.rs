//! A band of a picture that accumulates blocks, and its tiles after the last block.

use super::backend::SplatBackend;
use super::band::{Band, splat_into};
use super::footprints::{FootprintBands, Tile};
use super::lattice::{Cells, DoubleRoom, FilteredCells, Gather, Lattice, Ones};
use super::lattice_bands::LatticeBands;
use super::tile_rect::{TILE, TileRect};
use super::view_setup::ViewSetup;
use crate::render::batches::{BlockReader, Layout, ReadStats};
use rayon::prelude::*;
use wavesplat_core::base::error::Result;
use wavesplat_core::wavelet::Lane;

/// A band of a picture.
pub(in crate::render) struct BandAccumulator<'a> {
    band: Band<'a>,
    planes: usize,
    ones: Option<Ones<'a>>,
    sums: BandSums<'a>,
}

enum BandSums<'a> {
    Tiles(Vec<Tile>),
    /// While blocks are added.
    Cells(&'a Lattice, Cells),
    /// After the last block.
    Filtered(&'a Lattice, FilteredCells),
}

impl<'a> BandAccumulator<'a> {
    /// The band of a picture with these pixels, and all planes at zero.
    pub(in crate::render) fn new(setup: &'a ViewSetup, rect: TileRect, layout: &Layout) -> Self {
        let planes = layout.planes();
        let tile = |rect| Tile::new(rect, planes, layout.order);
        let sums = match &setup.backend {
            SplatBackend::Lattice(lattice) => BandSums::Cells(lattice, lattice.cells_of(&rect, planes)),
            SplatBackend::Footprints => BandSums::Tiles(rect.cover([TILE; 2]).into_iter().map(tile).collect()),
        };
        Self { band: Band { setup, rect }, planes, ones: None, sums }
    }

    /// The same, rounded relative to the image of ones.
    pub(in crate::render) fn relative_to(self, ones: Option<Ones<'a>>) -> Self {
        Self { ones, ..self }
    }

    /// The filtered cells, if the backend is a lattice.
    pub(in crate::render) fn into_filtered(self) -> Option<FilteredCells> {
        match self.sums {
            BandSums::Filtered(_, cells) => Some(cells),
            BandSums::Tiles(_) | BandSums::Cells(..) => None,
        }
    }

    /// Ends the sums of a lattice after the last block.
    fn filter(&mut self) {
        let sums = std::mem::replace(&mut self.sums, BandSums::Tiles(Vec::new()));
        self.sums = match sums {
            BandSums::Cells(lattice, cells) => BandSums::Filtered(lattice, lattice.filter(cells, &self.band.rect)),
            sums => sums,
        };
    }

    /// Calls `finish` for every tile, with its pixels in `pictures`, which have the size of the whole picture.
    pub(in crate::render) fn finish<T: Send>(
        &self,
        pictures: &mut [T],
        finish: impl Fn(ResolvedTile<'_>, &mut Pixels<'_, T>) + Sync,
    ) {
        let (width, tile) = (self.band.setup.camera.size[0], self.band.setup.backend.tile());
        let columns = self.band.rect.x.len().div_ceil(tile[0]);
        let rects = self.band.rect.cover(tile);
        let bands = self.by_rows_of_tiles(pictures, tile[1]);
        rects.par_chunks(columns).zip(bands).enumerate().for_each(|(n, (rects, planes))| {
            let mut pixels = Pixels { planes, width, top: rects[0].y.start };
            for (i, rect) in rects.iter().enumerate() {
                if let Some(sums) = self.tile(rect, n * columns + i) {
                    finish(ResolvedTile { rect, planes: self.planes, sums }, &mut pixels);
                }
            }
        });
    }

    /// The sums of tile `number`, after the last block.
    fn tile<'t>(&'t self, rect: &'t TileRect, number: usize) -> Option<TileSums<'t>> {
        match &self.sums {
            BandSums::Tiles(tiles) => Some(TileSums::Tile(&tiles[number])),
            BandSums::Filtered(lattice, cells) => {
                Some(TileSums::Gather(Box::new(Gather::new(lattice, cells, rect, self.ones))))
            }
            BandSums::Cells(..) => None,
        }
    }

    /// For every row of tiles, its rows of every picture.
    fn by_rows_of_tiles<'p, T>(&self, pictures: &'p mut [T], height: usize) -> Vec<Vec<&'p mut [T]>> {
        let ([width, rows], TileRect { y, .. }) = (self.band.setup.camera.size, &self.band.rect);
        let mut bands: Vec<Vec<&mut [T]>> = Vec::new();
        bands.resize_with(y.len().div_ceil(height), Vec::new);
        for picture in pictures.chunks_exact_mut(width * rows) {
            let rows = picture[y.start * width..y.end * width].chunks_mut(height * width);
            bands.iter_mut().zip(rows).for_each(|(band, rows)| band.push(rows));
        }
        bands
    }
}

/// A tile after its last block.
pub(in crate::render) struct ResolvedTile<'a> {
    pub(in crate::render) rect: &'a TileRect,
    planes: usize,
    sums: TileSums<'a>,
}

enum TileSums<'a> {
    Tile(&'a Tile),
    Gather(Box<Gather<'a>>),
}

impl ResolvedTile<'_> {
    /// The planes that may have sums.
    pub(in crate::render) fn used(&self) -> Vec<usize> {
        match &self.sums {
            TileSums::Tile(_) => (0..self.planes).collect(),
            TileSums::Gather(gather) => gather.used(),
        }
    }

    /// Loads the planes at `count` pixels of a row, from `first` on, into the first lanes of `planes`.
    pub(in crate::render) fn load(&mut self, first: usize, count: usize, planes: &mut [Lane]) {
        match &mut self.sums {
            TileSums::Tile(tile) => tile.load(first, count, planes),
            TileSums::Gather(gather) => gather.load(first, count, planes),
        }
    }
}

/// The rows of pictures that belong to a row of tiles.
pub(in crate::render) struct Pixels<'a, T> {
    planes: Vec<&'a mut [T]>,
    width: usize,
    top: usize,
}

impl<T> Pixels<'_, T> {
    /// `count` neighbouring pixels in a row of a picture.
    pub(in crate::render) fn at(&mut self, picture: usize, [x, y]: [usize; 2], count: usize) -> &mut [T] {
        &mut self.planes[picture][(y - self.top) * self.width + x..][..count]
    }
}

impl<T: Copy> Pixels<'_, T> {
    /// Stores neighbouring pixels in a row of a picture.
    pub(in crate::render) fn put(&mut self, picture: usize, [x, y]: [usize; 2], pixels: &[T]) {
        self.at(picture, [x, y], pixels.len()).copy_from_slice(pixels);
    }
}

/// Splats all blocks in order, each into all bands that it reaches. A block is decoded once for all
/// bands that take footprints, and once for all bands that have a lattice. If these need more `room` than there is, the
/// bands have no sums.
pub(in crate::render) fn splat(
    accumulators: &mut [BandAccumulator<'_>],
    blocks: &[usize],
    reader: &BlockReader<'_>,
    room: &DoubleRoom,
) -> Result<ReadStats> {
    let (mut tiles, mut cells) = (Vec::new(), Vec::new());
    let planes = accumulators.first().map_or(0, |accumulator| accumulator.planes);
    for BandAccumulator { band, sums, .. } in accumulators.iter_mut() {
        match sums {
            BandSums::Tiles(of_band) => tiles.push((band.clone(), of_band)),
            BandSums::Cells(lattice, of_band) => cells.push((band.clone(), *lattice, of_band)),
            BandSums::Filtered(..) => {}
        }
    }
    let mut stats = splat_into(&mut LatticeBands::new(cells, room), blocks, reader)?;
    if room.is_exceeded() {
        return Ok(stats);
    }
    stats += splat_into(&mut FootprintBands::new(tiles, planes), blocks, reader)?;
    accumulators.iter_mut().for_each(BandAccumulator::filter);
    Ok(stats)
}
