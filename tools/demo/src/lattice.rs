//! Finite differences on a regular lattice: the diffusion step, derivatives, the curl.

/// Points with the same spacing along x, y, z; a field over it is an array with x fastest, then y, then z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// Number of points along x, y, z; at least 3 each.
    pub dims: [usize; 3],
    /// Metres between neighbours.
    pub spacing: f64,
}

impl Lattice {
    /// Number of points.
    pub fn points(&self) -> usize {
        self.dims.iter().product()
    }

    /// How far apart in the array the neighbours along an axis stand.
    pub fn stride(&self, axis: usize) -> usize {
        self.dims[..axis].iter().product()
    }

    /// The coordinates, counted in points, of the point at a place of the array.
    pub fn coordinates(&self, index: usize) -> [usize; 3] {
        std::array::from_fn(|a| index / self.stride(a) % self.dims[a])
    }

    /// Metres from point (0, 0, 0) to the point at a place of the array.
    pub fn position(&self, index: usize) -> [f64; 3] {
        self.coordinates(index).map(|c| c as f64 * self.spacing)
    }

    /// Metres between the first and the last point along an axis.
    pub fn length(&self, axis: usize) -> f64 {
        (self.dims[axis] - 1) as f64 * self.spacing
    }

    /// Places of the array on the six faces, ascending.
    pub fn faces(&self) -> impl Iterator<Item = usize> + use<> {
        let lattice = *self;
        (0..self.points()).filter(move |&i| {
            let c = lattice.coordinates(i);
            (0..3).any(|a| c[a] == 0 || c[a] + 1 == lattice.dims[a])
        })
    }

    /// One explicit step (FTCS) of du/dt = D laplace(u) on all points but the faces, which `to` keeps.
    ///
    /// `to = from + number * (sum of the 6 neighbours - 6 from)` with `number` = D dt / spacing^2. The scheme is
    /// stable for `number` <= 1/6 (von Neumann) and then obeys the maximum principle.
    pub fn diffuse(&self, number: f64, from: &[f64], to: &mut [f64]) {
        let [nx, ny, nz] = self.dims;
        for z in 1..nz - 1 {
            for y in 1..ny - 1 {
                let start = (z * ny + y) * nx;
                self.diffuse_row(number, from, start, &mut to[start + 1..start + nx - 1]);
            }
        }
    }

    /// The step of one x-row that begins at `start`, into the row without its two ends.
    fn diffuse_row(&self, number: f64, from: &[f64], start: usize, out: &mut [f64]) {
        let n = out.len();
        let row = |first: usize| &from[first..][..n];
        let (here, west, east) = (row(start + 1), row(start), row(start + 2));
        let (south, north) = (row(start + 1 - self.stride(1)), row(start + 1 + self.stride(1)));
        let (below, above) = (row(start + 1 - self.stride(2)), row(start + 1 + self.stride(2)));
        for x in 0..n {
            let around = (west[x] + east[x]) + (south[x] + north[x]) + (below[x] + above[x]);
            out[x] = here[x] + number * (around - 6.0 * here[x]);
        }
    }

    /// The derivative along an axis, per metre: second-order, central inside and one-sided at the ends.
    pub fn derivative(&self, field: &[f64], axis: usize) -> Vec<f64> {
        let (stride, last, scale) = (self.stride(axis), self.dims[axis] - 1, 0.5 / self.spacing);
        let at = |i: usize| match i / stride % (last + 1) {
            0 => 4.0 * field[i + stride] - 3.0 * field[i] - field[i + 2 * stride],
            c if c == last => 3.0 * field[i] - 4.0 * field[i - stride] + field[i - 2 * stride],
            _ => field[i + stride] - field[i - stride],
        };
        (0..field.len()).map(|i| scale * at(i)).collect()
    }

