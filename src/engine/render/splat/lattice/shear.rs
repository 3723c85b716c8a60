//! The sheared lattice of a view: positions of voxels in cells.
//!
//! The principal axis a is the axis closest to the view direction; b and c are the others. On the screen, a step along
//! a equals `alpha` steps along b plus `beta` steps along c, so voxel (i_b, i_c, k) lies at the cells
//!
//! ```text
//! u = q (i_b + alpha k)        v = q (i_c + beta k)        q cells a voxel                                (eq 35)
//! ```
//!
//! The voxels of one slice k are whole cells apart, so their footprints differ by whole cells only.

use wavesplat_core::base::grid::Grid;
use wavesplat_core::view::camera::Camera;

/// The sheared lattice of one view.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Shear {
    /// The axes b, c and a.
    pub(in crate::render) axes: [usize; 3],
    /// The slopes alpha and beta.
    pub(in crate::render) slopes: [f64; 2],
    /// Depth from a voxel to the next one along b, c and a, in world units.
    pub(in crate::render) depths: [f64; 3],
    /// Pixels from a voxel to the next one along b and along c.
    pub(in crate::render) pixels: [[f64; 2]; 2],
    /// The pixel and the depth of voxel (0, 0, 0).
    pub(in crate::render) origin: [f64; 3],
    /// Cells per voxel along b and c.
    pub(super) fineness: usize,
}

impl Shear {
    /// The lattice of a camera's view of a grid, with `fineness` cells per voxel.
    pub(in crate::render) fn new(camera: &Camera, grid: &Grid, fineness: usize) -> Self {
        let origin = camera.project(grid.position([0; 3]));
        let steps: [[f64; 3]; 3] = std::array::from_fn(|axis| camera.step(axis, grid.spacing[axis]));
        let facing = |axis: usize| (steps[axis][2] / grid.spacing[axis]).abs();
        let a = (0..3).fold(0, |best, axis| if facing(axis) > facing(best) { axis } else { best });
        let axes = [usize::from(a == 0), if a == 2 { 1 } else { 2 }, a];
        let [b, c, a] = axes.map(|axis| steps[axis]);
        let det = b[0] * c[1] - b[1] * c[0];
        let slopes = [(a[0] * c[1] - a[1] * c[0]) / det, (b[0] * a[1] - b[1] * a[0]) / det];
        let pixels = [[b[0], b[1]], [c[0], c[1]]];
        Self { axes, slopes, depths: [b[2], c[2], a[2]], pixels, origin, fineness }
    }

    /// The same lattice with b and c exchanged if steps along c are longer across the picture, so that few columns of
    /// cells lie around a pixel.
    pub(super) fn widened(self) -> Self {
        let ([b, c, a], [alpha, beta], [zb, zc, za], [along, across]) =
            (self.axes, self.slopes, self.depths, self.pixels);
        if across[0].abs() <= along[0].abs() {
            return self;
        }
        Self { axes: [c, b, a], slopes: [beta, alpha], depths: [zc, zb, za], pixels: [across, along], ..self }
    }

    /// Cells along u by which a row of cells moves for columns to be upright, per row (eq 46).
    pub(super) fn lean(&self) -> f64 {
        let [b, c] = self.pixels;
        if c[0].abs() > UPRIGHT * c[1].abs() { -c[0] / b[0] } else { 0.0 }
    }

    /// The position of a voxel in cells (eq 35).
    pub(in crate::render) fn position(&self, voxel: [usize; 3]) -> [f64; 2] {
        let [b, c, a] = self.axes.map(|axis| voxel[axis] as f64);
        let q = self.fineness as f64;
        [q * (b + self.slopes[0] * a), q * (c + self.slopes[1] * a)]
    }

    /// The depth of a voxel.
    pub(in crate::render) fn depth(&self, voxel: [usize; 3]) -> f64 {
        (0..3).fold(self.origin[2], |z, i| z + self.depths[i] * voxel[self.axes[i]] as f64)
    }

    /// Converts an offset in pixels to cells.
    pub(in crate::render) fn cells(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [b, c] = self.pixels;
        let det = b[0] * c[1] - b[1] * c[0];
        [(x * c[1] - y * c[0]) / det, (b[0] * y - b[1] * x) / det].map(|voxels| voxels * self.fineness as f64)
    }

    /// The position of a point of the picture in cells.
    pub(in crate::render) fn cell_at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.cells([x - self.origin[0], y - self.origin[1]])
    }

    /// Converts a position in cells to pixels.
    pub(in crate::render) fn pixel(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [b, c] = [u, v].map(|cells| cells / self.fineness as f64);
        std::array::from_fn(|i| self.origin[i] + b * self.pixels[0][i] + c * self.pixels[1][i])
    }
}

/// A column of cells counts as upright if it leans by less than this share: far less than a pixel over any volume.
const UPRIGHT: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::view::camera::View;

    #[test]
    fn positions_agree_with_the_camera() {
        let grid = Grid { dims: [9, 7, 5], spacing: [1.0, 0.7, 1.3], origin: [-40.0, 3.0, 1e3] };
        for (azimuth, elevation, roll) in [(0.0, 0.0, 0.0), (90.0, 0.0, 30.0), (33.0, 21.0, 0.0), (200.0, -80.0, 5.0)] {
            let view = View { azimuth, elevation, roll, size: [80, 60], scale: None, center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            for fineness in [1, 2] {
                let shear = Shear::new(&camera, &grid, fineness);
                for (shear, voxel) in
                    [shear, shear.widened()].into_iter().flat_map(|s| grid.whole().iter().map(move |v| (s, v)))
                {
                    let [x, y, z] = camera.project(grid.position(voxel));
                    let pixel = shear.pixel(shear.position(voxel));
                    let off = [pixel[0] - x, pixel[1] - y, shear.depth(voxel) - z];
                    assert!(off.iter().all(|d| d.abs() < 1e-9), "{voxel:?} {off:?}");
                }
            }
        }
    }
}
