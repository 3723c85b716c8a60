//! The stated error of the lattice.
//!
//! Let w_i be the exact weight of voxel i at a pixel, w~_i its weight on the lattice, and E_i = w~_i - w_i. A mean
//! divides by the sum of the same weights w~. So a value m may be taken off all samples, and with m in the middle of the
//! value range R, the error of a mean at a pixel with the sum of weights W is at most
//!
//! ```text
//! R / (2 W) (sum of |E_i| + |sum of E_i|) <= R P / W        P = larger of the sums of positive and of negative E_i
//! ```
//!
//! over the voxels that are present. P grows with every voxel, so it is largest for an infinite grid; there it is (sum
//! of |E_i| + |sum of E_i|) / 2 at most. An emission has no such offset, and twice the error.
//!
//! Both sums are bounded slice by slice. Let A_u replace a function along u by its cells, filtered and
//! summed with the kernel, and A_v the same along v. Then w~ = A_u A_v w, and
//!
//! ```text
//! w~ - w = (A_v - 1) w + A_v (A_u - 1) w                                                                  (eq 39)
//! ```
//!
//! At a fixed u, w is a Gaussian along v with the conditional deviation. So [`Axis::new`] sums the first part along one
//! axis, for all positions of pixel and slice between cells. The second part is at most the error along u times the blur of
//! A_v, for the error has a Gaussian's shape along v. If rows move, A_u differs from row to row: its error is the largest for any
//! move. If not, u and v may change places; and on a principal axis w is a product, and A_v changes nothing but an error
//! of second order.
//!
//! A ray meets at most K slices, so P <= K times the P of a slice. It is stated as a share of the largest sum of weights
//! in the picture ([`super::picture`]). To this come the kernel's cut and the rounding to f32.

use super::Spreading;
use super::fit::{AxisFit, Spread};
use super::kernel::Kernel;
use super::prefilter::{HALF, Taps};

/// Upper bounds for an infinite slice of voxels, as shares of its largest sum of weights.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct SliceError {
    /// Of the sum of |E_i|.
    pub(in crate::render) sum: f64,
    /// Of |the sum of E_i|.
    pub(super) of_ones: f64,
    /// Of |the sum of E_i v_i| if v is a wave of [`WAVE`] voxels along u or v.
    pub(in crate::render) of_waves: f64,
}

impl SliceError {
    /// The error of spreading voxels and gathering them with a kernel.
    pub(super) fn new(weighting: &Weighting<'_>, spreading: &Spreading) -> Self {
        Self::at_positions(weighting, spreading, 1)
    }

    /// A lower bound of these bounds, from few positions.
    pub(super) fn at_least(weighting: &Weighting<'_>, spreading: &Spreading) -> Self {
        Self::at_positions(weighting, spreading, FEW)
    }

    fn at_positions(weighting: &Weighting<'_>, spreading: &Spreading, step: usize) -> Self {
        let Weighting { kernel, cut, roundings } = *weighting;
        let Spreading { shear, fits: [along, across], .. } = spreading;
        let moves = shear.lean() != 0.0;
        let (marginal, conditional) = (kernel.sigmas(), kernel.conditional_sigmas());
        let row = |fit, moves| Row { fineness: shear.fineness, fit, moves, step };
        let u = Axis::new(&row(along, moves), [conditional[0], marginal[0]]);
        let v = Axis::new(&row(across, false), [conditional[1], marginal[1]]);
        let across_first = |[eu, ev]: [f64; 2]| ev + eu * v.blur;
        // Rows that do not move are filtered in either order.
        let either = |[eu, ev]: [f64; 2]| (eu + ev * u.blur).min(product(kernel, [eu, ev]));
        let both = |errors| if moves { across_first(errors) } else { across_first(errors).min(either(errors)) };
        let cut = cut * u.amplified * v.amplified;
        let rounding = ROUNDING * roundings as f64 * u.blur * v.blur;
        let bound = |errors| both(errors) + cut + rounding;
        Self {
            sum: bound([u.sum, v.sum]),
            of_ones: bound([u.of_ones, v.of_ones]),
            of_waves: bound([u.of_waves, v.of_waves]),
        }
    }

