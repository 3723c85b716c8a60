//! Both ends of a range of samples: how often the extremes occur, and how far from them all other values are.

use crate::base::sample::SampleType;

/// The largest of some values: how often it occurs, and the largest of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Peak {
    value: f64,
    count: u64,
    next: f64,
}

impl Peak {
    const NONE: Self = Self { value: f64::NEG_INFINITY, count: 0, next: f64::NEG_INFINITY };

    /// Of all values of both.
    fn join(self, other: Self) -> Self {
        if self.value == other.value {
            return Self { count: self.count + other.count, next: self.next.max(other.next), ..self };
        }
        let (most, less) = if self.value > other.value { (self, other) } else { (other, self) };
        Self { next: most.next.max(less.value), ..most }
    }

    /// Adds values times `sign`; `most` is the largest product. Looks at every value only if `most` reaches the peak.
    fn add(&mut self, values: &[f64], most: f64, sign: f64) {
        if most >= self.value {
            *self = self.join(Self::count(values, most, sign));
        } else {
            self.next = self.next.max(most);
        }
    }

    /// The number of occurrences of `value`, the largest of the values times `sign`.
    fn count(values: &[f64], value: f64, sign: f64) -> Self {
        let (mut count, mut next) = (0, f64::NEG_INFINITY);
        for v in values {
            let v = sign * v;
            count += u64::from(v == value);
            next = if v < value && v > next { v } else { next };
        }
        Self { value, count, next }
    }
}

/// Both ends of the range of some values. Neither depends on their order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtremeCounts {
    most: Peak,
    /// The largest of the values with the opposite sign.
    least: Peak,
}

/// A value at an end of the range that repeats, far from all others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// The value.
    pub value: f64,
    /// How often it occurs.
    pub count: u64,
    /// The range of all other values. It leaves out those at the other end, if any remain without them.
    pub others: (f64, f64),
}

impl Extreme {
    /// Its distance from the others as a multiple of their range.
    pub fn distance(&self) -> f64 {
        let (lo, hi) = self.others;
        (lo - self.value).max(self.value - hi) / (hi - lo)
    }
}

impl ExtremeCounts {
    pub(crate) const NONE: Self = Self { most: Peak::NONE, least: Peak::NONE };

    /// Of all values of both.
    pub(crate) fn join(self, other: Self) -> Self {
        Self { most: self.most.join(other.most), least: self.least.join(other.least) }
    }

    /// Adds values without missing ones; their range is from `lo` to `hi`.
    pub(crate) fn add(&mut self, values: &[f64], lo: f64, hi: f64) {
        if lo == hi {
            let peak = |value| Peak { value, count: values.len() as u64, next: f64::NEG_INFINITY };
            *self = self.join(Self { most: peak(hi), least: peak(-lo) });
            return;
        }
        self.most.add(values, hi, 1.0);
        self.least.add(values, -lo, -1.0);
    }

    /// The extreme that is farther from all others, in multiples of their range; none if the others are all the same.
    pub fn extreme(&self) -> Option<Extreme> {
        let (lo, hi) = (-self.least.value, self.most.value);
        let within = (-self.least.next, self.most.next);
        let others = |whole: (f64, f64)| if within.0 < within.1 { within } else { whole };
        let most = Extreme { value: hi, count: self.most.count, others: others((lo, self.most.next)) };
        let least = Extreme { value: lo, count: self.least.count, others: others((-self.least.next, hi)) };
        let varied = [most, least].into_iter().filter(|e| e.others.0 < e.others.1 && e.distance().is_finite());
        varied.max_by(|a, b| a.distance().total_cmp(&b.distance()))
    }
}

