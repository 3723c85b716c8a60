//! Index arithmetic on grids of voxels: regions, rows, blocks. No I/O, no samples.
//!
//! Triples are in the order x, y, z; arrays have x fastest, then y, z, and time slowest.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A regular grid of voxels in the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Number of voxels along x, y, z; none is 0.
    pub dims: [usize; 3],
    /// World units between neighbours along x, y, z.
    pub spacing: [f64; 3],
    /// World position of voxel (0, 0, 0).
    pub origin: [f64; 3],
}

/// A volume that is wider than high by this factor is nearly a sheet.
const FLAT: f64 = 20.0;

/// A volume that is wider than high by about this factor looks like one.
const VISIBLE: f64 = 4.0;

impl Grid {
    /// A grid of unit spacing at the world's origin.
    pub fn unit(dims: [usize; 3]) -> Self {
        Self { dims, spacing: [1.0; 3], origin: [0.0; 3] }
    }

    /// The largest distance of neighbouring voxels, in world units.
    pub fn largest_spacing(&self) -> f64 {
        self.spacing.into_iter().fold(0.0, f64::max)
    }

    /// The region of all voxels.
    pub fn whole(&self) -> Region {
        Region { start: [0; 3], end: self.dims }
    }

    /// World position of a voxel.
    pub fn position(&self, voxel: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.origin[a] + self.spacing[a] * voxel[a] as f64)
    }

    /// The grid with its heights multiplied: `factor` is finite and positive.
    pub fn exaggerated(&self, factor: f64) -> Self {
        let ([x, y, z], [ox, oy, oz]) = (self.spacing, self.origin);
        Self { spacing: [x, y, z * factor], origin: [ox, oy, oz * factor], ..*self }
    }

    /// The factor that makes heights visible where the volume is nearly a flat sheet: about a quarter of the width, by 1, 2
    /// or 5 times a power of 10; 1 for other volumes.
    pub fn sensible_exaggeration(&self) -> f64 {
        let extent = |axis: usize| self.spacing[axis] * (self.dims[axis] - 1) as f64;
        let (wide, high) = (extent(0).max(extent(1)), extent(2));
        if high <= 0.0 || high * FLAT >= wide {
            return 1.0;
        }
        let wanted = wide / high / VISIBLE;
        let power = 10_f64.powf(wanted.log10().floor());
        let is_near = |factor: &f64| *factor <= wanted * 1.25;
        [10.0, 5.0, 2.0].into_iter().map(|digit| digit * power).find(is_near).unwrap_or(power)
    }

    /// The grid of a region of this one, at the same place in the world.
    pub fn crop(&self, region: &Region) -> Self {
        Self { dims: region.dims(), spacing: self.spacing, origin: self.position(region.start) }
    }
}

/// A box of voxels, `start` included and `end` excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// First voxel along x, y, z.
    pub start: [usize; 3],
    /// One past the last voxel along x, y, z.
    pub end: [usize; 3],
}

impl fmt::Display for Region {
    /// Writes `x0:x1,y0:y1,z0:z1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { start: [x, y, z], end: [u, v, w] } = self;
        write!(f, "{x}:{u},{y}:{v},{z}:{w}")
    }
}

