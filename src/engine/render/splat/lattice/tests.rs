//! Compares values of blocks that are spread slice by slice with values that are spread one by one.

use super::cells::Rectangle;
use super::*;
use crate::render::batches::PlaneValues;
use std::collections::BTreeMap;
use std::sync::Arc;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::{Camera, View};

/// splitmix64.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn random_view(random: &mut Random) -> View {
    let straight = [-180.0, -90.0, 0.0, 90.0];
    let mut angle = |most: f64| if random.below(3) == 0 { random.pick(&straight) } else { random.between(-most, most) };
    let (azimuth, elevation, roll) = (angle(180.0), angle(90.0), angle(180.0));
    View { azimuth, elevation, roll, size: [64, 64], scale: None, center: None }
}

/// The sums at every cell of the values of a block's voxels within `clip`, spread one by one.
fn each_by_itself(spreading: &Spreading, block: &Region, clip: &Region, values: &[f64]) -> BTreeMap<[isize; 2], f64> {
    let mut sums = BTreeMap::new();
    for voxel in block.intersect(clip).iter() {
        let value = values[block.index(voxel)] * (-spreading.tau * spreading.shear.depth(voxel)).exp();
        // Weights jump where cells are as near as others: there rounding decides.
        let Shear { axes: [b, c, a], slopes, fineness, .. } = spreading.shear;
        let whole = [b, c].map(|axis| (fineness * voxel[axis]) as isize);
        let rest = slopes.map(|slope| fineness as f64 * slope * voxel[a] as f64);
        let at = |i: usize| {
            let Spread { first, weights } = spreading.fits[i].at(rest[i]);
            Spread { first: first + whole[i], weights }
        };
        let [u, v] = [at(0), at(1)];
        for (v, across) in (v.first..).zip(&v.weights[..spreading.width()]) {
            for (u, along) in (u.first..).zip(&u.weights[..spreading.width()]) {
                *sums.entry([u, v]).or_insert(0.0) += value * across * along;
            }
        }
    }
    sums
}

/// Cells per voxel, and cells that a voxel is spread to.
const CHOICES: [(usize, usize); 7] = [(1, 4), (1, 5), (2, 4), (2, 5), (3, 5), (3, 6), (4, 6)];

