//! The sums of codes against those of decoded values, each spread by itself.

use super::*;
use crate::bound::{Bound, Promise};
use crate::camera::{Camera, View};
use crate::codec::WindowCodec;
use crate::codec::decode::Block;
use crate::codec::scheme::Scheme;
use crate::sample::SampleType;
use crate::volume::{Grid, Region};
use wavesplat_format::{Basis, Outliers};

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

fn random_scheme(random: &mut Random) -> Scheme {
    use Axis::{T, X, Y, Z};
    let samples: [&[Axis]; 6] = [&[X, Y, Z, T], &[Z, Y, X, T], &[T, Z, Y, X], &[T, X], &[Y, T, Z], &[]];
    let others: [&[Axis]; 4] = [&[X, Y, Z], &[Z, X, Y], &[Y], &[X, Z]];
    let basis = random.pick(&[Basis::Samples, Basis::Samples, Basis::Haar, Basis::Learned, Basis::Multi]);
    let order = if basis == Basis::Samples { random.pick(&samples) } else { random.pick(&others) };
    let stencil = random.pick(&[Stencil::Linear, Stencil::Cubic]);
    let pyramid = Pyramid { order: order.to_vec(), stencil, growth: 1.5, most: 3.0, single: false };
    let pyramid = (random.below(8) > 0).then_some(pyramid);
    Scheme { pyramid, ..Scheme::along_time(basis) }
}

fn random_view(random: &mut Random) -> View {
    let straight = [-180.0, -90.0, 0.0, 90.0];
    let mut angle = |most: f64| if random.below(3) == 0 { random.pick(&straight) } else { random.between(-most, most) };
    let (azimuth, elevation, roll) = (angle(180.0), angle(90.0), angle(180.0));
    View { azimuth, elevation, roll, size: [64, 64], scale: None, center: None }
}

/// A codec and a block with random codes, most of them zero, for voxels from `region.start` on.
fn random_block(random: &mut Random, size: [usize; 3]) -> (WindowCodec, Block) {
    let scheme = random_scheme(random);
    let frames = match scheme.basis {
        Basis::Haar => random.pick(&[1, 4, 8]),
        Basis::Multi => random.pick(&[3, 9]),
        _ => 1 + random.below(13),
    };
    let promise = Promise { bound: Bound::Pointwise, tolerance: 0.01, delta: 0.01 };
    let codec = WindowCodec::new(scheme, frames, SampleType::F64, promise, 48);
    let voxels: usize = size.iter().product();
    let every = random.pick(&[1, 3, 30]);
    let code = |_| if random.below(every) == 0 { random.below(21) as i32 - 10 } else { 0 };
    let codes = (0..voxels * codec.basis.coefficients()).map(code).collect();
    let (outliers, missing, exact) = (Outliers::default(), Default::default(), None);
    (codec, Block { size, voxels, step: 0.7, codes, outliers, missing, exact, bytes_read: 0 })
}

/// Every value by itself.
fn direct(block: &Coded<'_>, spreading: &Spreading, ks: &[usize], like: &Cells) -> Vec<f64> {
    let mut cells = Cells::new(like.first, like.size, ks.len());
    let size: [usize; 3] = std::array::from_fn(|a| block.shape[a]);
    let region = Region { start: block.start, end: std::array::from_fn(|a| block.start[a] + size[a]) };
    for (plane, k) in ks.iter().enumerate() {
        for (index, voxel) in region.iter().enumerate() {
            let value = block.field.at(k * region.voxels() + index);
            let amount = value * (-spreading.tau * spreading.shear.depth(voxel)).exp();
            let [(u, along), (v, across)] = spreading.shear.place(voxel).map(|p| spread(spreading.degree, p));
            for (dv, across) in across.iter().take(spreading.degree + 1).enumerate() {
                for (du, along) in along.iter().take(spreading.degree + 1).enumerate() {
                    if along * across < 1e-13 {
                        continue; // rounding decides which cell is the first
                    }
                    let [x, y] = [u - like.first[0] + du as isize, v - like.first[1] + dv as isize];
                    let at = (plane * like.size[1] + y as usize) * like.size[0] + x as usize;
                    cells.sums[at] += amount * along * across;
                }
            }
        }
    }
    cells.sums
}