impl Region {
    /// Number of voxels along x, y, z.
    #[inline]
    pub fn dims(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.end[a].saturating_sub(self.start[a]))
    }

    /// Number of voxels.
    #[inline]
    pub fn voxels(&self) -> usize {
        self.dims().into_iter().fold(1, usize::saturating_mul)
    }

    /// Whether the region has no voxel.
    pub fn is_empty(&self) -> bool {
        self.dims().contains(&0)
    }

    /// The voxels in both regions.
    pub fn intersect(&self, other: &Self) -> Self {
        Self {
            start: std::array::from_fn(|a| self.start[a].max(other.start[a])),
            end: std::array::from_fn(|a| self.end[a].min(other.end[a])),
        }
    }

    /// The least region around both.
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            start: std::array::from_fn(|a| self.start[a].min(other.start[a])),
            end: std::array::from_fn(|a| self.end[a].max(other.end[a])),
        }
    }

    /// Whether every voxel of `other` is inside.
    pub fn contains(&self, other: &Self) -> bool {
        (0..3).all(|a| self.start[a] <= other.start[a] && other.end[a] <= self.end[a])
    }

    /// The voxels of the region on the lattice of every n-th voxel along each axis, numbered on that lattice.
    pub fn every(&self, n: usize) -> Self {
        Self { start: self.start.map(|i| i.div_ceil(n)), end: self.end.map(|i| i.div_ceil(n)) }
    }

    /// The same box moved by `offset`.
    pub fn moved_by(&self, offset: [usize; 3]) -> Self {
        Self {
            start: std::array::from_fn(|a| self.start[a] + offset[a]),
            end: std::array::from_fn(|a| self.end[a] + offset[a]),
        }
    }

    /// The (y, z) of every x-row, in array order.
    pub fn rows(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (y, z) = (self.start[1]..self.end[1], self.start[2]..self.end[2]);
        z.flat_map(move |z| y.clone().map(move |y| (y, z)))
    }

    /// Every voxel (x, y, z), in array order.
    pub fn iter(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let x = self.start[0]..self.end[0];
        self.rows().flat_map(move |(y, z)| x.clone().map(move |x| [x, y, z]))
    }

    /// The region in coordinates that begin at the first voxel of another.
    pub fn relative_to(&self, other: &Self) -> Self {
        let [start, end] =
            [self.start, self.end].map(|at| std::array::from_fn(|a| at[a].saturating_sub(other.start[a])));
        Self { start, end }
    }

    /// Index of a voxel in the array of this region.
    #[inline]
    pub fn index(&self, voxel: [usize; 3]) -> usize {
        let d = self.dims();
        let [x, y, z] = std::array::from_fn(|a| voxel[a] - self.start[a]);
        (z * d[1] + y) * d[0] + x
    }

    /// The voxel at `index` in the array of this region.
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims();
        let inside = [index % nx, index / nx % ny, index / (nx * ny)];
        std::array::from_fn(|a| self.start[a] + inside[a])
    }
}

/// A volume cut into boxes of the same size; those at the upper faces may be smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockGrid {
    /// Voxels of the volume along x, y, z.
    pub dims: [usize; 3],
    /// Voxels of a whole block along x, y, z.
    pub edges: [usize; 3],
}

impl BlockGrid {
    /// A volume cut into cubes of `edge` voxels a side.
    pub fn cubes(dims: [usize; 3], edge: usize) -> Self {
        Self { dims, edges: [edge; 3] }
    }

    /// Number of blocks along x, y, z.
    pub fn counts(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.dims[a].div_ceil(self.edges[a]))
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.counts().iter().product()
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The voxels of a block; blocks are numbered x fastest, then y, z.
    pub fn region(&self, block: usize) -> Region {
        let [cx, cy, _] = self.counts();
        let at = [block % cx, block / cx % cy, block / (cx * cy)];
        Region {
            start: std::array::from_fn(|a| at[a] * self.edges[a]),
            end: std::array::from_fn(|a| ((at[a] + 1) * self.edges[a]).min(self.dims[a])),
        }
    }

    /// Sorts blocks so that those of each 2 x 2 x 2, 4 x 4 x 4, ... follow each other.
    pub fn sort_nested(&self, blocks: &mut [usize]) {
        blocks.sort_by_cached_key(|block| self.place_in_nested(*block));
    }

    /// A number that ascends from block to block in the order of [`Self::sort_nested`].
    pub fn place_in_nested(&self, block: usize) -> u64 {
        let [cx, cy, _] = self.counts();
        interleaved([block % cx, block / cx % cy, block / (cx * cy)])
    }

