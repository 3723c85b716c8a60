//! Means as if all rays of a view were equally long. The mean along a ray that barely touches the volume is that of few voxels: it
//! stands out at the rim, and says little.
//!
//! ```text
//! shown = beyond + share (mean - beyond)        share = length of the ray / longest length in the view     (eq 51)
//! ```
//!
//! This is the mean along a ray of the longest length that meets the value `beyond` outside of the volume.

use super::PIXELS;
use crate::render::ViewReport;
use crate::render::annotate::camera;
use rayon::prelude::*;
use wavesplat_core::base::grid::{Grid, Region};

/// The box of a volume in which rays are measured.
#[derive(Debug, Clone, PartialEq)]
pub struct RayLengths {
    grid: Grid,
    /// The least and the largest coordinate along each axis.
    ends: [[f64; 2]; 3],
}

impl RayLengths {
    /// The rays through the voxels of a region and `rim` world units around them.
    pub fn new(grid: &Grid, region: &Region, rim: f64) -> Self {
        let at = |axis: usize, place: f64| grid.origin[axis] + place * grid.spacing[axis];
        let least = |axis: usize| at(axis, region.start[axis] as f64 - 0.5) - rim;
        let largest = |axis: usize| at(axis, region.end[axis] as f64 - 0.5) + rim;
        Self { grid: *grid, ends: [0, 1, 2].map(|axis| [least(axis), largest(axis)]) }
    }

    /// The lengths of the rays of all pixels, row by row, as shares of the longest one in the view; none if the view is none.
    pub fn shares(&self, view: &ViewReport, size @ [width, height]: [usize; 2]) -> Vec<f32> {
        let Some(camera) = camera(&self.grid, size, view) else { return Vec::new() };
        let (_, along) = camera.ray([0.0; 2]);
        let longest =
            (0..3).map(|a| (self.ends[a][1] - self.ends[a][0]) / along[a].abs()).fold(f64::INFINITY, f64::min);
        let share = |at: usize| {
            let (from, along) = camera.ray([(at % width) as f64 + 0.5, (at / width) as f64 + 0.5]);
            (self.length(from, along) / longest).min(1.0) as f32
        };
        (0..width * height).into_par_iter().with_min_len(PIXELS).map(share).collect()
    }

    /// The length of a ray within the box; `along` has length 1.
    fn length(&self, from: [f64; 3], along: [f64; 3]) -> f64 {
        let [mut near, mut far] = [f64::NEG_INFINITY, f64::INFINITY];
        for (axis, ends) in self.ends.iter().enumerate() {
            let is_across = along[axis] == 0.0;
            if is_across && !(ends[0]..=ends[1]).contains(&from[axis]) {
                return 0.0;
            }
            if !is_across {
                let [a, b] = ends.map(|end| (end - from[axis]) / along[axis]);
                (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
            }
        }
        (far - near).max(0.0)
    }
}

/// How means are weighed by the lengths of their rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighing {
    /// The rays.
    pub rays: RayLengths,
    /// The value beyond the volume.
    pub beyond: f32,
}

impl Weighing {
    /// The value to show for a mean along a ray with this share of the longest length (eq 51).
    pub(super) fn value(&self, mean: f32, share: f32) -> f32 {
        weighed(mean, share, self.beyond)
    }
}

/// The value to show for a mean, with a value beyond the volume (eq 51).
pub fn weighed(mean: f32, share: f32, beyond: f32) -> f32 {
    beyond + share * (mean - beyond)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [40, 30];

    fn plate() -> RayLengths {
        let grid = Grid { origin: [5.0, -3.0, 2.0], spacing: [1.0, 1.5, 0.5], ..Grid::unit([12, 9, 6]) };
        let region = Region { start: [1, 0, 2], end: [12, 9, 6] };
        RayLengths::new(&grid, &region, 0.25)
    }

    fn view(azimuth: f64, elevation: f64) -> ViewReport {
        ViewReport { azimuth, elevation, scale: 2.0, center: [11.0, 3.0, 3.5], ..ViewReport::default() }
    }

    /// The length of a ray in a box by small steps.
    fn stepped(rays: &RayLengths, from: [f64; 3], along: [f64; 3]) -> f64 {
        const STEP: f64 = 1e-3;
        let is_inside =
            |t: &f64| (0..3).all(|a| (rays.ends[a][0]..=rays.ends[a][1]).contains(&(from[a] + t * along[a])));
        (-40_000..40_000).map(|n| f64::from(n) * STEP).filter(is_inside).count() as f64 * STEP
    }

    #[test]
    fn lengths_of_rays_are_those_of_small_steps() {
        let rays = plate();
        assert_eq!(rays.ends, [[5.25, 17.0 - 0.25], [-4.0, 10.0], [2.5, 5.0]]);
        for angles in [[0.0, 0.0], [90.0, 0.0], [0.0, 90.0], [31.0, 17.0], [210.0, -40.0]] {
            let camera = camera(&rays.grid, SIZE, &view(angles[0], angles[1])).expect("a view");
            for pixel in [[20.5, 15.5], [3.0, 4.0], [31.0, 20.0], [12.0, 12.0]] {
                let (from, along) = camera.ray(pixel);
                let (length, expected) = (rays.length(from, along), stepped(&rays, from, along));
                assert!((length - expected).abs() < 3e-3, "{angles:?} {pixel:?}: {length} {expected}");
            }
        }
    }

    #[test]
    fn all_rays_of_a_face_are_equally_long() {
        let rays = plate();
        let shares = rays.shares(&view(0.0, 90.0), SIZE);
        assert!(shares.iter().all(|share| *share == 0.0 || *share > 0.999_999) && shares[15 * 40 + 20] > 0.5);
        let oblique = rays.shares(&view(30.0, 30.0), SIZE);
        assert!(oblique.iter().filter(|share| (0.01..0.99).contains(*share)).count() > 50);
        assert!(oblique[15 * 40 + 20] == 1.0 && oblique[0] == 0.0);
    }
}
