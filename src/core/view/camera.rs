//! The parallel camera: world positions to pixels and depth.
//!
//! With azimuth a and elevation e, the view looks along `forward`, and `right` is forward x up:
//!
//! ```text
//! forward = (sin a cos e, -cos a cos e, -sin e)
//! up      = (sin a sin e, -cos a sin e,  cos e)
//! right   = (-cos a, -sin a, 0)
//! ```
//!
//! At a = e = 0 it looks along -y with z up. The azimuth turns counter-clockwise seen from +z. The roll turns the
//! picture counter-clockwise. The camera maps a world position p to a pixel position and a depth (`src/method.md`,
//! section 2):
//!
//! ```text
//! x = W/2 + S right.(p - c)    y = H/2 - S up.(p - c)    z = forward.(p - c) - least over the corners     (eq 14)
//! ```
//!
//! W and H are the size of the picture, S is pixels per world unit, and c is the world point in the middle of the
//! picture. Pixel (a, b) has its centre at (a + 1/2, b + 1/2). Depths are at least 0: they count from the nearest
//! corner of the grid.

use crate::base::error::{Error, Result};
use crate::base::grid::Grid;
use serde::{Deserialize, Serialize};

/// The settings of a view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Degrees about z, counter-clockwise seen from +z; 0 looks along -y.
    pub azimuth: f64,
    /// Degrees above the horizon; 90 looks straight down.
    pub elevation: f64,
    /// Degrees by which the picture turns counter-clockwise.
    pub roll: f64,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Pixels per world unit; by default the whole volume fits.
    pub scale: Option<f64>,
    /// The world point in the middle of the picture; by default the centre of the volume.
    pub center: Option<[f64; 3]>,
}

impl View {
    /// The whole volume in a picture of 512 x 512 pixels, seen from an azimuth and elevation in degrees.
    pub fn new(azimuth: f64, elevation: f64) -> Self {
        Self { azimuth, elevation, roll: 0.0, size: [512, 512], scale: None, center: None }
    }
}

/// A view of one grid: an affine map from world positions to pixels and depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Pixels per world unit.
    pub scale: f64,
    right: [f64; 3],
    up: [f64; 3],
    forward: [f64; 3],
    center: [f64; 3],
    nearest: f64,
}

/// Share of the picture that the volume fills at the default scale.
const FIT: f64 = 0.9;

/// Bounds of the rounding error in the projection of a voxel.
#[derive(Debug, Clone, Copy)]
pub struct ProjectionError {
    /// In pixels along each axis.
    pub(crate) pixels: f64,
    /// In depth, in world units.
    pub(crate) depth: f64,
}

impl Camera {
    /// The camera for a view of `grid`.
    ///
    /// # Errors
    /// Numbers that are not finite, a scale that is not above 0, or a picture size out of range.
    pub fn new(view: &View, grid: &Grid) -> Result<Self> {
        let center = view.center.unwrap_or_else(|| middle(grid));
        let numbers = [("azimuth", view.azimuth), ("elevation", view.elevation), ("roll", view.roll)];
        let all = numbers.into_iter().chain(center.map(|n| ("center", n)));
        if let Some((setting, _)) = all.into_iter().find(|(_, n)| !n.is_finite()) {
            return Err(Error::setting(setting, "takes finite numbers"));
        }
        if view.scale.is_some_and(|scale| !(scale.is_finite() && scale > 0.0)) {
            return Err(Error::setting("scale", "takes a finite number above 0"));
        }
        if view.size.iter().any(|n| *n == 0 || *n > MOST_PIXELS) {
            return Err(Error::setting("size", format!("a picture is 1 to {MOST_PIXELS} pixels wide and high")));
        }
        let [right, up, forward] = axes(view);
        let mut camera = Self { size: view.size, scale: 1.0, right, up, forward, center, nearest: 0.0 };
        camera.nearest = corners(grid).map(|p| dot(forward, minus(p, center))).fold(f64::INFINITY, f64::min);
        camera.scale = view.scale.unwrap_or_else(|| camera.fitting_scale(grid));
        Ok(camera)
    }

