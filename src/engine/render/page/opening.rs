//! The picture that a page opens at.

/// The preferred picture is shown first unless another one has more than this many times its spread.
const MUCH: f64 = 2.0;

/// The number of the picture to open at: the preferred one, unless another one shows much more; 0 if there is none. `spreads` has
/// the [`spread`] of each.
pub fn opening(spreads: &[f64], preferred: usize) -> usize {
    let most = (0..spreads.len()).rev().max_by(|a, b| spreads[*a].total_cmp(&spreads[*b])).unwrap_or(0);
    if spreads.get(preferred).is_some_and(|spread| spread * MUCH >= spreads[most]) { preferred } else { most }
}

/// The standard deviation of the numbers that are there: how much there is to see.
pub fn spread(numbers: &[f32]) -> f64 {
    let known = || numbers.iter().filter(|number| number.is_finite()).map(|number| f64::from(*number));
    let count = known().count().max(1) as f64;
    let mean = known().sum::<f64>() / count;
    (known().map(|number| (number - mean) * (number - mean)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_open_where_they_should_unless_there_is_much_more_to_see_elsewhere() {
        assert_eq!(opening(&[], 0), 0);
        assert_eq!(opening(&[0.0, 1.9, 1.0, 1.0], 2), 2);
        assert_eq!(opening(&[0.0, 3.0, 1.0, 3.0, 0.0], 2), 1); // the first of the best
        assert_eq!(opening(&[0.0; 5], 2), 2);
    }

    #[test]
    fn spreads_leave_out_what_is_missing() {
        assert_eq!(spread(&[1.0, f32::NAN, 3.0]), 1.0);
        assert_eq!(spread(&[f32::NAN; 3]) + spread(&[]) + spread(&[7.0; 9]), 0.0);
    }
}
