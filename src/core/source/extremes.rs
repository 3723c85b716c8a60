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

    /// No values, to be joined with these: values that reach no end of these need not be counted.
    pub(crate) fn none_beside(&self) -> Self {
        let none = |peak: Peak| Peak { count: 0, next: f64::NEG_INFINITY, ..peak };
        Self { most: none(self.most), least: none(self.least) }
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

/// Whether programs write a value where they have none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Habit {
    /// No program is known to.
    None,
    /// Some do, but it may also be a sample: a limit where samples saturate, or a huge number.
    Common,
    /// It is hardly ever a sample, far from all others.
    Sure,
}

/// Whether programs commonly write this value where they have none: the limits of a type, nines, and huge numbers.
/// Small integers hold counts and brightness, where a limit means saturation.
pub fn habit(ty: SampleType, value: f64) -> Habit {
    let (is_least, is_limit) = (LEAST.contains(&value), MOST.contains(&value));
    let nines = is_nines(ty, value);
    let (sure, common) = match ty {
        SampleType::U8 | SampleType::I8 => (false, false),
        SampleType::U16 => (false, is_limit || nines),
        SampleType::U32 => (false, value >= 2_147_483_647.0 || nines),
        SampleType::I16 | SampleType::I32 => (is_least || nines && value < 0.0, is_limit || nines),
        SampleType::F16 => (nines, value.abs() >= 65504.0),
        SampleType::F32 | SampleType::F64 => {
            (is_least || nines || ODD.contains(&value) || is_known_huge(value), value.abs() >= HUGE || is_limit)
        }
    };
    match (sure, common) {
        (true, _) => Habit::Sure,
        (false, true) => Habit::Common,
        (false, false) => Habit::None,
    }
}

/// The least integers of 16 and 32 bits, which floats are often converted from.
const LEAST: [f64; 3] = [-32768.0, -32767.0, -2_147_483_648.0];

/// The largest integers.
const MOST: [f64; 4] = [32767.0, 65535.0, 2_147_483_647.0, 2_147_483_648.0];

/// Of well logs, of the Met Office, and of climate tables.
const ODD: [f64; 3] = [-999.25, -1_073_741_824.0, -99.0];

/// Numbers of this size are rarely samples.
pub const HUGE: f64 = 1e15;

/// Defaults of NetCDF, CMIP, Ferret, GrADS, HYCOM and Surfer, and the largest floats; of either sign.
const KNOWN_HUGE: [f64; 12] = [
    9.969_209_968_386_869e36,
    1e20,
    1e30,
    1e34,
    1e35,
    1e36,
    1e37,
    9.999e20,
    1.267_650_6e30,
    1.701_41e38,
    f32::MAX as f64,
    f64::MAX,
];

/// Whether a value is a known one of that size, in 64 bits or rounded to 32.
fn is_known_huge(value: f64) -> bool {
    KNOWN_HUGE.into_iter().any(|known| value.abs() == known || value.abs() == f64::from(known as f32))
}

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
            let beside = values.chunks(run).fold(ExtremeCounts::NONE, |seen, part| {
                let mut found = seen.none_beside();
                let range = part.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
                found.add(part, range.0, range.1);
                seen.join(found)
            });
            assert_eq!(beside, whole, "{run}, beside those before");
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
            assert_eq!(habit(SampleType::F32, value), Habit::Sure, "{value}");
        }
        for (ty, value) in [(SampleType::F32, 65535.0), (SampleType::F64, 3.2e18), (SampleType::U16, 65535.0)] {
            assert_eq!(habit(ty, value), Habit::Common, "{value} may be a sample");
        }
        let f32_in_f64 = f64::from(9.969_21e36_f32);
        assert_eq!([1e20, -999.25, f32_in_f64, -f64::MAX].map(|v| habit(SampleType::F64, v)), [Habit::Sure; 4]);
        let short = [-32768.0, -999.0, 999.0, 32767.0, 3071.0].map(|v| habit(SampleType::I16, v));
        assert_eq!(short, [Habit::Sure, Habit::Sure, Habit::Common, Habit::Common, Habit::None]);
        for value in [0.0, 1.0, -1.0, 255.0, 1000.0, 7800.0, 99.0, f64::from(300.15_f32), 9998.0] {
            assert_eq!(habit(SampleType::F32, value), Habit::None, "{value}");
        }
        assert_eq!(habit(SampleType::U8, 255.0), Habit::None);
        assert_eq!(written(SampleType::F32, 1e20_f32.into()), "1e20");
    }
}
