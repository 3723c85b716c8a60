//! The bound of [Dobashi](wavesplat::bibliography), section 3.4 (eq 11-13), voxel by voxel.

use super::camera::Lattice;

/// A line of sight along `axis` (0, 1, 2) through a place in voxels; the coordinate along that axis is ignored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    pub(crate) axis: usize,
    pub(crate) at: [f64; 3],
}

/// g of one frame on a line: the mean of the samples that are not missing, with the Gaussian weights of eq 3, tau = 0.
/// None if all that have any weight are missing. No voxel is too far away to count.
pub(crate) fn mean(lattice: &Lattice, sigma: f64, line: &Line, values: &[f64], missing: &[bool]) -> Option<f64> {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, position) in lattice.positions().into_iter().enumerate().filter(|(i, _)| !missing[*i]) {
        let mut squares = 0.0;
        for a in (0..3).filter(|a| *a != line.axis) {
            let place = lattice.origin[a] + lattice.spacing[a] * line.at[a];
            squares += (position[a] - place).powi(2);
        }
        let weight = (-squares / (2.0 * sigma * sigma)).exp();
        sum += weight * values[i];
        weights += weight;
    }
    (weights > 0.0).then(|| sum / weights)
}

/// delta of a window of frames, [t][z][y][x]: epsilon(t) = tolerance * mean of |g(t)| over the lines, `eps_wave`^2 = sum of
/// epsilon(t)^2, and delta^2 = `eps_wave`^2 / T.
pub(crate) fn delta(lattice: &Lattice, tolerance: f64, lines: &[Line], values: &[f64], missing: &[bool]) -> f64 {
    let sigma = 0.75 * lattice.spacing.into_iter().fold(0.0, f64::max);
    let voxels = lattice.voxels();
    let mut squares = 0.0;
    for (values, missing) in values.chunks(voxels).zip(missing.chunks(voxels)) {
        let seen: Vec<f64> = lines.iter().filter_map(|line| mean(lattice, sigma, line, values, missing)).collect();
        let mean = if seen.is_empty() { 0.0 } else { seen.iter().map(|g| g.abs()).sum::<f64>() / seen.len() as f64 };
        squares += (tolerance * mean).powi(2);
    }
    (squares / (values.len() / voxels) as f64).sqrt()
}

mod tests {
    use super::*;

    const CUBE: Lattice = Lattice { dims: [4, 4, 4], spacing: [1.0; 3], origin: [7.0; 3] };

    #[test]
    fn a_constant_has_its_value_as_mean_and_its_share_as_bound() {
        let line = Line { axis: 1, at: [0.3, 9.0, 2.9] };
        let constant = vec![-3.0; 2 * 64];
        assert!((mean(&CUBE, 0.75, &line, &constant[..64], &[false; 64]).unwrap() + 3.0).abs() < 1e-14);
        assert!((delta(&CUBE, 0.1, &[line; 3], &constant, &[false; 128]) - 0.3).abs() < 1e-14);
        assert_eq!(delta(&CUBE, 0.1, &[line; 3], &constant, &[true; 128]), 0.0);
    }

    #[test]
    fn a_line_sees_its_own_column_most() {
        let mut values = vec![0.0; 64];
        for z in 0..4 {
            values[(z * 4 + 2) * 4 + 1] = 1.0; // x = 1, y = 2
        }
        let g = |x, y| mean(&CUBE, 0.75, &Line { axis: 2, at: [x, y, 0.0] }, &values, &[false; 64]).unwrap();
        let weight = |d: f64| (-d * d / 1.125).exp();
        let along = |at: f64| (0..4).map(|i| weight(f64::from(i) - at)).sum::<f64>();
        assert!((g(1.0, 2.0) - 1.0 / (along(1.0) * along(2.0))).abs() < 1e-14);
        assert!((g(1.5, 2.0) - weight(0.5) / (along(1.5) * along(2.0))).abs() < 1e-14);
    }
}
