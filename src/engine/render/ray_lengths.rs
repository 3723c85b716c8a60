//! The lengths of rays, by which means are weighed: a ray that barely touches the volume meets few voxels, so that its mean stands
//! out at the rim, and says little. Short rays are filled up with the value `beyond` (eq 51):
//!
//! ```text
//! shown = beyond + share (mean - beyond)        share = length of the ray / longest length in the view
//! ```

use super::ViewReport;
use super::annotate::camera;
use rayon::prelude::*;
use serde::Serialize;
use wavesplat_core::base::grid::{Grid, Region};

/// The least number of pixels whose rays a thread measures.
const PIXELS: usize = 1 << 14;

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

    /// The rays of a picture; `None` if its view is none.
    pub(super) fn seen(&self, view: &ViewReport, size: [usize; 2]) -> Option<SeenRays> {
        let camera = camera(&self.grid, size, view)?;
        let from = |pixel: [f64; 2]| camera.ray(pixel).0;
        let [first, right, down] = [[0.5, 0.5], [1.5, 0.5], [0.5, 1.5]].map(from);
        let (ends, along) = (self.ends, camera.ray([0.0; 2]).1);
        let longest = (0..3).map(|a| (ends[a][1] - ends[a][0]) / along[a].abs()).fold(f64::INFINITY, f64::min);
        let step = |to: [f64; 3]| std::array::from_fn(|a| to[a] - first[a]);
        Some(SeenRays { from: first, right: step(right), down: step(down), along, ends, longest })
    }

    /// The lengths of the rays of all pixels, row by row, as shares of the longest one in the view; none if the view is none.
    pub fn shares(&self, view: &ViewReport, size @ [width, height]: [usize; 2]) -> Vec<f32> {
        let Some(rays) = self.seen(view, size) else { return Vec::new() };
        let share = |at: usize| rays.share([at % width, at / width]);
        (0..width * height).into_par_iter().with_min_len(PIXELS).map(share).collect()
    }
}

/// The rays of a picture through a box, as a page gets them.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct SeenRays {
    /// The origin of the first pixel's ray, and its change from column to column and from row to row.
    from: [f64; 3],
    right: [f64; 3],
    down: [f64; 3],
    /// The direction of all rays, of length 1.
    along: [f64; 3],
    ends: [[f64; 2]; 3],
    /// The longest length within the box.
    longest: f64,
}

impl SeenRays {
    /// The length of a pixel's ray as a share of the longest one.
    fn share(&self, [x, y]: [usize; 2]) -> f32 {
        let from = std::array::from_fn(|a| self.from[a] + x as f64 * self.right[a] + y as f64 * self.down[a]);
        (self.length(from) / self.longest).min(1.0) as f32
    }

    /// The length of a ray within the box.
    fn length(&self, from: [f64; 3]) -> f64 {
        let [mut near, mut far] = [f64::NEG_INFINITY, f64::INFINITY];
        for (axis, ends) in self.ends.iter().enumerate() {
            let along = self.along[axis];
            if along == 0.0 && !(ends[0]..=ends[1]).contains(&from[axis]) {
                return 0.0;
            }
            if along != 0.0 {
                let [a, b] = ends.map(|end| (end - from[axis]) / along);
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
            let view = view(angles[0], angles[1]);
            let (seen, camera) = (rays.seen(&view, SIZE), camera(&rays.grid, SIZE, &view));
            let (seen, camera) = (seen.expect("rays"), camera.expect("a view"));
            for [x, y] in [[20, 15], [3, 4], [31, 20], [12, 12]] {
                let (from, along) = camera.ray([x as f64 + 0.5, y as f64 + 0.5]);
                let (length, expected) = (f64::from(seen.share([x, y])) * seen.longest, stepped(&rays, from, along));
                assert!((length - expected).abs() < 3e-3, "{angles:?} {x} {y}: {length} {expected}");
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