    /// The pixel position (x, y) and the depth z of a world position (eq 14); z is in world units behind the nearest
    /// corner.
    pub fn project(&self, position: [f64; 3]) -> [f64; 3] {
        let q = minus(position, self.center);
        [
            self.size[0] as f64 / 2.0 + self.scale * dot(self.right, q),
            self.size[1] as f64 / 2.0 - self.scale * dot(self.up, q),
            dot(self.forward, q) - self.nearest,
        ]
    }

    /// The change of the projection, [x, y, depth], for a step of `length` along a world axis.
    pub fn step(&self, axis: usize, length: f64) -> [f64; 3] {
        let along = |screen: [f64; 3]| screen[axis] * length;
        [self.scale * along(self.right), -self.scale * along(self.up), along(self.forward)]
    }

    /// The ray through a point of the picture: its world position at depth 0, and the unit vector along which depths
    /// grow.
    pub fn ray(&self, [x, y]: [f64; 2]) -> ([f64; 3], [f64; 3]) {
        let right = (x - self.size[0] as f64 / 2.0) / self.scale;
        let up = (self.size[1] as f64 / 2.0 - y) / self.scale;
        let across = |a: usize| right * self.right[a] + up * self.up[a];
        (std::array::from_fn(|a| self.center[a] + across(a) + self.nearest * self.forward[a]), self.forward)
    }

    /// The depth of the farthest corner of `grid`, in world units.
    pub fn depth(&self, grid: &Grid) -> f64 {
        corners(grid).map(|p| self.project(p)[2]).fold(0.0, f64::max)
    }

    /// The world point `length` world units to the right of the point in the middle of the picture.
    pub fn beside(&self, length: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.center[axis] + length * self.right[axis])
    }

    /// The world point `right` and `up` world units from the point in the middle of the picture.
    pub fn moved(&self, right: f64, up: f64) -> [f64; 3] {
        std::array::from_fn(|axis| self.center[axis] + right * self.right[axis] + up * self.up[axis])
    }

    /// The direction to a point `azimuth` degrees to the right of the viewer and `elevation` degrees above.
    pub fn towards(&self, azimuth: f64, elevation: f64) -> [f64; 3] {
        let ((sin_a, cos_a), (sin_e, cos_e)) = (sin_cos_degrees(azimuth), sin_cos_degrees(elevation));
        let share =
            |axis: usize| cos_e * sin_a * self.right[axis] + sin_e * self.up[axis] - cos_e * cos_a * self.forward[axis];
        std::array::from_fn(share)
    }

    /// The depth of the nearest corner of `grid`, which may be a part of the camera's grid.
    pub fn nearest_of(&self, grid: &Grid) -> f64 {
        corners(grid).map(|p| self.project(p)[2]).fold(f64::INFINITY, f64::min)
    }

    /// Bounds of the rounding error in the projection of any voxel of `grid`.
    pub fn rounding(&self, grid: &Grid) -> ProjectionError {
        let size = |p: [f64; 3]| p.iter().map(|c| c.abs()).sum::<f64>();
        let far = corners(grid).map(size).fold(size(self.center), f64::max);
        let depth = 64.0 * f64::EPSILON * far; // some twenty operations on numbers of at most twice this size
        let pixels = self.scale * depth + 4.0 * f64::EPSILON * self.size[0].max(self.size[1]) as f64;
        ProjectionError { pixels, depth }
    }

    /// The largest scale at which every cell of the grid lies within the picture, with a margin.
    fn fitting_scale(&self, grid: &Grid) -> f64 {
        let half = |axis: [f64; 3]| {
            let reach = |p| dot(axis, minus(p, self.center)).abs();
            let cell: f64 = (0..3).map(|a| (axis[a] * grid.spacing[a]).abs() / 2.0).sum();
            corners(grid).map(reach).fold(0.0, f64::max) + cell
        };
        let fit = |pixels: usize, half: f64| FIT * pixels as f64 / (2.0 * half);
        fit(self.size[0], half(self.right)).min(fit(self.size[1], half(self.up)))
    }
}

/// A picture's side is limited so that its area fits in memory arithmetic.
const MOST_PIXELS: usize = 1 << 15;

