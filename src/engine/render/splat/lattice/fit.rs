//! The weights that spread a voxel to the cells around it, along one axis: those that fit its Gaussian best.
//!
//! Pixels gather filtered cells with the Gaussian G, so a number in the cell c counts at p as g(p - c), with the taps f
//! of the prefilter. A voxel at x should count as G(p - x). Its weights s, one for each of the nearest `width` cells,
//! minimize
//!
//! ```text
//! integral over p of (sum over c of s_c g(p - c) - G(p - x))^2        with (sum of s_c) (sum of f_j) = 1
//! g(d) = sum over j of f_j G(d - j)                                                                       (eq 45)
//! ```
//!
//! This is the projection of the Gaussian onto the shifts of g. The condition keeps constants exact. The products of
//! Gaussians have integrals in closed form, so weights take a few equations per position.

use super::prefilter::{HALF, Prefilter, TAPS, Taps, solve};

/// The largest number of cells that a voxel is spread to along an axis.
pub(super) const MOST_WIDTH: usize = 6;

/// Weights of cells side by side; zeros beyond the width.
pub(super) type CellWeights = [f64; MOST_WIDTH];

/// The cells along an axis that a voxel is spread to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// The first cell.
    pub(super) first: isize,
    /// The weights of this cell and of those after it.
    pub(super) weights: CellWeights,
}

/// Spreading along one axis, for a Gaussian.
#[derive(Debug, Clone)]
pub(super) struct AxisFit {
    /// Cells that a voxel is spread to.
    pub(super) width: usize,
    /// The prefilters, and the taps of the one that moves nothing.
    pub(super) prefilter: Prefilter,
    pub(super) taps: Taps,
    /// Standard deviation of the Gaussian in cells.
    sigma: f64,
    /// The integrals of g(p - c) g(p - d). Rows beyond the width are those of the unit matrix.
    products: [CellWeights; MOST_WIDTH],
    /// The change of weights that adds to their sum and spoils the fit least.
    level: CellWeights,
}

impl AxisFit {
    /// Spreading to `width` cells, for a Gaussian with a standard deviation of `sigma` cells.
    pub(super) fn new(width: usize, sigma: f64) -> Self {
        let prefilter = Prefilter::new(width, sigma);
        let taps = symmetric(prefilter.taps(0.0));
        let of_pair = |d: f64| both(|j| both(|l| tap(&taps, j) * tap(&taps, l) * overlap(d + (j - l) as f64, sigma)));
        let by_distance: Vec<f64> = (0..width).map(|d| of_pair(d as f64)).collect();
        let product = |c: usize, d: usize| {
            if c.max(d) < width { by_distance[c.abs_diff(d)] } else { f64::from(u8::from(c == d)) }
        };
        let products = std::array::from_fn(|c| std::array::from_fn(|d| product(c, d)));
        let ones = std::array::from_fn(|c| if c < width { 1.0 } else { 0.0 });
        Self { width, prefilter, taps, sigma, products, level: solve(products, ones) }
    }

    /// The first cell that a voxel at `position` is spread to.
    pub(super) fn first(&self, position: f64) -> isize {
        (position - self.width as f64 / 2.0).floor() as isize + 1
    }

    /// The taps that move cells by `rest`.
    pub(super) fn moved(&self, rest: f64) -> Taps {
        if rest == 0.0 { self.taps } else { self.prefilter.taps(rest) }
    }

    /// The cells and the weights for a voxel at `position` (eq 45).
    pub(super) fn at(&self, position: f64) -> Spread {
        let first = self.first(position);
        let with_voxel = |c: usize| {
            let d = (first + c as isize) as f64 - position;
            both(|j| tap(&self.taps, j) * overlap(d + j as f64, self.sigma))
        };
        let wanted = std::array::from_fn(|c| if c < self.width { with_voxel(c) } else { 0.0 });
        let mut weights = solve(self.products, wanted);
        let sum = |weights: &CellWeights| weights.iter().sum::<f64>();
        let missing = (1.0 / self.taps.iter().sum::<f64>() - sum(&weights)) / sum(&self.level);
        weights.iter_mut().zip(self.level).for_each(|(weight, level)| *weight += missing * level);
        Spread { first, weights }
    }
}

