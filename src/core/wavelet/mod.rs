//! Temporal bases: transform the series of one window to coefficients and back.
//!
//! ```text
//! v(t_j) = sum over k of c_k u_k(t_j)                                                                     (eq 5)
//! ```
//!
//! All packages transform through [`TimeBasis`] only: a pair of linear transforms whose coefficients are
//! ordered from coarse to fine. `src/method.md`, section 3, lists the bases. Transforms work on [`LANES`] voxels at a
//! time, so that plain loops become vector code.
//!
//! To add a basis:
//!
//! 1. Implement [`TimeBasis`] in a file of this folder, and name it in [`basis`] and [`check_window`]. Coding,
//!    decoding, rendering and extraction need no change: they use the trait.
//! 2. Append its variant to [`Basis`] in `format/src/window.rs`, and define its inverse in `format/FORMAT.md`, section
//!    8.
//! 3. Name it in [`AnyBasis`]: options, requests and files have that name. In `engine/convert`, say whether it takes a
//!    pyramid and whether it is tried (`choose.rs`), how many coefficients it has (`plan.rs`), and its default window and whether it works without a prediction
//!    (`request.rs`).
//! 4. Add it to the lists of tests: `every_basis` below, `tests/specification.rs`, which decodes it a second time from
//!    `FORMAT.md`, `tests/golden.rs`, and `BASES` in `tests/common`.

mod haar;
mod learned;
mod multi;
mod samples;

pub(crate) use haar::Haar;
pub use learned::Learned;
pub(crate) use multi::Multi;
pub(crate) use samples::Samples;
pub use wavesplat_format::Basis;

use crate::base::choice::Choice;
use crate::base::error::{Error, Result};
use std::fmt::Debug;
use std::ops::Range;

/// A basis, or `None` for whichever suits.
pub type AnyBasis = Option<Basis>;

impl Choice for AnyBasis {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("haar", Some(Basis::Haar), "Haar wavelets"),
        ("multi", Some(Basis::Multi), "The multiwavelet of Geronimo, Hardin and Massopust"),
        ("learned", Some(Basis::Learned), "Orthonormal functions learned from the window's own series"),
        ("pyramid", Some(Basis::Samples), "No transform along time: samples are predicted in space and time"),
        ("auto", None, "learned or pyramid, whichever variant makes a few sample boxes of the window smallest"),
    ];
}

/// The number of voxels transformed together.
pub const LANES: usize = 8;

/// One sample or coefficient of each of [`LANES`] voxels.
pub type Lane = [f64; LANES];

/// A basis u_k for the series of one window: v(t) = sum over k of c_k u_k(t) (eq 5).
pub trait TimeBasis: Send + Sync + Debug {
    /// The number of samples in a series, which is the number of frames in the window.
    fn frames(&self) -> usize;

    /// The number K of coefficients of a series; at least [`Self::frames`].
    fn coefficients(&self) -> usize;

    /// The number of coefficients in each temporal level, coarse to fine; they add up to K.
    fn levels(&self) -> Vec<usize>;

    /// Transforms samples to coefficients. `series` holds [`Self::frames`] lanes, `coefficients` K lanes.
    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]);

    /// The functions u_k(t_j), as `[k][j]`, if coefficients are sums of products with them.
    fn rows(&self) -> Option<&[Vec<f64>]> {
        None
    }

    /// Transforms coefficients to samples. Overwrites `coefficients`, which serve as scratch.
    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]);

    /// A basis restricted to the marked coefficients, which gives the same series if all others are zero; none if that
    /// saves nothing.
    fn only(&self, _marked: &[bool]) -> Option<Box<dyn TimeBasis>> {
        None
    }

    /// A basis whose inverse gives only some frames, one after another, with the same bits; none if that saves nothing.
    fn only_frames(&self, _frames: &[usize]) -> Option<Box<dyn TimeBasis>> {
        None
    }
}

/// Creates the basis of a window of `frames` frames; `functions` are the learned ones, if any (`Learned::new`).
pub fn basis(kind: Basis, functions: &[i16], frames: usize) -> Box<dyn TimeBasis> {
    match kind {
        Basis::Haar => Box::new(Haar::new(frames)),
        Basis::Multi => Box::new(Multi::new(frames)),
        Basis::Samples => Box::new(Samples(frames)),
        Basis::Learned => Box::new(Learned::new(functions, frames)),
    }
}

/// An error if full windows of `frames` frames do not suit the basis.
pub fn check_window(kind: Basis, frames: usize) -> Result<()> {
    let (fits, rule) = match kind {
        Basis::Haar => (frames.is_power_of_two(), "a power of two, such as 32"),
        Basis::Multi => (frames >= 3 && (frames - 1).is_power_of_two(), "a power of two plus one, such as 33"),
        Basis::Samples | Basis::Learned => (frames >= 1, "at least one frame"),
    };
    let most = wavesplat_format::limits::MAX_WINDOW_FRAMES as usize;
    if fits && frames <= most {
        return Ok(());
    }
    let problem = format!("the {kind:?} basis takes {rule}, at most {most}, not {frames}");
    Err(Error::setting("window", problem.to_lowercase()))
}

