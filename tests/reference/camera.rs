//! The parallel camera (eq 14).
//!
//! Azimuth a, elevation e and roll q are in degrees.
//!
//! - a = 0, e = 0 looks along -y with z up: the viewer stands at +y, and +x is on the LEFT (r = d x u = -x).
//! - The azimuth turns the viewer about z, counter-clockwise seen from +z: at a = 90 the viewer stands at -x and looks
//!   along +x. A positive elevation raises the viewer, who then looks down.
//! - At e = +90 the viewer looks along -z with up = where the viewer at e = 0 looked; at e = -90 along +z with up = where
//!   that viewer stood. Both are what the formulas below give by continuity.
//! - The roll turns the image counter-clockwise as the viewer sees it: at q = 90 what was on the right is at the top.
//!
//! ```text
//! d  = ( sin a cos e, -cos a cos e, -sin e)
//! u0 = ( sin a sin e, -cos a sin e,  cos e)
//! r0 = d x u0 = (-cos a, -sin a, 0)
//! r  = cos q r0 - sin q u0
//! u  = sin q r0 + cos q u0
//! ```

/// Where the voxels are; triples are in the order x, y, z.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    /// Number of voxels along x, y, z.
    pub(crate) dims: [usize; 3],
    /// World units between neighbours.
    pub(crate) spacing: [f64; 3],
    /// World position of voxel (0, 0, 0).
    pub(crate) origin: [f64; 3],
}

impl Lattice {
    /// Number of voxels.
    pub(crate) fn voxels(&self) -> usize {
        self.dims[0] * self.dims[1] * self.dims[2]
    }

    /// World position of voxel (i, j, k) along (x, y, z).
    pub(crate) fn position(&self, [i, j, k]: [usize; 3]) -> [f64; 3] {
        [
            self.origin[0] + self.spacing[0] * i as f64,
            self.origin[1] + self.spacing[1] * j as f64,
            self.origin[2] + self.spacing[2] * k as f64,
        ]
    }

    /// World positions of all voxels in array order: x fastest, then y, then z (section 2).
    pub(crate) fn positions(&self) -> Vec<[f64; 3]> {
        let mut positions = Vec::new();
        for k in 0..self.dims[2] {
            for j in 0..self.dims[1] {
                for i in 0..self.dims[0] {
                    positions.push(self.position([i, j, k]));
                }
            }
        }
        positions
    }

    /// World positions of the 8 corner voxels.
    pub(crate) fn corners(&self) -> Vec<[f64; 3]> {
        let mut corners = Vec::new();
        for k in [0, self.dims[2] - 1] {
            for j in [0, self.dims[1] - 1] {
                for i in [0, self.dims[0] - 1] {
                    corners.push(self.position([i, j, k]));
                }
            }
        }
        corners
    }

    /// The middle between the first and the last voxel.
    pub(crate) fn middle(&self) -> [f64; 3] {
        let first = self.position([0, 0, 0]);
        let last = self.position([self.dims[0] - 1, self.dims[1] - 1, self.dims[2] - 1]);
        [(first[0] + last[0]) / 2.0, (first[1] + last[1]) / 2.0, (first[2] + last[2]) / 2.0]
    }
}

/// Everything that an image depends on besides the volume.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// Degrees about z, counter-clockwise seen from +z.
    pub(crate) azimuth: f64,
    /// Degrees above the x, y plane.
    pub(crate) elevation: f64,
    /// Degrees by which the image is turned counter-clockwise as the viewer sees it.
    pub(crate) roll: f64,
    /// W, pixels.
    pub(crate) width: usize,
    /// H, pixels.
    pub(crate) height: usize,
    /// s, pixels per world unit.
    pub(crate) scale: f64,
    /// c, the world point shown at the centre of the image; the middle of the lattice if none.
    pub(crate) center: Option<[f64; 3]>,
    /// Standard deviation of the kernel in world units.
    pub(crate) sigma: f64,
    /// Attenuation per world unit.
    pub(crate) tau: f64,
}

/// The orthonormal directions of a view, r = d x u.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Directions {
    /// Where the viewer looks.
    pub(crate) d: [f64; 3],
    /// To the right in the image.
    pub(crate) r: [f64; 3],
    /// To the top of the image.
    pub(crate) u: [f64; 3],
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Section 2, the angles in words made formulas; see the head of this file.
pub(crate) fn directions(azimuth: f64, elevation: f64, roll: f64) -> Directions {
    let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
    let (sin_e, cos_e) = elevation.to_radians().sin_cos();
    let (sin_q, cos_q) = roll.to_radians().sin_cos();
    let d = [sin_a * cos_e, -cos_a * cos_e, -sin_e];
    let u0 = [sin_a * sin_e, -cos_a * sin_e, cos_e];
    let r0 = cross(d, u0);
    let r = [0, 1, 2].map(|axis| cos_q * r0[axis] - sin_q * u0[axis]);
    let u = [0, 1, 2].map(|axis| sin_q * r0[axis] + cos_q * u0[axis]);
    Directions { d, r, u }
}

/// Section 2: x and y of a world point in pixels from the top left corner of the image (pixel (a, b) has its centre at
/// (a + 1/2, b + 1/2)), and z, the world length behind the nearest corner voxel.
pub(crate) fn project(lattice: &Lattice, view: &View, point: [f64; 3]) -> [f64; 3] {
    let Directions { d, r, u } = directions(view.azimuth, view.elevation, view.roll);
    let c = view.center.unwrap_or(lattice.middle());
    let mut nearest = f64::INFINITY;
    for corner in lattice.corners() {
        nearest = nearest.min(dot(d, minus(corner, c)));
    }
    let x = view.width as f64 / 2.0 + view.scale * dot(r, minus(point, c));
    let y = view.height as f64 / 2.0 - view.scale * dot(u, minus(point, c));
    let z = dot(d, minus(point, c)) - nearest;
    [x, y, z]
}