    /// The curl of a vector field: component a is d(f_c)/db - d(f_b)/dc, with a, b, c cyclic.
    pub fn curl(&self, field: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        std::array::from_fn(|a| {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            let (plus, minus) = (self.derivative(&field[c], b), self.derivative(&field[b], c));
            plus.iter().zip(&minus).map(|(p, m)| p - m).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const NUMBER: f64 = 0.15; // D dt / dx^2, 0.9 of the limit
    const DIFFUSIVITY: f64 = 0.02;

    /// `start` after `steps` steps with its faces held.
    fn evolve(lattice: &Lattice, start: Vec<f64>, steps: usize) -> Vec<f64> {
        let (mut from, mut to) = (start.clone(), start);
        for _ in 0..steps {
            lattice.diffuse(NUMBER, &from, &mut to);
            std::mem::swap(&mut from, &mut to);
        }
        from
    }

    fn time(lattice: &Lattice, steps: usize) -> f64 {
        steps as f64 * NUMBER * lattice.spacing.powi(2) / DIFFUSIVITY
    }

    /// Largest error of the decay of sin sin sin on a box of 0.04 x 0.02 x 0.03 m, relative to the exact peak.
    fn eigenmode_error(refinement: usize, steps: usize) -> f64 {
        let lattice = Lattice { dims: [8, 4, 6].map(|n| n * refinement + 1), spacing: 0.005 / refinement as f64 };
        let mode = |i| {
            let p = lattice.position(i);
            (0..3).map(|a| libm::sin(PI * p[a] / lattice.length(a))).product::<f64>()
        };
        let start: Vec<f64> = (0..lattice.points()).map(mode).collect();
        let rate = DIFFUSIVITY * PI * PI * (0..3).map(|a| lattice.length(a).powi(-2)).sum::<f64>();
        let decay = libm::exp(-rate * time(&lattice, steps));
        let end = evolve(&lattice, start.clone(), steps);
        end.iter().zip(&start).map(|(e, s)| (e / decay - s).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn an_eigenmode_decays_as_it_should_and_the_error_is_of_second_order() {
        let errors = [(2, 20), (4, 80), (8, 320)].map(|(refinement, steps)| eigenmode_error(refinement, steps));
        assert!(errors[1] < 0.03 && errors[2] < 0.008, "{errors:?}");
        for pair in errors.windows(2) {
            assert!((3.5..4.7).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
    }

    /// u(s, t) for a slab 0 <= s <= 1 at rest whose faces jump to 1; t in units of length^2 / D
    /// (Carslaw & Jaeger, Conduction of Heat in Solids, 3.4).
    fn slab(s: f64, t: f64) -> f64 {
        let term = |n: i32| {
            let k = f64::from(2 * n + 1) * PI;
            4.0 / k * libm::sin(k * s) * libm::exp(-k * k * t)
        };
        1.0 - (0..200).map(term).sum::<f64>()
    }

    #[test]
    fn a_step_diffuses_into_a_slab_as_the_series_says() {
        let lattice = Lattice { dims: [65, 65, 17], spacing: 0.001 };
        let mut start = vec![0.0; lattice.points()];
        lattice.faces().for_each(|i| start[i] = 1.0);
        for steps in [60, 170] {
            let end = evolve(&lattice, start.clone(), steps);
            let t = time(&lattice, steps) * DIFFUSIVITY / lattice.length(2).powi(2);
            for z in 0..17 {
                let (u, exact) = (end[(z * 65 + 32) * 65 + 32], slab(z as f64 / 16.0, t));
                assert!((u - exact).abs() < 3e-3, "steps {steps}, z {z}: {u} for {exact}");
            }
        }
    }

    #[test]
    fn the_step_keeps_a_linear_field_and_the_faces() {
        let lattice = Lattice { dims: [5, 6, 7], spacing: 0.5 };
        let linear = |i| lattice.position(i).iter().zip([1.0, -2.0, 3.0]).map(|(p, k)| k * p).sum::<f64>();
        let start: Vec<f64> = (0..lattice.points()).map(linear).collect();
        let end = evolve(&lattice, start.clone(), 10);
        assert!(start.iter().zip(&end).all(|(s, e)| (s - e).abs() < 1e-12));
        assert!(lattice.faces().all(|i| start[i] == end[i]));
        assert_eq!(lattice.faces().count(), 5 * 6 * 7 - 3 * 4 * 5);
    }

    #[test]
    fn the_curl_of_a_linear_field_is_exact() {
        let lattice = Lattice { dims: [3, 4, 5], spacing: 0.25 };
        let m = [[1.0, 2.0, -3.0], [4.0, -5.0, 6.0], [7.0, 8.0, 9.0]];
        let field = [0, 1, 2].map(|c: usize| {
            let at = |i| lattice.position(i).iter().zip(m[c]).map(|(p, k)| k * p).sum::<f64>();
            (0..lattice.points()).map(at).collect::<Vec<_>>()
        });
        for (component, expected) in lattice.curl(&field).iter().zip([2.0, -10.0, 2.0]) {
            assert!(component.iter().all(|&v| v == expected), "{component:?}");
        }
    }
}