    /// The largest share of the value range by which a mean is off, or of the largest value for an emission.
    pub(in crate::render) fn of_a_mean(self) -> f64 {
        0.5 * (self.sum + self.of_ones)
    }

    /// An estimate of the same for smooth values: those of waves of [`WAVE`] voxels.
    pub(in crate::render) fn of_a_smooth_mean(self) -> f64 {
        0.5 * (self.of_waves + self.of_ones)
    }
}

/// Both errors of a kernel that is a product of one factor along u and one along v; infinite for other kernels.
fn product(kernel: &Kernel, [eu, ev]: [f64; 2]) -> f64 {
    let ([u, v], [cu, cv]) = (kernel.sigmas(), kernel.conditional_sigmas());
    let is_product = u - cu < 1e-9 * u && v - cv < 1e-9 * v;
    if is_product { eu + ev + eu * ev } else { f64::INFINITY }
}

/// A kernel as pixels use it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weighting<'a> {
    pub(super) kernel: &'a Kernel,
    /// The share of its sum that its weights leave out.
    pub(super) cut: f64,
    /// The largest number of roundings to f32.
    pub(super) roundings: usize,
}

/// Bound of a rounding to f32, of an addition or a weight: 2^-24 of values at most twice the value range.
const ROUNDING: f64 = 1.0 / (1_u64 << 23) as f64;

/// Bounds along one axis, as shares of the largest sum of the Gaussian over an infinite row of voxels.
#[derive(Debug, Clone, Copy, Default)]
struct Axis {
    /// The largest sum of |E_i|.
    sum: f64,
    /// The largest |sum of E_i|.
    of_ones: f64,
    /// The largest |sum of E_i times a wave|.
    of_waves: f64,
    /// The largest sum of |weight of a cell| times the Gaussian of the slice.
    blur: f64,
    /// The largest sum over voxels of |weight of one cell|, times the number of cells per voxel.
    amplified: f64,
}

/// Positions in a cell that are tried for a slice and for a pixel. Weights are sums of waves with periods of one cell and
/// less. The longest waves dominate, so the largest error lies at most 1 - cos(pi / 12) above those found.
const PHASES: usize = 12;
/// Every so many positions give a lower bound.
const FEW: usize = 4;
const MARGIN: f64 = 1.04;
/// Voxels of the wave for which errors are estimated: finer structures are rarely much of a picture.
const WAVE: isize = 8;
/// Voxels farther than this many deviations and cells have no weight.
const FAR: f64 = 8.0;

/// A row of voxels, their cells, and the positions that are tried.
struct Row<'a> {
    fineness: usize,
    fit: &'a AxisFit,
    /// Whether the row of cells moves, by any share of a cell.
    moves: bool,
    /// Every so many positions are tried.
    step: usize,
}

impl Axis {
    /// The bounds for a Gaussian with a `conditional` and a `marginal` deviation in cells (eq 39).
    fn new(row: &Row<'_>, [conditional, marginal]: [f64; 2]) -> Self {
        let (mut most, mut largest) = (Self::default(), [0.0_f64; 2]);
        let tables = [conditional, marginal].map(Table::new);
        let half = if row.moves { PHASES as isize / 2 } else { 0 };
        for by in (-half..=half).step_by(row.step) {
            let taps = row.fit.moved(by as f64 / PHASES as f64);
            // Mirrored positions have the same sums.
            for voxel in (0..=PHASES / 2).step_by(row.step) {
                let (first, cells) = filtered(&row.fit.at(voxel as f64 / PHASES as f64), row.fit.width, &taps);
                most.add(
                    &VoxelRow { voxel, by, fineness: row.fineness, first, cells: &cells },
                    row.step,
                    &tables,
                    &mut largest,
                );
            }
        }
        let margin = if row.step == 1 { MARGIN } else { 1.0 };
        most.sum *= margin / largest[0];
        most.of_ones *= margin / largest[0];
        most.of_waves *= margin / largest[0];
        most.blur *= margin / largest[1];
        most.amplified *= row.fineness as f64;
        most
    }

