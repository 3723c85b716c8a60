//! The structural similarity of two pictures ([Wang](wavesplat::bibliography)).

use libm::exp;
use rayon::prelude::*;

/// Pixels of a window's side.
pub(super) const WINDOW: usize = 11;
const SIGMA: f64 = 1.5; // pixels
const K1: f64 = 0.01;
const K2: f64 = 0.03;

/// A picture of some channels, one after another at each pixel, row after row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Picture<'a> {
    /// All numbers; NaN is background.
    pub(super) values: &'a [f64],
    /// Pixels a row.
    pub(super) width: usize,
    /// Numbers a pixel.
    pub(super) channels: usize,
}

/// The values that pictures may have: what constants are taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scope {
    /// The largest less the smallest.
    pub(super) peak: f64,
    /// Their middle; only what is lost to rounding depends on it.
    pub(super) middle: f64,
}

/// Weighted means over a window of a, b, a^2, b^2 and a b.
type Moments = [f64; 5];

/// The mean similarity over all windows that lie inside and are free of background, for each channel, and the mean of these.
///
/// None if there is no such window, or if the peak is 0. Pictures must have the same size.
pub(super) fn ssim(a: Picture, b: Picture, scope: Scope) -> Option<f64> {
    let height = a.values.len() / (a.width * a.channels).max(1);
    if a.width < WINDOW || height < WINDOW || scope.peak <= 0.0 {
        return None;
    }
    let of_channels = (0..a.channels).filter_map(|channel| of_channel(a, b, scope, height, channel));
    mean(of_channels.map(|value| (value, 1)))
}

/// Sums of rows are added in their order, so that the number of threads changes nothing.
fn of_channel(a: Picture, b: Picture, scope: Scope, height: usize, channel: usize) -> Option<f64> {
    let weights = gaussian();
    let rows: Vec<(f64, u64)> = (0..=height - WINDOW)
        .into_par_iter()
        .map(|y| of_row(&columns(a, b, scope, y, channel, &weights), scope, &weights))
        .collect();
    mean(rows)
}

/// The mean from sums and counts.
fn mean(sums: impl IntoIterator<Item = (f64, u64)>) -> Option<f64> {
    let (sum, count) = sums.into_iter().fold((0.0, 0), |all, one| (all.0 + one.0, all.1 + one.1));
    (count > 0).then(|| sum / count as f64)
}