/// The largest difference between both, in units of the largest sum.
fn difference(random: &mut Random, size: [usize; 3]) -> f64 {
    let (codec, block) = random_block(random, size);
    let start: [usize; 3] = std::array::from_fn(|_| random.below(30));
    let dims = std::array::from_fn(|a| start[a] + size[a] + random.below(3));
    let spacing = std::array::from_fn(|_| random.pick(&[1.0, 1.0, 0.4, 1.7]));
    let grid = Grid { dims, spacing, origin: [3.0, -7.0, 40.0] };
    let camera = Camera::new(&random_view(random), &grid).expect("a valid view");
    let shear = Shear::new(&camera, &grid, random.pick(&[1, 2, 3]));
    let tau = random.pick(&[0.0, 0.02, 0.2]);
    let spreading = Spreading { shear, degree: random.pick(&[1, 3, 5]), tau };
    let field = block.field(&codec);
    let (shape, pyramid) = (codec.shape(size), codec.scheme.pyramid.as_ref());
    let coded = Coded { start, shape, pyramid, step: block.step, codes: &block.codes, field: &field };
    let timed = pyramid.is_some_and(|p| p.order.contains(&Axis::T));
    let ks: Vec<usize> = (0..shape[3]).filter(|_| timed || random.below(4) > 0).collect();
    let cells = block_cells(&coded, &spreading, &ks);
    let expected = direct(&coded, &spreading, &ks, &cells);
    let largest = expected.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let off = cells.sums.iter().zip(&expected).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
    if largest > 0.0 { off / largest } else { off }
}

#[test]
fn codes_and_values_give_the_same_sums() {
    let mut worst = 0.0_f64;
    for seed in 0..1500 {
        let mut random = Random(seed);
        let size = std::array::from_fn(|_| 1 + random.below(if seed % 4 == 0 { 20 } else { 9 }));
        let off = difference(&mut random, size);
        assert!(off < 1e-12, "block {seed} of {size:?}: {off:e}");
        worst = worst.max(off);
    }
    assert!(worst > 0.0);
}

#[test]
fn large_blocks_too() {
    for (seed, size) in [[48, 48, 48], [48, 17, 33], [31, 48, 2], [1, 48, 40]].into_iter().enumerate() {
        let off = difference(&mut Random(1000 + seed as u64), size);
        assert!(off < 1e-12, "{size:?}: {off:e}");
    }
}

#[test]
fn an_amount_for_every_voxel_is_as_each_by_itself() {
    for seed in 0..300 {
        let mut random = Random(seed);
        let start: [usize; 3] = std::array::from_fn(|_| random.below(30));
        let region = Region { start, end: start.map(|s| s + 1 + random.below(9)) };
        let spacing = std::array::from_fn(|_| random.pick(&[1.0, 1.0, 0.4, 1.7]));
        let grid = Grid { dims: region.end, spacing, origin: [3.0, -7.0, 40.0] };
        let camera = Camera::new(&random_view(&mut random), &grid).expect("a valid view");
        let shear = Shear::new(&camera, &grid, random.pick(&[1, 2, 3]));
        let spreading = Spreading { shear, degree: random.pick(&[1, 3, 5]), tau: random.pick(&[0.0, 0.2]) };
        let mut dense = Dense::new(&spreading, &region, 2);
        let mut slow = Cells::new(dense.cells.first.map(|n| n - 1), dense.cells.size.map(|n| n + 2), 2);
        for plane in 0..2 {
            let amounts: Vec<f64> = (0..region.voxels()).map(|_| random.between(-1.0, 1.0)).collect();
            dense.add(plane, &amounts);
            for (voxel, amount) in region.iter().zip(amounts) {
                let fading = (-spreading.tau * shear.depth(voxel)).exp();
                let places = shear.place(voxel).map(|place| spread(spreading.degree, place));
                slow.add(plane, amount * fading, places, spreading.degree);
            }
        }
        let [width, height] = dense.cells.size;
        for (n, sum) in dense.cells.sums.iter().enumerate() {
            let (plane, v, u) = (n / (width * height), n / width % height, n % width);
            let expected = slow.plane(plane)[(v + 1) * (width + 2) + u + 1];
            assert!((sum - expected).abs() < 1e-10 * (1.0 + expected.abs()), "{seed}: {sum} for {expected}");
        }
    }
}