/// Whether programs commonly write this value where they have none: the limits of a type, nines, and huge numbers.
/// Small integers hold counts and brightness, where a limit means saturation.
pub fn is_customary(ty: SampleType, value: f64) -> bool {
    match ty {
        SampleType::U8 | SampleType::I8 => false,
        SampleType::I16 => matches!(value, -32768.0 | -32767.0 | 32767.0) || is_nines(ty, value),
        SampleType::U16 => value == 65535.0 || is_nines(ty, value),
        SampleType::I32 | SampleType::U32 => value.abs() >= 2_147_483_647.0 || is_nines(ty, value),
        SampleType::F16 => value.abs() >= 65504.0 || is_nines(ty, value),
        SampleType::F32 | SampleType::F64 => value.abs() >= 1e15 || LIMITS.contains(&value) || is_nines(ty, value),
    }
}

/// Limits of integers, which floats are often converted from.
const LIMITS: [f64; 6] = [-32768.0, -32767.0, 32767.0, 65535.0, -2_147_483_648.0, 2_147_483_648.0];

/// Whether the digits of a value are three nines or more, as in -9999 and 999.9.
fn is_nines(ty: SampleType, value: f64) -> bool {
    let digits = written(ty, value.abs()).replace('.', "");
    digits.len() >= 3 && value.abs() >= 99.0 && digits.bytes().all(|digit| digit == b'9')
}

/// A value with the fewest digits that tell it from the others of its type.
pub fn written(ty: SampleType, value: f64) -> String {
    let text = if ty == SampleType::F32 { format!("{:?}", value as f32) } else { format!("{value:?}") };
    text.strip_suffix(".0").map_or(text.clone(), Into::into)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(values: &[f64]) -> ExtremeCounts {
        let mut extremes = ExtremeCounts::NONE;
        let range = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        if !values.is_empty() {
            extremes.add(values, range.0, range.1);
        }
        extremes
    }

    #[test]
    fn extremes_are_those_of_all_values_however_they_are_divided() {
        let values: Vec<f64> = (0..200).map(|i| f64::from((i * 7919) % 13 - 5)).collect();
        let count = |value: f64| values.iter().filter(|v| **v == value).count() as u64;
        let whole = counted(&values);
        assert_eq!(whole.most, Peak { value: 7.0, count: count(7.0), next: 6.0 });
        assert_eq!(whole.least, Peak { value: 5.0, count: count(-5.0), next: 4.0 });
        for run in [1, 3, 64] {
            let parts = values.chunks(run).map(counted);
            assert_eq!(parts.clone().fold(ExtremeCounts::NONE, ExtremeCounts::join), whole, "{run}");
            assert_eq!(parts.rev().fold(ExtremeCounts::NONE, ExtremeCounts::join), whole, "{run}, backwards");
            let mut added = ExtremeCounts::NONE;
            for part in values.chunks(run) {
                let range = part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
                added.add(part, range.0, range.1);
            }
            assert_eq!(added, whole, "{run}, one after the other");
        }
    }

    #[test]
    fn the_farther_extreme_is_found_beside_another() {
        let mut values = vec![1e20, 1e20, -9999.0];
        values.extend((0..100).map(f64::from));
        let found = counted(&values).extreme().expect("one is far");
        assert_eq!((found.value, found.count, found.others), (1e20, 2, (0.0, 99.0)));
        assert!(found.distance() > 1e17);
        assert!(counted(&[0.0, 0.0, 1.0]).extreme().is_none() && counted(&[2.0; 5]).extreme().is_none());
        assert!(ExtremeCounts::NONE.extreme().is_none());
    }

    #[test]
    fn customary_values_are_known_in_every_type() {
        for value in
            [1e20, 9.969_209_968_386_869e36, -9999.0, f64::from(-999.9_f32), 999.0, -32768.0, f64::from(f32::MAX)]
        {
            assert!(is_customary(SampleType::F32, value), "{value}");
        }
        for value in [0.0, 1.0, -1.0, 255.0, 1000.0, 7800.0, 99.0, f64::from(300.15_f32), 9998.0] {
            assert!(!is_customary(SampleType::F32, value), "{value}");
        }
        assert!(!is_customary(SampleType::U8, 255.0) && is_customary(SampleType::U16, 65535.0));
        assert_eq!(written(SampleType::F32, 1e20_f32.into()), "1e20");
    }
}