/// The window along one axis; the whole window is its product with itself. Sums to 1.
fn gaussian() -> [f64; WINDOW] {
    let weight = |i: usize| exp(-(i as f64 - (WINDOW / 2) as f64).powi(2) / (2.0 * SIGMA * SIGMA));
    let weights: [f64; WINDOW] = std::array::from_fn(weight);
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// The window's sums down each column, from row `y` on; not a number where there is background.
fn columns(a: Picture, b: Picture, scope: Scope, y: usize, channel: usize, weights: &[f64; WINDOW]) -> Vec<Moments> {
    let mut columns = vec![[0.0; 5]; a.width];
    for (row, weight) in (y..).zip(weights) {
        let at = |x: usize| (row * a.width + x) * a.channels + channel;
        for (x, sums) in columns.iter_mut().enumerate() {
            let (a, b) = (a.values[at(x)] - scope.middle, b.values[at(x)] - scope.middle);
            add(sums, &[a, b, a * a, b * b, a * b], *weight);
        }
    }
    columns
}

#[inline(always)]
fn add(sums: &mut Moments, moments: &Moments, weight: f64) {
    sums.iter_mut().zip(moments).for_each(|(sum, moment)| *sum += weight * moment);
}

/// The sum of the similarities of a row's windows, and how many there are. What has background or infinities is NaN here.
fn of_row(columns: &[Moments], scope: Scope, weights: &[f64; WINDOW]) -> (f64, u64) {
    let windows = columns.windows(WINDOW).map(|window| {
        let mut sums = [0.0; 5];
        window.iter().zip(weights).for_each(|(moments, weight)| add(&mut sums, moments, *weight));
        similarity(&sums, scope)
    });
    windows.filter(|s| s.is_finite()).fold((0.0, 0), |(sum, count), s| (sum + s, count + 1))
}

/// Equation 13 of [Wang](wavesplat::bibliography). Variances are of the values less the middle, so that little is lost to rounding.
fn similarity(&[a, b, aa, bb, ab]: &Moments, Scope { peak, middle }: Scope) -> f64 {
    let (c1, c2) = ((K1 * peak).powi(2), (K2 * peak).powi(2));
    let (var_a, var_b, covariance) = (aa - a * a, bb - b * b, ab - a * b);
    let (a, b) = (a + middle, b + middle);
    (2.0 * a * b + c1) / (a * a + b * b + c1) * ((2.0 * covariance + c2) / (var_a + var_b + c2))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [23, 17];
    const SCOPE: Scope = Scope { peak: 255.0, middle: 127.5 };

    fn picture(values: &[f64], channels: usize) -> Picture<'_> {
        Picture { values, width: SIZE[0], channels }
    }

    /// Numbers from 0 to 255 that look random.
    fn numbers(channels: usize, seed: usize) -> Vec<f64> {
        let number = |i: usize| ((i * 7919 + seed * 104_729) % 1009 % 256) as f64;
        (0..SIZE[0] * SIZE[1] * channels).map(number).collect()
    }

    /// Each window by two passes over all of its pixels, with the weights of two dimensions.
    fn slow(a: Picture, b: Picture, peak: f64, channel: usize) -> f64 {
        let half = (WINDOW / 2) as f64;
        let squared = |x: usize, y: usize| (x as f64 - half).powi(2) + (y as f64 - half).powi(2);
        let weight = |x, y| exp(-squared(x, y) / (2.0 * SIGMA * SIGMA));
        let places = || (0..WINDOW * WINDOW).map(|i| (i % WINDOW, i / WINDOW));
        let total: f64 = places().map(|(x, y)| weight(x, y)).sum();
        let (mut sum, mut count) = (0.0, 0.0);
        for (left, top) in (0..=SIZE[1] - WINDOW).flat_map(|y| (0..=SIZE[0] - WINDOW).map(move |x| (x, y))) {
            let at = |p: Picture, x, y| p.values[((top + y) * SIZE[0] + left + x) * p.channels + channel];
            let mean = |f: &dyn Fn(usize, usize) -> f64| -> f64 {
                places().map(|(x, y)| weight(x, y) / total * f(x, y)).sum()
            };
            let (ma, mb) = (mean(&|x, y| at(a, x, y)), mean(&|x, y| at(b, x, y)));
            let va = mean(&|x, y| (at(a, x, y) - ma).powi(2));
            let vb = mean(&|x, y| (at(b, x, y) - mb).powi(2));
            let cov = mean(&|x, y| (at(a, x, y) - ma) * (at(b, x, y) - mb));
            let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));
            let one = (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
            (sum, count) = if one.is_nan() { (sum, count) } else { (sum + one, count + 1.0) };
        }
        sum / count
    }

    #[test]
    fn similarity_equals_the_double_sum_over_windows() {
        let (a, b) = (numbers(1, 1), numbers(1, 2));
        let fast = ssim(picture(&a, 1), picture(&b, 1), SCOPE).unwrap();
        assert!((fast - slow(picture(&a, 1), picture(&b, 1), 255.0, 0)).abs() < 1e-12, "{fast}");
    }

    #[test]
    fn channels_are_averaged() {
        let (a, b) = (numbers(3, 1), numbers(3, 5));
        let fast = ssim(picture(&a, 3), picture(&b, 3), SCOPE).unwrap();
        let slow = (0..3).map(|c| slow(picture(&a, 3), picture(&b, 3), 255.0, c)).sum::<f64>() / 3.0;
        assert!((fast - slow).abs() < 1e-12, "{fast} {slow}");
    }

    #[test]
    fn windows_with_background_are_left_out() {
        let (mut a, mut b) = (numbers(1, 1), numbers(1, 2));
        (a[3], b[30]) = (f64::NAN, f64::NAN);
        let fast = ssim(picture(&a, 1), picture(&b, 1), SCOPE).unwrap();
        assert!((fast - slow(picture(&a, 1), picture(&b, 1), 255.0, 0)).abs() < 1e-12, "{fast}");
        let infinite: Vec<f64> = a.iter().map(|v| if v.is_nan() { f64::INFINITY } else { *v }).collect();
        assert_eq!(ssim(picture(&infinite, 1), picture(&b, 1), SCOPE), Some(fast));
        let nothing = vec![f64::NAN; a.len()];
        assert_eq!(ssim(picture(&nothing, 1), picture(&b, 1), SCOPE), None);
    }

    #[test]
    fn identical_pictures_have_similarity_one() {
        let a = numbers(2, 3);
        assert_eq!(ssim(picture(&a, 2), picture(&a, 2), SCOPE), Some(1.0));
    }

    #[test]
    fn an_offset_of_a_plain_picture_changes_the_luminance_alone() {
        let (a, b) = (vec![100.0; SIZE[0] * SIZE[1]], vec![120.0; SIZE[0] * SIZE[1]]);
        let c1 = (0.01f64 * 255.0).powi(2);
        let expected = (2.0 * 100.0 * 120.0 + c1) / (100.0f64.powi(2) + 120.0f64.powi(2) + c1);
        assert!((ssim(picture(&a, 1), picture(&b, 1), SCOPE).unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn small_differences_of_large_values_are_not_lost() {
        let (a, b) = (numbers(1, 1), numbers(1, 2));
        let expected = slow(picture(&a, 1), picture(&b, 1), 255.0, 0);
        let far = |v: &[f64]| v.iter().map(|v| v + 1e9).collect::<Vec<_>>();
        let (a, b) = (far(&a), far(&b));
        let found = ssim(picture(&a, 1), picture(&b, 1), Scope { peak: 255.0, middle: 1e9 + 127.5 }).unwrap();
        let luminance = 1e-3; // nearly 1 so far away, and less where the pictures were
        assert!(found >= expected - luminance && (found - slow(picture(&a, 1), picture(&b, 1), 255.0, 0)).abs() < 1e-9);
    }

    #[test]
    fn pictures_smaller_than_a_window_have_none() {
        let small = [1.0; 10 * 20];
        let of = |width| Picture { values: &small, width, channels: 1 };
        assert!(ssim(of(10), of(10), SCOPE).is_none() && ssim(of(20), of(20), SCOPE).is_none());
    }
}
