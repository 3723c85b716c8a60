//! The planes of a view, block by block.

use super::{PlanesView, Taps};
use rayon::prelude::*;
use std::ops::Range;
use wavesplat_core::base::grid::Region;

impl PlanesView {
    /// The voxels that planes need: a box around all of them.
    pub(in crate::render) fn needed(&self) -> Region {
        let slabs = (0..self.planes.len()).map(|plane| self.slab(plane));
        slabs.reduce(|a, b| a.joined(&b)).unwrap_or(self.clip)
    }

    /// The voxels that a plane needs.
    fn slab(&self, plane: usize) -> Region {
        let (plane, mut slab) = (self.planes[plane], self.clip);
        let mut place = [0.0; 3];
        place[plane.axis] = plane.at;
        let around = self.taps(place).region();
        (slab.start[plane.axis], slab.end[plane.axis]) = (around.start[plane.axis], around.end[plane.axis]);
        slab
    }

    /// The pixels that may need voxels of a region: columns and rows.
    fn pixels(&self, region: &Region) -> [Range<usize>; 2] {
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for plane in 0..self.planes.len() {
            let part = self.slab(plane).intersect(region);
            if part.is_empty() {
                continue;
            }
            for corner in self.corners(plane, &part) {
                let at = self.camera.project(corner);
                ends.iter_mut().zip(at).for_each(|([lo, hi], at)| (*lo, *hi) = (lo.min(at), hi.max(at)));
            }
        }
        std::array::from_fn(|i| {
            let [lo, hi] = ends[i];
            let pixel = |at: f64| at.clamp(0.0, self.camera.size[i] as f64) as usize;
            if lo > hi { 0..0 } else { pixel((lo - 1.0).floor())..pixel((hi + 1.0).ceil()) }
        })
    }

    /// The world positions of the corners of the part of a plane that needs voxels of a region.
    fn corners(&self, plane: usize, part: &Region) -> impl Iterator<Item = [f64; 3]> {
        let (plane, grid, part) = (self.planes[plane], self.grid, *part);
        (0..8).map(move |corner| {
            std::array::from_fn(|a| {
                let ends = [part.start[a] as f64 - 1.0, part.end[a] as f64];
                let place = if a == plane.axis { plane.at } else { ends[corner >> a & 1] };
                grid.origin[a] + grid.spacing[a] * place
            })
        })
    }

    /// Bytes of the pictures of `frames` frames, and of their sums.
    pub(in crate::render) fn bytes(&self, frames: usize) -> usize {
        frames * self.camera.size.iter().product::<usize>() * (size_of::<f64>() + size_of::<f32>())
    }

    /// Whether any pixel needs a voxel of a region.
    pub(in crate::render) fn needs(&self, region: &Region) -> bool {
        let [columns, mut rows] = self.pixels(region);
        rows.any(|y| columns.clone().any(|x| self.taps_in(region, [x, y]).is_some()))
    }

    /// The voxels that a pixel interpolates, if one of them is in a region.
    fn taps_in(&self, region: &Region, pixel: [usize; 2]) -> Option<Taps> {
        let hit = self.nearest(pixel.map(|n| n as f64 + 0.5))?;
        Some(self.taps(hit.place)).filter(|taps| !taps.region().intersect(region).is_empty())
    }

    /// Whether a pixel shows a plane.
    pub(in crate::render) fn shows(&self, pixel: [usize; 2]) -> bool {
        self.nearest(pixel.map(|n| n as f64 + 0.5)).is_some()
    }

    /// Adds the samples of a region to the sums of all pixels, each with one sum for each frame. `sample` gives a voxel
    /// of the region in a frame.
    pub(in crate::render) fn add(
        &self,
        region: &Region,
        frames: usize,
        sample: impl Fn(usize, usize) -> f64 + Sync,
        sums: &mut [f64],
    ) {
        let [columns, rows] = self.pixels(region);
        let of_row = self.camera.size[0] * frames;
        let rows_of_sums = sums.par_chunks_exact_mut(of_row).enumerate().skip(rows.start).take(rows.len());
        rows_of_sums.for_each(|(y, row)| {
            for x in columns.clone() {
                let Some(taps) = self.taps_in(region, [x, y]) else { continue };
                for voxel in taps.region().intersect(region).iter() {
                    let (index, weight) = (region.index(voxel), taps.weight(voxel));
                    let of_frames = row[x * frames..][..frames].iter_mut().enumerate();
                    of_frames.for_each(|(frame, sum)| *sum += weight * sample(frame, index));
                }
            }
        });
    }
}