    /// The numbers of the blocks that touch `region`, ascending.
    pub fn touching(&self, region: &Region) -> impl Iterator<Item = usize> + use<> {
        let [cx, cy, _] = self.counts();
        let blocks = Region {
            start: std::array::from_fn(|a| region.start[a] / self.edges[a]),
            end: std::array::from_fn(|a| match region.is_empty() {
                true => region.start[a] / self.edges[a],
                false => region.end[a].div_ceil(self.edges[a]),
            }),
        };
        blocks.iter().map(move |[x, y, z]| (z * cy + y) * cx + x)
    }
}

/// The place in Z-order: the bits of three numbers in turns, up to 21 of each.
fn interleaved(numbers: [usize; 3]) -> u64 {
    let bits = (0..21).flat_map(|bit| (0..3).map(move |a| (bit, a)));
    bits.fold(0, |all, (bit, a)| all | (numbers[a] as u64 >> bit & 1) << (3 * bit + a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_volumes_are_exaggerated() {
        let grid = |z: f64| Grid { spacing: [1000.0, 900.0, z], ..Grid::unit([101, 50, 31]) };
        // 100 km wide and 3000 z high: a quarter of the width is 25 km
        let factors = [10.0, 100.0, 160.0, 170.0].map(|z| grid(z).sensible_exaggeration());
        assert_eq!(factors, [100.0, 10.0, 5.0, 1.0]);
        assert_eq!(Grid { dims: [101, 50, 1], ..grid(1.0) }.sensible_exaggeration(), 1.0);
        let drawn = Grid { origin: [1.0, 2.0, -3.0], ..grid(10.0) }.exaggerated(50.0);
        assert_eq!((drawn.spacing, drawn.origin), ([1000.0, 900.0, 500.0], [1.0, 2.0, -150.0]));
    }

    #[test]
    fn blocks_tile_the_volume_without_overlap() {
        let grid = BlockGrid { dims: [7, 5, 3], edges: [4, 3, 2] };
        let mut seen = vec![0; 7 * 5 * 3];
        let whole = Grid::unit(grid.dims).whole();
        for block in 0..grid.len() {
            for v in grid.region(block).iter() {
                seen[whole.index(v)] += 1;
            }
        }
        assert!(seen.iter().all(|n| *n == 1));
    }

    #[test]
    fn a_voxel_and_its_place_in_the_array_are_inverse() {
        let region = Region { start: [2, 0, 5], end: [5, 4, 7] };
        for (i, v) in region.iter().enumerate() {
            assert_eq!((region.index(v), region.voxel(i)), (i, v));
        }
    }

    #[test]
    fn blocks_in_nested_order_stay_near_each_other() {
        let grid = BlockGrid::cubes([5, 3, 2], 1);
        let mut blocks: Vec<usize> = (0..grid.len()).collect();
        grid.sort_nested(&mut blocks);
        let places: Vec<[usize; 3]> = blocks.iter().map(|b| grid.region(*b).start).collect();
        assert_eq!(places[..8].iter().flatten().max(), Some(&1));
        assert_eq!(places[8], [2, 0, 0]);
        blocks.sort_unstable();
        assert!(blocks.into_iter().eq(0..grid.len()));
    }

    #[test]
    fn touching_agrees_with_testing_every_block() {
        let grid = BlockGrid { dims: [9, 10, 11], edges: [4, 5, 3] };
        for region in [
            Region { start: [0, 0, 0], end: [9, 10, 11] },
            Region { start: [3, 4, 7], end: [5, 5, 9] },
            Region { start: [4, 4, 4], end: [4, 8, 8] },
        ] {
            let slow: Vec<_> = (0..grid.len()).filter(|b| !grid.region(*b).intersect(&region).is_empty()).collect();
            assert_eq!(grid.touching(&region).collect::<Vec<_>>(), slow, "{region:?}");
        }
    }
}