/// The values of the basis functions: `rows[k][t]` is u_k(t), with K rows of `frames` columns.
pub fn synthesis(basis: &dyn TimeBasis) -> Vec<Vec<f64>> {
    (0..basis.coefficients())
        .map(|k| {
            let mut coefficients = vec![Lane::default(); basis.coefficients()];
            coefficients[k] = [1.0; LANES];
            let mut series = vec![Lane::default(); basis.frames()];
            basis.inverse(&mut coefficients, &mut series);
            series.iter().map(|lane| lane[0]).collect()
        })
        .collect()
}

/// The largest sum over k of |u_k(t)| (eq 25). If every coefficient changes by at most e, a sample moves by at most
/// gain * e.
pub(crate) fn gain(synthesis: &[Vec<f64>]) -> f64 {
    let frames = synthesis.first().map_or(0, Vec::len);
    (0..frames).map(|t| synthesis.iter().map(|u| u[t].abs()).sum()).fold(0.0, f64::max)
}

/// Which coefficients are needed to decode only `frames` of the window: those whose function is not zero there.
pub fn needed(synthesis: &[Vec<f64>], frames: &[usize]) -> Vec<bool> {
    synthesis.iter().map(|u| frames.iter().any(|t| u[*t] != 0.0)).collect()
}

/// Splits `0..K` into ranges as long as `lengths`.
pub(crate) fn ranges(lengths: &[usize]) -> Vec<Range<usize>> {
    let mut start = 0;
    lengths
        .iter()
        .map(|n| {
            start += n;
            start - n..start
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_basis() -> impl Iterator<Item = Box<dyn TimeBasis>> {
        let kinds = [Basis::Haar, Basis::Multi, Basis::Samples, Basis::Learned];
        (1..=70).flat_map(move |n| kinds.map(|kind| basis(kind, &some_functions(kind, n), n)))
    }

    /// Up to three functions; the third is nearly a sum of the others.
    fn some_functions(kind: Basis, n: usize) -> Vec<i16> {
        let row = |k: usize, t: usize| [3000, (t * 911 % 7919) as i16, (t * 911 % 7919) as i16 + 2999][k];
        let rows = if kind == Basis::Learned { n.min(3) } else { 0 };
        (0..rows).flat_map(|k| (0..n).map(move |t| row(k, t))).collect()
    }

    fn some_series(n: usize) -> Vec<Lane> {
        (0..n).map(|t| std::array::from_fn(|l| ((t * 37 + l * 101) % 53) as f64 - 20.0)).collect()
    }

    #[test]
    fn inverse_undoes_forward_for_every_length() {
        for b in every_basis() {
            let series = some_series(b.frames());
            let mut coefficients = vec![Lane::default(); b.coefficients()];
            b.forward(&series, &mut coefficients);
            let mut back = vec![Lane::default(); b.frames()];
            b.inverse(&mut coefficients, &mut back);
            for (x, y) in series.iter().flatten().zip(back.iter().flatten()) {
                assert!((x - y).abs() < 1e-12, "{b:?}: {x} came back as {y}");
            }
        }
    }

    #[test]
    fn levels_add_up_to_all_coefficients() {
        for b in every_basis() {
            assert_eq!(b.levels().iter().sum::<usize>(), b.coefficients(), "{b:?}");
            assert!(b.coefficients() >= b.frames());
        }
    }

    #[test]
    fn learned_functions_come_first_and_are_made_orthonormal() {
        let functions: Vec<i16> = (0..5).map(|t| 4000 * t).chain([9000; 5]).collect();
        let u = synthesis(&Learned::new(&functions, 5));
        let dot = |a: usize, b: usize| (0..5).map(|t| u[a][t] * u[b][t]).sum::<f64>();
        for (a, b) in (0..5).flat_map(|a| (0..5).map(move |b| (a, b))) {
            assert!((dot(a, b) - f64::from(u8::from(a == b))).abs() < 1e-14);
        }
        let norm = 30f64.sqrt();
        (0..5).for_each(|t| assert!((u[0][t] - t as f64 / norm).abs() < 1e-12));
    }

    #[test]
    fn a_constant_series_has_one_haar_coefficient() {
        for n in 1..=70 {
            let b = basis(Basis::Haar, &[], n);
            let mut coefficients = vec![Lane::default(); n];
            b.forward(&vec![[3.0; LANES]; n], &mut coefficients);
            assert!((coefficients[0][0] - 3.0 * (n as f64).sqrt()).abs() < 1e-12);
            assert!(coefficients[1..].iter().all(|c| c[0].abs() < 1e-12), "length {n}");
        }
    }

    #[test]
    fn a_frame_needs_few_haar_coefficients() {
        let u = synthesis(basis(Basis::Haar, &[], 32).as_ref());
        let one = needed(&u, &[11]);
        assert_eq!(one.iter().filter(|n| **n).count(), 6);
        assert!(needed(&u, &(0..32).collect::<Vec<_>>()).iter().all(|n| *n));
    }

    #[test]
    fn haar_gain_is_the_closed_form() {
        let u = synthesis(basis(Basis::Haar, &[], 32).as_ref());
        let expected = (1.0 + (0..5).map(|l| 2f64.powf(f64::from(l) / 2.0)).sum::<f64>()) / 32f64.sqrt();
        assert!((gain(&u) - expected).abs() < 1e-12);
    }
}
