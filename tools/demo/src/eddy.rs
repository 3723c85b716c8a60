//! Eddy currents in a conducting plate under a passing magnet: the demo's archive, computed from physics.
//!
//! In a uniform conductor without displacement current, Maxwell's equations with J = sigma E give
//! dH/dt = D laplace(H) with D = 1 / (mu0 sigma) (Jackson, Classical Electrodynamics, 3rd ed., 5.18) for every
//! Cartesian component, and J = curl H. The magnet is a point dipole with a vertical moment that passes above the
//! plate at a constant speed. On the plate's faces H is the dipole's field: what the currents add to the field
//! outside is neglected. That makes the currents too strong, but leaves their rings, their skin effect and their
//! decay; and since the field of a dipole has no curl, no current crosses a face.
//!
//! SI units throughout: metres, seconds, A/m for H, A/m^2 for J. x is the way of the magnet, z points up.

use crate::lattice::Lattice;
use std::f64::consts::PI;

/// The magnetic constant, H/m (before 2019 exact; off by 1e-10 since).
const MU_0: f64 = 4e-7 * PI;

/// How much of the stable step, spacing^2 / (6 D), is used.
const STEP_SAFETY: f64 = 0.9;

/// A conducting plate with samples on a lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    /// Number of samples along x, y, z; at least 3 each.
    pub dims: [usize; 3],
    /// Metres between samples.
    pub spacing: f64,
    /// S/m.
    pub conductivity: f64,
}

impl Default for Plate {
    /// Aluminium, 150 x 150 x 40 mm, sampled every 2 mm.
    fn default() -> Self {
        Self { dims: [75, 75, 20], spacing: 2e-3, conductivity: 3.5e7 }
    }
}

impl Plate {
    /// The diffusivity of the magnetic field, 1 / (mu0 sigma), m^2/s.
    pub fn diffusivity(&self) -> f64 {
        1.0 / (MU_0 * self.conductivity)
    }

    fn lattice(&self) -> Lattice {
        Lattice { dims: self.dims, spacing: self.spacing }
    }
}

/// A magnet that passes above the plate along x, over the middle of its width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnet {
    /// The moment along z, A m^2.
    pub moment: f64,
    /// Metres from the top face to the magnet's centre; at least about 4 spacings, or the lattice cannot resolve it.
    pub height: f64,
    /// m/s.
    pub speed: f64,
    /// Metres before the plate at which it starts, and behind the plate at which it ends.
    pub overrun: f64,
}

impl Default for Magnet {
    /// A ball of 16 mm of NdFeB (1e6 A/m), 12 mm above the plate, at 10 m/s. Outside, a uniformly magnetised ball
    /// has exactly a dipole's field.
    fn default() -> Self {
        Self { moment: 2.1, height: 12e-3, speed: 10.0, overrun: 45e-3 }
    }
}

/// The field H, A/m, at `r` metres from a dipole of `moment` A m^2 along z:
/// H = (3 n (n . m) - m) / (4 pi |r|^3) with n = r / |r| (Jackson 5.56).
pub fn dipole_field(moment: f64, r: [f64; 3]) -> [f64; 3] {
    let squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    let strength = moment / (4.0 * PI * squared * squared.sqrt());
    let along = 3.0 * r[2] / squared;
    [strength * along * r[0], strength * along * r[1], strength * (along * r[2] - 1.0)]
}

/// |J| in A/m^2 at the samples of the plate (x fastest, then y, z) at `frames` instants with equal distances.
///
/// The magnet has rested at its start since long ago, so that there is no current yet. It moves through the frames,
/// and arrives at its end at the last of them.
pub fn eddy_currents(plate: Plate, magnet: Magnet, frames: usize) -> impl Iterator<Item = Vec<f32>> {
    let mut solver = Solver::new(plate, magnet, frames);
    (1..=frames).map(move |frame| {
        solver.advance_to_frame(frame);
        solver.current()
    })
}

/// The state of the field, and the buffers for advancing it.
struct Solver {
    lattice: Lattice,
    magnet: Magnet,
    /// Places of the array on the faces.
    faces: Vec<usize>,
    /// H, A/m, by component.
    field: [Vec<f64>; 3],
    /// The next values of one component.
    next: Vec<f64>,
    /// Seconds.
    step: f64,
    /// D dt / spacing^2.
    number: f64,
    steps_per_frame: usize,
    steps_done: usize,
}

