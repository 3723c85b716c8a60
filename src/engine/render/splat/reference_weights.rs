//! Sums of uncut weights at single pixels. They decide which pixels are background (eq 16).
//!
//! They also bound the contribution of voxels beyond a depth, since weights fall as exp(-tau z) (eq 3), so that the
//! deepest voxels can be left out.

use super::lattice::Shear;
use std::ops::Range;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::Camera;
use wavesplat_core::view::footprint::{Footprint, Kernel, Method, VoxelRows};

/// Sums of uncut weights of a view at single pixels.
pub(in crate::render) struct ReferenceWeights<'a> {
    camera: &'a Camera,
    grid: &'a Grid,
    /// The voxels that count.
    clip: Region,
    tau: f64,
    /// It stands for an uncut one.
    footprint: Footprint,
    /// Pixels from its centre to its cut. The footprint itself reaches a pixel at least.
    reach: f64,
    /// The rows of voxels along b.
    rows: VoxelRows,
    shear: Shear,
}

impl<'a> ReferenceWeights<'a> {
    /// Sums of the weights of the voxels in `clip`.
    ///
    /// # Errors
    /// A kernel whose weights are no numbers.
    pub(in crate::render) fn new(camera: &'a Camera, grid: &'a Grid, clip: Region, kernel: Kernel) -> Result<Self> {
        let footprint = Footprint::new(kernel, grid, camera.scale, Method::EXACT)?;
        let reach = Method::EXACT.radius * kernel.sigma * camera.scale;
        let shear = Shear::new(camera, grid, 1);
        let rows = footprint.rows(shear.pixels[0], shear.depths[0]);
        Ok(Self { camera, grid, clip, tau: kernel.tau, footprint, reach, rows, shear })
    }

    /// The sum at a pixel's centre.
    pub(in crate::render) fn at(&self, pixel: [usize; 2]) -> f64 {
        self.at_point(pixel.map(|n| n as f64 + 0.5))
    }

    /// The sum at a point of the picture plane. Points beyond the cut of all voxels have the sum within a pixel.
    fn at_point(&self, point: [f64; 2]) -> f64 {
        let near = self.within(self.reach, point);
        if near == 0.0 { self.within(self.footprint.reach, point) } else { near }
    }

    /// The sum at a point over the voxels within `reach` pixels, slice by slice and row by row.
    fn within(&self, reach: f64, point: [f64; 2]) -> f64 {
        let [b, c, a] = self.shear.axes;
        let clip = &self.clip;
        let point = [0, 1].map(|i| point[i] - self.shear.origin[i]);
        let [_, v] = self.shear.cells(point);
        let half = self.half(1, reach);
        let mut sum = 0.0;
        for k in clip.start[a]..clip.end[a] {
            let centre = v - self.shear.slopes[1] * k as f64;
            for i in around(centre, half, clip.start[c]..clip.end[c]) {
                let mut voxel = [0; 3];
                (voxel[a], voxel[c]) = (k, i);
                sum += self.row(voxel, clip.start[b]..clip.end[b], point, reach);
            }
        }
        sum
    }

    /// An upper bound of the sum at any point of the picture plane.
    ///
    /// The sum of a slice is largest at the position of a voxel. The number of slices that a ray meets is
    /// limited by their extent, footprints included, and each slice is a step deeper than the last. The ray may meet
    /// the first slice in front of the volume, and voxels of a slice may be nearer than the point where the ray meets
    /// the slice.
    pub(in crate::render) fn most(&self) -> f64 {
        let Shear { axes, slopes, .. } = &self.shear;
        let (tau, dims) = (self.tau, self.clip.dims());
        let beside = |i: usize| (dims[axes[i]] as f64 + 2.0 * self.half(i, self.reach)) / slopes[i].abs() + 1.0;
        let slices = (dims[axes[2]] as f64).min(beside(0)).min(beside(1)).ceil() as usize;
        let (deeper, nearer) = (self.deeper(), self.nearer());
        let along: f64 = (0..slices).map(|n| libm::exp(-tau * (n as f64 * deeper - 2.0 * nearer).max(0.0))).sum();
        along * self.slice() * self.footprint.at_depth(self.nearest())
    }

