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
        let (dims, velocity) = (self.dims, &self.velocity);
        let moved = |field: &Field| transported(dims, field, velocity);
        let (next, smoke) = ([0, 1, 2].map(|axis| moved(&velocity[axis])), moved(&self.smoke));
        (self.velocity, self.smoke) = (next, smoke);
        self.steps += 1;
    }

    /// Fills the source with smoke.
    fn emit(&mut self) {
        let [side, middle] = [self.dims[0].min(self.dims[1]) as f32, 0.5];
        let [radius, height] = SOURCE.map(|share| share * side);
        // A point on a circle, by the rational form of sine and cosine.
        let t = (self.steps % 64) as f32 / 32.0 - 1.0;
        let around = [(1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t)].map(|c| WANDER * radius * c);
        let centre = [middle * self.dims[0] as f32 + around[0], middle * self.dims[1] as f32 + around[1], height];
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
        let curl: [Field; 3] = [
            each(dims, |at| slope(dims, w, at, 1) - slope(dims, v, at, 2)),
            each(dims, |at| slope(dims, u, at, 2) - slope(dims, w, at, 0)),
            each(dims, |at| slope(dims, v, at, 0) - slope(dims, u, at, 1)),
        ];
        let length: Field = each(dims, |at| norm([0, 1, 2].map(|axis| curl[axis][index(dims, at)])));
        let towards = |at: [usize; 3]| {
            let gradient = [0, 1, 2].map(|axis| slope(dims, &length, at, axis));
            gradient.map(|g| g / (norm(gradient) + 1e-6))
        };
        let force = |at: [usize; 3], axis: usize| {
            let (n, [a, b]) = (towards(at), [(axis + 1) % 3, (axis + 2) % 3]);
            let confined = n[a] * curl[b][index(dims, at)] - n[b] * curl[a][index(dims, at)];
            CONFINEMENT * confined + if axis == 2 { BUOYANCY * self.smoke[index(dims, at)] } else { 0.0 }
        };
        let next = [0, 1, 2].map(|axis| each(dims, |at| self.velocity[axis][index(dims, at)] + DT * force(at, axis)));
        self.velocity = next;
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

/// A field of the values that `value` gives for voxels.
fn each(dims: [usize; 3], value: impl Fn([usize; 3]) -> f32 + Sync) -> Field {
    let [nx, ny, _] = dims;
    let mut field = vec![0.0; dims.iter().product()];
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

/// The field after a step along the velocity, by MacCormack's scheme: the error of a step there and back is halved and
/// taken away, but no value leaves the range of those around the place that it comes from.
fn transported(dims: [usize; 3], field: &Field, velocity: &[Field; 3]) -> Field {
    let there = each(dims, |at| sample(dims, field, place(dims, velocity, at, -DT)));
    let back = each(dims, |at| sample(dims, &there, place(dims, velocity, at, DT)));
    each(dims, |at| {
        let around = corners(dims, field, place(dims, velocity, at, -DT));
        let (low, high) = (around.iter().copied().reduce(f32::min), around.iter().copied().reduce(f32::max));
        let i = index(dims, at);
        (there[i] + 0.5 * (field[i] - back[i])).clamp(low.unwrap_or(0.0), high.unwrap_or(0.0))
    })
}

/// Where that which is at a voxel is after the time `dt`.
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
        assert_eq!(transported(DIMS, &spot, &wind), each(DIMS, |at| if at == [8, 9, 11] { 1.0 } else { 0.0 }));
    }
}
