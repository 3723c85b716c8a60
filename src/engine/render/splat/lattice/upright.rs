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
        self.shear.cells([0, 1].map(|i| pixel[i] - self.shear.origin[i]))
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
