//! Colours from the method alone: piecewise linear between points of values, constant beyond the first and last point.

/// Red, green and blue of a value, each 0 to 1.
pub(crate) type Point = (f64, [f64; 3]);

/// The colour of a present value. If two points have the same value, the second applies from there on.
pub(crate) fn colour(points: &[Point], value: f64) -> [f64; 3] {
    let mut found = points[0].1;
    for pair in points.windows(2) {
        let ((from, a), (to, b)) = (pair[0], pair[1]);
        if value >= to {
            found = b;
        } else if value >= from {
            let share = (value - from) / (to - from);
            return [0, 1, 2].map(|c| (1.0 - share) * a[c] + share * b[c]);
        }
    }
    found
}

mod tests {
    use super::colour;

    #[test]
    fn colours_between_points_and_beyond() {
        let points = [(1.0, [0.0; 3]), (2.0, [1.0, 0.5, 0.0]), (2.0, [0.0, 0.0, 1.0]), (4.0, [1.0; 3])];
        let expected = [(0.0, 0.0), (1.0, 0.0), (1.5, 0.5), (2.0, 0.0), (3.0, 0.5), (4.0, 1.0), (9.0, 1.0)];
        assert!(expected.into_iter().all(|(value, red)| colour(&points, value)[0] == red));
    }
}
