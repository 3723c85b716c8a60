//! The temporal bases as explicit matrices: [Haar](wavesplat::bibliography) (eq 17) and [GHM](wavesplat::bibliography)
//! (eq 18 and 19).
//!
//! An analysis matrix A has one row per coefficient and one column per sample: c = A v. The synthesis matrix is its
//! inverse: v = S c. Rows are ordered coarse to fine and, within a level, by time.
//!
//! Haar: row 0 is the mean times sqrt T; a wavelet is POSITIVE on its first half and negative on its second.
//!
//! GHM multiwavelet of T = 2N + 1 samples, N a power of two. Write q = sqrt 2 and let a level of n intervals have 2n + 1
//! functions: index 2i is node i (0 <= i <= n), index 2i + 1 is the middle of interval i (0 <= i < n). Going to n / 2
//! coarse intervals, with m = 0..n/2 their nodes (coarse node m is fine index 4m):
//!
//! ```text
//! coarse middle m:  fine 4m+1 .. 4m+3    (6, 8q, 6)/(10q)                     0 <= m < n/2; [mid, node, mid]
//! coarse node m:    fine 4m-3 .. 4m+3    (-1, -3q, 9, 10q, 9, -3q, -1)/20     0 < m < n/2; [mid, node, mid, NODE, ...]
//! first node:       fine 0, 1, 2, 3      (10, 9, -3q, -1)/(10q)
//! last node:        fine 2n, 2n-1, 2n-2, 2n-3: the same four numbers, mirrored
//! even wavelet m:   fine 4m-3 .. 4m+3    (-1, -3q, 9, -10q, 9, -3q, -1)/20    0 < m < n/2
//! odd wavelet m:    fine 4m-3 .. 4m+3    (-1, -3q, 9, 0, -9, 3q, 1)/(10q)     0 < m < n/2; in order of increasing time
//! first wavelet:    fine 0, 1, 2, 3      (-10, 9, -3q, -1)/(10q)
//! last wavelet:     fine 2n, 2n-1, 2n-2, 2n-3: the same four numbers, mirrored (so -10 stands on the end node)
//! ```
//!
//! Counts: n/2 + 1 nodes and n/2 middles are n + 1 scaling functions; 2 (n/2 - 1) + 2 = n wavelets; together 2n + 1.
//!
//! Order of a level's wavelets: first wavelet; for m = 1 .. n/2 - 1 the even one, then the odd one; last wavelet. Order of
//! all coefficients: the scaling functions [node, middle, node] of the one coarsest interval, then the wavelets of the
//! level 2 -> 1, of 4 -> 2, ..., of N -> N/2. N = 1 (T = 3) has no level, only the prefilter.
//!
//! What eq 19 leaves to the reader, and what settled it. A coarse node's seven numbers stand on
//! [mid, node, mid, NODE, mid, node, mid]: centred on the node, the coarse middles (54 - 48 - 6 = 0) and the neighbouring
//! nodes (-9 + 18 - 9 = 0) are orthogonal to it. "Inward" mirrors the four numbers of the last end, because they are half
//! of the symmetric seven. Orthonormality cannot settle SIGNS: they are as printed, the odd wavelet's read in order of
//! increasing time, and both end wavelets have -10 on their end node. The coefficients are the prefilter's own: the factor
//! sqrt 2 of eq 18, which makes dropped energy comparable with sample error, is NOT applied.

/// A matrix as a list of rows.
pub(crate) type Matrix = Vec<Vec<f64>>;

pub(crate) fn zeros(rows: usize, columns: usize) -> Matrix {
    vec![vec![0.0; columns]; rows]
}

pub(crate) fn identity(n: usize) -> Matrix {
    let mut matrix = zeros(n, n);
    for i in 0..n {
        matrix[i][i] = 1.0;
    }
    matrix
}

pub(crate) fn transpose(matrix: &Matrix) -> Matrix {
    let mut transposed = zeros(matrix[0].len(), matrix.len());
    for row in 0..matrix.len() {
        for column in 0..matrix[0].len() {
            transposed[column][row] = matrix[row][column];
        }
    }
    transposed
}

