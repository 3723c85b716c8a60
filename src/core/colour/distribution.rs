//! The distribution of values: the value of empty space, and opacities that show rare values.

/// Finite values in ascending order.
#[derive(Debug, Clone, Default)]
pub struct Distribution {
    sorted: Vec<f32>,
}

/// A value that many others are close to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Common {
    /// The value.
    pub value: f64,
    /// The share of all values that are close to it: within 1 % of the range, and 3 % for [`Distribution::empty`].
    pub share: f64,
}

/// Bins of the range in which the most common value is looked for.
const BINS: usize = 200;

/// The distance within which values count as the same, as a share of the range.
const NEAR: f64 = 0.01;

/// The same for values of empty space, where fields fade away.
const NEAR_EMPTY: f64 = 0.03;

/// The least share of values that make space look empty.
const EMPTY: f64 = 0.1;

/// Points of opacities over the range.
const POINTS: usize = 31;

/// The optical depth of a path through the whole volume, on average: less than 1 % of the light passes.
const DEPTH: f64 = 5.0;

/// The opacity of a voxel is at most this.
const MOST_OPAQUE: f64 = 0.9;

/// Few small things never stop most light; their opacities are not raised by more than this.
const MOST_SCALE: f64 = 8.0;

/// Ranks, 0 to 1, are raised to this power: few values are much more opaque than most.
const RARITY: i32 = 4;

/// How much the rank counts, beside the distance itself.
const BY_RANK: f64 = 0.75;

impl Distribution {
    /// The distribution of the values that are finite.
    pub fn new(mut values: Vec<f32>) -> Self {
        values.retain(|value| value.is_finite());
        values.sort_unstable_by(f32::total_cmp);
        Self { sorted: values }
    }

    /// The values, ascending.
    pub fn values(&self) -> &[f32] {
        &self.sorted
    }

    /// The share of values from `lo` to `hi`.
    fn share(&self, lo: f64, hi: f64) -> f64 {
        let below = |limit: f64, with: bool| {
            self.sorted.partition_point(|v| f64::from(*v) < limit || (with && f64::from(*v) == limit))
        };
        (below(hi, true) - below(lo, false)) as f64 / self.sorted.len().max(1) as f64
    }

    /// The value in a range that most others are close to; `None` without values or for an empty range.
    pub fn common(&self, (lo, hi): (f64, f64)) -> Option<Common> {
        let width = (hi - lo) / BINS as f64;
        if self.sorted.is_empty() || width.is_nan() || width <= 0.0 || width.is_infinite() {
            return None;
        }
        let bin = |n: usize| self.share(lo + (n as f64 - 1.0) * width, lo + (n as f64 + 2.0) * width);
        let best = (0..BINS).max_by(|a, b| bin(*a).total_cmp(&bin(*b)).then(b.cmp(a)))?;
        let (from, to) = (lo + (best as f64 - 1.0) * width, lo + (best as f64 + 2.0) * width);
        let [from, to] = [from, to].map(|limit| self.sorted.partition_point(|v| f64::from(*v) < limit));
        let value = f64::from(*self.sorted.get((from + to) / 2)?);
        let near = NEAR * (hi - lo);
        Some(Common { value, share: self.share(value - near, value + near) })
    }

    /// The value of empty space: the least of a range, or 0 within it, if a tenth of all values are close to it.
    pub fn empty(&self, (lo, hi): (f64, f64)) -> Option<Common> {
        let near = NEAR_EMPTY * (hi - lo);
        let around = |value: f64| Common { value, share: self.share(value - near, value + near) };
        let zero = Some(0.0).filter(|zero| lo < *zero && *zero < hi);
        let found = [Some(lo), zero].into_iter().flatten().map(around).max_by(|a, b| a.share.total_cmp(&b.share))?;
        let from = self.sorted.partition_point(|v| f64::from(*v) < found.value - near);
        let to = self.sorted.partition_point(|v| f64::from(*v) <= found.value + near);
        let value = f64::from(*self.sorted.get((from + to) / 2)?);
        Some(Common { value, ..found }).filter(|found| found.share >= EMPTY)
    }

    /// Opacities over a range, as points (share of the range, opacity): empty space is transparent, or else the most
    /// common value. The farther a value is from it, in rank and in value, the more opaque it is. The opacities are
    /// scaled so that a path through the volume, `length` times as long as the path that they refer to, stops most
    /// light.
    pub fn opacities(&self, (lo, hi): (f64, f64), length: f64) -> Vec<(f64, f64)> {
        let Some(common) = self.empty((lo, hi)).or_else(|| self.common((lo, hi))) else {
            return vec![(0.0, 0.0), (1.0, 1.0)];
        };
        let at = |point: usize| point as f64 / (POINTS - 1) as f64;
        let weight = |point: usize| self.weight(lo + at(point) * (hi - lo), (lo, hi), &common);
        let weights: Vec<f64> = (0..POINTS).map(weight).collect();
        let scale = self.opacity_of_the_rarest(&weights, (lo, hi), length);
        (0..POINTS).map(|point| (at(point), (scale * weights[point]).min(MOST_OPAQUE))).collect()
    }

