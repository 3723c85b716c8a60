//! A hot plume that rises through still air, by the method of Stam (Stable Fluids, SIGGRAPH 1999) with the confinement of
//! vortices of Fedkiw, Stam and Jensen (Visual Simulation of Smoke, SIGGRAPH 2001): an archive of computed flow, made in
//! seconds.
//!
//! A step of dt adds buoyancy and confinement to the velocity u, makes it free of divergence, and moves u and the smoke s
//! along u:
//!
//! ```text
//! u += dt (b s e_z + c h (N x w)),  w = curl u,  N = grad |w| / |grad |w||
//! u -= grad p,  laplace p = div u                      (Jacobi's iteration, from the last step's p)
//! u, s <- their values at x - dt u(x)                  (MacCormack)
//! ```
//!
//! Lengths are in voxels and times in frames. Beyond the faces, values are those on the faces. All is f32 and only adds,
//! multiplies, divides and takes roots, so that every machine computes the same bits.

use rayon::prelude::*;

/// The part of a frame that a step takes.
const DT: f32 = 0.25;
/// The acceleration by smoke of density 1.
const BUOYANCY: f32 = 0.25;
/// The strength of confinement.
const CONFINEMENT: f32 = 0.06;
const ITERATIONS: usize = 30;
/// Of the box's shorter side: the radius of the source, and its height above the floor.
const SOURCE: [f32; 2] = [0.14, 0.14];
/// The source moves around the middle, by this share of its radius, so that the plume bends.
const WANDER: f32 = 0.5;

/// A number for each voxel, x fastest, then y, then z.
type Field = Vec<f32>;

/// The density of smoke, 0 to 1, at the voxels of `frames` instants.
pub fn plume(dims: [usize; 3], frames: usize) -> impl Iterator<Item = Vec<f32>> {
    let mut flow = Flow::new(dims);
    (0..frames).map(move |_| {
        (0..(1.0 / DT) as usize).for_each(|_| flow.advance());
        flow.smoke.clone()
    })
}

struct Flow {
    dims: [usize; 3],
    velocity: [Field; 3],
    smoke: Field,
    pressure: Field,
    steps: usize,
}

impl Flow {
    fn new(dims: [usize; 3]) -> Self {
        let zero = || vec![0.0; dims.iter().product()];
        Self { dims, velocity: [zero(), zero(), zero()], smoke: zero(), pressure: zero(), steps: 0 }
    }

    fn advance(&mut self) {
        self.emit();
        self.accelerate();
        self.project();
        let dims = self.dims;
        let [from, to] = [-DT, DT].map(|dt| each(dims, |at| place(dims, &self.velocity, at, dt)));
        for field in self.velocity.iter_mut().chain([&mut self.smoke]) {
            *field = transported(dims, field, &from, &to);
        }
        self.steps += 1;
    }

    /// Fills the source with smoke.
    fn emit(&mut self) {
        let side = self.dims[0].min(self.dims[1]) as f32;
        let [radius, height] = SOURCE.map(|share| share * side);
        let [right, back] = on_circle(self.steps).map(|c| WANDER * radius * c);
        let centre = [0.5 * self.dims[0] as f32 + right, 0.5 * self.dims[1] as f32 + back, height];
        let inside = |[x, y, z]: [usize; 3]| {
            let off = [x as f32 - centre[0], y as f32 - centre[1], 1.5 * (z as f32 - centre[2])];
            off.iter().map(|d| d * d).sum::<f32>() < radius * radius
        };
        let smoke = each(self.dims, |at| if inside(at) { 1.0 } else { self.smoke[index(self.dims, at)] });
        self.smoke = smoke;
    }

    /// Adds buoyancy and confinement to the velocity.
    fn accelerate(&mut self) {
        let (dims, [u, v, w]) = (self.dims, &self.velocity);
        let curl = each(dims, |at| {
            let slope = |field: &Field, axis: usize| slope(dims, field, at, axis);
            [slope(w, 1) - slope(v, 2), slope(u, 2) - slope(w, 0), slope(v, 0) - slope(u, 1)]
        });
        let length: Field = curl.iter().map(|curl| norm(*curl)).collect();
        let force = each(dims, |at| {
            let gradient = [0, 1, 2].map(|axis| slope(dims, &length, at, axis));
            let (steepness, [x, y, z]) = (norm(gradient) + 1e-6, curl[index(dims, at)]);
            let [a, b, c] = gradient.map(|g| g / steepness);
            let [x, y, z] = [b * z - c * y, c * x - a * z, a * y - b * x].map(|confined| CONFINEMENT * confined);
            [x, y, z + BUOYANCY * self.smoke[index(dims, at)]]
        });
        for (axis, field) in self.velocity.iter_mut().enumerate() {
            field.iter_mut().zip(&force).for_each(|(speed, force)| *speed += DT * force[axis]);
        }
    }

