//! Slabs across the view direction: how a view is cut into them, and how much of each voxel's kernel lies in one.

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::render::RenderConfig;
use crate::render::eye::Eye;
use crate::volume::{Grid, Region};

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
    pub(super) fn new([near, far]: [f64; 2], (sigma, radius): (f64, f64), thickness: f64) -> Self {
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

    /// The share of a kernel's integral along the ray that lies in the slab, of a voxel at depth `z`:
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

/// More slabs than this are refused.
const MOST_SLABS: usize = 1 << 16;
/// Standard deviations of the kernel in front of the first voxels and behind the last ones that slabs are cut in, too.
const TAIL: f64 = 3.0;

/// The slabs of a view.
#[derive(Debug)]
pub(in crate::render) struct Slabs {
    /// An eye for each, from front to back.
    pub(in crate::render) eyes: Vec<Eye>,
    /// World units of each.
    pub(super) thickness: f64,
}

/// The depths between which a view is cut.
fn ends(eye: &Eye, config: &RenderConfig) -> [f64; 2] {
    let [nearest, farthest] = eye.camera.depths_of(&eye.grid.crop(&eye.clip));
    [nearest - TAIL * config.kernel.sigma, farthest + TAIL * config.kernel.sigma]
}

/// How many slabs a view is to be cut into.
pub(in crate::render) fn count(eye: &Eye, config: &RenderConfig) -> usize {
    let [from, to] = ends(eye, config);
    config.mode.slabs().unwrap_or(((to - from) / eye.grid.largest_spacing()).ceil().max(1.0) as usize)
}

/// Cuts the volume into slabs across the view direction. The first and the last one have no end.
pub(in crate::render) fn cut(eye: &Eye, config: &RenderConfig) -> Result<Slabs> {
    let ([from, to], count) = (ends(eye, config), count(eye, config));
    if !(1..=MOST_SLABS).contains(&count) {
        return Err(Error::usage(format!("--slabs: takes 1 to {MOST_SLABS}; here it would be {count}")));
    }
    let thickness = (to - from) / count as f64;
    let end = |n: usize| match n {
        0 => f64::NEG_INFINITY,
        n if n == count => f64::INFINITY,
        n => from + (to - from) * (n as f64 / count as f64),
    };
    let kernel = (config.kernel.sigma, eye.method.radius);
    let slab = |n: usize| Slab::new([end(n), end(n + 1)], kernel, thickness);
    let eyes = (0..count).map(|n| Eye { slab: Some(slab(n)), ..eye.clone() }).collect();
    Ok(Slabs { eyes, thickness })
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