    /// Takes in the sums of a row of voxels at every `step`-th position of a pixel, and the `largest` sums of both Gaussians.
    fn add(&mut self, row: &VoxelRow<'_>, step: usize, tables: &[Table; 2], largest: &mut [f64; 2]) {
        let by_phase = |n: usize| row.cells.iter().skip(n).step_by(row.fineness).map(|w| w.abs()).sum::<f64>();
        self.amplified = (0..row.fineness).map(by_phase).fold(self.amplified, f64::max);
        for pixel in (0..PHASES * row.fineness).step_by(step) {
            let RowSums { sum, of_ones, of_wave, exact, .. } = row.sums(pixel, &tables[0]);
            let RowSums { blurred, exact: of_marginal, .. } = row.sums(pixel, &tables[1]);
            *largest = [largest[0].max(exact), largest[1].max(of_marginal)];
            self.sum = larger(self.sum, sum);
            self.of_ones = larger(self.of_ones, of_ones.abs());
            self.of_waves = larger(self.of_waves, of_wave[0].hypot(of_wave[1]));
            self.blur = larger(self.blur, blurred);
        }
    }
}

/// The larger number; infinity for a filter without numbers.
fn larger(most: f64, number: f64) -> f64 {
    if number.is_nan() { f64::INFINITY } else { most.max(number) }
}

/// A Gaussian at multiples of 1 / [`PHASES`] cells.
struct Table {
    values: Vec<f64>,
    /// Cells beyond which voxels have no weight.
    far: f64,
}

impl Table {
    fn new(sigma: f64) -> Self {
        let value = |n: usize| {
            let distance = n as f64 / (PHASES as f64 * sigma);
            libm::exp(-0.5 * distance * distance)
        };
        let far = FAR * sigma;
        Self { values: (0..=(far * PHASES as f64) as usize).map(value).collect(), far }
    }

    fn at(&self, distance: isize) -> f64 {
        self.values.get(distance.unsigned_abs()).copied().unwrap_or(0.0)
    }
}

/// Sums over the voxels of a row.
#[derive(Debug, Default)]
struct RowSums {
    /// Of |E_i|, and of E_i.
    sum: f64,
    of_ones: f64,
    /// Of E_i times the cosine and the sine of a wave of [`WAVE`] voxels.
    of_wave: [f64; 2],
    /// Of |cell weights| times the Gaussian, and of exact weights.
    blurred: f64,
    exact: f64,
}

/// A row of voxels, at positions that are multiples of 1 / [`PHASES`] cells.
struct VoxelRow<'a> {
    /// A voxel lies here, and others every `fineness` cells from it.
    voxel: usize,
    fineness: usize,
    /// Cells have moved by this.
    by: isize,
    /// The first cell that the voxel reaches, and the weights of the cells from there on.
    first: isize,
    cells: &'a [f64],
}

impl VoxelRow<'_> {
    fn sums(&self, pixel: usize, gaussian: &Table) -> RowSums {
        let reach = ((gaussian.far + self.cells.len() as f64) / self.fineness as f64).ceil() as isize;
        let mut sums = RowSums::default();
        for n in -reach..=reach {
            let at = pixel as isize - n * (self.fineness * PHASES) as isize;
            let exact = gaussian.at(at - self.voxel as isize);
            let (mut sum, mut blurred) = (0.0, 0.0);
            for (cell, weight) in (self.first..).zip(self.cells) {
                let here = gaussian.at(at - self.by - cell * PHASES as isize);
                sum += weight * here;
                blurred += weight.abs() * here;
            }
            let error = sum - exact;
            sums.sum += error.abs();
            sums.of_ones += error;
            sums.blurred += blurred;
            sums.exact += exact;
            let angle = std::f64::consts::TAU * n.rem_euclid(WAVE) as f64 / WAVE as f64;
            sums.of_wave = [sums.of_wave[0] + error * libm::cos(angle), sums.of_wave[1] + error * libm::sin(angle)];
        }
        sums
    }
}

