//! The B-splines that spread a value over the cells around it ([Unser](wavesplat_core::bibliography)), by the recurrence of
//! [DeBoor](wavesplat_core::bibliography).

/// The highest degree.
pub(super) const MOST_DEGREE: usize = 5;

/// Weights of the cells around a position.
pub(super) type Spread = [f64; MOST_DEGREE + 1];

/// The first cell that a value at `position` reaches, and the weights of this cell and the `degree` cells after it.
/// The weights sum to 1, and their centre of mass is `position`.
pub(super) fn spread(degree: usize, position: f64) -> (isize, Spread) {
    let start = position - (degree + 1) as f64 / 2.0; // the spline is nonzero for degree + 1 cells from here on
    let below = start.floor();
    (below as isize + 1, weights(degree, start - below))
}

/// The cardinal B-splines that are nonzero at `t` in [0, 1), from left to right, by the recurrence of
/// [DeBoor](wavesplat_core::bibliography).
fn weights(degree: usize, t: f64) -> Spread {
    let mut n = Spread::default();
    n[0] = 1.0;
    for d in 1..=degree {
        let mut saved = 0.0;
        for (r, weight) in n.iter_mut().enumerate().take(d) {
            let part = *weight / d as f64;
            *weight = saved + ((r + 1) as f64 - t) * part;
            saved = (t + (d - r - 1) as f64) * part;
        }
        n[d] = saved;
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_around_the_place() {
        for degree in 1..=MOST_DEGREE {
            for position in [-3.75, -1.0, 0.0, 0.3, 17.999] {
                let (first, weights) = spread(degree, position);
                let cells = || (first..).zip(&weights[..=degree]);
                let sum: f64 = weights.iter().sum();
                let centre: f64 = cells().map(|(cell, w)| cell as f64 * w).sum();
                assert!((sum - 1.0).abs() < 1e-15 && (centre - position).abs() < 1e-14, "{degree} {position}");
            }
        }
    }

    #[test]
    fn the_spline_of_degree_four_by_hand() {
        let (first, weights) = spread(4, 2.0);
        let expected = [1.0, 76.0, 230.0, 76.0, 1.0].map(|w| w / 384.0);
        assert_eq!(first, 0);
        assert!(weights.iter().zip(expected).all(|(w, e)| (w - e).abs() < 1e-15));
    }

    #[test]
    fn the_cubic_spline_by_hand() {
        let (first, weights) = spread(3, 2.0);
        assert_eq!(first, 1);
        let expected = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0];
        assert!(weights.iter().zip(expected).all(|(w, e)| (w - e).abs() < 1e-16));
    }
}
