//! Searches the values of short series, and shrinks a series that breaks its bound.

use super::{Target, targets};
use crate::bounds::search;
use crate::common::{cases, tried};
use proptest::prelude::*;
use std::time::Instant;

/// A sample as multiples of half the bound, half the step and ulps from the middle of the range.
type Parts = (i8, i8, i8);

fn value(target: &Target, step: f64, (deltas, steps, ulps): Parts) -> f64 {
    let middle = target.value(0.5);
    let away = f64::from(deltas) * target.delta() / 2.0 + f64::from(steps) * step / 2.0;
    middle + away + f64::from(ulps) * target.ulp()
}

fn parts() -> impl Strategy<Value = Parts> {
    (-4..=4_i8, prop_oneof![Just(0), -9..=9_i8], prop_oneof![Just(0), -2..=2_i8])
}

#[test]
fn no_short_series_breaks_its_bound() {
    const FRAMES: usize = 6;
    const SERIES: usize = 62;
    let started = Instant::now();
    let all = (targets(), prop::collection::vec(parts(), 0..=FRAMES * SERIES), 1..=FRAMES);
    let check = |(mut target, mut parts, frames): (Target, Vec<Parts>, usize)| {
        (target.case.frames, target.case.dims) = (frames, [16, 4, 1]);
        parts.resize(FRAMES * SERIES, (0, 0, 0));
        let step = target.step().unwrap_or(0.0);
        let of = |series: &[Parts]| series[..frames].iter().map(|p| value(&target, step, *p)).collect();
        let series: Vec<Vec<f64>> = parts.chunks_exact(FRAMES).map(of).collect();
        target.case.trial(&target.samples(&series)).check()
    };
    tried(search(1500, all, check), cases(75_000), started);
}
