//! The lattice backend: spreads the values of all voxels, plane by plane, to the cells of each view's lattice.

use super::band::{Band, BandGroup};
use super::lattice::{CellPlane, Cells, DoubleRoom, Lattice, Placed, Rectangle, SpreadScratch};
use crate::render::batches::{BlockAdder, BlockPlanes, Scratch};
use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use wavesplat_core::base::error::Result;

/// Bands of views that have a lattice.
pub(super) struct LatticeBands<'a, 'c> {
    bands: Vec<Band<'a>>,
    lattices: Vec<&'a Lattice>,
    cells: Vec<&'c mut Cells>,
    /// The cells of each band.
    rectangles: Vec<Rectangle>,
    room: &'c DoubleRoom,
    /// Buffers for reuse: fresh memory from the system costs as much as the work done in it.
    spare: Mutex<Vec<(Scratch, SpreadScratch)>>,
}

/// A block and its location in every band that it reaches.
pub(super) struct PlacedBlock<'b> {
    planes: Box<dyn BlockPlanes + 'b>,
    placed: Vec<Option<Placed>>,
}

impl<'a, 'c> LatticeBands<'a, 'c> {
    pub(super) fn new(bands: Vec<(Band<'a>, &'a Lattice, &'c mut Cells)>, room: &'c DoubleRoom) -> Self {
        let mut group = Self {
            bands: Vec::new(),
            lattices: Vec::new(),
            cells: Vec::new(),
            rectangles: Vec::new(),
            room,
            spare: Mutex::default(),
        };
        for (band, lattice, cells) in bands {
            group.bands.push(band);
            group.lattices.push(lattice);
            group.rectangles.push(cells.rectangle());
            group.cells.push(cells);
        }
        group
    }

    /// The location of a block in a band; `None` if it does not reach the band.
    fn locate(&self, band: usize, block: usize) -> Option<Placed> {
        let setup = self.bands[band].setup;
        let region = setup.blocks.region(block);
        self.bands[band].sees(block).then(|| self.lattices[band].placed(&region, &setup.clip, &self.rectangles[band]))
    }
}

impl BandGroup for LatticeBands<'_, '_> {
    fn bands(&self) -> &[Band<'_>] {
        &self.bands
    }
}

impl BlockAdder for LatticeBands<'_, '_> {
    type Block<'b> = PlacedBlock<'b>;

    fn prepare<'b>(&self, block: usize, planes: Box<dyn BlockPlanes + 'b>) -> Result<PlacedBlock<'b>> {
        let placed = (0..self.bands.len()).map(|band| self.locate(band, block)).collect();
        Ok(PlacedBlock { planes, placed })
    }

    fn is_full(&self) -> bool {
        self.room.is_exceeded()
    }

    /// Each plane has one owner, so that its sums do not depend on threads.
    fn add(&mut self, blocks: &[PlacedBlock<'_>]) -> Result<()> {
        let (spare, room) = (&self.spare, self.room);
        by_planes(&mut self.cells, room).into_par_iter().enumerate().try_for_each(|(plane, mut bands)| {
            if room.is_exceeded() {
                return Ok(());
            }
            let (mut scratch, mut spreading) = lock(spare).pop().unwrap_or_default();
            for PlacedBlock { planes, placed } in blocks {
                let values = planes.plane(plane, &mut scratch)?;
                for (sums, placed) in bands.iter_mut().zip(placed) {
                    placed.iter().for_each(|placed| placed.add(values, sums, &mut spreading));
                }
            }
            lock(spare).push((scratch, spreading));
            Ok(())
        })
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// For every plane, its cells in all bands.
fn by_planes<'a>(cells: &'a mut [&mut Cells], room: &'a DoubleRoom) -> Vec<Vec<CellPlane<'a>>> {
    let mut planes: Vec<Vec<CellPlane<'_>>> = Vec::new();
    for of_band in cells {
        let of_band = of_band.planes_mut(room);
        planes.resize_with(of_band.len(), Vec::new);
        planes.iter_mut().zip(of_band).for_each(|(plane, sums)| plane.push(sums));
    }
    planes
}