pub(crate) fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = zeros(a.len(), b[0].len());
    for row in 0..a.len() {
        for column in 0..b[0].len() {
            for k in 0..b.len() {
                product[row][column] += a[row][k] * b[k][column];
            }
        }
    }
    product
}

/// Matrix times vector: coefficients from samples with A, samples from coefficients with S.
pub(crate) fn apply(matrix: &Matrix, vector: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; matrix.len()];
    for row in 0..matrix.len() {
        for k in 0..vector.len() {
            result[row] += matrix[row][k] * vector[k];
        }
    }
    result
}

/// The inverse by Gaussian elimination, the largest pivot of each column first.
pub(crate) fn inverse(matrix: &Matrix) -> Matrix {
    let n = matrix.len();
    let mut left = matrix.clone();
    let mut right = identity(n);
    for column in 0..n {
        let mut pivot = column;
        for row in column..n {
            if left[row][column].abs() > left[pivot][column].abs() {
                pivot = row;
            }
        }
        left.swap(column, pivot);
        right.swap(column, pivot);
        let divisor = left[column][column];
        assert!(divisor != 0.0, "the matrix has no inverse");
        for k in 0..n {
            left[column][k] /= divisor;
            right[column][k] /= divisor;
        }
        for row in 0..n {
            let factor = left[row][column];
            if row != column {
                for k in 0..n {
                    left[row][k] -= factor * left[column][k];
                    right[row][k] -= factor * right[column][k];
                }
            }
        }
    }
    right
}

/// Section 3, `haar`: T = 2^p, orthonormal, written down function by function.
pub(crate) fn haar_matrix_of_power(p: u32) -> Matrix {
    let samples = 1_usize << p;
    let mut rows = vec![vec![1.0 / (samples as f64).sqrt(); samples]];
    let mut support = samples;
    while support >= 2 {
        for start in (0..samples).step_by(support) {
            let mut row = vec![0.0; samples];
            for j in 0..support / 2 {
                row[start + j] = 1.0 / (support as f64).sqrt();
                row[start + support / 2 + j] = -1.0 / (support as f64).sqrt();
            }
            rows.push(row);
        }
        support /= 2;
    }
    rows
}

/// Haar for any number of samples n >= 1 ("unbalanced Haar"), orthonormal.
///
/// Start with n scaling functions of one sample each. At each level neighbours (s1 of m1 samples, s2 of m2) give
/// s = (sqrt m1 s1 + sqrt m2 s2) / sqrt(m1 + m2) and d = (sqrt m2 s1 - sqrt m1 s2) / sqrt(m1 + m2); one that is left over
/// at the end goes up unchanged and gives no wavelet. Rows: the last s, then the d coarse to fine, each level by time.
pub(crate) fn haar_matrix(n: usize) -> Matrix {
    let mut scaling: Vec<(f64, Vec<f64>)> = identity(n).into_iter().map(|row| (1.0, row)).collect();
    let mut wavelets: Matrix = Vec::new();
    while scaling.len() > 1 {
        let mut coarser = Vec::new();
        let mut level = Vec::new();
        for pair in scaling.chunks(2) {
            if pair.len() == 1 {
                coarser.push(pair[0].clone());
                continue;
            }
            let ((m1, s1), (m2, s2)) = (&pair[0], &pair[1]);
            let total = m1 + m2;
            let mut s = vec![0.0; n];
            let mut d = vec![0.0; n];
            for j in 0..n {
                s[j] = (m1.sqrt() * s1[j] + m2.sqrt() * s2[j]) / total.sqrt();
                d[j] = (m2.sqrt() * s1[j] - m1.sqrt() * s2[j]) / total.sqrt();
            }
            coarser.push((total, s));
            level.push(d);
        }
        level.extend(wavelets);
        wavelets = level;
        scaling = coarser;
    }
    let mut rows = vec![scaling[0].1.clone()];
    rows.extend(wavelets);
    rows
}