    /// The opacity of a value before scaling, 0 to 1: it rises with the distance from the common value, in rank and by
    /// itself. The ends of the range stand for the values beyond.
    fn weight(&self, value: f64, (lo, hi): (f64, f64), common: &Common) -> f64 {
        let (distance, farthest) = ((value - common.value).abs(), (hi - common.value).max(common.value - lo));
        if distance <= NEAR * (hi - lo) {
            return 0.0;
        }
        let (from, to) = (common.value - distance, common.value + distance);
        let nearer = self.share(if from <= lo { f64::MIN } else { from }, if to >= hi { f64::MAX } else { to });
        let rank = ((nearer - common.share) / (1.0 - common.share).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let share = distance / farthest;
        share * (BY_RANK * rank.powi(RARITY) + (1.0 - BY_RANK) * share * share)
    }

    /// The factor of the weights with which a path of this length has the wanted depth.
    fn opacity_of_the_rarest(&self, weights: &[f64], (lo, hi): (f64, f64), length: f64) -> f64 {
        let width = (hi - lo) / (POINTS - 1) as f64;
        let share = |point: usize| {
            let middle = lo + point as f64 * width;
            self.share(middle - width / 2.0, middle + width / 2.0)
        };
        let shares: Vec<f64> = (0..POINTS).map(share).collect();
        let depth = |scale: f64| {
            let of = |(weight, share): (&f64, &f64)| -share * libm::log1p(-(scale * weight).min(MOST_OPAQUE));
            length * weights.iter().zip(&shares).map(of).sum::<f64>()
        };
        let (mut least, mut most) = (0.0, MOST_SCALE);
        for _ in 0..30 {
            let middle = (least + most) / 2.0;
            if depth(middle) < DEPTH { least = middle } else { most = middle }
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_space_is_the_common_value() {
        let mut values = vec![0.0; 900];
        values.extend((0..100).map(|n| n as f32 / 100.0));
        values.extend([f32::NAN, f32::INFINITY]);
        let common = Distribution::new(values).common((0.0, 1.0)).expect("values");
        assert!(common.value == 0.0 && (common.share - 0.902).abs() < 1e-9, "{common:?}");
        let even = Distribution::new((0..1000).map(|n| n as f32).collect());
        assert!(even.common((0.0, 999.0)).is_some_and(|common| common.share < 0.04));
        for (values, range) in [(vec![], (0.0, 1.0)), (vec![1.0], (1.0, 1.0)), (vec![1.0], (0.0, f64::INFINITY))] {
            assert_eq!(Distribution::new(values).common(range), None);
        }
    }

    #[test]
    fn empty_space_is_at_the_least_value_or_at_zero() {
        let of = |parts: &[(f32, usize)]| {
            let mut values: Vec<f32> = (0..100).map(|n| n as f32 / 50.0 - 1.0).collect();
            parts.iter().for_each(|(value, count)| values.extend(vec![*value; *count]));
            Distribution::new(values).empty((-1.0, 1.0)).map(|empty| empty.value)
        };
        assert_eq!(of(&[(-1.0, 100), (0.5, 300)]), Some(-1.0), "a common value inside is no empty space");
        assert_eq!(of(&[(0.0, 50)]), Some(0.0));
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn rare_values_are_opaque_and_common_ones_transparent() {
        let bell = |n: usize| (n % 101) as f32 / 101.0 + (n % 97) as f32 / 97.0 + (n % 89) as f32 / 89.0 - 1.5;
        let bell = Distribution::new((0..100_000).map(bell).collect());
        let opacities = bell.opacities((-1.5, 1.5), 100.0);
        let middle = opacities[15];
        assert!(middle.0 == 0.5 && middle.1 == 0.0 && opacities[0].1 > 0.05 && opacities[30].1 > 0.05, "{opacities:?}");
        assert!(opacities.windows(2).skip(16).all(|pair| pair[0].1 <= pair[1].1));
        assert!(opacities.iter().all(|(share, a)| (0.0..=1.0).contains(share) && (0.0..=MOST_OPAQUE).contains(a)));
        let deep = bell.opacities((-1.5, 1.5), 1000.0);
        assert!(deep[30].1 < 0.3 * opacities[30].1, "longer paths have fainter voxels");
    }

    #[test]
    fn few_or_equal_values_have_opacities_too() {
        for values in [vec![], vec![3.0], vec![3.0; 9], vec![0.0, 1.0]] {
            let opacities = Distribution::new(values).opacities((0.0, 1.0), 10.0);
            assert!(opacities.len() > 1 && opacities.iter().all(|(_, a)| a.is_finite()), "{opacities:?}");
        }
    }
}
