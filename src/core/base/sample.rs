//! Samples as numbers: little-endian bytes of any [`SampleType`] to `f64` and back.
//!
//! Every type but `f64` fits in `f64` exactly, so arithmetic on `f64` loses nothing of the input.

pub use wavesplat_format::SampleType;

use super::vectors::dispatch;
use crate::base::half::Half;

macro_rules! for_type {
    ($ty:expr, $run:ident, $($arg:expr),*) => {
        match $ty {
            SampleType::U8 => $run!(u8, $($arg),*),
            SampleType::I8 => $run!(i8, $($arg),*),
            SampleType::U16 => $run!(u16, $($arg),*),
            SampleType::I16 => $run!(i16, $($arg),*),
            SampleType::U32 => $run!(u32, $($arg),*),
            SampleType::I32 => $run!(i32, $($arg),*),
            SampleType::F16 => $run!(Half, $($arg),*),
            SampleType::F32 => $run!(f32, $($arg),*),
            SampleType::F64 => $run!(f64, $($arg),*),
        }
    };
}

/// Fills `out` with the numbers whose little-endian bytes are `bytes` (`out.len() * ty.size()` of them).
pub fn load(ty: SampleType, bytes: &[u8], out: &mut [f64]) {
    load_as(ty, bytes, out, |v| v);
}

/// As [`load`], with each number converted by `of`.
pub fn load_as<T>(ty: SampleType, bytes: &[u8], out: &mut [T], of: impl Fn(f64) -> T) {
    assert_eq!(bytes.len(), out.len() * ty.size(), "bytes of {} samples", out.len());
    macro_rules! run {
        ($t:ty, $bytes:expr, $out:expr) => {
            for (o, b) in $out.iter_mut().zip($bytes.as_chunks::<{ size_of::<$t>() }>().0) {
                *o = of(f64::from(<$t>::from_le_bytes(*b)));
            }
        };
    }
    for_type!(ty, run, bytes, out);
}

/// The largest magnitude of the first `count` samples of rows of so many bytes each. Ignores NaN.
pub(crate) fn magnitude_of_rows(ty: SampleType, rows: &[u8], row: usize, count: usize) -> f64 {
    macro_rules! run {
        ($t:ty, $rows:expr) => {
            dispatch!(magnitude_of($rows, row, count, |sample| f64::from(<$t>::from_le_bytes(sample))))
        };
    }
    for_type!(ty, run, rows)
}

#[inline(always)]
fn magnitude_of<const SIZE: usize>(rows: &[u8], row: usize, count: usize, of: impl Fn([u8; SIZE]) -> f64) -> f64 {
    let mut lanes = [0.0; RANGE_LANES];
    for row in rows.chunks_exact(row) {
        let (some, last) = row.as_chunks::<SIZE>().0[..count].as_chunks::<RANGE_LANES>();
        for samples in some {
            for l in 0..RANGE_LANES {
                keep_larger(&mut lanes[l], of(samples[l]));
            }
        }
        last.iter().for_each(|sample| keep_larger(&mut lanes[0], of(*sample)));
    }
    lanes.into_iter().fold(0.0, f64::max)
}

#[inline(always)]
fn keep_larger(largest: &mut f64, value: f64) {
    *largest = if value.abs() > *largest { value.abs() } else { *largest };
}

/// Fills each element of `out` with `N` neighbouring samples. The next element starts `stride` samples later.
pub(crate) fn load_strided<const N: usize>(ty: SampleType, bytes: &[u8], stride: usize, out: &mut [[f64; N]]) {
    macro_rules! run {
        ($t:ty, $bytes:expr, $out:expr) => {{
            let samples = $bytes.as_chunks::<{ size_of::<$t>() }>().0;
            for (i, lane) in $out.iter_mut().enumerate() {
                let samples: &[_; N] = samples[i * stride..].first_chunk().expect("samples of every row");
                *lane = samples.map(|b| f64::from(<$t>::from_le_bytes(b)));
            }
        }};
    }
    for_type!(ty, run, bytes, out);
}