    /// An upper bound of the sums of all slices that a ray meets, each as if the slice were infinite, as a multiple of
    /// the largest sum in the picture plane. Near 1, except for volumes that are thin or dimmed.
    pub(super) fn slices(&self) -> f64 {
        let Region { start, end } = &self.clip;
        let point = |share: f64| {
            let voxel = [0, 1, 2].map(|a| start[a] + ((end[a] - 1 - start[a]) as f64 * share).round() as usize);
            let [x, y, _] = self.camera.project(self.grid.position(voxel));
            self.at_point([x, y])
        };
        let shares = if self.tau == 0.0 { &[0.5][..] } else { &[0.0, 0.25, 0.5, 0.75, 1.0] };
        self.most() / shares.iter().map(|share| point(*share)).fold(0.0, f64::max)
    }

    /// A depth beyond which all voxels together add at most `share` of the nearest voxel's own weight, and so of the
    /// largest sum anywhere. Let S be the sum of an infinite slice and r_n = r_0 + n d the depth at which a ray meets
    /// slice n, and let the voxels that reach the ray be at most e nearer or farther than that. Then all voxels deeper
    /// than z add up to
    ///
    /// ```text
    /// sum over n of S exp(-tau max(z, r_n - e)) <= S exp(-tau z) (2 e / d + 1 + 1 / (1 - exp(-tau d)))
    /// ```
    pub(super) fn deepest(&self, share: f64) -> f64 {
        let (tau, deeper, nearer) = (self.tau, self.deeper(), self.nearer());
        let slices = 2.0 * nearer / deeper + 1.0 - 1.0 / libm::expm1(-tau * deeper);
        self.nearest() + libm::log(self.slice() * slices / share) / tau
    }

    /// The depth that a ray gains from slice to slice.
    fn deeper(&self) -> f64 {
        let Shear { slopes, depths, .. } = &self.shear;
        (depths[2] - slopes[0] * depths[0] - slopes[1] * depths[1]).abs()
    }

    /// How much nearer a voxel can be than the point where the ray meets its slice, if its footprint reaches the ray.
    fn nearer(&self) -> f64 {
        [0, 1].map(|i| self.half(i, self.reach) * self.shear.depths[i].abs()).iter().sum()
    }

    fn nearest(&self) -> f64 {
        self.camera.nearest_of(&self.grid.crop(&self.clip))
    }

    /// An upper bound of the sum of weights of a slice at any point, in units of a voxel's own weight: the sum at a voxel
    /// with as many voxels to each side as the volume has.
    fn slice(&self) -> f64 {
        let [b, c] = self.shear.pixels;
        let dims = self.clip.dims();
        let [most, rows] =
            [0, 1].map(|i| self.half(i, self.reach).min(dims[self.shear.axes[i]] as f64).ceil() as isize);
        let weight = |i: isize, j: isize| {
            let [x, y] = [0, 1].map(|n| i as f64 * b[n] + j as f64 * c[n]);
            self.footprint.share([x, y])
        };
        (-rows..=rows).flat_map(|j| (-most..=most).map(move |i| weight(i, j))).sum()
    }

    /// Voxels to one side along b (0) or c (1) that are within `reach` pixels.
    fn half(&self, i: usize, reach: f64) -> f64 {
        let corners = [[reach, reach], [reach, -reach]].map(|off| self.shear.cells(off)[i].abs());
        corners[0].max(corners[1])
    }

    /// The sum over the voxels `all` of a row along b that starts at `voxel`.
    fn row(&self, mut voxel: [usize; 3], all: Range<usize>, point: [f64; 2], reach: f64) -> f64 {
        let [bx, by] = self.shear.pixels[0];
        let squared = bx * bx + by * by;
        let off = self.off(voxel, point);
        let centre = -(off[0] * bx + off[1] * by) / squared;
        let near = around(centre, std::f64::consts::SQRT_2 * reach / squared.sqrt(), all);
        if near.is_empty() {
            return 0.0;
        }
        voxel[self.shear.axes[0]] = near.start;
        let (off, z) = (self.off(voxel, point), self.shear.depth(voxel));
        self.rows.sum(off, z, near.len())
    }

    /// The offset from a point of the picture to a voxel, in pixels.
    fn off(&self, voxel: [usize; 3], point: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.shear.position(voxel);
        let [b, c] = self.shear.pixels;
        [0, 1].map(|i| u * b[i] + v * c[i] - point[i])
    }
}

/// The whole numbers of a range within `half` of `centre`.
fn around(centre: f64, half: f64, all: Range<usize>) -> Range<usize> {
    let end = (centre + half + 1.0).floor().clamp(0.0, all.end as f64) as usize;
    let start = (centre - half).ceil().clamp(all.start as f64, all.end as f64) as usize;
    start.min(end)..end
}
