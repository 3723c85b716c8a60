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
//! w~ - w = (A_u - 1) w + A_u (A_v - 1) w                                                                  (eq 39)
//! ```
//!
//! At a fixed v, w is a Gaussian along u with the conditional deviation. So [`Axis::new`] sums the first part along one
//! axis, for all positions of pixel and slice between cells. The second part is the error along v, a Gaussian's shape
//! along u, times at most the blur of A_u. On a principal axis w is a product, and A_u changes nothing but an error of
//! second order.
//!
//! A ray meets at most K slices, so P <= K times the P of a slice. It is stated as a share of the largest sum of weights
//! in the picture ([`super::picture`]). To this come the kernel's cut and the rounding to f32.

use super::fit::{AxisFit, Spread};
use super::kernel::Kernel;
use super::prefilter::HALF;

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
    /// The error with `fineness` cells per voxel, spread along u and v.
    pub(super) fn new(weighting: &Weighting<'_>, fineness: usize, fits: &[AxisFit; 2]) -> Self {
        Self::at_positions(weighting, fineness, fits, 1)
    }

    /// A lower bound of these bounds, from few positions.
    pub(super) fn at_least(weighting: &Weighting<'_>, fineness: usize, fits: &[AxisFit; 2]) -> Self {
        Self::at_positions(weighting, fineness, fits, FEW)
    }

    fn at_positions(weighting: &Weighting<'_>, fineness: usize, fits: &[AxisFit; 2], step: usize) -> Self {
        let Weighting { kernel, cut, roundings } = *weighting;
        let (marginal, conditional) = (kernel.sigmas(), kernel.conditional_sigmas());
        let axis = |i: usize| Axis::new(fineness, &fits[i], [conditional[i], marginal[i]], step);
        let [u, v] = [axis(0), axis(1)];
        // Either axis may be replaced first.
        let both = |[eu, ev]: [f64; 2]| (eu + ev * u.blur).min(ev + eu * v.blur).min(product(kernel, [eu, ev]));
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

impl Axis {
    /// The bounds for a Gaussian with a `conditional` and a `marginal` deviation in cells (eq 39).
    fn new(fineness: usize, fit: &AxisFit, [conditional, marginal]: [f64; 2], step: usize) -> Self {
        let mut most = Self::default();
        let mut largest = [0.0_f64; 2];
        let tables = [conditional, marginal].map(Table::new);
        // Mirrored positions have the same sums.
        for voxel in (0..=PHASES / 2).step_by(step) {
            // Voxels lie at this position and every `fineness` cells from it.
            let (first, cells) = filtered(fit, voxel as f64 / PHASES as f64);
            let by_phase = |n: usize| cells.iter().skip(n).step_by(fineness).map(|w| w.abs()).sum::<f64>();
            most.amplified = (0..fineness).map(by_phase).fold(most.amplified, f64::max);
            for pixel in (0..PHASES * fineness).step_by(step) {
                let row = Row { voxel, pixel, fineness, first, cells: &cells };
                let RowSums { sum, of_ones, of_wave, exact: weights, .. } = row.sums(&tables[0]);
                let RowSums { blurred, exact: marginal_weights, .. } = row.sums(&tables[1]);
                largest = [largest[0].max(weights), largest[1].max(marginal_weights)];
                most.sum = most.sum.max(sum);
                most.of_ones = most.of_ones.max(of_ones.abs());
                most.of_waves = most.of_waves.max(of_wave[0].hypot(of_wave[1]));
                most.blur = most.blur.max(blurred);
            }
        }
        let margin = if step == 1 { MARGIN } else { 1.0 };
        most.sum *= margin / largest[0];
        most.of_ones *= margin / largest[0];
        most.of_waves *= margin / largest[0];
        most.blur *= margin / largest[1];
        most.amplified *= fineness as f64;
        most
    }
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

/// A row of voxels and a pixel, whose positions are multiples of 1 / [`PHASES`] cells.
struct Row<'a> {
    voxel: usize,
    pixel: usize,
    fineness: usize,
    /// The first cell that the voxel reaches, and the weights of the cells from there on.
    first: isize,
    cells: &'a [f64],
}

impl Row<'_> {
    fn sums(&self, gaussian: &Table) -> RowSums {
        let reach = ((gaussian.far + self.cells.len() as f64) / self.fineness as f64).ceil() as isize;
        let mut sums = RowSums::default();
        for n in -reach..=reach {
            let at = self.pixel as isize - n * (self.fineness * PHASES) as isize;
            let exact = gaussian.at(at - self.voxel as isize);
            let (mut sum, mut blurred) = (0.0, 0.0);
            for (cell, weight) in (self.first..).zip(self.cells) {
                let here = gaussian.at(at - cell * PHASES as isize);
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

/// The filtered cells of a voxel: the first one that it reaches, and its weights.
pub(super) fn filtered(fit: &AxisFit, voxel: f64) -> (isize, Vec<f64>) {
    let Spread { first, weights } = fit.at(voxel);
    let mut out = vec![0.0; fit.width + 2 * HALF];
    for (n, weight) in weights[..fit.width].iter().enumerate() {
        for j in 0..=2 * HALF {
            out[n + j] += weight * fit.taps[j.abs_diff(HALF)];
        }
    }
    (first - HALF as isize, out)
}

#[cfg(test)]
mod tests {
    use super::super::axis::Cut;
    use super::super::kernel::Weights;
    use super::super::shear::Shear;
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::view::camera::{Camera, View};

    /// A view of four pixels a voxel.
    #[derive(Clone, Copy)]
    struct Seen {
        azimuth: f64,
        elevation: f64,
        /// Standard deviation in pixels.
        sigma: f64,
        /// The cut in standard deviations.
        radius: f64,
    }

    fn kernel(Seen { azimuth, elevation, sigma, radius }: Seen, fineness: usize) -> (Shear, Kernel) {
        let grid = Grid::unit([20, 20, 20]);
        let view = View { azimuth, elevation, roll: 20.0, size: [100, 100], scale: Some(4.0), center: None };
        let shear = Shear::new(&Camera::new(&view, &grid).expect("a valid view"), &grid, fineness);
        let kernel = Kernel::new(&shear, sigma, Cut { radius, phases: 1024 }).expect("a kernel");
        (shear, kernel)
    }

    fn fits(kernel: &Kernel, width: usize) -> [AxisFit; 2] {
        kernel.conditional_sigmas().map(|sigma| AxisFit::new(width, sigma))
    }

    fn weighting(kernel: &Kernel) -> Weighting<'_> {
        Weighting { kernel, cut: kernel.cut(), roundings: 8 }
    }

    #[test]
    fn finer_and_more_cells_are_nearer() {
        for (azimuth, elevation, most) in [(0.0, 0.0, 1.0), (30.0, 30.0, 1.0), (45.0, 35.26, 0.9)] {
            for (fineness, width, error) in [(2, 4, 6e-4), (2, 5, 3e-4), (3, 5, 2e-5), (3, 6, 2e-5), (4, 6, 1e-5)] {
                let (_, kernel) = kernel(Seen { azimuth, elevation, sigma: 3.0, radius: 6.0 }, fineness);
                let stated = SliceError::new(&weighting(&kernel), fineness, &fits(&kernel, width)).of_a_mean();
                assert!(stated < most * error, "{fineness} {width} at {azimuth}: {stated:e}");
            }
        }
    }

    /// The sums of |E_i|, of E_i and of weights of an infinite slice, straight from the definition.
    fn sums(shear: &Shear, kernel: &Kernel, fits: &[AxisFit; 2], [slice, pixel]: [[f64; 2]; 2]) -> [f64; 3] {
        let q = shear.fineness as f64;
        let cells = [0, 1].map(|i| filtered(&fits[i], slice[i]));
        let mut weights = Weights::new(kernel);
        let (mut off, mut signed, mut all) = (0.0, 0.0, 0.0);
        for (n, m) in (-12..=12).flat_map(|n| (-12..=12).map(move |m| (f64::from(n), f64::from(m)))) {
            let at = [pixel[0] - n * q, pixel[1] - m * q];
            kernel.weights(at, &mut weights);
            let mut sum = 0.0;
            for (v, u, weights) in weights.rows() {
                for (u, of_pixel) in (u..).zip(weights) {
                    let cell = [u, v];
                    let weight = |a: usize| usize::try_from(cell[a] - cells[a].0).ok().and_then(|c| cells[a].1.get(c));
                    if let (Some(along), Some(across)) = (weight(0), weight(1)) {
                        sum += f64::from(*of_pixel) * along * across;
                    }
                }
            }
            let exact = kernel.gaussian([at[0] - slice[0], at[1] - slice[1]]);
            (off, signed, all) = (off + (sum - exact).abs(), signed + sum - exact, all + exact);
        }
        [off, signed.abs(), all]
    }

    /// The largest sums of |E_i| and of E_i of any slice and pixel, as shares of the largest sum of weights.
    fn largest(shear: &Shear, kernel: &Kernel, fits: &[AxisFit; 2]) -> [f64; 2] {
        let mut most = [0.0_f64; 3];
        for n in 0..144_usize {
            // Voxels repeat after `fineness` cells.
            let third = |n: usize| (n % 3) as f64 / 3.0;
            let quarter = |n: usize| (n % 4 * shear.fineness) as f64 / 4.0;
            let places = [[third(n), third(n / 3)], [quarter(n / 9), quarter(n / 36)]];
            let found = sums(shear, kernel, fits, places);
            (0..3).for_each(|i| most[i] = most[i].max(found[i]));
        }
        [most[0] / most[2], most[1] / most[2]]
    }

    #[test]
    fn slices_are_off_by_no_more_than_stated() {
        let views = [(0.0, 0.0), (3.0, 2.0), (17.0, 9.0), (30.0, 30.0), (45.0, 35.26), (100.0, -70.0)];
        for (n, (azimuth, elevation)) in views.into_iter().enumerate() {
            for sigma in if n < 2 { &[1.2, 2.4, 3.0, 4.0][..] } else { &[3.0] } {
                for (fineness, width) in [(1, 4), (1, 5), (2, 4), (2, 5), (3, 5), (3, 6), (4, 6)] {
                    let (shear, kernel) = kernel(Seen { azimuth, elevation, sigma: *sigma, radius: 4.8 }, fineness);
                    let fits = fits(&kernel, width);
                    let stated = SliceError::new(&weighting(&kernel), fineness, &fits);
                    let [off, signed] = largest(&shear, &kernel, &fits);
                    let what = format!("{fineness} {width} at {azimuth}, {sigma}: {off:e} {signed:e}, {stated:?}");
                    assert!(off <= stated.sum && signed <= stated.of_ones, "{what}");
                    assert!(off > 0.25 * stated.sum || stated.sum < 1e-3, "{what}");
                }
            }
        }
    }
}
