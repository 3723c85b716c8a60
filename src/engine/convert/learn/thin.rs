//! Eigenvectors of a large matrix that few vectors make up: series of few voxels, or of voxels that change alike.
//!
//! The matrix is taken apart into rows, A = sum of l_k l_k^T (Cholesky's, with the largest remaining diagonal entry
//! first), until what is left has less energy than matters. Rotations of pairs of rows then make all of them orthogonal
//! (Jacobi's from one side), and A stays their sum of products: they are its eigenvectors, with their energies as squares.
//! The arithmetic has a fixed order, so every machine gets the same result.

/// Eigenvalues and eigenvectors of a symmetric matrix of n x n numbers without negative eigenvalues, largest first. Those
/// of less than `least` may be missing.
pub(super) fn eigen(a: &[f64], n: usize, least: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let all: f64 = (0..n).map(|i| a[i * n + i]).sum();
    let mut rows = factors(a, n, (least * NEGLIGIBLE).max(all * ROUNDING));
    orthogonalise(&mut rows);
    let mut found: Vec<(f64, Vec<f64>)> = rows.into_iter().map(|row| (dot(&row, &row), row)).collect();
    found.retain(|(energy, _)| *energy > 0.0);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.iter_mut().for_each(|(energy, row)| row.iter_mut().for_each(|v| *v /= energy.sqrt()));
    found.into_iter().unzip()
}

/// Rows whose products sum up to the matrix, but for a trace of `rest`.
fn factors(a: &[f64], n: usize, rest: f64) -> Vec<Vec<f64>> {
    let mut diagonal: Vec<f64> = (0..n).map(|i| a[i * n + i]).collect();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    while rows.len() < n && diagonal.iter().sum::<f64>() > rest {
        let pivot = (0..n).max_by(|i, j| diagonal[*i].total_cmp(&diagonal[*j])).unwrap_or(0);
        let mut row = a[pivot * n..][..n].to_vec();
        for before in &rows {
            let along = before[pivot];
            row.iter_mut().zip(before).for_each(|(v, b)| *v -= along * b);
        }
        let root = diagonal[pivot].sqrt();
        for (v, left) in row.iter_mut().zip(&mut diagonal) {
            *v /= root;
            *left = (*left - *v * *v).max(0.0);
        }
        diagonal[pivot] = 0.0;
        rows.push(row);
    }
    rows
}

/// Makes rows orthogonal. Their sum of products stays.
fn orthogonalise(rows: &mut [Vec<f64>]) {
    for _ in 0..super::SWEEPS {
        let mut squares: Vec<f64> = rows.iter().map(|row| dot(row, row)).collect();
        let mut is_done = true;
        for (p, q) in (0..rows.len()).flat_map(|q| (0..q).map(move |p| (p, q))) {
            let (before, after) = rows.split_at_mut(q);
            let (a, b) = (&mut before[p], &mut after[0]);
            let both = dot(a, b);
            if both * both <= ENOUGH * squares[p] * squares[q] {
                continue;
            }
            is_done = false;
            let theta = (squares[q] - squares[p]) / (2.0 * both);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            squares[p] -= t * both;
            squares[q] += t * both;
            rotate(a, b, t);
        }
        if is_done {
            return;
        }
    }
}

/// Rotates two rows by an angle with the tangent `t`.
fn rotate(a: &mut [f64], b: &mut [f64], t: f64) {
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for (x, y) in a.iter_mut().zip(b) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

/// The sum of products, in eight sums side by side.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, last_a) = a.as_chunks::<8>();
    let (b, last_b) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + last_a.iter().zip(last_b).map(|(a, b)| a * b).sum::<f64>()
}

/// What is left out, as a share of the least energy that matters.
const NEGLIGIBLE: f64 = 1.0 / 16.0;

/// What is left out at least, as a share of all energy: rounding errors.
const ROUNDING: f64 = 1e-14;

/// The squared cosine of two rows at which they are orthogonal. Functions are stored with 16 bits.
const ENOUGH: f64 = 1e-18;

#[cfg(test)]
mod tests {
    use super::super::eigen as whole;
    use super::*;

    #[test]
    fn few_vectors_give_the_eigenvectors_of_the_whole_matrix() {
        let (n, vectors) = (200, 7);
        let entry = |k: usize, i: usize| ((k * k * 31 + i * 17 + k * i * 7) % 101) as f64 / (1 << k) as f64;
        let rows: Vec<Vec<f64>> = (0..vectors).map(|k| (0..n).map(|i| entry(k, i)).collect()).collect();
        let sum = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
        let a: Vec<f64> = (0..n * n).map(|at| sum(at / n, at % n)).collect();
        let (values, found) = eigen(&a, n, 0.0);
        let (expected, of_whole) = whole(a, n);
        assert_eq!(values.len(), vectors);
        for k in 0..vectors {
            assert!((values[k] / expected[k] - 1.0).abs() < 1e-9, "{k}: {} {}", values[k], expected[k]);
            assert!((dot(&found[k], &of_whole[k]).abs() - 1.0).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn energies_that_do_not_matter_are_left_out() {
        let n = 150;
        let energy = |i: usize| if i < 5 { 10.0 + i as f64 } else { 1e-6 };
        let a: Vec<f64> = (0..n * n).map(|at| if at / n == at % n { energy(at / n) } else { 0.0 }).collect();
        let (values, _) = eigen(&a, n, 1.0);
        assert_eq!(values.len(), 5);
        values.iter().zip([14.0, 13.0, 12.0, 11.0, 10.0]).for_each(|(v, e)| assert!((v - e).abs() < 1e-12, "{v} {e}"));
    }
}