/// Right, up and forward of a view.
fn axes(view: &View) -> [[f64; 3]; 3] {
    let (sin_a, cos_a) = sin_cos_degrees(view.azimuth);
    let (sin_e, cos_e) = sin_cos_degrees(view.elevation);
    let (sin_r, cos_r) = sin_cos_degrees(view.roll);
    let forward = [sin_a * cos_e, -cos_a * cos_e, -sin_e];
    let up = [sin_a * sin_e, -cos_a * sin_e, cos_e];
    let right = [-cos_a, -sin_a, 0.0]; // forward x up
    let turned = |a: f64, b: f64| std::array::from_fn(|i| a * right[i] + b * up[i]);
    [turned(cos_r, -sin_r), turned(sin_r, cos_r), forward]
}

/// Sine and cosine, exact at multiples of 90 degrees.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let degrees = degrees % 360.0;
    let turns = (degrees / 90.0).round();
    let (s, c) = libm::sincos((degrees - turns * 90.0).to_radians());
    match turns.rem_euclid(4.0) as u8 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

fn middle(grid: &Grid) -> [f64; 3] {
    let [first, last] = [grid.position([0; 3]), grid.position(grid.dims.map(|n| n - 1))];
    std::array::from_fn(|a| (first[a] + last[a]) / 2.0)
}

fn corners(grid: &Grid) -> impl Iterator<Item = [f64; 3]> {
    let grid = *grid;
    (0..8).map(move |c| grid.position(std::array::from_fn(|a| if c >> a & 1 == 1 { grid.dims[a] - 1 } else { 0 })))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(azimuth: f64, elevation: f64) -> Camera {
        let view = View { azimuth, elevation, roll: 0.0, size: [100, 100], scale: Some(10.0), center: None };
        Camera::new(&view, &Grid::unit([3, 3, 3])).expect("a valid view")
    }

    #[test]
    fn from_the_front_z_is_up_and_x_points_left() {
        let c = camera(0.0, 0.0);
        assert_eq!(c.project([1.0, 1.0, 1.0]), [50.0, 50.0, 1.0]);
        assert_eq!(c.project([2.0, 1.0, 2.0]), [40.0, 40.0, 1.0]);
        assert_eq!(c.project([1.0, 2.0, 1.0])[2], 0.0);
    }

    #[test]
    fn from_above_depth_runs_down() {
        let c = camera(0.0, 90.0);
        assert_eq!(c.project([1.0, 1.0, 0.0])[2], 2.0);
        assert_eq!(c.project([1.0, 0.0, 1.0])[1], 40.0, "the far side, -y, is up");
    }

    #[test]
    fn a_ray_is_the_inverse_of_the_projection() {
        let c = camera(37.0, -21.0);
        for position in [[0.0, 1.0, 2.0], [-3.0, 0.5, 9.0]] {
            let [x, y, depth] = c.project(position);
            let (start, along) = c.ray([x, y]);
            let found: [f64; 3] = std::array::from_fn(|a| start[a] + depth * along[a]);
            assert!((0..3).all(|a| (found[a] - position[a]).abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn the_axes_are_orthonormal() {
        for (azimuth, elevation, roll) in [(30.0, 30.0, 0.0), (123.0, -71.0, 40.0), (-1e4, 1e3, 7.0)] {
            let a = axes(&View { azimuth, elevation, roll, size: [1, 1], scale: None, center: None });
            for i in 0..3 {
                for j in 0..3 {
                    assert!((dot(a[i], a[j]) - f64::from(u8::from(i == j))).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn the_fitting_scale_shows_every_corner() {
        let grid = Grid { dims: [75, 75, 20], spacing: [0.002; 3], origin: [0.0; 3] };
        for azimuth in [0.0, 30.0, 200.0] {
            let view = View { azimuth, elevation: 30.0, roll: 10.0, size: [64, 48], scale: None, center: None };
            let c = Camera::new(&view, &grid).expect("a valid view");
            for p in corners(&grid) {
                let [x, y, _] = c.project(p);
                assert!((0.0..64.0).contains(&x) && (0.0..48.0).contains(&y));
            }
        }
    }
}