/// `value` after it was stored as `ty`: rounded to nearest, and for integers clamped to their range.
pub fn round_to(ty: SampleType, value: f64) -> f64 {
    macro_rules! as_int {
        ($t:ty) => {
            value.round().clamp(f64::from(<$t>::MIN), f64::from(<$t>::MAX))
        };
    }
    match ty {
        SampleType::U8 => as_int!(u8),
        SampleType::I8 => as_int!(i8),
        SampleType::U16 => as_int!(u16),
        SampleType::I16 => as_int!(i16),
        SampleType::U32 => as_int!(u32),
        SampleType::I32 => as_int!(i32),
        SampleType::F16 => f64::from(Half::nearest(value)),
        SampleType::F32 => f64::from(value as f32),
        SampleType::F64 => value,
    }
}

/// The sample of type `ty` next to a finite value: the least above it (`up`), or the largest below; infinite beyond the largest float,
/// none beyond the range of integers.
pub fn beside(ty: SampleType, value: f64, up: bool) -> Option<f64> {
    macro_rules! float {
        ($nearest:expr, $up:expr, $down:expr) => {{
            let nearest = $nearest;
            let is_beyond = if up { f64::from(nearest) > value } else { f64::from(nearest) < value };
            Some(f64::from(match is_beyond {
                true => nearest,
                false if up => $up(nearest),
                false => $down(nearest),
            }))
        }};
    }
    macro_rules! integer {
        ($t:ty) => {{
            let next = if up { value.floor() + 1.0 } else { value.ceil() - 1.0 };
            let (least, most) = (f64::from(<$t>::MIN), f64::from(<$t>::MAX));
            if up { Some(next.max(least)).filter(|n| *n <= most) } else { Some(next.min(most)).filter(|n| *n >= least) }
        }};
    }
    match ty {
        SampleType::U8 => integer!(u8),
        SampleType::I8 => integer!(i8),
        SampleType::U16 => integer!(u16),
        SampleType::I16 => integer!(i16),
        SampleType::U32 => integer!(u32),
        SampleType::I32 => integer!(i32),
        SampleType::F16 => float!(Half::nearest(value), Half::next_up, Half::next_down),
        SampleType::F32 => float!(value as f32, f32::next_up, f32::next_down),
        SampleType::F64 => float!(value, f64::next_up, f64::next_down),
    }
}

/// Writes `values` as little-endian samples of type `ty`, rounded as by [`round_to`].
pub fn store(ty: SampleType, values: &[f64], out: &mut [u8]) {
    dispatch!(to_bytes(ty, values, out));
}

#[inline(always)]
fn to_bytes(ty: SampleType, values: &[f64], out: &mut [u8]) {
    assert_eq!(out.len(), values.len() * ty.size(), "bytes of {} samples", values.len());
    macro_rules! run {
        ($t:ident, $values:expr, $out:expr) => {
            for (b, v) in $out.as_chunks_mut::<{ size_of::<$t>() }>().0.iter_mut().zip($values) {
                *b = cast!($t, *v).to_le_bytes();
            }
        };
    }
    macro_rules! cast {
        (f64, $v:expr) => {
            $v
        };
        (f32, $v:expr) => {
            $v as f32
        };
        (Half, $v:expr) => {
            Half::nearest($v)
        };
        ($t:ident, $v:expr) => {
            $v.round() as $t // also clamps
        };
    }
    for_type!(ty, run, values, out);
}

/// Replaces samples below `lo` by it, and those above `hi` by that.
pub fn clip(ty: SampleType, lo: f64, hi: f64, samples: &mut [u8]) {
    let mut values = vec![0.0; CLIPPED.min(samples.len() / ty.size())];
    for run in samples.chunks_mut(CLIPPED * ty.size()) {
        let values = &mut values[..run.len() / ty.size()];
        load(ty, run, values);
        values.iter_mut().for_each(|value| *value = value.clamp(lo, hi));
        store(ty, values, run);
    }
}

