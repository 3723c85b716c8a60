//! Where the rays of pixels meet planes.

use crate::render::config::Plane;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::{Camera, View};

/// The planes through a volume, as a view shows them.
#[derive(Debug, Clone)]
pub struct PlanesView {
    /// The camera of the view.
    pub camera: Camera,
    /// The lattice of the volume.
    pub(super) grid: Grid,
    /// The voxels that are shown.
    pub(super) clip: Region,
    pub(super) planes: Vec<Plane>,
}

/// The point at which a ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// The number of the plane.
    pub plane: usize,
    /// The depth along the ray in world units, as the camera counts it.
    pub depth: f64,
    /// The place in voxels along x, y, z.
    pub place: [f64; 3],
}

impl PlanesView {
    /// The planes through the voxels of `clip`.
    ///
    /// # Errors
    /// No planes, a plane beyond the voxels, or a view that [`Camera::new`] refuses.
    pub fn new(grid: &Grid, clip: Region, planes: &[Plane], view: &View) -> Result<Self> {
        let camera = Camera::new(view, grid)?;
        if planes.is_empty() || !planes.iter().all(|plane| plane.is_within(&clip)) {
            return Err(Error::setting("planes", "takes one plane or more, between voxels of the region"));
        }
        Ok(Self { camera, grid: *grid, clip, planes: planes.to_vec() })
    }

    /// The nearest plane that the ray through a point of the picture meets; of planes at the same depth, the first.
    pub fn nearest(&self, point: [f64; 2]) -> Option<Hit> {
        let (start, along) = self.camera.ray(point);
        let start: [f64; 3] = std::array::from_fn(|a| (start[a] - self.grid.origin[a]) / self.grid.spacing[a]);
        let along: [f64; 3] = std::array::from_fn(|a| along[a] / self.grid.spacing[a]);
        let hits = self.planes.iter().enumerate().filter_map(|(number, plane)| self.hit(number, plane, start, along));
        hits.reduce(|nearest, other| if other.depth < nearest.depth { other } else { nearest })
    }

    /// Where a ray, given in voxels, meets a plane.
    fn hit(&self, number: usize, plane: &Plane, start: [f64; 3], along: [f64; 3]) -> Option<Hit> {
        let depth = (plane.at - start[plane.axis]) / along[plane.axis];
        if !depth.is_finite() {
            return None;
        }
        let mut place: [f64; 3] = std::array::from_fn(|a| start[a] + depth * along[a]);
        place[plane.axis] = plane.at;
        let inside = |a: usize| {
            place[a] >= self.clip.start[a] as f64 - HALF - ROUNDING
                && place[a] < self.clip.end[a] as f64 - HALF + ROUNDING
        };
        (0..3).all(inside).then_some(Hit { plane: number, depth, place })
    }

    /// The voxels around a place.
    pub fn taps(&self, place: [f64; 3]) -> Taps {
        Taps::new(place, &self.clip)
    }
}

/// Planes end half a voxel beyond the outermost voxels.
const HALF: f64 = 0.5;

/// Places this near to each other, in voxels, are the same.
const ROUNDING: f64 = 1e-9;

/// Up to eight voxels around a place, with weights that sum to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    first: [usize; 3],
    share: [f64; 3],
}

impl Taps {
    /// The voxels of a region around a place, which may lie beyond its outermost voxels.
    pub fn new(place: [f64; 3], region: &Region) -> Self {
        let within = |a: usize| place[a].clamp(region.start[a] as f64, region.end[a].saturating_sub(1) as f64);
        let place: [f64; 3] = std::array::from_fn(within);
        let near = place.map(f64::round);
        let is_voxel = |a: usize| (place[a] - near[a]).abs() <= ROUNDING;
        let first = std::array::from_fn(|a| if is_voxel(a) { near[a] } else { place[a].floor() });
        let share = std::array::from_fn(|a| if is_voxel(a) { 0.0 } else { place[a] - first[a] });
        Self { first: first.map(|first| first as usize), share }
    }

    /// The box of all voxels with a weight.
    pub fn region(&self) -> Region {
        let end = |a: usize| self.first[a] + 1 + usize::from(self.share[a] > 0.0);
        Region { start: self.first, end: std::array::from_fn(end) }
    }

    /// The weight of a voxel of [`Self::region`].
    pub fn weight(&self, voxel: [usize; 3]) -> f64 {
        let along = |a: usize| if voxel[a] == self.first[a] { 1.0 - self.share[a] } else { self.share[a] };
        along(0) * along(1) * along(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(azimuth: f64, elevation: f64, planes: &[Plane]) -> PlanesView {
        let view = View { size: [40, 40], scale: Some(4.0), ..View::new(azimuth, elevation) };
        let grid = Grid { dims: [5, 4, 3], spacing: [1.0, 1.0, 2.0], origin: [10.0, 0.0, 0.0] };
        PlanesView::new(&grid, grid.whole(), planes, &view).expect("planes within")
    }

    #[test]
    fn the_nearest_plane_hides_the_others() {
        let planes = [0.5, 2.0].map(|at| Plane { axis: 2, at });
        let above = view(180.0, 90.0, &planes).nearest([20.0, 20.0]).expect("in the middle");
        assert_eq!((above.plane, above.depth, above.place), (1, 0.0, [2.0, 1.5, 2.0]));
        let below = view(180.0, -90.0, &planes).nearest([20.0, 20.0]).expect("in the middle");
        assert_eq!((below.plane, below.depth), (0, 1.0));
        assert_eq!(view(0.0, 0.0, &planes).nearest([20.0, 20.0]), None, "seen from the edge");
    }

    #[test]
    fn planes_end_half_a_voxel_beyond_the_outermost_voxels() {
        let face = view(180.0, 90.0, &[Plane { axis: 2, at: 1.0 }]);
        let seen = |x: f64, y: f64| face.nearest([x, y]).is_some();
        // 5 x 4 voxels of 4 pixels around (20, 20)
        assert!(seen(10.1, 12.1) && seen(29.9, 27.9) && !seen(9.9, 20.0) && !seen(30.1, 20.0) && !seen(20.0, 28.1));
        let place = face.nearest([29.0, 13.0]).expect("a corner").place;
        assert!((place[0] - 4.25).abs() < 1e-12 && (place[1] - 3.25).abs() < 1e-12, "x to the right, y up: {place:?}");
    }

    #[test]
    fn weights_are_those_of_linear_interpolation() {
        let region = Region { start: [1, 0, 0], end: [5, 4, 1] };
        let taps = Taps::new([2.25, 1.0 + 1e-12, 0.4], &region);
        assert_eq!(taps.region(), Region { start: [2, 1, 0], end: [4, 2, 1] });
        assert_eq!([[2, 1, 0], [3, 1, 0]].map(|voxel| taps.weight(voxel)), [0.75, 0.25]);
        assert_eq!(Taps::new([0.0, 9.0, -3.0], &region).region(), Region { start: [1, 3, 0], end: [2, 4, 1] });
    }

    #[test]
    fn planes_beyond_the_region_are_refused() {
        let (grid, view) = (Grid::unit([5, 4, 3]), View::new(0.0, 0.0));
        for (axis, at) in [(0, -0.1), (0, 4.1), (2, f64::NAN), (3, 0.0), (1, f64::INFINITY)] {
            assert!(PlanesView::new(&grid, grid.whole(), &[Plane { axis, at }], &view).is_err(), "{axis} {at}");
        }
        assert!(PlanesView::new(&grid, grid.whole(), &[], &view).is_err());
    }
}
