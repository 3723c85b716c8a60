//! The lattice of filtered cells: its columns are upright in the picture, so that pixels are summed in two passes.
//!
//! If no column of cells is upright, row v of the cells moves along u while it is filtered ([`super::prefilter`] moves it by
//! the part that is not whole), so that the cells of one u lie below one another:
//!
//! ```text
//! T'(u, v) = T(u + lean v, v)        lean = -c_x / b_x, with a cell's steps b and c in the picture         (eq 46)
//! ```
//!
//! Column u lies at one x. So the Gaussian of eq 37 is a product of a factor along the column and one across it:
//!
//! ```text
//! A(u, y) = sum over v of g_v(v_y(u) - v) T'(u, v)       w(x, y) = sum over u of g_u(u_x - u) A(u, y)      (eq 38)
//! ```
//!
//! with u_x the position of column x of pixels, and v_y(u) the position at which row y of pixels crosses column u.

use super::axis::{AxisKernel, Cut};
use super::filtered::Window;
use super::shear::Shear;

/// The upright lattice of a view, and its kernel.
#[derive(Debug, Clone)]
pub(super) struct Upright {
    /// The lattice with upright columns.
    shear: Shear,
    /// Cells that a row moves along u, per row.
    lean: f64,
    pub(super) along: AxisKernel,
    pub(super) across: AxisKernel,
    /// u of the pixels at x = 0, and per pixel along x.
    pub(super) u: [f64; 2],
    /// v at which y = 0 crosses column 0 of cells, per pixel along y, and per column of cells.
    pub(super) v: [f64; 3],
}

/// How far a row of cells moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Move {
    /// Whole cells.
    pub(super) cells: isize,
    /// The rest, from -0.5 to 0.5.
    pub(super) rest: f64,
}