/// The filtered cells of a voxel that is spread to `width` cells: the first one that it reaches, and its weights.
fn filtered(spread: &Spread, width: usize, taps: &Taps) -> (isize, Vec<f64>) {
    let mut out = vec![0.0; width + 2 * HALF];
    for (n, weight) in spread.weights[..width].iter().enumerate() {
        taps.iter().rev().enumerate().for_each(|(j, tap)| out[n + j] += weight * tap);
    }
    (spread.first - HALF as isize, out)
}

#[cfg(test)]
mod tests {
    use super::super::axis::Cut;
    use super::super::shear::Shear;
    use super::super::upright::{Move, Upright};
    use super::super::{Choice, Sums};
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::view::camera::{Camera, View};

    /// A view of four pixels a voxel.
    #[derive(Debug, Clone, Copy)]
    struct Seen {
        azimuth: f64,
        elevation: f64,
        roll: f64,
        /// Standard deviation in pixels.
        sigma: f64,
        /// The cut in standard deviations.
        radius: f64,
    }

    /// The lattice of a view.
    struct Splatted {
        kernel: Kernel,
        upright: Upright,
        spreading: Spreading,
        /// For each row of cells from -[`ROWS`] on, how far it moves, and its filter.
        rows: Vec<(isize, Taps)>,
    }

    const ROWS: isize = 80;

    impl Splatted {
        fn new(seen: Seen, fineness: usize, width: usize) -> Self {
            let Seen { azimuth, elevation, roll, sigma, radius } = seen;
            let grid = Grid::unit([20, 20, 20]);
            let view = View { azimuth, elevation, roll, size: [100, 100], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            let shear = Shear::new(&camera, &grid, fineness).widened();
            let kernel = Kernel::new(&shear, sigma);
            let upright = Upright::new(&shear, sigma, Cut { radius, phases: 1024 }).expect("a kernel");
            let choice = Choice::new(fineness, width, Sums::Double);
            let spreading = Spreading::new(shear, choice, kernel.conditional_sigmas(), 0.0, 20);
            let of_row = |v: isize| {
                let Move { cells, rest } = upright.moved(v);
                (cells, spreading.fits[0].moved(rest))
            };
            let rows = (-ROWS..=ROWS).map(of_row).collect();
            Self { kernel, upright, spreading, rows }
        }

        fn stated(&self) -> SliceError {
            let weighting = Weighting { kernel: &self.kernel, cut: self.upright.cut(), roundings: 8 };
            SliceError::new(&weighting, &self.spreading)
        }
    }

    #[test]
    fn finer_and_more_cells_are_nearer() {
        let upright = [6e-4, 3e-4, 2e-5, 2e-5, 1e-5];
        let leaning = [8e-4, 4.5e-4, 2e-5, 2e-5, 1e-5];
        let seen = |azimuth, elevation, roll| Seen { azimuth, elevation, roll, sigma: 3.0, radius: 6.0 };
        for (seen, errors) in [
            (seen(0.0, 0.0, 0.0), upright),
            (seen(30.0, 30.0, 0.0), upright),
            (seen(45.0, 35.26, 20.0), upright.map(|error| 0.9 * error)),
            (seen(0.0, 0.0, 20.0), leaning),
            (seen(30.0, 70.0, 0.0), leaning.map(|error| 1.1 * error)),
        ] {
            for ((fineness, width), error) in [(2, 4), (2, 5), (3, 5), (3, 6), (4, 6)].into_iter().zip(errors) {
                let stated = Splatted::new(seen, fineness, width).stated().of_a_mean();
                assert!(stated < error, "{fineness} {width} {seen:?}: {stated:e}");
            }
        }
    }

    /// The weights of the cells around a pixel, from the first column and row on.
    fn weights(upright: &Upright, [x, y]: [f64; 2]) -> (isize, Vec<(isize, Vec<f32>)>) {
        let mut along = vec![0.0; upright.along.padded()];
        let first = upright.along.weights(upright.u[0] + x * upright.u[1], &mut along);
        let column = |(u, weight): (isize, &f32)| {
            let mut across = vec![0.0; upright.across.padded()];
            let [origin, per_row, per_column] = upright.v;
            let top = upright.across.weights(origin + y * per_row + u as f64 * per_column, &mut across);
            (top, across.iter().map(|of_row| of_row * weight).collect())
        };
        (first, (first..).zip(&along).map(column).collect())
    }