/// Section 3, the prefilter of 2N + 1 samples on N intervals: samples to finest coefficients.
pub(crate) fn ghm_prefilter(intervals: usize) -> Matrix {
    let size = 2 * intervals + 1;
    let mut matrix = zeros(size, size);
    for i in 0..=intervals {
        matrix[2 * i][2 * i] = 1.0 / 3.0_f64.sqrt();
    }
    for i in 0..intervals {
        let factor = 5.0 / (4.0 * 6.0_f64.sqrt());
        matrix[2 * i + 1][2 * i] = 0.3 * factor;
        matrix[2 * i + 1][2 * i + 1] = factor;
        matrix[2 * i + 1][2 * i + 2] = 0.3 * factor;
    }
    matrix[0][0] *= 0.5_f64.sqrt();
    matrix[size - 1][size - 1] *= 0.5_f64.sqrt();
    matrix
}

/// Section 3, one level from n fine to n / 2 coarse intervals: n + 1 rows of scaling functions in the order
/// [node, middle, node, ..., node], then n rows of wavelets. n is even.
pub(crate) fn ghm_level(fine: usize) -> Matrix {
    let q = 2.0_f64.sqrt();
    let size = 2 * fine + 1;
    let coarse = fine / 2;
    let row = |entries: &[(usize, f64)]| {
        let mut row = vec![0.0; size];
        for &(index, value) in entries {
            row[index] = value;
        }
        row
    };
    // Seven numbers centred on coarse node m, and four numbers inward from either end.
    let centred = |m: usize, numbers: [f64; 7], divisor: f64| {
        row(&[0, 1, 2, 3, 4, 5, 6].map(|k| (4 * m + k - 3, numbers[k] / divisor)))
    };
    let first = |numbers: [f64; 4]| row(&[0, 1, 2, 3].map(|k| (k, numbers[k] / (10.0 * q))));
    let last = |numbers: [f64; 4]| row(&[0, 1, 2, 3].map(|k| (size - 1 - k, numbers[k] / (10.0 * q))));

    let end_node = [10.0, 9.0, -3.0 * q, -1.0];
    let end_wavelet = [-10.0, 9.0, -3.0 * q, -1.0];
    let node = [-1.0, -3.0 * q, 9.0, 10.0 * q, 9.0, -3.0 * q, -1.0];
    let even_wavelet = [-1.0, -3.0 * q, 9.0, -10.0 * q, 9.0, -3.0 * q, -1.0];
    let odd_wavelet = [-1.0, -3.0 * q, 9.0, 0.0, -9.0, 3.0 * q, 1.0];

    let mut rows = Vec::new();
    for m in 0..=coarse {
        if m == 0 {
            rows.push(first(end_node));
        } else if m == coarse {
            rows.push(last(end_node));
        } else {
            rows.push(centred(m, node, 20.0));
        }
        if m < coarse {
            let (mid, node) = (6.0 / (10.0 * q), 8.0 * q / (10.0 * q));
            rows.push(row(&[(4 * m + 1, mid), (4 * m + 2, node), (4 * m + 3, mid)]));
        }
    }
    rows.push(first(end_wavelet));
    for m in 1..coarse {
        rows.push(centred(m, even_wavelet, 20.0));
        rows.push(centred(m, odd_wavelet, 10.0 * q));
    }
    rows.push(last(end_wavelet));
    rows
}

/// Section 3, `multi`: the analysis matrix of T = 2N + 1 samples, the prefilter and all levels down to one interval
/// multiplied out. `intervals` is N, a power of two.
pub(crate) fn ghm_matrix(intervals: usize) -> Matrix {
    let size = 2 * intervals + 1;
    let mut analysis = ghm_prefilter(intervals);
    let mut fine = intervals;
    while fine > 1 {
        // A level acts on the scaling functions, which stand first; the wavelets found before it stay where they are.
        let level = ghm_level(fine);
        let mut step = identity(size);
        for row in 0..2 * fine + 1 {
            for column in 0..2 * fine + 1 {
                step[row][column] = level[row][column];
            }
        }
        analysis = multiply(&step, &analysis);
        fine /= 2;
    }
    analysis
}