mod tests {
    use super::*;

    fn assert_close(found: [f64; 3], expected: [f64; 3]) {
        for axis in 0..3 {
            assert!((found[axis] - expected[axis]).abs() < 1e-12, "found {found:?}, expected {expected:?}");
        }
    }

    #[track_caller]
    fn assert_directions(angles: [f64; 3], d: [f64; 3], r: [f64; 3], u: [f64; 3]) {
        let found = directions(angles[0], angles[1], angles[2]);
        assert_close(found.d, d);
        assert_close(found.r, r);
        assert_close(found.u, u);
    }

    #[test]
    fn viewer_at_plus_y_has_plus_x_on_the_left() {
        assert_directions([0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn azimuth_turns_counter_clockwise_seen_from_plus_z() {
        // -y turned by 90 degrees counter-clockwise about z is +x; the right hand then points along -y.
        assert_directions([90.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]);
        assert_directions([180.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        assert_directions([-90.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn up_at_the_poles_is_continued_from_below() {
        assert_directions([0.0, 90.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]);
        assert_directions([0.0, -90.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        assert_directions([90.0, 90.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]);
        for azimuth in [0.0, 37.0, 200.0] {
            for pole in [90.0, -90.0] {
                let at = directions(azimuth, pole, 0.0);
                let near = directions(azimuth, pole * (1.0 - 1e-9), 0.0);
                assert!(dot(at.u, near.u) > 1.0 - 1e-12 && dot(at.r, near.r) > 1.0 - 1e-12);
            }
        }
    }

    #[test]
    fn roll_brings_the_right_to_the_top() {
        // Unrolled, the right is -x; after a roll of 90 degrees -x is up and what was up, z, is on the left.
        assert_directions([0.0, 0.0, 90.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]);
        assert_directions([0.0, 0.0, 180.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
    }

    #[test]
    fn directions_are_orthonormal_and_right_is_d_cross_u() {
        for azimuth in [-170.0, -33.0, 0.0, 12.5, 90.0, 211.0] {
            for elevation in [-90.0, -41.0, 0.0, 7.0, 90.0] {
                for roll in [-100.0, 0.0, 30.0] {
                    let Directions { d, r, u } = directions(azimuth, elevation, roll);
                    assert_close([dot(d, d), dot(r, r), dot(u, u)], [1.0, 1.0, 1.0]);
                    assert_close([dot(d, r), dot(r, u), dot(u, d)], [0.0, 0.0, 0.0]);
                    assert_close(cross(d, u), r);
                }
            }
        }
    }

    const LATTICE: Lattice = Lattice { dims: [5, 3, 2], spacing: [1.0, 2.0, 3.0], origin: [10.0, 20.0, 30.0] };

    fn view(azimuth: f64, elevation: f64) -> View {
        let (width, height) = (100, 60);
        View { azimuth, elevation, roll: 0.0, width, height, scale: 4.0, center: None, sigma: 1.0, tau: 0.0 }
    }

    #[test]
    fn hand_computed_projections() {
        // The middle of the lattice is (12, 22, 31.5), its half extents are (2, 2, 1.5).
        assert_close(LATTICE.middle(), [12.0, 22.0, 31.5]);
        let last = [14.0, 24.0, 33.0];
        assert_close(project(&LATTICE, &view(0.0, 0.0), LATTICE.middle()), [50.0, 30.0, 2.0]);
        assert_close(project(&LATTICE, &view(0.0, 0.0), last), [42.0, 24.0, 0.0]);
        assert_close(project(&LATTICE, &view(90.0, 0.0), last), [42.0, 24.0, 4.0]);
        assert_close(project(&LATTICE, &view(0.0, 90.0), last), [42.0, 38.0, 0.0]);
        assert_close(project(&LATTICE, &view(0.0, -90.0), last), [42.0, 22.0, 3.0]);
        // At 45 degrees d = (1, -1, 0) / sqrt 2: the nearest corners have the smallest x and the largest y.
        let half = 0.5_f64.sqrt();
        assert_close(project(&LATTICE, &view(45.0, 0.0), last), [50.0 - 16.0 * half, 24.0, 4.0 * half]);
    }

    #[test]
    fn another_center_moves_the_picture_but_not_the_depth() {
        let moved = View { center: Some([14.0, 24.0, 33.0]), ..view(0.0, 0.0) };
        assert_close(project(&LATTICE, &moved, [14.0, 24.0, 33.0]), [50.0, 30.0, 0.0]);
        assert_close(project(&LATTICE, &moved, LATTICE.middle()), [58.0, 36.0, 2.0]);
    }

    #[test]
    fn positions_and_corners_are_in_array_order() {
        let positions = LATTICE.positions();
        assert_eq!(positions.len(), LATTICE.voxels());
        assert_close(positions[1], [11.0, 20.0, 30.0]);
        assert_close(positions[5], [10.0, 22.0, 30.0]);
        assert_close(positions[15], [10.0, 20.0, 33.0]);
        assert_eq!(LATTICE.corners().len(), 8);
        assert_close(LATTICE.corners()[7], positions[29]);
    }
}