    /// Makes the velocity free of divergence, nearly.
    fn project(&mut self) {
        let (dims, velocity) = (self.dims, &self.velocity);
        let divergence: Field =
            each(dims, |at| [0, 1, 2].map(|axis| slope(dims, &velocity[axis], at, axis)).iter().sum());
        for _ in 0..ITERATIONS {
            let pressure = &self.pressure;
            self.pressure = each(dims, |at| (around(dims, pressure, at) - divergence[index(dims, at)]) / 6.0);
        }
        let pressure = &self.pressure;
        let next =
            [0, 1, 2].map(|axis| each(dims, |at| velocity[axis][index(dims, at)] - slope(dims, pressure, at, axis)));
        self.velocity = next;
    }
}

/// Where the source is on a circle of radius 1, which it goes around in twice `HALF` steps: the rational form of sine and
/// cosine gives half of the circle, and the other half has the opposite signs.
fn on_circle(step: usize) -> [f32; 2] {
    const HALF: usize = 64;
    let t = 2.0 * (step % HALF) as f32 / HALF as f32 - 1.0;
    let sign = if (step / HALF).is_multiple_of(2) { 1.0 } else { -1.0 };
    [1.0 - t * t, 2.0 * t].map(|c| sign * c / (1.0 + t * t))
}

/// What `value` gives for each voxel.
fn each<T: Copy + Default + Send>(dims: [usize; 3], value: impl Fn([usize; 3]) -> T + Sync) -> Vec<T> {
    let [nx, ny, _] = dims;
    let mut field = vec![T::default(); dims.iter().product()];
    field.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slab)| {
        for (y, row) in slab.chunks_exact_mut(nx).enumerate() {
            row.iter_mut().enumerate().for_each(|(x, out)| *out = value([x, y, z]));
        }
    });
    field
}

fn index(dims: [usize; 3], [x, y, z]: [usize; 3]) -> usize {
    (z * dims[1] + y) * dims[0] + x
}

fn norm(v: [f32; 3]) -> f32 {
    v.iter().map(|c| c * c).sum::<f32>().sqrt()
}

/// The two neighbours along an axis.
fn neighbours(dims: [usize; 3], field: &Field, at: [usize; 3], axis: usize) -> [f32; 2] {
    let value = |c: usize| field[index(dims, std::array::from_fn(|a| if a == axis { c } else { at[a] }))];
    [value(at[axis].saturating_sub(1)), value((at[axis] + 1).min(dims[axis] - 1))]
}

/// The central difference along an axis.
fn slope(dims: [usize; 3], field: &Field, at: [usize; 3], axis: usize) -> f32 {
    let [before, after] = neighbours(dims, field, at, axis);
    0.5 * (after - before)
}

/// The sum of the six neighbours.
fn around(dims: [usize; 3], field: &Field, at: [usize; 3]) -> f32 {
    (0..3).map(|axis| neighbours(dims, field, at, axis).iter().sum::<f32>()).sum()
}

/// The field after a step, by MacCormack's scheme: the error of a step there and back is halved and taken away, but no
/// value leaves the range of those around the place that it comes from. `from` and `to` are where what is at each voxel
/// was one step before, and will be one step later.
fn transported(dims: [usize; 3], field: &Field, from: &[[f32; 3]], to: &[[f32; 3]]) -> Field {
    let there = each(dims, |at| sample(dims, field, from[index(dims, at)]));
    let back = each(dims, |at| sample(dims, &there, to[index(dims, at)]));
    each(dims, |at| {
        let i = index(dims, at);
        let around = corners(dims, field, from[i]);
        let [low, high] = [f32::min, f32::max].map(|end| around.into_iter().fold(around[0], end));
        (there[i] + 0.5 * (field[i] - back[i])).clamp(low, high)
    })
}