#[test]
fn slices_spread_like_single_values() {
    let (mut cut, mut clipped) = (0, 0);
    for seed in 0..600 {
        let mut random = Random(seed);
        let start: [usize; 3] = std::array::from_fn(|_| random.below(30));
        let most = if seed % 40 == 0 { 45 } else { 9 };
        let block = Region { start, end: start.map(|s| s + 1 + random.below(most)) };
        let mut clip = block;
        if random.below(2) == 0 {
            clip.start = std::array::from_fn(|a| random.below(block.end[a]));
            clipped += 1;
        }
        let spacing = std::array::from_fn(|_| random.pick(&[1.0, 1.0, 0.4, 1.7]));
        let grid = Grid { dims: block.end, spacing, origin: [3.0, -7.0, 40.0] };
        let camera = Camera::new(&random_view(&mut random), &grid).expect("a valid view");
        let ((fineness, width), sums) = (random.pick(&CHOICES), random.pick(&[Sums::Single, Sums::Double]));
        let shear = Shear::new(&camera, &grid, fineness);
        let (tau, slices) = (random.pick(&[0.0, 0.2]), block.end[shear.axes[2]]);
        let sigma = 0.8 * fineness as f64;
        let spreading =
            Arc::new(Spreading::new(shear, Choice::new(fineness, width, sums), [sigma, 1.3 * sigma], tau, slices));
        let every = random.pick(&[1, 30]);
        let mut value = |_| if random.below(every) == 0 { f64::from(random.between(-1.0, 1.0) as f32) } else { 0.0 };
        let values: Vec<f64> = (0..block.voxels()).map(&mut value).collect();
        let expected = each_by_itself(&spreading, &block, &clip, &values);
        let cells = || expected.keys().copied();
        let low = [0, 1].map(|i| cells().map(|c| c[i]).min().unwrap_or(0));
        let high = [0, 1].map(|i| cells().map(|c| c[i]).max().unwrap_or(0));
        // Grow or shrink the rectangle on each side, or cut most of it on one side.
        let mut more = [0; 4].map(|_| random.below(9) as isize - 3);
        let side = random.below(8);
        if side < 4 {
            more[side] = -((high[side % 2] - low[side % 2]).max(0) * 3 / 4);
        }
        cut += usize::from(more.iter().any(|n| *n < 0));
        let size = [0, 1].map(|i| (high[i] - low[i] + 1 + more[i] + more[2 + i]).max(1) as usize);
        let rectangle = Rectangle::holding([0, 1].map(|i| low[i] - more[i]), size, fineness);
        let placed = Placed::new(&spreading, &block, &clip, &rectangle);
        let single: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        let few: Vec<(u32, f64)> = (0..).zip(values.iter().copied()).filter(|(_, v)| *v != 0.0).collect();
        let ways =
            [PlaneValues::Double(&values), PlaneValues::Single(&single), PlaneValues::Few(&few), PlaneValues::Nothing];
        let (mut planes, mut work) = (Cells::new(rectangle, ways.len(), sums), SpreadScratch::default());
        let room = DoubleRoom::new(ways.len() + 1);
        let into = planes.planes_mut(&room).into_iter().zip(ways);
        into.for_each(|(mut plane, values)| placed.add(values, &mut plane, &mut work));
        let planes = touched(&planes);
        let numbers: Vec<usize> = planes.iter().map(|(number, _)| *number).collect();
        let some_values = every == 1; // sparse values may all be zero, or lie outside
        assert!(numbers == [0, 1, 2] || !some_values && numbers.iter().all(|n| *n < 3), "{numbers:?}");
        let whole = Rectangle::holding(low, [0, 1].map(|i| (high[i] - low[i]).max(0) as usize + 1), fineness);
        let mut all = Cells::new(whole, 1, sums);
        let placed = Placed::new(&spreading, &block, &clip, &whole);
        placed.add(PlaneValues::Double(&values), &mut all.planes_mut(&room)[0], &mut work);
        let all = touched(&all);
        let all: BTreeMap<[isize; 2], f64> = all.iter().flat_map(|(_, plane)| cells_of(&whole, plane)).collect();
        for (number, plane) in planes.iter().filter(|(number, _)| *number < 2) {
            for (cell, sum) in cells_of(&rectangle, plane) {
                assert_eq!(
                    sum,
                    all.get(&cell).copied().unwrap_or(0.0),
                    "{seed}, {number}: the sum depends on the extent of the planes"
                );
            }
        }
        for (number, plane) in &planes {
            for (cell, sum) in cells_of(&rectangle, plane) {
                let expected = expected.get(&cell).copied().unwrap_or(0.0);
                let off = (sum - expected).abs();
                assert!(off < 4e-6 * (1.0 + expected.abs()), "{seed}, {number}: {sum} for {expected} at {cell:?}");
            }
        }
    }
    assert!(cut > 100 && clipped > 100);
}

/// The planes with sums.
fn touched(cells: &Cells) -> Vec<(usize, Vec<f64>)> {
    let area = cells.rectangle.area();
    let single: Vec<&[f32]> = cells.single.iter().flat_map(|planes| planes.chunks_exact(area)).collect();
    let plane = |number: usize, sums: &super::cells::PlaneSums| {
        let single = |at: usize| single.get(number).map_or(0.0, |sums| f64::from(sums[at]));
        let double = |at: usize| sums.double.as_ref().map_or(0.0, |double| double[at]);
        let all: Vec<f64> = (0..area).map(|at| single(at) + double(at)).collect();
        let is_touched = sums.has_single || cells.sums == Sums::Single && sums.double.is_some();
        (is_touched || all.iter().any(|sum| *sum != 0.0)).then_some((number, all))
    };
    cells.planes.iter().enumerate().filter_map(|(number, sums)| plane(number, sums)).collect()
}

/// Every cell of a plane and its sum.
fn cells_of<'a>(rectangle: &'a Rectangle, plane: &'a [f64]) -> impl Iterator<Item = ([isize; 2], f64)> + 'a {
    let [first_u, first_v] = rectangle.first;
    let rows = (first_v..).map_while(|v| Some((v, rectangle.row(v)?)));
    rows.flat_map(move |(v, row)| {
        let cells = (first_u..).map_while(|u| Some((u, rectangle.in_row(u)?)));
        cells.map(move |(u, at)| ([u, v], plane[row.start + at]))
    })
}
