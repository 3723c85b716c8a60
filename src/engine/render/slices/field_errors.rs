//! Bounds of the errors of the field, from those of the blocks that the kernel reaches.
//!
//! The field is a mean with weights that are not negative, so its error is at most the largest of its samples. Its gradient
//! is a sum of samples times the derivatives of these weights.

use super::GROUP;
use super::needed::around;
use super::taps::{Taps, along};
use super::view::SlicedView;
use crate::render::batches::{BlockRange, FrameBounds, SampleReader, Units};
use wavesplat_core::base::grid::BlockGrid;
use wavesplat_core::base::sample::magnitude;

/// Bounds of the errors of the field near each block, in the units of the field.
pub(super) struct FieldErrors<'a> {
    view: &'a SlicedView,
    blocks: BlockGrid,
    near: Vec<f32>,
    /// What each frame adds: the rounding of its samples, and their error if nothing is known of blocks.
    of_frames: Vec<f32>,
    /// The largest bound.
    pub(super) most: f32,
    /// The error of the gradient, in units per world unit, of a whole kernel whose samples are all off by 1.
    of_gradient: f32,
    /// How fast this grows, as a share, with the part of the kernel that is not present.
    of_absence: f32,
}

impl<'a> FieldErrors<'a> {
    pub(super) fn new(view: &'a SlicedView, reader: &SampleReader<'_>, units: &Units) -> Self {
        let (blocks, batch, rounding) = (reader.blocks, reader.batch, rounding(view));
        let known_size = |known: &BlockRange| Some(size(units, known.range)).filter(|size| size.is_finite());
        // Ranges, to be joined with those of the blocks around; only their ends count.
        let mut near = vec![(0.0, 0.0); blocks.len()];
        for known in &batch.selection().ranges {
            near[known.block].1 = known.error * units.per * WEIGHTS + rounding * known_size(known).unwrap_or(0.0);
        }
        let near: Vec<f32> =
            around(view, blocks, near, |i| view.reach[i]).into_iter().map(|(_, error)| rounded_up(error)).collect();
        let all_known = batch.selection().ranges.iter().all(|known| known_size(known).is_some());
        let of_frame = |frame: &FrameBounds| {
            let unknown = frame.error * units.per * WEIGHTS + rounding * size(units, frame.range);
            rounded_up(frame.rounding() * units.per + if all_known { 0.0 } else { unknown })
        };
        let of_frames: Vec<f32> = batch.errors().frames.iter().map(of_frame).collect();
        let most = [&near, &of_frames].map(|errors| errors.iter().copied().fold(0.0, f32::max)).into_iter().sum();
        let (of_gradient, of_absence) = (of_gradient(view) as f32, of_absence(view) as f32);
        Self { view, blocks, near, of_frames, most, of_gradient, of_absence }
    }

    /// Bytes for so many blocks: ranges, those around them, and bounds.
    pub(super) fn bytes(blocks: BlockGrid) -> usize {
        blocks.len() * (3 * size_of::<(f64, f64)>() + size_of::<f32>())
    }

    /// Bounds the error of the gradient (eq 41), in units per world unit. Samples are off by at most `error`; `present` is the share of the
    /// kernel's weights that meet samples. The gradient is divided by this share. Where the share changes, the error of the mean adds to it.
    #[inline(always)]
    pub(super) fn of_gradient(&self, error: f32, present: f32) -> f32 {
        let mean = (self.of_absence * (1.0 - present)).clamp(0.0, 1.0);
        error * self.of_gradient * (1.0 + mean) / present.max(f32::MIN_POSITIVE)
    }

    /// The error at the sixteen cells of a group of a frame. `place` is that of the row's first cell.
    pub(super) fn of_group(&self, frame: usize, [b, c, a]: [f32; 3], group: usize) -> f32 {
        let first = b + (group * GROUP) as f32;
        let [across, down, deep] = [
            self.blocks_at(0, [first, first + (GROUP - 1) as f32]),
            self.blocks_at(1, [c; 2]),
            self.blocks_at(2, [a; 2]),
        ];
        let strides = self.strides();
        let mut most = 0.0_f32;
        for z in deep {
            for y in down.clone() {
                for x in across.clone() {
                    most = most.max(self.near[x * strides[0] + y * strides[1] + z * strides[2]]);
                }
            }
        }
        most + self.of_frames.get(frame).unwrap_or(&MOST)
    }

    /// The blocks along one of the axes b, c and a at the nearest voxels to some places.
    fn blocks_at(&self, i: usize, [from, to]: [f32; 2]) -> std::ops::RangeInclusive<usize> {
        let axis = self.view.shear.axes[i];
        let ((start, count), edge) = (along(&self.view.clip, self.view.shear.axes), self.blocks.edges[axis]);
        let voxel = |at: f32| (at.max(0.0) as usize).min(count[i] - 1);
        let [from, to] = [voxel(from), voxel(to.ceil())];
        let is_turned = i == 2 && self.view.is_reversed();
        let [from, to] = if is_turned { [count[i] - 1 - to, count[i] - 1 - from] } else { [from, to] };
        (start[i] + from) / edge..=(start[i] + to) / edge
    }

    /// The distances of two neighbouring blocks along b, c and a in the list of blocks.
    fn strides(&self) -> [usize; 3] {
        let counts = self.blocks.counts();
        self.view.shear.axes.map(|axis| counts[..axis].iter().product())
    }
}

/// Far more steps than a table has; sums and products of few are numbers.
const MOST: f32 = 1e30;
/// The sum of the kernel's weights as 32-bit numbers is at most this.
const WEIGHTS: f64 = 1.0 + 1e-5;

fn rounded_up(error: f64) -> f32 {
    (error as f32).next_up().min(MOST)
}

/// The largest number that a range of values has in these units.
fn size(units: &Units, (lo, hi): (f64, f64)) -> f64 {
    if lo > hi { 0.0 } else { magnitude((lo - units.zero, hi - units.zero)) * units.per }
}

/// The rounding of the field as a share of its largest samples: a sum of products along each axis, of rounded samples.
fn rounding(view: &SlicedView) -> f64 {
    let products: usize = view.reach.iter().map(|reach| 2 * reach + 2).sum();
    (products + 4) as f64 * f64::from(f32::EPSILON)
}

/// The length of the vector of the largest sums of absolute derivatives along each axis.
fn of_gradient(view: &SlicedView) -> f64 {
    let per = view.per_world_unit();
    let along = |i: usize| per[i] * largest_slopes(view.sigma[i]);
    (0..3).map(|i| along(i).powi(2)).sum::<f64>().sqrt()
}

/// The largest derivative of any weight as a share of the weight, beside the sum of absolute derivatives.
fn of_absence(view: &SlicedView) -> f64 {
    let pull = |i: usize| 2.0 * (view.reach[i] + 1) as f64 / view.sigma[i].powi(2);
    (0..3).map(|i| pull(i) / largest_slopes(view.sigma[i])).fold(0.0, f64::max)
}

/// The largest sum of absolute derivatives of the weights at any position.
fn largest_slopes(sigma: f64) -> f64 {
    /// Positions that are tried, and an allowance for those between them.
    const TRIED: u32 = 256;
    const BETWEEN: f64 = 1.05;
    let sum = |n: u32| -> f64 {
        let taps = Taps::new(f64::from(n) / f64::from(TRIED), sigma);
        taps.slopes.iter().map(|slope| f64::from(slope.abs())).sum()
    };
    (0..TRIED).map(sum).fold(0.0, f64::max) * BETWEEN
}