/// Taps that are the same on both sides, as f32 holds them. The weights that are fitted to them make up for the rounding.
fn symmetric(taps: Taps) -> Taps {
    std::array::from_fn(|j| f64::from((0.5 * (taps[j] + taps[TAPS - 1 - j])) as f32))
}

/// The tap of the cell j cells away.
fn tap(taps: &Taps, j: isize) -> f64 {
    taps[(j + HALF as isize) as usize]
}

/// The sum over all taps.
fn both(term: impl Fn(isize) -> f64) -> f64 {
    let half = HALF as isize;
    (-half..=half).map(term).sum()
}

/// The integral of two Gaussians with a standard deviation of `sigma` cells, `d` cells apart, as a share of its largest
/// value. A little of that of two narrow Gaussians is added, so that no weight is arbitrary.
fn overlap(d: f64, sigma: f64) -> f64 {
    let share = |sigma: f64| libm::exp(-d * d / (4.0 * sigma * sigma));
    share(sigma) + if d.abs() < 8.0 * NARROW { LITTLE * share(NARROW) } else { 0.0 }
}

/// The narrow Gaussian's standard deviation in cells, and its weight.
const NARROW: f64 = 0.4;
const LITTLE: f64 = 3e-10;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_keep_constants_and_mirror() {
        for (width, sigma) in [(4, 1.2), (4, 1.5), (5, 1.5), (5, 2.25), (6, 2.7), (6, 3.0), (6, 40.0)] {
            let fit = AxisFit::new(width, sigma);
            for position in [-3.75, -1.0, 0.0, 0.3, 0.5, 17.999] {
                let Spread { first, weights } = fit.at(position);
                let sum: f64 = weights.iter().sum();
                assert!((sum * fit.taps.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{width} {sigma} {position}");
                let mirrored = fit.at(-position);
                let weight = |spread: &Spread, cell: isize| {
                    usize::try_from(cell - spread.first)
                        .ok()
                        .and_then(|n| spread.weights.get(n))
                        .copied()
                        .unwrap_or(0.0)
                };
                // A cell at the edge may belong to one of the two only.
                for cell in first + 1..first + width as isize - 1 {
                    let [one, other] = [weights[(cell - first) as usize], weight(&mirrored, -cell)];
                    let edge = (position * 2.0).fract() == 0.0;
                    assert!(edge || (one - other).abs() < 1e-6, "{width} {sigma} {position}: {one} {other}");
                }
            }
        }
    }

    /// The sum of squares of the fitted function less the Gaussian, by sampling.
    fn off(fit: &AxisFit, position: f64, weights: &CellWeights, first: isize) -> f64 {
        let gaussian = |d: f64| (-0.5 * (d / fit.sigma).powi(2)).exp();
        let at = |p: f64| {
            let cell = |c: usize| {
                let d = p - (first + c as isize) as f64;
                weights[c] * both(|j| tap(&fit.taps, j) * gaussian(d - j as f64))
            };
            ((0..fit.width).map(cell).sum::<f64>() - gaussian(p - position)).powi(2)
        };
        (-400..400).map(|n| at(position + f64::from(n) * 0.05)).sum()
    }

    #[test]
    fn no_other_weights_with_the_same_sum_fit_better() {
        for (width, sigma) in [(4, 1.5), (5, 1.5), (5, 2.25)] {
            let fit = AxisFit::new(width, sigma);
            for position in [0.0, 0.2, 0.5, 0.9] {
                let Spread { first, weights } = fit.at(position);
                let best = off(&fit, position, &weights, first);
                for c in 0..width - 1 {
                    for change in [-1e-3, 1e-3] {
                        let mut other = weights;
                        (other[c], other[c + 1]) = (other[c] + change, other[c + 1] - change);
                        assert!(off(&fit, position, &other, first) > best, "{width} {sigma} {position} {c}");
                    }
                }
            }
        }
    }
}
