//! A slab perpendicular to the view direction, and the share of each voxel's kernel in it (eq 29).

use crate::base::grid::{Grid, Region};
use crate::view::camera::Camera;

/// A slab between two depths, in world units behind the nearest corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::render) struct Slab {
    near: f64,
    far: f64,
    /// Radius of the cut kernel in standard deviations, and 1 / (sqrt 2 sigma).
    radius: f64,
    scale: f64,
    /// World units from one slab to the next.
    thickness: f64,
}

impl Slab {
    /// A slab for a kernel with standard deviation `sigma`, cut at `radius` deviations.
    pub(in crate::render) fn new([near, far]: [f64; 2], (sigma, radius): (f64, f64), thickness: f64) -> Self {
        Self { near, far, radius, scale: std::f64::consts::FRAC_1_SQRT_2 / sigma, thickness }
    }

    /// World units from a voxel to the cut of its kernel.
    fn reach(&self) -> f64 {
        self.radius * std::f64::consts::FRAC_1_SQRT_2 / self.scale
    }

    /// The range of depths of voxels whose kernels reach the slab.
    pub(in crate::render) fn reached_from(&self) -> [f64; 2] {
        [self.near - self.reach(), self.far + self.reach()]
    }

    /// The share of a kernel's integral along the ray that lies in the slab, for a voxel at depth `z` (eq 29):
    /// Phi((far - z) / sigma) - Phi((near - z) / sigma).
    pub(in crate::render) fn share(&self, z: f64) -> f64 {
        let [from, to] = self.reached_from();
        if !(from..=to).contains(&z) {
            return 0.0;
        }
        let beyond = |depth: f64| libm::erfc((depth - z) * self.scale);
        0.5 * (beyond(self.near) - beyond(self.far)).max(0.0)
    }

    /// An upper bound of the number of slabs that are reached by the kernels of voxels within a depth range of `deep`.
    pub(in crate::render) fn reached_by(&self, deep: f64) -> usize {
        ((deep + 2.0 * self.reach()) / self.thickness).ceil() as usize + 1
    }

    /// Whether the kernel of any voxel of a region reaches the slab.
    pub(in crate::render) fn is_reached(&self, region: &Region, grid: &Grid, camera: &Camera) -> bool {
        let [from, to] = self.reached_from();
        let [nearest, farthest] = camera.depths_of(&grid.crop(region));
        nearest <= to && from <= farthest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_all_slabs_sum_to_one() {
        let ends: Vec<f64> = (0..=20).map(|n| f64::from(n) * 0.7 - 4.0).collect();
        let slabs: Vec<Slab> = ends.windows(2).map(|ends| Slab::new([ends[0], ends[1]], (0.9, 6.0), 0.7)).collect();
        for z in [0.0, 0.3, 2.0, 4.5] {
            let all: f64 = slabs.iter().map(|slab| slab.share(z)).sum();
            assert!((all - 1.0).abs() < 1e-5, "{z}: {all}");
        }
        let one = Slab::new([-0.9, 0.9], (0.9, 6.0), 1.8);
        assert!((one.share(0.0) - 0.682_689_492).abs() < 1e-8, "one deviation to both sides");
        assert_eq!(one.share(7.0), 0.0);
    }
}