/// Samples that are clipped at a time.
const CLIPPED: usize = 4 << 10;

/// Whether a sample is missing: not finite, or equal to the `declared` missing value.
pub fn is_missing(value: f64, declared: Option<f64>) -> bool {
    !value.is_finite() || Some(value) == declared
}

/// Whether any value is missing. It reads all values, so that the loop becomes vector code.
#[inline(always)]
pub fn is_any_missing<T: Copy + Into<f64>>(values: &[T], declared: Option<f64>) -> bool {
    let declared = declared.unwrap_or(f64::NAN); // equal to nothing
    let mut any = false;
    for v in values {
        let v: f64 = (*v).into();
        any |= !v.is_finite() | (v == declared);
    }
    any
}

/// A declared missing value rounded to type `ty`: 1e35 as f32 is another number than as f64.
pub fn missing_value(ty: SampleType, declared: Option<f64>) -> Option<f64> {
    declared.map(|v| if ty.is_float() { round_to(ty, v) } else { v })
}

/// The range of some values; None if any of them is missing. For long runs: it uses vector code.
#[inline(always)]
pub(crate) fn range_unless_missing(values: &[f64], declared: Option<f64>) -> Option<(f64, f64)> {
    let declared = declared.unwrap_or(f64::NAN); // equal to nothing
    let mut all = Range::<RANGE_LANES>::EMPTY;
    let (many, rest) = values.as_chunks();
    for values in many {
        all.add(values, declared);
    }
    let mut last = Range::<1>::EMPTY;
    for v in rest {
        last.add(&[*v], declared);
    }
    let (a, b) = (all.whole()?, last.whole()?);
    Some((a.0.min(b.0), a.1.max(b.1)))
}

/// The range of all samples that are not missing, (inf, -inf) if there are none. `missing` is called with the index of
/// each missing sample.
pub fn range_of_present(
    ty: SampleType,
    samples: &[u8],
    declared: Option<f64>,
    missing: impl FnMut(usize),
) -> (f64, f64) {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for_each_present(ty, samples, declared, missing, |_, run| range = join_ranges(range, run));
    range
}

/// Calls `present(values, their range)` for runs of samples that are not missing, and `missing` with the index of each
/// sample that is.
pub(crate) fn for_each_present(
    ty: SampleType,
    samples: &[u8],
    declared: Option<f64>,
    mut missing: impl FnMut(usize),
    mut present: impl FnMut(&[f64], (f64, f64)),
) {
    for_each_run(ty, samples, |first, values| {
        if let Some(run) = dispatch!(range_unless_missing(values, declared)) {
            present(values, run);
            return;
        }
        for (i, value) in values.iter().enumerate() {
            match is_missing(*value, declared) {
                true => missing(first + i),
                false => present(&[*value], (*value, *value)),
            }
        }
    });
}