/// Where the flow carries what is at a voxel within the time `dt`.
fn place(dims: [usize; 3], velocity: &[Field; 3], at: [usize; 3], dt: f32) -> [f32; 3] {
    std::array::from_fn(|axis| {
        let to = at[axis] as f32 + dt * velocity[axis][index(dims, at)];
        to.clamp(0.0, (dims[axis] - 1) as f32)
    })
}

/// The lowest of the eight voxels around a place.
fn low(dims: [usize; 3], place: [f32; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| (place[axis] as usize).min(dims[axis] - 2))
}

/// The values of the eight voxels around a place.
fn corners(dims: [usize; 3], field: &Field, place: [f32; 3]) -> [f32; 8] {
    let first = index(dims, low(dims, place));
    std::array::from_fn(|n| field[first + (n & 1) + (n >> 1 & 1) * dims[0] + (n >> 2) * dims[0] * dims[1]])
}

/// The value between eight voxels.
fn sample(dims: [usize; 3], field: &Field, place: [f32; 3]) -> f32 {
    let (low, v) = (low(dims, place), corners(dims, field, place));
    let share: [f32; 3] = std::array::from_fn(|axis| place[axis] - low[axis] as f32);
    let mix = |a: f32, b: f32, axis: usize| a + share[axis] * (b - a);
    let row = |n: usize| mix(v[n], v[n + 1], 0);
    mix(mix(row(0), row(2), 1), mix(row(4), row(6), 1), 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIMS: [usize; 3] = [24, 20, 32];

    /// The mean height of all smoke, in voxels.
    fn height(smoke: &Field) -> f32 {
        let level = |z: usize| smoke[z * DIMS[0] * DIMS[1]..][..DIMS[0] * DIMS[1]].iter().sum::<f32>();
        (0..DIMS[2]).map(|z| z as f32 * level(z)).sum::<f32>() / smoke.iter().sum::<f32>()
    }

    #[test]
    fn smoke_rises_and_stays_within_0_and_1() {
        let frames: Vec<Field> = plume(DIMS, 12).collect();
        assert!(frames.iter().flatten().all(|s| (0.0..=1.0).contains(s)));
        assert!(frames.windows(2).skip(2).all(|pair| height(&pair[0]) < height(&pair[1])));
        assert_eq!(frames, plume(DIMS, 12).collect::<Vec<_>>());
    }

    #[test]
    fn the_source_goes_around_a_circle_without_jumps() {
        let off = |[a, b]: [[f32; 2]; 2]| ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sqrt();
        for step in 0..256 {
            let [here, next, opposite] = [0, 1, 64].map(|later| on_circle(step + later));
            assert!(
                (off([here, [0.0; 2]]) - 1.0).abs() < 1e-6 && off([here, next]) < 0.07,
                "{step}: {here:?} {next:?}"
            );
            assert_eq!(here, opposite.map(|c| -c), "{step}");
        }
    }

    #[test]
    fn projection_takes_divergence_away() {
        let mut flow = Flow::new(DIMS);
        let squared = |at: [usize; 3]| (0..3).map(|a| (at[a] as f32 - DIMS[a] as f32 / 2.0).powi(2)).sum::<f32>();
        flow.velocity[2] = each(DIMS, |at| (-squared(at) / 18.0).exp()); // a jet
        let rough = |flow: &Flow| {
            let divergence =
                |at: [usize; 3]| (0..3).map(|axis| slope(DIMS, &flow.velocity[axis], at, axis)).sum::<f32>();
            each(DIMS, divergence).iter().map(|d| d * d).sum::<f32>()
        };
        let before = rough(&flow);
        flow.project();
        assert!(rough(&flow) < 0.3 * before, "{} of {before}", rough(&flow));
    }

    #[test]
    fn a_uniform_wind_carries_smoke_by_whole_voxels() {
        let wind = [1.0, 0.0, 0.0].map(|speed| vec![speed / DT; DIMS.iter().product()]);
        let spot = each(DIMS, |at| if at == [7, 9, 11] { 1.0 } else { 0.0 });
        let [from, to] = [-DT, DT].map(|dt| each(DIMS, |at| place(DIMS, &wind, at, dt)));
        assert_eq!(transported(DIMS, &spot, &from, &to), each(DIMS, |at| if at == [8, 9, 11] { 1.0 } else { 0.0 }));
    }
}
