//! The values of a block in one plane, ready to be summed in f32.

use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::codec::real::Real;

/// The values v of a block as `middle` + `scale` times numbers that sums in f32 can hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockValues<'a, R> {
    pub(super) values: &'a [R],
    /// Taken off all values. 0 unless they are large compared with their range.
    pub(super) middle: f64,
    /// The unit of the numbers; 0 if all of them are zero.
    pub(super) scale: f64,
    /// The largest size of a value less the middle.
    pub(super) largest: f64,
}

/// Values larger than this many times their range are spread without their middle: rounding is relative to the range.
const MOST_RANGES: f64 = 2.0;
/// Sums of values in this range are far from the limits of f32.
const UNSCALED: [f64; 2] = [1e-25, 1e25];

/// Whether sums of values of this size are far from the limits of f32.
pub(super) fn fits_single(value: f64) -> bool {
    (UNSCALED[0]..=UNSCALED[1]).contains(&value.abs())
}

impl<'a, R: Real> BlockValues<'a, R> {
    /// Finds the middle and the scale of values, none of which is NaN.
    pub(super) fn new(values: &'a [R]) -> Self {
        let [least, most] = dispatch!(range(values)).map(Real::to_f64);
        let largest = most.max(-least);
        let middle = if largest > MOST_RANGES * (most - least) { 0.5 * least + 0.5 * most } else { 0.0 };
        let largest = if middle == 0.0 { largest } else { 0.5 * most - 0.5 * least };
        let is_usual = largest == 0.0 || fits_single(largest);
        let scale = if is_usual { f64::from(u8::from(largest != 0.0)) } else { largest };
        Self { values, middle, scale, largest }
    }

    /// Loads the numbers of every `step`-th value from `first` on.
    #[inline(always)]
    pub(super) fn load_row<S: Real>(&self, first: usize, step: usize, row: &mut [S]) {
        let values = &self.values[first..];
        let number = |value: &R| S::from_f64(value.to_f64());
        let scaled = |value: &R| S::from_f64((value.to_f64() - self.middle) / self.scale);
        match (self.middle == 0.0 && self.scale == 1.0, step) {
            (true, 1) => row.iter_mut().zip(values).for_each(|(to, value)| *to = number(value)),
            (true, _) => row.iter_mut().zip(values.iter().step_by(step)).for_each(|(to, value)| *to = number(value)),
            _ => row.iter_mut().zip(values.iter().step_by(step)).for_each(|(to, value)| *to = scaled(value)),
        }
    }
}

/// The least and the largest value; zeros without values.
#[inline(always)]
fn range<R: Real>(values: &[R]) -> [R; 2] {
    const LANES: usize = 16;
    let Some(first) = values.first() else { return [R::default(); 2] };
    let (mut least, mut most) = ([*first; LANES], [*first; LANES]);
    let (lines, rest) = values.as_chunks::<LANES>();
    for line in lines {
        (least, most) = (lower(&least, line), higher(&most, line));
    }
    let (mut lowest, mut highest) = ([*first], [*first]);
    for value in least.iter().chain(&most).chain(rest) {
        (lowest, highest) = (lower(&lowest, &[*value]), higher(&highest, &[*value]));
    }
    [lowest[0], highest[0]]
}

// One loop that changes both ends in place is not always compiled to minima and maxima of vectors.

#[inline(always)]
fn lower<R: Real, const N: usize>(a: &[R; N], b: &[R; N]) -> [R; N] {
    let mut out = *a;
    for l in 0..N {
        out[l] = if b[l] < a[l] { b[l] } else { a[l] };
    }
    out
}

#[inline(always)]
fn higher<R: Real, const N: usize>(a: &[R; N], b: &[R; N]) -> [R; N] {
    let mut out = *a;
    for l in 0..N {
        out[l] = if b[l] > a[l] { b[l] } else { a[l] };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_far_from_zero_lose_their_middle() {
        let of = |values: &[f64]| {
            let values = BlockValues::new(values);
            (values.middle, values.scale)
        };
        assert_eq!(of(&[]), (0.0, 0.0));
        assert_eq!(of(&[0.0; 40]), (0.0, 0.0));
        assert_eq!(of(&[5.0; 40]), (5.0, 0.0));
        assert_eq!(of(&[1.0, 2.0]), (0.0, 1.0));
        assert_eq!(of(&[-2.0, -1.0]), (0.0, 1.0));
        assert_eq!(of(&[299.0, 301.0]), (300.0, 1.0));
        assert_eq!(of(&[0.0, 1e30]), (0.0, 1e30));
        assert_eq!(of(&[-1e-30, 1e-30]), (0.0, 1e-30));
        assert_eq!(of(&[-f64::MAX, f64::MAX]), (0.0, f64::MAX));
        let mut row = [0.0_f32; 2];
        BlockValues::new(&[299.0, 1.0, 301.5]).load_row(0, 2, &mut row);
        assert_eq!(row, [299.0, 301.5]);
        BlockValues::new(&[299.0, 300.0, 301.0]).load_row(0, 2, &mut row);
        assert_eq!(row, [-1.0, 1.0]);
    }
}
