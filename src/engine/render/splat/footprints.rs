//! The footprint backend: adds values of voxels times footprints to the planes of one tile of the picture (eq 9; eq 4
//! if the values are samples). This is the splatting of [Westover](wavesplat_core::bibliography).
//!
//! A tile has one owner and adds blocks and voxels in a fixed order, so a pixel's sum depends neither on the tiles nor on
//! the number of threads. Sums are in f64.

use super::band::{Band, BandGroup};
use super::sparse_terms::SparseTerms;
use super::tile_rect::{TileRect, intersect, overlap};
use super::view_setup::ViewSetup;
use crate::render::batches::{BlockAdder, BlockPlanes, Order};
use rayon::prelude::*;
use std::ops::Range;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::view::footprint::Footprint;
use wavesplat_core::wavelet::Lane;

/// Bands of views that take footprints.
pub(in crate::render) struct FootprintBands<'a, 'c> {
    bands: Vec<Band<'a>>,
    tiles: Vec<&'c mut Vec<Tile>>,
    planes: usize,
}

/// The values of a block, and its projected voxels in every band that it reaches.
pub(in crate::render) struct ProjectedBlock {
    terms: SparseTerms,
    splats: Vec<Option<Splats>>,
}

impl<'a, 'c> FootprintBands<'a, 'c> {
    /// Bands with `planes` planes.
    pub(super) fn new(bands: Vec<(Band<'a>, &'c mut Vec<Tile>)>, planes: usize) -> Self {
        let (bands, tiles) = bands.into_iter().unzip();
        Self { bands, tiles, planes }
    }
}

impl BandGroup for FootprintBands<'_, '_> {
    fn bands(&self) -> &[Band<'_>] {
        &self.bands
    }
}

impl BlockAdder for FootprintBands<'_, '_> {
    type Block<'b> = ProjectedBlock;

    fn prepare<'b>(&self, block: usize, planes: Box<dyn BlockPlanes + 'b>) -> Result<ProjectedBlock> {
        let terms = SparseTerms::from_block(planes.as_ref(), self.planes)?;
        let splats = |band: &Band<'_>| band.sees(block).then(|| Splats::new(&terms, block, band.setup));
        Ok(ProjectedBlock { splats: self.bands.iter().map(splats).collect(), terms })
    }

    /// Each tile has one owner, so that its sums do not depend on threads.
    fn add(&mut self, blocks: &[ProjectedBlock]) -> Result<()> {
        for (n, tiles) in self.tiles.iter_mut().enumerate() {
            let footprint = &self.bands[n].setup.footprint;
            tiles.par_iter_mut().for_each(|tile| {
                for ProjectedBlock { terms, splats } in blocks {
                    splats[n].iter().for_each(|splats| tile.splat(splats, terms, footprint));
                }
            });
        }
        Ok(())
    }
}

/// A rectangle of pixels with its planes.
#[derive(Debug)]
pub(in crate::render) struct Tile {
    pub(in crate::render) rect: TileRect,
    /// Number of planes.
    count: usize,
    order: Order,
    sums: Vec<f64>,
}

impl Tile {
    /// A tile with all planes at zero.
    pub(in crate::render) fn new(rect: TileRect, count: usize, order: Order) -> Self {
        Self { sums: vec![0.0; count * rect.pixels()], rect, count, order }
    }

    /// Loads the planes at `count` pixels from `first` on into the first lanes of `planes`.
    pub(in crate::render) fn load(&self, first: usize, count: usize, planes: &mut [Lane]) {
        let pixels = self.rect.pixels();
        for (p, lane) in planes.iter_mut().enumerate() {
            for (l, sum) in lane.iter_mut().enumerate().take(count) {
                *sum = match self.order {
                    Order::Planes => self.sums[p * pixels + first + l],
                    Order::Pixels => self.sums[(first + l) * self.count + p],
                };
            }
        }
    }

