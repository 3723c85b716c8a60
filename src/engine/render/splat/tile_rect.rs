//! Rectangles of pixels, and the columns and rows that voxels reach.

use std::ops::Range;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::Camera;
use wavesplat_core::view::footprint::Footprint;

/// Pixels per side of a tile: its planes fit in a core's cache, and neighbours share few footprints.
pub(in crate::render) const TILE: usize = 64;
/// The width of the widest tile in pixels, a multiple of that of all others.
pub(in crate::render) const WIDEST: usize = 2 * TILE;

/// A rectangle of pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::render) struct TileRect {
    /// Columns of the picture.
    pub(in crate::render) x: Range<usize>,
    /// Rows of the picture.
    pub(in crate::render) y: Range<usize>,
}

impl TileRect {
    /// A whole picture.
    pub(in crate::render) fn whole([width, height]: [usize; 2]) -> Self {
        Self { x: 0..width, y: 0..height }
    }

    /// Tiles of the size `tile` that cover the rectangle, row by row. Tiles at the right and lower edges may be smaller.
    pub(in crate::render) fn cover(&self, tile: [usize; 2]) -> Vec<Self> {
        let pieces = |r: Range<usize>, most: usize| r.clone().step_by(most).map(move |s| s..(s + most).min(r.end));
        let of_row = |y: Range<usize>| pieces(self.x.clone(), tile[0]).map(move |x| Self { x, y: y.clone() });
        pieces(self.y.clone(), tile[1]).flat_map(of_row).collect()
    }

    /// Width and height in pixels.
    pub(in crate::render) fn size(&self) -> [usize; 2] {
        [self.x.len(), self.y.len()]
    }

    /// Number of pixels.
    pub(in crate::render) fn pixels(&self) -> usize {
        self.x.len() * self.y.len()
    }

    /// The column and the row of the `n`-th pixel, counted row by row.
    pub(in crate::render) fn pixel(&self, n: usize) -> [usize; 2] {
        [self.x.start + n % self.x.len(), self.y.start + n / self.x.len()]
    }
}

/// The columns and rows of the picture that any voxel of a block can reach. Both are empty if either is.
pub(in crate::render) fn pixels_reached(
    region: &Region,
    grid: &Grid,
    camera: &Camera,
    footprint: &Footprint,
) -> [Range<usize>; 2] {
    let ends: [[f64; 3]; 2] = [grid.position(region.start), grid.position(region.end.map(|e| e - 1))];
    let corner = |n: usize| camera.project(std::array::from_fn(|a| ends[n >> a & 1][a]));
    pixels_around((0..8).map(corner).map(|[x, y, _]| [x, y]), footprint.reach, camera.size)
}

/// The columns and rows of a picture of `size` pixels within `reach` pixels of the bounding box of `points`. Both are
/// empty if either is.
pub(in crate::render) fn pixels_around(
    points: impl Iterator<Item = [f64; 2]>,
    reach: f64,
    size: [usize; 2],
) -> [Range<usize>; 2] {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(point[i]), high[i].max(point[i])));
    }
    // One more pixel on each side covers rounding.
    let span = |i: usize| {
        let (from, to) = (low[i] - reach - 1.0, high[i] + reach + 1.0);
        let end = to.clamp(0.0, size[i] as f64).ceil() as usize;
        from.clamp(0.0, end as f64).floor() as usize..end
    };
    if span(0).is_empty() || span(1).is_empty() { [0..0, 0..0] } else { [span(0), span(1)] }
}

/// Whether two ranges overlap.
pub(in crate::render) fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    !intersect(a, b).is_empty()
}

/// The intersection of two ranges.
pub(in crate::render) fn intersect(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once() {
        let (mut counts, all) = (vec![0; 150 * 100], TileRect { x: 20..140, y: 30..100 });
        for rect in all.cover([TILE; 2]) {
            for y in rect.y.clone() {
                rect.x.clone().for_each(|x| counts[y * 150 + x] += 1);
            }
        }
        let is_inside = |at: usize| all.x.contains(&(at % 150)) && all.y.contains(&(at / 150));
        assert!(counts.iter().enumerate().all(|(at, n)| *n == usize::from(is_inside(at))));
    }
}