impl Solver {
    fn new(plate: Plate, magnet: Magnet, frames: usize) -> Self {
        let lattice = plate.lattice();
        let frame_time = (lattice.length(0) + 2.0 * magnet.overrun) / magnet.speed / frames.max(1) as f64;
        let longest = STEP_SAFETY * plate.spacing.powi(2) / (6.0 * plate.diffusivity());
        let steps_per_frame = libm::ceil(frame_time / longest).max(1.0) as usize;
        let step = frame_time / steps_per_frame as f64;
        let number = plate.diffusivity() * step / plate.spacing.powi(2);
        let (field, next) = (std::array::from_fn(|_| vec![0.0; lattice.points()]), vec![0.0; lattice.points()]);
        let faces = lattice.faces().collect();
        let mut solver = Self { lattice, magnet, faces, field, next, step, number, steps_per_frame, steps_done: 0 };
        (0..lattice.points()).for_each(|i| solver.apply(i));
        solver
    }

    /// Sets H at a place of the array to the magnet's field at this instant.
    fn apply(&mut self, index: usize) {
        let [x, y, z] = self.lattice.position(index);
        let magnet_x = self.magnet.speed * self.step * self.steps_done as f64 - self.magnet.overrun;
        let magnet_z = self.lattice.length(2) + self.magnet.height;
        let r = [x - magnet_x, y - 0.5 * self.lattice.length(1), z - magnet_z];
        let applied = dipole_field(self.magnet.moment, r);
        self.field.iter_mut().zip(applied).for_each(|(component, h)| component[index] = h);
    }

    fn advance(&mut self) {
        self.steps_done += 1;
        for component in &mut self.field {
            self.lattice.diffuse(self.number, component, &mut self.next);
            std::mem::swap(component, &mut self.next);
        }
        for face in 0..self.faces.len() {
            self.apply(self.faces[face]);
        }
    }

    fn advance_to_frame(&mut self, frame: usize) {
        while self.steps_done < frame * self.steps_per_frame {
            self.advance();
        }
    }

    /// |J|, A/m^2.
    fn current(&self) -> Vec<f32> {
        let [x, y, z] = self.lattice.curl(&self.field);
        let norm = |i: usize| (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt() as f32;
        (0..x.len()).map(norm).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A quarter of the resolution of the demo.
    fn small() -> Plate {
        Plate { dims: [38, 38, 11], spacing: 4e-3, ..Plate::default() }
    }

    #[test]
    fn the_dipole_has_its_known_values_and_no_divergence() {
        let expected = 2.0 * 3.0 / (4.0 * PI * 0.125); // 2 m / (4 pi z^3) on the axis
        assert!((dipole_field(3.0, [0.0, 0.0, 0.5])[2] / expected - 1.0).abs() < 1e-14);
        assert!((dipole_field(3.0, [0.3, 0.4, 0.0])[2] / (-0.5 * expected) - 1.0).abs() < 1e-14);
        let (at, d) = ([0.3, -0.2, 0.4], 1e-4);
        let slope = |a: usize| {
            let moved = |s: f64| std::array::from_fn(|b| if a == b { at[b] + s * d } else { at[b] });
            (dipole_field(3.0, moved(1.0))[a] - dipole_field(3.0, moved(-1.0))[a]) / (2.0 * d)
        };
        let slopes = [slope(0), slope(1), slope(2)];
        assert!(slopes.iter().sum::<f64>().abs() < 1e-5 * slopes[2].abs(), "{slopes:?}");
    }

    #[test]
    fn aluminium_has_its_diffusivity() {
        assert!((Plate::default().diffusivity() - 0.022736).abs() < 1e-6);
    }

    #[test]
    fn frames_have_the_plates_size_and_are_the_same_every_time() {
        let run = || eddy_currents(small(), Magnet::default(), 4).collect::<Vec<_>>();
        let frames = run();
        assert_eq!(frames.len(), 4);
        assert!(frames.iter().all(|f| f.len() == 38 * 38 * 11 && f.iter().all(|v| v.is_finite() && *v >= 0.0)));
        assert_eq!(frames, run());
    }

    #[test]
    fn currents_grow_and_decay_and_follow_the_magnet() {
        let peak = |f: &Vec<f32>| f.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        let peaks: Vec<_> = eddy_currents(small(), Magnet::default(), 16).map(|f| peak(&f)).collect();
        assert!(peaks[8].1 > 4.0 * peaks[0].1 && peaks[8].1 > 4.0 * peaks[15].1, "{peaks:?}");
        let x = |frame: usize| peaks[frame].0 % 38;
        assert!(x(5) + 4 < x(8) && x(8) + 4 < x(11), "{peaks:?}");
    }

    #[test]
    fn a_magnet_at_rest_leaves_no_current() {
        let slow = Magnet { speed: 1e-3, overrun: 30e-3, ..Magnet::default() };
        let largest = |m| {
            let mut solver = Solver::new(small(), m, 100_000);
            solver.advance_to_frame(1);
            solver.current().into_iter().fold(0.0, f32::max)
        };
        let fast = eddy_currents(small(), Magnet::default(), 2).next().unwrap().into_iter().fold(0.0, f32::max);
        assert!(largest(slow) < 0.1 * fast, "{} of {fast}", largest(slow));
    }
}