/// The smallest range that holds both.
pub fn join_ranges(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Number of independent ranges: a comparison need not wait for the last one.
const RANGE_LANES: usize = 16;

/// Ranges of `N` runs of values.
struct Range<const N: usize> {
    lo: [f64; N],
    hi: [f64; N],
    /// Not a number where a value was missing.
    missing: [f64; N],
}

impl<const N: usize> Range<N> {
    const EMPTY: Self = Self { lo: [f64::INFINITY; N], hi: [f64::NEG_INFINITY; N], missing: [0.0; N] };

    #[inline(always)]
    fn add(&mut self, values: &[f64; N], declared: f64) {
        for (i, &v) in values.iter().enumerate() {
            self.lo[i] = if v < self.lo[i] { v } else { self.lo[i] };
            self.hi[i] = if v > self.hi[i] { v } else { self.hi[i] };
            self.missing[i] = if (v.abs() < f64::INFINITY) & (v != declared) { self.missing[i] } else { f64::NAN };
        }
    }

    fn whole(&self) -> Option<(f64, f64)> {
        let range =
            (self.lo.into_iter().fold(f64::INFINITY, f64::min), self.hi.into_iter().fold(f64::NEG_INFINITY, f64::max));
        (!self.missing.iter().any(|m| m.is_nan())).then_some(range)
    }
}

/// Rounds a few values as by [`round_to`].
pub(crate) fn round_all<const N: usize>(ty: SampleType, values: &[f64; N]) -> [f64; N] {
    match ty {
        SampleType::F64 => *values,
        SampleType::F32 => values.map(|v| f64::from(v as f32)),
        _ => values.map(|v| round_to(ty, v)),
    }
}

/// Calls `visit(index of the first, values)` for all samples, a run at a time.
pub(crate) fn for_each_run(ty: SampleType, samples: &[u8], mut visit: impl FnMut(usize, &[f64])) {
    const RUN: usize = 512;
    let mut values = [0.0; RUN];
    for (run, bytes) in samples.chunks(RUN * ty.size()).enumerate() {
        let values = &mut values[..bytes.len() / ty.size()];
        load(ty, bytes, values);
        visit(run * RUN, values);
    }
}

/// Reverses the bytes of every sample: big-endian to little-endian and back.
pub fn swap_endian(ty: SampleType, bytes: &mut [u8]) {
    if ty.size() > 1 {
        bytes.chunks_exact_mut(ty.size()).for_each(<[u8]>::reverse);
    }
}

/// The largest rounding error for numbers up to `magnitude`.
pub fn rounding(ty: SampleType, magnitude: f64) -> f64 {
    match ty {
        SampleType::F16 => magnitude * 2f64.powi(-11),
        SampleType::F32 => magnitude * 2f64.powi(-24),
        SampleType::F64 => 0.0,
        _ => 0.5,
    }
}

/// The largest absolute value in a range; 0 if it is empty.
pub fn magnitude(range: (f64, f64)) -> f64 {
    let (lo, hi) = range;
    if lo <= hi { (-lo).max(hi) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_keeps_its_extremes() {
        let cases = [
            (SampleType::U8, 0.0, 255.0),
            (SampleType::I8, -128.0, 127.0),
            (SampleType::U16, 0.0, 65535.0),
            (SampleType::I16, -32768.0, 32767.0),
            (SampleType::U32, 0.0, 4294967295.0),
            (SampleType::I32, -2147483648.0, 2147483647.0),
            (SampleType::F16, -65504.0, 65504.0),
            (SampleType::F32, f64::from(f32::MIN), f64::from(f32::MAX)),
            (SampleType::F64, f64::MIN, f64::MAX),
        ];
        for (ty, lo, hi) in cases {
            let mut bytes = vec![0; 2 * ty.size()];
            store(ty, &[lo, hi], &mut bytes);
            let mut back = [0.0; 2];
            load(ty, &bytes, &mut back);
            assert_eq!(back, [lo, hi], "{ty}");
        }
    }

    #[test]
    fn storing_rounds_as_it_should() {
        let values =
            [0.0, -0.0, 0.4, -0.5, 2.5, 254.7, 1e4 + 0.5, -1e9, 1e-9, 1.0 + 1e-9, 1e39, f64::MAX, f64::INFINITY];
        let types =
            [SampleType::U8, SampleType::I8, SampleType::U16, SampleType::I16, SampleType::U32, SampleType::I32];
        for ty in types.into_iter().chain([SampleType::F16, SampleType::F32, SampleType::F64]) {
            let (mut bytes, mut back) = (vec![0; values.len() * ty.size()], [0.0; 13]);
            store(ty, &values, &mut bytes);
            load(ty, &bytes, &mut back);
            assert_eq!(back, values.map(|v| round_to(ty, v)), "{ty}");
        }
    }

    #[test]
    fn halves_round_to_nearest_from_all_digits() {
        let ulp = 2f64.powi(-10);
        for (share, expected) in
            [(0.5, 1.0), (0.5 + 2f64.powi(-30), 1.0 + ulp), (0.5 - 2f64.powi(-30), 1.0), (1.5, 1.0 + 2.0 * ulp)]
        {
            assert_eq!(round_to(SampleType::F16, 1.0 + share * ulp), expected, "{share}");
            assert_eq!(round_to(SampleType::F16, -1.0 - share * ulp), -expected, "{share}");
        }
        assert_eq!(round_to(SampleType::F16, 65519.999), 65504.0);
        assert_eq!(round_to(SampleType::F16, 65520.0), f64::INFINITY);
        assert_eq!(round_to(SampleType::F16, 1e-300), 0.0);
        assert_eq!(round_to(SampleType::F16, f64::MAX), f64::INFINITY);
        assert!(round_to(SampleType::F16, f64::NAN).is_nan());
    }

    #[test]
    fn rows_are_loaded_as_each_sample_is() {
        let numbers: Vec<f64> = (0..60).map(f64::from).collect();
        for ty in [SampleType::U8, SampleType::I16, SampleType::F16, SampleType::F32, SampleType::F64] {
            let mut bytes = vec![0; numbers.len() * ty.size()];
            store(ty, &numbers, &mut bytes);
            let mut rows = [[0.0; 4]; 5];
            load_strided(ty, &bytes[3 * ty.size()..], 13, &mut rows);
            for (i, row) in rows.iter().enumerate() {
                assert_eq!(row[..], numbers[3 + 13 * i..][..4], "{ty}");
            }
            let mut again = vec![0.0f32; numbers.len()];
            load_as(ty, &bytes, &mut again, |v| v as f32);
            assert!(again.iter().zip(&numbers).all(|(a, b)| f64::from(*a) == *b));
        }
    }

    #[test]
    fn ranges_are_those_of_all_values_whatever_their_number() {
        let value = |i: usize| ((i * 7919) % 104_729) as f64 - 5e4;
        for n in [0, 1, 15, 16, 17, 100] {
            let mut values: Vec<f64> = (0..n).map(value).collect();
            let slow = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (v.min(a), v.max(b)));
            assert_eq!(dispatch!(range_unless_missing(&values[..], Some(0.5))), Some(slow));
            for missing in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.5] {
                for i in 0..n {
                    let before = std::mem::replace(&mut values[i], missing);
                    assert_eq!(
                        dispatch!(range_unless_missing(&values[..], Some(0.5))),
                        None,
                        "{missing} at {i} of {n}"
                    );
                    values[i] = before;
                }
            }
        }
    }

    #[test]
    fn missing_samples_are_counted_and_not_in_the_range() {
        let mut values: Vec<f64> = (0..1500).map(f64::from).collect();
        for i in [0, 700, 1499] {
            values[i] = [f64::NAN, f64::INFINITY, -9.0][i % 3];
        }
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut missing = Vec::new();
        let range = range_of_present(SampleType::F64, &bytes, Some(-9.0), |i| missing.push(i));
        let expected: Vec<usize> = (0..1500).filter(|i| is_missing(values[*i], Some(-9.0))).collect();
        assert_eq!((range, missing), ((1.0, 1498.0), expected));
        let all = range_of_present(SampleType::U8, &[7, 7], Some(7.0), |_| {});
        assert_eq!(all, (f64::INFINITY, f64::NEG_INFINITY));
    }

    #[test]
    fn integers_round_to_nearest_and_clamp() {
        assert_eq!(round_to(SampleType::U8, 2.5), 3.0);
        assert_eq!(round_to(SampleType::U8, -7.0), 0.0);
        assert_eq!(round_to(SampleType::I16, 1e9), 32767.0);
    }

    #[test]
    fn swapping_twice_changes_nothing() {
        let mut bytes = [1, 2, 3, 4, 5, 6, 7, 8];
        swap_endian(SampleType::F32, &mut bytes);
        assert_eq!(bytes, [4, 3, 2, 1, 8, 7, 6, 5]);
        swap_endian(SampleType::F32, &mut bytes);
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}
