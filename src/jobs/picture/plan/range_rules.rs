//! Rules for the ends of automatic ranges.

/// The range of ascending values. At each end, up to one value in 200 is left out if these take two fifths of the
/// range.
pub(super) fn robust_range(values: &[f32]) -> (f64, f64) {
    let few = values.len() / 200;
    let at = |n: usize| f64::from(values[n]);
    let (lo, hi, low, high) = (at(0), at(values.len() - 1), at(few), at(values.len() - 1 - few));
    let (large, least) = (0.4 * (hi - lo), 0.05 * (hi - lo));
    let clipped = |end: f64, inner: f64| if (end - inner).abs() >= large && high - low > least { inner } else { end };
    (clipped(lo, low), clipped(hi, high))
}

/// The end of a range for tissue: few of the ascending values that are not near those of air are brighter. `None` if hardly any is of
/// air, as in maps of signed values.
pub(super) fn tissue_end(values: &[f32]) -> Option<f64> {
    /// The share of values that are not brighter.
    const MOST: f64 = 0.98;
    /// How far air reaches from the least values, as a share of the range, and its least share of all values.
    const AIR: f64 = 0.1;
    const LEAST_AIR: f64 = 0.1;
    let at = |values: &[f32], share: f64| values.get((share * values.len() as f64) as usize).map(|v| f64::from(*v));
    let (least, most) = (at(values, 0.01)?, at(values, MOST)?);
    let air = values.partition_point(|value| f64::from(*value) <= least + AIR * (most - least));
    let has_air = air as f64 >= LEAST_AIR * values.len() as f64;
    at(&values[air..], MOST).filter(|end| has_air && *end > least)
}

/// The range without what errors put below 0 where no sample is negative. `least` is the least sample, if it is known.
pub(super) fn not_below_zero((lo, hi): (f64, f64), least: Option<f64>) -> (f64, f64) {
    let is_below = lo < 0.0 && 0.0 < hi && least.is_some_and(|least| least >= 0.0);
    (if is_below { 0.0 } else { lo }, hi)
}

/// The range around the same middle, at least as wide as a hundred thousandth of its values. What changes by less is mostly
/// rounding, and should look constant.
pub(super) fn at_least_noticeable((lo, hi): (f64, f64)) -> (f64, f64) {
    const LEAST: f64 = 1e-5;
    let (middle, half) = (lo / 2.0 + hi / 2.0, LEAST / 2.0 * lo.abs().max(hi.abs()));
    if (hi - lo) / 2.0 < half { (middle - half, middle + half) } else { (lo, hi) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_samples_that_are_never_negative_begin_at_zero() {
        assert_eq!(not_below_zero((-0.01, 0.4), Some(0.0)), (0.0, 0.4));
        for (range, least) in [((-0.01, 0.4), Some(-0.01)), ((-0.01, 0.4), None), ((-2.0, -1.0), Some(0.0))] {
            assert_eq!(not_below_zero(range, least), range);
        }
    }

    #[test]
    fn ranges_are_wider_than_rounding() {
        let near = |(lo, hi): (f64, f64), (a, b): (f64, f64)| (lo - a).abs() < 1e-9 && (hi - b).abs() < 1e-9;
        assert!(near(at_least_noticeable((300.0, 300.00003)), (299.998_515, 300.001_515)));
        assert!(near(at_least_noticeable((-5.000_001, -5.0)), (-5.000_025_5, -4.999_975_5)));
        for range in [(300.0, 300.1), (0.0, 1e-20), (-1e-9, 1e-9), (1.0, 1.000_011)] {
            assert_eq!(at_least_noticeable(range), range);
        }
    }
}