    /// Adds the values of a block's voxels times their footprints (eq 9).
    pub(in crate::render) fn splat(&mut self, voxels: &Splats, terms: &SparseTerms, footprint: &Footprint) {
        if !(overlap(&voxels.x, &self.rect.x) && overlap(&voxels.y, &self.rect.y)) {
            return;
        }
        let (mut column, mut row, mut all) = (Vec::new(), Vec::new(), vec![0.0; self.count]);
        for voxel in &voxels.voxels {
            let (full_x, full_y) = (footprint.span(voxel.x, voxels.size[0]), footprint.span(voxel.y, voxels.size[1]));
            let (x, y) = (intersect(&full_x, &self.rect.x), intersect(&full_y, &self.rect.y));
            if x.is_empty() || y.is_empty() {
                continue;
            }
            // Weights start at the footprint's own edge, so that a tile's edge cannot change their last bits.
            footprint.weights(voxel.x, &full_x, &mut row);
            footprint.weights(voxel.y, &full_y, &mut column);
            let row = &row[x.start - full_x.start..x.end - full_x.start];
            let column = &column[y.start - full_y.start..y.end - full_y.start];
            let pixel = [x.start, y.start];
            let (planes, values) = terms.of_voxel(voxel.index);
            match self.order {
                Order::Planes => {
                    for (plane, value) in planes.iter().zip(values) {
                        self.add(usize::from(*plane), value * voxel.weight, pixel, row, column);
                    }
                }
                Order::Pixels => {
                    all.fill(0.0);
                    planes.iter().zip(values).for_each(|(p, a)| all[usize::from(*p)] = a * voxel.weight);
                    self.add_all(&all, pixel, row, column);
                }
            }
        }
    }

    /// Adds `value` times the outer product of a row and a column of weights to a plane, from a pixel on.
    fn add(&mut self, plane: usize, value: f64, [x, y]: [usize; 2], row: &[f64], column: &[f64]) {
        let TileRect { x: xs, y: ys } = &self.rect;
        let (width, pixels) = (xs.len(), self.rect.pixels());
        let start = plane * pixels + (y - ys.start) * width + (x - xs.start);
        dispatch!(add_to_plane(&mut self.sums[start..], width, value, row, column));
    }

    /// Adds a value for every plane, as [`Self::add`] does for one.
    fn add_all(&mut self, values: &[f64], [x, y]: [usize; 2], row: &[f64], column: &[f64]) {
        let TileRect { x: xs, y: ys } = &self.rect;
        let width = xs.len();
        let start = ((y - ys.start) * width + (x - xs.start)) * self.count;
        dispatch!(add_to_pixels(&mut self.sums[start..], width, values, row, column));
    }
}

/// Adds `value` times the outer product of a row and a column to a plane whose rows are `width` pixels apart.
#[inline(always)]
fn add_to_plane(sums: &mut [f64], width: usize, value: f64, row: &[f64], column: &[f64]) {
    for (weight, line) in column.iter().zip(sums.chunks_mut(width)) {
        let factor = value * weight;
        for (sum, w) in line.iter_mut().zip(row) {
            *sum += factor * w;
        }
    }
}

/// The same with a value for each of a pixel's planes, which are interleaved.
#[inline(always)]
fn add_to_pixels(sums: &mut [f64], width: usize, values: &[f64], row: &[f64], column: &[f64]) {
    let count = values.len();
    let mut factors = vec![0.0; count];
    for (weight, line) in column.iter().zip(sums.chunks_mut(width * count)) {
        factors.iter_mut().zip(values).for_each(|(f, value)| *f = value * weight);
        for (pixel, w) in line.chunks_exact_mut(count).zip(row) {
            pixel.iter_mut().zip(&factors).for_each(|(sum, f)| *sum += f * w);
        }
    }
}

/// The projected voxels of a block.
#[derive(Debug)]
pub(in crate::render) struct Splats {
    voxels: Vec<Splat>,
    size: [usize; 2],
    /// Columns and rows of the picture that the voxels reach.
    x: Range<usize>,
    y: Range<usize>,
}

#[derive(Debug)]
struct Splat {
    /// The voxel's number in its block.
    index: usize,
    x: f64,
    y: f64,
    /// exp(-tau z) f(0, 0).
    weight: f64,
}

impl Splats {
    /// Bytes of a voxel.
    pub(in crate::render) const BYTES: usize = size_of::<Splat>();

    /// Projects the voxels of a block that are splatted and have values.
    pub(in crate::render) fn new(terms: &SparseTerms, block: usize, setup: &ViewSetup) -> Self {
        let ViewSetup { camera, footprint, grid, clip, .. } = setup;
        let region = setup.blocks.region(block);
        let mut voxels = Vec::new();
        for v in region.intersect(clip).iter() {
            let index = region.index(v);
            if !terms.of_voxel(index).0.is_empty() {
                let [x, y, z] = camera.project(grid.position(v));
                voxels.push(Splat { index, x, y, weight: footprint.at_depth(z) });
            }
        }
        let size = camera.size;
        let x = reach(voxels.iter().map(|v| footprint.span(v.x, size[0])));
        let y = reach(voxels.iter().map(|v| footprint.span(v.y, size[1])));
        Self { voxels, size, x, y }
    }
}

/// The smallest range that holds all nonempty spans.
fn reach(spans: impl Iterator<Item = Range<usize>>) -> Range<usize> {
    let all = spans.filter(|s| !s.is_empty()).reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
    all.unwrap_or(0..0)
}