mod tests {
    use super::*;

    fn assert_same(a: &Matrix, b: &Matrix, tolerance: f64) {
        assert_eq!((a.len(), a[0].len()), (b.len(), b[0].len()));
        for row in 0..a.len() {
            for column in 0..a[0].len() {
                let off = (a[row][column] - b[row][column]).abs();
                assert!(off <= tolerance, "row {row}, column {column}: {off:e}");
            }
        }
    }

    fn assert_orthonormal(matrix: &Matrix, tolerance: f64) {
        assert_same(&multiply(matrix, &transpose(matrix)), &identity(matrix.len()), tolerance);
    }

    #[test]
    fn haar_of_four_by_hand() {
        let h = 0.5_f64.sqrt();
        let expected =
            vec![vec![0.5, 0.5, 0.5, 0.5], vec![0.5, 0.5, -0.5, -0.5], vec![h, -h, 0.0, 0.0], vec![0.0, 0.0, h, -h]];
        assert_same(&haar_matrix(4), &expected, 1e-15);
        assert_same(&haar_matrix_of_power(2), &expected, 1e-15);
    }

    #[test]
    fn unbalanced_haar_of_three_and_five_by_hand() {
        let root = f64::sqrt;
        let h = root(0.5);
        // (0, 1), then 2 joins: s of 2 samples with s of 1 sample.
        let three =
            vec![vec![1.0 / root(3.0); 3], vec![1.0 / root(6.0), 1.0 / root(6.0), -2.0 / root(6.0)], vec![h, -h, 0.0]];
        assert_same(&haar_matrix(3), &three, 1e-15);
        // (0, 1), (2, 3), 4 goes up; (01, 23), 4 goes up; (0123, 4).
        let five = vec![
            vec![1.0 / root(5.0); 5],
            vec![0.5 / root(5.0), 0.5 / root(5.0), 0.5 / root(5.0), 0.5 / root(5.0), -2.0 / root(5.0)],
            vec![0.5, 0.5, -0.5, -0.5, 0.0],
            vec![h, -h, 0.0, 0.0, 0.0],
            vec![0.0, 0.0, h, -h, 0.0],
        ];
        assert_same(&haar_matrix(5), &five, 1e-15);
    }

    #[test]
    fn haar_is_orthonormal_for_every_length() {
        for n in 1..=40 {
            let matrix = haar_matrix(n);
            assert_eq!(matrix.len(), n);
            assert_orthonormal(&matrix, 1e-14);
            assert_same(&inverse(&matrix), &transpose(&matrix), 1e-14);
            let constant = apply(&matrix, &vec![3.0; n]);
            assert!((constant[0] - 3.0 * (n as f64).sqrt()).abs() < 1e-13);
            assert!(constant[1..].iter().all(|c| c.abs() < 1e-14));
        }
    }

    #[test]
    fn unbalanced_haar_of_a_power_of_two_is_haar() {
        for p in 0..=6 {
            assert_same(&haar_matrix(1 << p), &haar_matrix_of_power(p), 1e-15);
        }
    }

    #[test]
    fn ghm_levels_are_square_and_orthonormal() {
        for fine in [2, 4, 8, 16, 32] {
            let level = ghm_level(fine);
            assert_eq!((level.len(), level[0].len()), (2 * fine + 1, 2 * fine + 1));
            assert_orthonormal(&level, 1e-15);
        }
    }