    /// The sums of |E_i|, of E_i and of weights of an infinite slice, straight from the definition.
    fn sums(splatted: &Splatted, [slice, pixel]: [[f64; 2]; 2]) -> [f64; 3] {
        let Splatted { kernel, upright, spreading: Spreading { shear, fits: [along, across], .. }, rows: moves } =
            splatted;
        let q = shear.fineness as isize;
        let (first, columns) = weights(upright, shear.pixel(pixel));
        let (low, of_rows) = filtered(&across.at(slice[1]), across.width, &across.taps);
        let (spread, mut sums) = (along.at(slice[0]), [0.0; 3]);
        let most = 12.max(24 / q); // voxels to each side that the filters reach
        for m in -most..=most {
            let of_row = |(v, weight): (isize, &f64)| {
                let (cells, taps) = &moves[(v + ROWS) as usize];
                let (u, filtered) = filtered(&spread, along.width, taps);
                (v, *weight, u - cells, filtered)
            };
            let rows: Vec<_> = (low + m * q..).zip(&of_rows).map(of_row).collect();
            for n in -most..=most {
                let mut sum = 0.0;
                for (v, across, u, cells) in &rows {
                    for (u, along) in (u + n * q..).zip(cells) {
                        let column = usize::try_from(u - first).ok().and_then(|u| columns.get(u));
                        let of_pixel = column.and_then(|(top, of_rows)| of_rows.get(usize::try_from(v - top).ok()?));
                        sum += across * along * of_pixel.map_or(0.0, |weight| f64::from(*weight));
                    }
                }
                let voxel = [slice[0] + (n * q) as f64, slice[1] + (m * q) as f64];
                let exact = kernel.gaussian([pixel[0] - voxel[0], pixel[1] - voxel[1]]);
                sums = [sums[0] + (sum - exact).abs(), sums[1] + sum - exact, sums[2] + exact];
            }
        }
        [sums[0], sums[1].abs(), sums[2]]
    }

    /// The largest sums of |E_i| and of E_i of any slice and pixel, as shares of the largest sum of weights.
    fn largest(splatted: &Splatted) -> [f64; 2] {
        let mut most = [0.0_f64; 3];
        for n in 0..144_usize {
            // Voxels repeat after `fineness` cells.
            let third = |n: usize| (n % 3) as f64 / 3.0;
            let quarter = |n: usize| (n % 4 * splatted.spreading.shear.fineness) as f64 / 4.0;
            let places = [[third(n), third(n / 3)], [quarter(n / 9), quarter(n / 36)]];
            let found = sums(splatted, places);
            (0..3).for_each(|i| most[i] = most[i].max(found[i]));
        }
        [most[0] / most[2], most[1] / most[2]]
    }

    #[test]
    fn slices_are_off_by_no_more_than_stated() {
        let views = [(0.0, 0.0), (3.0, 2.0), (17.0, 9.0), (30.0, 30.0), (45.0, 35.26), (100.0, -70.0)];
        let choices = [(1, 4), (1, 5), (2, 4), (2, 5), (3, 5), (3, 6), (4, 6)];
        for (n, (azimuth, elevation)) in views.into_iter().enumerate() {
            for sigma in if n < 2 { &[1.2, 2.4, 3.0, 4.0][..] } else { &[3.0] } {
                for (m, (fineness, width)) in choices.into_iter().enumerate() {
                    for (roll, tight) in [(20.0, 0.25), ([0.0, 77.0, 45.0][(n + m) % 3], 0.2)] {
                        let seen = Seen { azimuth, elevation, roll, sigma: *sigma, radius: 4.8 };
                        let splatted = Splatted::new(seen, fineness, width);
                        let stated = splatted.stated();
                        let [off, signed] = largest(&splatted);
                        let what = format!("{fineness} {width} {seen:?}: {off:e} {signed:e}, {stated:?}");
                        assert!(off <= stated.sum && signed <= stated.of_ones, "{what}");
                        assert!(off > tight * stated.sum || stated.sum < 1e-3, "{what}");
                    }
                }
            }
        }
    }
}
