//! The weights of a normalised Gaussian at whole voxels, along one axis.

use wavesplat_core::base::grid::Region;

/// The kernel is cut where a voxel is at least this many standard deviations away.
pub(super) const CUT: f64 = 4.0;

/// Positions are at most this far from the first voxel: farther ones have no weights, either.
const FARTHEST: f64 = 1e15;

/// Voxels on each side of a position that the kernel reaches, for a standard deviation in voxels.
pub(super) fn reach(sigma: f64) -> usize {
    (CUT * sigma).ceil().max(1.0) as usize
}

/// The weights of the voxels around a position.
#[derive(Debug, Clone)]
pub(super) struct Taps {
    /// The position in voxels.
    pub(super) position: f64,
    /// The voxel of the first weight.
    pub(super) first: i64,
    /// Weights of sum 1.
    pub(super) weights: Vec<f32>,
    /// The derivatives of the weights by the position.
    pub(super) slopes: Vec<f32>,
    /// The sum of the kernel at all voxels; about 1 unless the kernel is narrow.
    pub(super) density: f64,
}

impl Taps {
    /// The weights at a position in voxels, of a Gaussian whose standard deviation is `sigma` voxels.
    pub(super) fn new(position: f64, sigma: f64) -> Self {
        let position = position.clamp(-FARTHEST, FARTHEST);
        let (below, reach) = (position.floor(), reach(sigma) as i64);
        let square = |n: i64| (position - below - n as f64).powi(2);
        let (nearest, decay) = (square(0).min(square(1)), 0.5 / (sigma * sigma));
        let share = |n: i64| libm::exp((nearest - square(n)) * decay);
        let shares: Vec<f64> = (1 - reach..=reach).map(share).collect();
        let sum: f64 = shares.iter().sum();
        let cut: f64 = (reach..3 * reach).map(|n| share(n + 1) + share(-n)).sum();
        let weights: Vec<f64> = shares.iter().map(|share| share / sum).collect();
        let pull = |n: i64| (n as f64 - (position - below)) / (sigma * sigma);
        let mean: f64 = (1 - reach..=reach).zip(&weights).map(|(n, weight)| weight * pull(n)).sum();
        let slopes = (1 - reach..=reach).zip(&weights).map(|(n, weight)| (weight * (pull(n) - mean)) as f32).collect();
        let peak = libm::exp(-nearest * decay) / ((2.0 * std::f64::consts::PI).sqrt() * sigma);
        let weights = weights.into_iter().map(|weight| weight as f32).collect();
        Self { position, first: below as i64 + 1 - reach, weights, slopes, density: (sum + cut) * peak }
    }

    /// The weights that meet the voxels from 0 to `count`, for a kernel moved by `by` voxels: the first such voxel, and
    /// the indices of the weights.
    pub(super) fn within(&self, by: i64, count: usize) -> (usize, std::ops::Range<usize>) {
        let first = self.first + by;
        let skipped = (-first).clamp(0, self.weights.len() as i64);
        let end = (count as i64 - first).clamp(skipped, self.weights.len() as i64);
        ((first + skipped).max(0) as usize, skipped as usize..end as usize)
    }

    /// These taps with their weights, or with the derivatives of these.
    pub(super) fn along(&self, derived: bool) -> (&Self, &[f32]) {
        (self, if derived { &self.slopes } else { &self.weights })
    }

    /// The sum of the weights that meet the voxels from 0 to `count`, for a kernel moved by `by` voxels.
    pub(super) fn presence(&self, by: i64, count: usize) -> f32 {
        let (_, met) = self.within(by, count);
        if met.len() == self.weights.len() { 1.0 } else { self.weights[met].iter().sum() }
    }

    /// The derivative of [`Self::presence`] by the position.
    pub(super) fn presence_slope(&self, by: i64, count: usize) -> f32 {
        let (_, met) = self.within(by, count);
        if met.len() == self.weights.len() { 0.0 } else { self.slopes[met].iter().sum() }
    }
}

/// A region's first voxel and number of voxels along three axes.
pub(super) fn along(region: &Region, axes: [usize; 3]) -> ([usize; 3], [usize; 3]) {
    (axes.map(|axis| region.start[axis]), axes.map(|axis| region.dims()[axis]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_the_gaussian() {
        for sigma in [0.02, 0.3, 0.75, 1.5, 4.0] {
            for position in [-7.0, 2.25, 2.5, 0.001, 5.999] {
                let taps = Taps::new(position, sigma);
                let sum: f32 = taps.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-6 && taps.weights.len() == 2 * reach(sigma));
                let gauss = |n: f64| (-0.5 * ((position - n) / sigma).powi(2)).exp();
                let all: f64 = (-60..60).map(|n| gauss(f64::from(n))).sum();
                let density = all / ((2.0 * std::f64::consts::PI).sqrt() * sigma);
                assert!((taps.density - density).abs() < 1e-9 * density.max(1e-300), "{sigma} {position}");
                for (i, weight) in taps.weights.iter().enumerate().filter(|_| all > 1e-200) {
                    let expected = gauss((taps.first + i as i64) as f64) / all;
                    assert!((f64::from(*weight) - expected).abs() < 2e-4, "{sigma} {position} {i}");
                }
            }
        }
    }

    #[test]
    fn slopes_are_those_of_the_weights() {
        const STEP: f64 = 1e-4;
        for sigma in [0.3, 0.75, 2.0] {
            for position in [3.01, 3.25, 3.5, 3.9] {
                let taps = Taps::new(position, sigma);
                let [before, after] = [position - STEP, position + STEP].map(|at| Taps::new(at, sigma).weights);
                for (slope, (a, b)) in taps.slopes.iter().zip(before.iter().zip(after)) {
                    let expected = (f64::from(b) - f64::from(*a)) / (2.0 * STEP);
                    assert!((f64::from(*slope) - expected).abs() < 2e-3, "{sigma} {position}: {slope} {expected}");
                }
                let sum: f32 = taps.slopes.iter().sum();
                assert!(
                    sum.abs() < 1e-6 && taps.presence_slope(50, 1000) == 0.0 && taps.presence_slope(-3, 1000) > 0.0
                );
            }
        }
    }

    #[test]
    fn positions_far_away_have_no_weights() {
        for position in [1e300, -1e300, f64::INFINITY, 1e18, f64::NAN] {
            let taps = Taps::new(position, 0.75);
            assert!(position.is_nan() || taps.within(0, 1000).1.is_empty(), "{position}");
        }
    }

    #[test]
    fn weights_outside_the_voxels_are_left_out() {
        let taps = Taps::new(0.5, 0.75);
        assert_eq!((taps.first, taps.weights.len()), (-2, 6));
        assert_eq!(taps.within(0, 10), (0, 2..6));
        assert_eq!(taps.within(0, 2), (0, 2..4));
        assert_eq!(taps.within(5, 10), (3, 0..6));
        assert_eq!(taps.within(9, 10), (7, 0..3));
        assert_eq!(taps.within(100, 10).1.len(), 0);
        assert_eq!(taps.within(-100, 10).1.len(), 0);
        assert!((taps.presence(0, 10) - taps.weights[2..].iter().sum::<f32>()).abs() < 1e-7);
    }
}