    #[test]
    fn ghm_of_three_samples_is_the_prefilter_alone() {
        // Nodes (1, 2, 3)[0] and [2]: s / sqrt 3 / sqrt 2; middle: (2 + 0.3 * 4) * 5 / (4 sqrt 6) = 4 / sqrt 6.
        let c = apply(&ghm_matrix(1), &[1.0, 2.0, 3.0]);
        let six = 6.0_f64.sqrt();
        for (found, expected) in c.iter().zip([1.0 / six, 4.0 / six, 3.0 / six]) {
            assert!((found - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn ghm_reproduces_straight_lines_with_three_coefficients() {
        for intervals in [1, 2, 4, 8, 16] {
            let size = 2 * intervals + 1;
            let line: Vec<f64> = (0..size).map(|j| 0.3 - 0.7 * j as f64 / size as f64).collect();
            let c = apply(&ghm_matrix(intervals), &line);
            assert!(c[..3].iter().all(|c| c.abs() > 1e-3), "{c:?}");
            assert!(c[3..].iter().all(|c| c.abs() < 1e-14), "{c:?}");
        }
    }

    #[test]
    fn ghm_synthesis_is_the_inverse() {
        for intervals in [1, 2, 4, 8, 16, 32] {
            let analysis = ghm_matrix(intervals);
            let synthesis = inverse(&analysis);
            assert_same(&multiply(&analysis, &synthesis), &identity(2 * intervals + 1), 1e-13);
            assert_same(&multiply(&synthesis, &analysis), &identity(2 * intervals + 1), 1e-13);
        }
    }

    #[test]
    fn ghm_order_is_coarse_to_fine_then_by_time() {
        // A wavelet reaches only the samples around it: where the rows of T = 9 (N = 4) are not 0.
        let analysis = ghm_matrix(4);
        let reach = |row: usize| {
            let touched: Vec<usize> = (0..9).filter(|&j| analysis[row][j].abs() > 1e-15).collect();
            (touched[0], touched[touched.len() - 1])
        };
        assert_eq!(reach(5), (0, 4)); // 4 -> 2: first
        assert_eq!(reach(6), (0, 8)); // the even one at the coarse node in the middle
        assert_eq!(reach(7), (0, 8)); // the odd one there
        assert_eq!(reach(8), (4, 8)); // last
        // Signs: the end wavelets weigh their end sample negatively, the odd one is antisymmetric about the middle.
        assert!(analysis[5][0] < 0.0 && analysis[8][8] < 0.0);
        for j in 0..9 {
            assert!((analysis[6][j] - analysis[6][8 - j]).abs() < 1e-15);
            assert!((analysis[7][j] + analysis[7][8 - j]).abs() < 1e-15);
            assert!((analysis[5][j] - analysis[8][8 - j]).abs() < 1e-15);
        }
        assert!(analysis[6][4] < 0.0 && analysis[7][3] > 0.0);
    }

    /// The largest eigenvalue of a symmetric positive matrix by power iteration.
    fn largest_eigenvalue(matrix: &Matrix) -> f64 {
        let mut vector: Vec<f64> = (0..matrix.len()).map(|i| 1.0 + (i as f64 * 1.3).sin()).collect();
        let mut norm = 0.0;
        for _ in 0..20_000 {
            vector = apply(matrix, &vector);
            norm = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
            vector.iter_mut().for_each(|x| *x /= norm);
        }
        norm
    }

    #[test]
    fn ghm_sample_error_lies_between_096_and_367_times_the_dropped_energy() {
        // Dropped coefficients c make the sample error S c. Scaled by sqrt 2 their energy is 2 |c|^2, so the ratio
        // |S c|^2 / (2 |c|^2) lies between the extreme eigenvalues of S^T S / 2; the least is 1 / (2 largest of A A^T).
        let analysis = ghm_matrix(16);
        let synthesis = inverse(&analysis);
        let most = largest_eigenvalue(&multiply(&transpose(&synthesis), &synthesis)) / 2.0;
        let least = 1.0 / (2.0 * largest_eigenvalue(&multiply(&analysis, &transpose(&analysis))));
        assert!((most - 3.67).abs() < 0.005, "{most}");
        assert!((least - 0.96).abs() < 0.005, "{least}");
    }
}
