//! A slab across the view direction: how much of each voxel's kernel lies in it (eq 29).

use crate::base::grid::{Grid, Region};
use crate::view::camera::Camera;

/// A slab: depths, in world units behind the nearest corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::render) struct Slab {
    near: f64,
    far: f64,
    /// Standard deviations of the kernel from its centre to where it is cut, and 1 / (sqrt 2 sigma).
    radius: f64,
    scale: f64,
    /// World units between one and the next.
    thickness: f64,
}

impl Slab {
    /// Of a kernel of deviation `sigma` that is cut `radius` deviations from its centre.
    pub(in crate::render) fn new([near, far]: [f64; 2], (sigma, radius): (f64, f64), thickness: f64) -> Self {
        Self { near, far, radius, scale: std::f64::consts::FRAC_1_SQRT_2 / sigma, thickness }
    }

    /// World units from a voxel to where its kernel is cut.
    fn reach(&self) -> f64 {
        self.radius * std::f64::consts::FRAC_1_SQRT_2 / self.scale
    }

    /// The depths of voxels whose kernels reach into it.
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

    /// How many slabs kernels of voxels reach into that are no further apart in depth than `deep`, at most.
    pub(in crate::render) fn reached_by(&self, deep: f64) -> usize {
        ((deep + 2.0 * self.reach()) / self.thickness).ceil() as usize + 1
    }

    /// Whether the kernel of any voxel of a region reaches into it.
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
    fn slabs_share_out_the_whole_kernel() {
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
