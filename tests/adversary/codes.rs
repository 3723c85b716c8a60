//! Series at the edges of codes, and at the edge of what may be dropped.

use super::{Target, inverse, targets};
use crate::bounds::{Case, search};
use crate::common::random::Random;
use crate::common::{cases, tried};
use std::time::Instant;
use wavesplat_core::wavelet::{TimeBasis, synthesis};

/// The target of a series.
#[derive(Debug, Clone, Copy)]
enum Aim {
    /// Coefficients half a step from their codes.
    HalfSteps,
    /// All coefficients rounded to the side that moves one sample furthest.
    Aligned,
    /// The decoded values of codes, plus or minus the bound.
    Delta,
    /// Multiples of half the bound or half the step.
    Multiples,
    /// One coefficient whose loss moves a sample by exactly the bound.
    Loss,
    /// A constant, with one sample at exactly the bound from it.
    Flash,
}

const AIMS: [Aim; 6] = [Aim::HalfSteps, Aim::Aligned, Aim::Delta, Aim::Multiples, Aim::Loss, Aim::Flash];

/// A small offset to either side, or none.
fn nudge(x: f64, random: &mut Random) -> f64 {
    match random.below(7) {
        0 => x.next_up(),
        1 => x.next_down(),
        2 => x * (1.0 + 1e-12),
        3 => x * (1.0 - 1e-12),
        4 => x * (1.0 + 1e-7 * random.signed()),
        _ => x,
    }
}

struct Attack<'a> {
    target: &'a Target,
    basis: Box<dyn TimeBasis>,
    functions: Vec<Vec<f64>>,
    step: f64,
}

impl Attack<'_> {
    fn series(&self, aim: Aim, random: &mut Random) -> Vec<f64> {
        let Self { target, basis, step, .. } = self;
        let (delta, frames) = (target.delta(), target.case.frames);
        let base = target.value(random.unit());
        match aim {
            Aim::HalfSteps => {
                let codes = self.codes(base, random);
                let half = |c: f64| nudge((c + [0.0, 0.5, -0.5][random.below(3)]) * step, random);
                inverse(basis.as_ref(), &Vec::from_iter(codes.into_iter().map(half)))
            }
            Aim::Aligned => {
                let (codes, t) = (self.codes(base, random), random.below(frames));
                let side = |(c, u): (f64, &Vec<f64>)| nudge((c + 0.5 * u[t].signum()) * step, random);
                inverse(basis.as_ref(), &Vec::from_iter(codes.into_iter().zip(&self.functions).map(side)))
            }
            Aim::Delta => {
                let codes = Vec::from_iter(self.codes(base, random).into_iter().map(|c| c * step));
                let moved = |v: f64| v + nudge([delta, -delta, 0.0, 2.0 * delta][random.below(4)], random);
                inverse(basis.as_ref(), &codes).into_iter().map(moved).collect()
            }
            Aim::Multiples => {
                let unit = [delta, *step][random.below(2)] / 2.0;
                let of = |_| nudge((base / unit).round() * unit + random.below(5) as f64 * unit, random);
                (0..frames).map(of).collect()
            }
            Aim::Loss => {
                let mut codes = self.codes(base, random);
                let k = random.below(codes.len());
                let most = self.functions[k].iter().fold(0.0_f64, |m, u| m.max(u.abs()));
                codes.iter_mut().for_each(|c| *c *= step);
                codes[k] += nudge(if most > 0.0 { delta / most } else { 0.0 }, random);
                inverse(basis.as_ref(), &codes)
            }
            Aim::Flash => {
                let place = random.below(frames);
                let off = nudge(delta, random) * [1.0, -1.0, 2.0, 3.0][random.below(4)];
                (0..frames).map(|t| if t == place { base + off } else { base }).collect()
            }
        }
    }

    /// Codes of about `base`, with some details.
    fn codes(&self, base: f64, random: &mut Random) -> Vec<f64> {
        let mut coefficients = vec![[0.0; 8]; self.basis.coefficients()];
        self.basis.forward(&vec![[base; 8]; self.target.case.frames], &mut coefficients);
        let detail = |random: &mut Random| if random.below(3) == 0 { random.below(9) as f64 - 4.0 } else { 0.0 };
        coefficients.iter().map(|c| (c[0] / self.step).round() + detail(random)).collect()
    }
}

/// Runs attacks with every aim. Returns the number of series.
fn attack(target: &Target, seed: u64) -> usize {
    let basis = target.basis();
    let functions = synthesis(basis.as_ref());
    let step = target.step().unwrap_or(target.ulp());
    let attack = Attack { target, basis, functions, step };
    let mut random = Random(seed);
    let series = (0..target.voxels()).map(|i| attack.series(AIMS[i % AIMS.len()], &mut random));
    let series = Vec::from_iter(series);
    let holes = target.case.ty.is_float() && seed.is_multiple_of(4);
    let samples = if holes { target.punctured(&series, &mut random) } else { target.samples(&series) };
    Case { seed: seed / 4, ..target.case.clone() }.trial(&samples).check() // the seed chooses what is kept
}

#[test]
fn no_series_at_the_edge_of_a_code_breaks_its_bound() {
    let started = Instant::now();
    let all = (targets(), proptest::prelude::any::<u64>());
    tried(search(1000, all, |(target, seed)| attack(&target, seed)), cases(250_000), started);
}
