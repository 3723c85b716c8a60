//! Learns functions along time from the series of some boxes: their principal components
//! ([Hotelling](wavesplat_core::bibliography)).
//!
//! With v_i the series of voxel i as a vector over time, the functions are the eigenvectors of the sum of products, in
//! order of decreasing energy:
//!
//! ```text
//! (sum of v_i v_i^T) u_k = energy_k u_k                                                                   (eq 20)
//! ```
//!
//! No other K functions leave a smaller sum of squares of these series. A function is kept if its coefficients have a
//! root mean square above delta / 4: below that, nearly all codes would be zero.

mod thin;

use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::codec::bound::ErrorBound;
use wavesplat_core::wavelet::Learned;

/// The functions for [`Learned::new`], the most important first: as many as matter under the error bound. `boxes` hold
/// samples frame by frame.
pub(super) fn learned_functions<'a>(
    boxes: impl Iterator<Item = &'a [u8]>,
    ty: SampleType,
    frames: usize,
    missing_value: Option<f64>,
    promise: &ErrorBound,
) -> Vec<i16> {
    let mut products = Products::new(frames);
    for samples in boxes {
        let mut values = vec![0.0; samples.len() / ty.size()];
        sample::load(ty, samples, &mut values);
        products.add(&values, missing_value);
    }
    let Some(scale) = products.scale() else { return Vec::new() };
    let small = promise.delta / 4.0 / scale;
    let least = small * small * products.series as f64;
    let (energies, rows) = match frames {
        ..=MOST_ROTATED => eigen(products.whole(), frames),
        _ => thin::eigen(&products.whole(), frames, least),
    };
    let matters = |energy: f64| energy > least;
    let kept = energies.iter().zip(&rows).take_while(|(energy, _)| matters(**energy));
    kept.flat_map(|(_, row)| Learned::quantise(row).collect::<Vec<_>>()).collect()
}

/// The longest window whose whole matrix is rotated: that takes a time of the cube of its length, many times over.
const MOST_ROTATED: usize = 128;

/// Sums over series of the products of samples at two frames, in units of the largest sample so far.
struct Products {
    frames: usize,
    /// The lower half, with the diagonal.
    matrix: Vec<f64>,
    series: usize,
    magnitude: f64,
}

impl Products {
    fn new(frames: usize) -> Self {
        Self { frames, matrix: vec![0.0; frames * frames], series: 0, magnitude: 0.0 }
    }

    /// Adds some series of a box; series with missing samples are left out.
    fn add(&mut self, values: &[f64], missing_value: Option<f64>) {
        let voxels = values.len() / self.frames;
        let largest =
            values.iter().filter(|v| !sample::is_missing(**v, missing_value)).fold(0.0, |m, v| v.abs().max(m));
        if largest == 0.0 {
            return;
        }
        self.rescale(largest);
        for voxel in (0..voxels).step_by(voxels.div_ceil(SERIES)) {
            let series: Vec<f64> = (0..self.frames).map(|t| values[t * voxels + voxel]).collect();
            if !series.iter().any(|v| sample::is_missing(*v, missing_value)) {
                let series: Vec<f64> = series.iter().map(|v| v / self.magnitude).collect();
                self.add_series(&series);
            }
        }
    }

    /// Changes the unit so that `largest` is at most 1.
    fn rescale(&mut self, largest: f64) {
        if largest > self.magnitude {
            let ratio = self.magnitude / largest;
            self.matrix.iter_mut().for_each(|m| *m *= ratio * ratio);
            self.magnitude = largest;
        }
    }

    fn add_series(&mut self, series: &[f64]) {
        self.series += 1;
        for (t, (row, a)) in self.matrix.chunks_exact_mut(self.frames).zip(series).enumerate() {
            row[..=t].iter_mut().zip(series).for_each(|(m, b)| *m += a * b);
        }
    }

    /// The matrix with both of its halves.
    fn whole(&self) -> Vec<f64> {
        let n = self.frames;
        (0..n * n).map(|i| (i / n, i % n)).map(|(i, j)| self.matrix[i.max(j) * n + i.min(j)]).collect()
    }

    /// The unit; none if there are no series.
    fn scale(&self) -> Option<f64> {
        (self.series > 0).then_some(self.magnitude)
    }
}

/// The largest number of series read from each box.
const SERIES: usize = 128;

/// Eigenvalues and eigenvectors of a symmetric matrix, largest first, by the rotations of
/// [Jacobi](wavesplat_core::bibliography). The arithmetic has a fixed order, so every machine gets the same result.
fn eigen(mut a: Vec<f64>, n: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut v: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    for _ in 0..SWEEPS {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i * n + j] * a[i * n + j]).sum();
        let all: f64 = a.iter().map(|x| x * x).sum();
        if off <= all * ENOUGH {
            break;
        }
        for (p, q) in (0..n).flat_map(|q| (0..q).map(move |p| (p, q))) {
            rotate(&mut a, &mut v, n, p, q);
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|i, j| a[j * n + j].total_cmp(&a[i * n + i]));
    (order.iter().map(|i| a[i * n + i]).collect(), order.iter().map(|i| v[*i].clone()).collect())
}

/// Rotates axes p and q so that the matrix entry (p, q) becomes 0.
fn rotate(a: &mut [f64], v: &mut [Vec<f64>], n: usize, p: usize, q: usize) {
    let off = a[p * n + q];
    if off == 0.0 {
        return;
    }
    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..n {
        let (x, y) = (a[k * n + p], a[k * n + q]);
        (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (a[p * n + k], a[q * n + k]);
        (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
    }
    let (before, after) = v.split_at_mut(q);
    for (x, y) in before[p].iter_mut().zip(&mut after[0]) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

/// The largest number of sweeps; a handful is usual.
const SWEEPS: usize = 30;

/// The share of squares off the diagonal at which the sweeps stop.
const ENOUGH: f64 = 1e-28;

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::codec::bound::Bound;

    #[test]
    fn eigenvectors_take_a_matrix_apart() {
        let n = 9;
        let entry = |i: usize, j: usize| ((i.min(j) * 31 + i.max(j) * 17) % 23) as f64 - 7.0;
        let a: Vec<f64> = (0..n * n).map(|i| entry(i / n, i % n)).collect();
        let (values, vectors) = eigen(a.clone(), n);
        assert!(values.is_sorted_by(|x, y| x >= y));
        for (value, vector) in values.iter().zip(&vectors) {
            for i in 0..n {
                let product: f64 = (0..n).map(|j| a[i * n + j] * vector[j]).sum();
                assert!((product - value * vector[i]).abs() < 1e-9, "{value}");
            }
        }
    }

    #[test]
    fn a_common_course_is_learned_whatever_its_size() {
        let course = [1.0, 4.0, 9.0, 2.0];
        for scale in [1e-300, 1.0, 1e300] {
            let values: Vec<u8> = course
                .iter()
                .flat_map(|c| [1.0, -2.0, 3.0].map(|v: f64| v * c * scale))
                .flat_map(f64::to_le_bytes)
                .collect();
            let promise = ErrorBound::new(Bound::Pointwise, 0.01, 0.1 * scale);
            let functions = learned_functions([&values[..]].into_iter(), SampleType::F64, 4, None, &promise);
            let ratio: Vec<f64> = functions.iter().map(|f| f64::from(*f) / f64::from(functions[0])).collect();
            assert_eq!(functions.len(), 4);
            ratio.iter().zip(course).for_each(|(r, c)| assert!((r - c).abs() < 1e-2, "{r} {c}"));
        }
    }
}
