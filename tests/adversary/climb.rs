//! Hill climbing: every voxel of an archive changes its series so that the error of the decoded series grows.

use super::Target;
use crate::bounds::{Case, ERRORS_KEPT, Trial};
use crate::common::random::Random;
use crate::common::samples::TYPES;
use crate::common::{times, tried};
use std::time::Instant;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound};

/// After this many rounds without a better series, a climber restarts elsewhere.
const PATIENCE: usize = 12;
const ROUNDS: usize = 60;

struct Climber {
    series: Vec<f64>,
    /// The largest share of the bound that its error used.
    height: f64,
    stuck: usize,
}

impl Climber {
    fn new(target: &Target, random: &mut Random) -> Self {
        let level = target.value(random.unit());
        Self { series: vec![level; target.case.frames], height: 0.0, stuck: 0 }
    }

    /// A series near its own: some samples moved by fractions of the bound.
    fn neighbour(&self, target: &Target, random: &mut Random) -> Vec<f64> {
        let (delta, frames) = (target.delta(), self.series.len());
        let size = delta * 0.5f64.powi(random.below(8) as i32 - 2);
        let (from, len) = (random.below(frames), 1 + random.below(frames));
        let mut series = self.series.clone();
        for (t, value) in series.iter_mut().enumerate().skip(from).take(len) {
            *value += match t % 3 {
                0 => size,
                1 => size * random.signed(),
                _ => target.ulp() * random.signed().round(),
            };
        }
        series
    }
}

/// The outcome of a climb.
struct Climbed {
    tried: usize,
    /// The highest share of the bound.
    best: f64,
    /// The largest error that a file allowed.
    allowed: f64,
}

/// Climbs for some rounds.
fn climb(target: &Target, seed: u64) -> Climbed {
    let mut random = Random(seed);
    let mut climbers = Vec::from_iter((0..target.voxels()).map(|_| Climber::new(target, &mut random)));
    let (mut tried, mut best, mut allowed) = (0, 0.0_f64, 0.0_f64);
    for _ in 0..ROUNDS {
        let series = Vec::from_iter(climbers.iter().map(|c| c.neighbour(target, &mut random)));
        let case = Case { seed, ..target.case.clone() }; // the seed chooses what is kept
        let trial = case.trial(&target.samples(&series));
        tried += trial.check();
        allowed = trial.file.metadata().windows.iter().map(|window| window.delta).fold(allowed, f64::max);
        for (i, (climber, series)) in climbers.iter_mut().zip(series).enumerate() {
            let voxels = target.voxels() + 2;
            let height = share(&trial, (i + 2..trial.source.len()).step_by(voxels));
            best = best.max(height);
            if height >= climber.height {
                let stuck = if height > climber.height { 0 } else { climber.stuck };
                *climber = Climber { series, height, stuck };
            }
            climber.stuck += 1;
            if climber.stuck > PATIENCE {
                *climber = Climber::new(target, &mut random);
            }
        }
    }
    Climbed { tried, best, allowed }
}

/// The share of the bound that the errors of a series use; its samples are at `places`.
fn share(trial: &Trial, places: impl Iterator<Item = usize>) -> f64 {
    let delta = trial.file.metadata().windows[0].delta;
    let present: Vec<usize> = places.filter(|at| trial.source[*at].is_finite()).collect();
    let frames = present.len() as f64;
    let keep = trial.file.metadata().keep();
    let limits = |v: f64| keep.relative.filter(|of| v.abs() >= of.floor).map_or(f64::MAX, |of| of.share * v.abs());
    let is_limited = keep.limits_samples();
    let errors = present.into_iter().map(|at| (trial.source[at], (trial.found[at] - trial.source[at]).abs()));
    match trial.case.bound {
        Bound::Relative { floor } => {
            let allowed = |v: f64| (trial.case.tolerance * v.abs().max(floor)).min(delta).min(limits(v));
            errors.map(|(v, e)| e / allowed(v)).fold(0.0, f64::max)
        }
        _ if is_limited || trial.case.bound == Bound::Pointwise => {
            errors.map(|(v, e)| e / delta.min(limits(v))).fold(0.0, f64::max)
        }
        _ => (errors.map(|(_, e)| e * e).sum::<f64>() / frames).sqrt() / delta,
    }
}

fn targets(ty: SampleType) -> Vec<Target> {
    let (range, tolerances) = if ty.is_float() { ((-1.0, 3.0), [0.01, 0.2]) } else { ((0.0, 100.0), [0.05, 0.145]) };
    let floor = 0.5 * range.1;
    let codings = [
        (Basis::Haar, Bound::Pointwise, 8, tolerances[0]),
        (Basis::Multi, Bound::Pointwise, 9, tolerances[0]),
        (Basis::Haar, Bound::Rms, 5, tolerances[1]),
        (Basis::Multi, Bound::Rms, 5, tolerances[1]),
        (Basis::Haar, Bound::Relative { floor }, 8, tolerances[0]),
        (Basis::Multi, Bound::Relative { floor }, 9, tolerances[0]),
        (Basis::Haar, Bound::Sampled { samples: 9, seed: 1 }, 8, tolerances[0]),
    ];
    let target = |(basis, bound, frames, tolerance)| Target::new(ty, range, tolerance, (basis, bound), frames);
    let mut all: Vec<Target> = codings.map(target).into();
    let gaps = [(Basis::Haar, 2), (Basis::Multi, 3)];
    let rms = |(basis, every)| Target { every, ..target((basis, Bound::Rms, 5, tolerances[1])) };
    all.extend(gaps.into_iter().filter(|_| ty.is_float()).map(rms));
    all
}

#[test]
fn hill_climbing_finds_no_series_beyond_the_bound() {
    let (started, mut series) = (Instant::now(), 0);
    for (n, ty) in (0..times()).flat_map(|_| TYPES).enumerate() {
        for (m, target) in targets(ty).into_iter().enumerate() {
            let Climbed { tried, best, .. } = climb(&target, ERRORS_KEPT * (n * 10 + m) as u64);
            // The climbers must come near the bound, or the search would prove nothing. A sampled bound moves with the
            // data.
            let near = if matches!(target.case.bound, Bound::Sampled { .. }) { 0.6 } else { 0.9 };
            assert!(best > near, "climbing is worth its time: {best} of the bound, {target:?}");
            series += tried;
            if (n + m) % 4 == 0 {
                let seed = ERRORS_KEPT * (n * 10 + m) as u64 + 1 + (n + m / 4) as u64 % (ERRORS_KEPT - 2);
                let Climbed { tried, best, allowed } = climb(&target, seed);
                let is_exact = allowed < target.ulp(); // no sample of the type may be off at all
                assert!(
                    best > 0.5 || is_exact,
                    "climbing is worth its time: {best} of the limit, seed {seed}, {target:?}"
                );
                series += tried;
            }
        }
    }
    tried(series, 1_200_000 * times(), started);
}