impl Upright {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels on a lattice; `None` if it is too large.
    pub(super) fn new(shear: &Shear, sigma: f64, cut: Cut) -> Option<Self> {
        let ([b, c], lean) = (shear.pixels, shear.lean());
        let shear = Shear { pixels: [b, [0.0, c[1] + lean * b[1]]], ..*shear };
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / shear.fineness as f64));
        let along = AxisKernel::new(sigma / b[0].abs(), cut)?;
        let across = AxisKernel::new(sigma / c[1].abs(), cut)?;
        let [x, y, _] = shear.origin;
        Some(Self { shear, lean, along, across, u: [-x / b[0], 1.0 / b[0]], v: [-y / c[1], 1.0 / c[1], -b[1] / c[1]] })
    }

    /// How far row v moves (eq 46).
    pub(super) fn moved(&self, v: isize) -> Move {
        let by = self.lean * v as f64;
        let cells = by.round();
        Move { cells: cells as isize, rest: by - cells }
    }

    /// The position of a pixel in cells.
    pub(super) fn position(&self, pixel: [f64; 2]) -> [f64; 2] {
        self.shear.cell_at(pixel)
    }

    /// The cells of a window of the lattice before rows move.
    pub(super) fn window(&self, before: &Window) -> Window {
        self.moved_window(before, -1)
    }

    /// The cells before rows move of a window of this lattice.
    pub(super) fn before(&self, window: &Window) -> Window {
        self.moved_window(window, 1)
    }

    /// The smallest window that holds the rows of another one, moved by whole cells to one side (1) or the other (-1).
    fn moved_window(&self, window: &Window, side: isize) -> Window {
        let Window { first: [u, v], size: [width, height] } = *window;
        let [first, last] = [v, v + height as isize - 1].map(|v| side * self.moved(v).cells);
        Window { first: [u + first.min(last), v], size: [width + first.abs_diff(last), height] }
    }

    /// The largest share of the kernel's sum over all cells that its weights leave out or get wrong.
    pub(super) fn cut(&self) -> f64 {
        self.along.cut + self.across.cut
    }

    /// Cells within the cut around a pixel, nearly: an ellipse of them.
    pub(super) fn cells(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * (self.along.cells * self.across.cells) as f64
    }

    /// An upper bound of the distance from a pixel to any cell with a weight, along u and v.
    pub(super) fn half(&self) -> [f64; 2] {
        let [along, across] = [&self.along, &self.across].map(|axis| (axis.cells / 2) as f64);
        [along, across + along * self.v[2].abs()]
    }

    /// The largest distance in pixels, along x or y, from a pixel to any cell with a weight.
    pub(super) fn reach(&self) -> f64 {
        let pixels = |axis: &AxisKernel, step: f64| (axis.cells / 2) as f64 * (step / self.shear.fineness as f64).abs();
        pixels(&self.along, self.shear.pixels[0][0]).max(pixels(&self.across, self.shear.pixels[1][1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::view::camera::{Camera, View};

    #[test]
    fn weights_are_the_gaussian_at_every_cell() {
        let grid = Grid::unit([9, 9, 9]);
        for (azimuth, elevation, roll, sigma) in
            [(0.0, 0.0, 7.0, 3.0), (31.0, 40.0, 7.0, 9.0), (45.0, 0.0, 0.0, 3.0), (20.0, 70.0, 120.0, 4.0)]
        {
            let view = View { azimuth, elevation, roll, size: [50, 50], scale: Some(4.0), center: None };
            let shear = Shear::new(&Camera::new(&view, &grid).expect("a valid view"), &grid, 2).widened();
            let upright = Upright::new(&shear, sigma, Cut { radius: 4.5, phases: 256 }).expect("a wide kernel");
            let (half, reach) = (upright.half(), upright.reach());
            let (mut along, mut across) = (vec![0.0; upright.along.padded()], vec![0.0; upright.across.padded()]);
            for [x, y] in [[0.0, 0.0], [-3.5, 12.5], [100.1, -7.77], [0.49, 0.51]] {
                let ([u, v], mut held) = (upright.position([x, y]), 0.0);
                let first = upright.along.weights(upright.u[0] + x * upright.u[1], &mut along);
                for (column, of_column) in (first..).zip(&along[..upright.along.cells]) {
                    let crossing = upright.v[0] + y * upright.v[1] + column as f64 * upright.v[2];
                    let top = upright.across.weights(crossing, &mut across);
                    for (row, of_row) in (top..).zip(&across[..upright.across.cells]) {
                        let [right, down] = upright.shear.pixel([column as f64, row as f64]);
                        let [right, down] = [right - x, down - y];
                        let expected = (-(right * right + down * down) / (2.0 * sigma * sigma)).exp();
                        assert!((f64::from(of_column * of_row) - expected).abs() < 4e-6, "{expected}");
                        let off = [(column as f64 - u).abs(), (row as f64 - v).abs()];
                        assert!((0..2).all(|i| off[i] <= half[i] + 1e-9) && right.abs() <= reach + 1e-9);
                        held += expected;
                    }
                }
                let every = (-60..=60)
                    .flat_map(|i| (-60..=60).map(move |j| [u.round() + f64::from(i), v.round() + f64::from(j)]));
                let weight = |cell: [f64; 2]| {
                    let [right, down] = upright.shear.pixel(cell);
                    (-((right - x).powi(2) + (down - y).powi(2)) / (2.0 * sigma * sigma)).exp()
                };
                let all: f64 = every.map(weight).sum();
                assert!((all - held) / all <= upright.cut(), "{azimuth}: {held} of {all}");
            }
        }
    }

    #[test]
    fn a_row_moves_by_its_whole_cells_and_a_rest() {
        let grid = Grid::unit([9, 9, 9]);
        let view = View { azimuth: 20.0, elevation: 70.0, roll: 33.0, size: [50, 50], scale: Some(4.0), center: None };
        let shear = Shear::new(&Camera::new(&view, &grid).expect("a valid view"), &grid, 2).widened();
        let upright = Upright::new(&shear, 3.0, Cut { radius: 4.5, phases: 256 }).expect("a kernel");
        for cell in [[0, 0], [5, -7], [-30, 41]] {
            let Move { cells, rest } = upright.moved(cell[1]);
            let [u, v] = cell.map(|n| n as f64);
            let (here, before) = (upright.shear.pixel([u, v]), shear.pixel([u + cells as f64 + rest, v]));
            assert!((0..2).all(|i| (here[i] - before[i]).abs() < 1e-9) && rest.abs() <= 0.5, "{cell:?}");
        }
    }
}
