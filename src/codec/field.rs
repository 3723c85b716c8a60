//! The coefficients of a block, whatever scheme they were coded with.

use super::WindowCodec;
use super::buffer::{Buffer, Pooled};
use super::pyramid::Passes;
use super::real::Real;
use crate::wavelet::{LANES, Lane, TimeBasis};
use multiversion::multiversion;
use wavesplat_format::Pyramid;

/// Decoded coefficients, `k * voxels + voxel`.
#[derive(Debug)]
pub enum Field<'a> {
    /// All are zero.
    Zero,
    /// Codes times a step.
    Codes {
        /// A coefficient is its code times this.
        step: f64,
        /// `k * voxels + voxel`.
        codes: &'a [i32],
    },
    /// What a pyramid in 32-bit floats gives.
    Single(Buffer<f32>),
    /// What a pyramid in 64-bit floats gives.
    Double(Buffer<f64>),
}

impl<'a> Field<'a> {
    /// From all codes of a block of `size` voxels; none: all are zero.
    pub(super) fn decode(codec: &WindowCodec, size: [usize; 3], step: f64, codes: &'a [i32]) -> Self {
        match &codec.scheme.pyramid {
            _ if codes.is_empty() => Self::Zero,
            None => Self::Codes { step, codes },
            Some(pyramid) if pyramid.single => Self::Single(refined(pyramid, codec.shape(size), step, codes)),
            Some(pyramid) => Self::Double(refined(pyramid, codec.shape(size), step, codes)),
        }
    }

    /// Whether all coefficients are zero.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Zero)
    }

    /// A coefficient.
    pub fn at(&self, index: usize) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::Codes { step, codes } => f64::from(codes[index]) * step,
            Self::Single(values) => values[index].into(),
            Self::Double(values) => values[index],
        }
    }

    /// Some coefficients from `first` on.
    fn load(&self, first: usize, out: &mut [f64]) {
        match self {
            Self::Zero => out.fill(0.0),
            Self::Codes { step, codes } => scale(*step, &codes[first..], out),
            Self::Single(values) => widen(&values[first..], out),
            Self::Double(values) => out.copy_from_slice(&values[first..first + out.len()]),
        }
    }

    /// Calls `visit(index of the first, values)` for all samples, a run of voxels at a time, with what the coefficients
    /// give.
    pub(super) fn for_each_run(&self, basis: &dyn TimeBasis, voxels: usize, mut visit: impl FnMut(usize, &[f64])) {
        let mut run = Run::new(basis);
        for first in (0..voxels).step_by(RUN) {
            let count = RUN.min(voxels - first);
            let nonzero = run.load(self, voxels, (first, count));
            run.invert(basis, nonzero, count.div_ceil(LANES));
            (0..basis.frames()).for_each(|frame| visit(frame * voxels + first, &run.frame(frame)[..count]));
        }
    }

    /// The same where coefficients are samples.
    pub(super) fn for_each_run_of_samples(&self, count: usize, mut visit: impl FnMut(usize, &[f64])) {
        let mut run = [0.0; 8 * RUN];
        for first in (0..count).step_by(run.len()) {
            let run = &mut run[..(8 * RUN).min(count - first)];
            self.load(first, run);
            visit(first, run);
        }
    }

    /// The series of a voxel.
    pub(super) fn series(&self, basis: &dyn TimeBasis, voxels: usize, voxel: usize) -> Vec<f64> {
        let mut work = vec![Lane::default(); basis.coefficients()];
        let mut series = vec![Lane::default(); basis.frames()];
        work.iter_mut().enumerate().for_each(|(k, lane)| lane[0] = self.at(k * voxels + voxel));
        basis.inverse(&mut work, &mut series);
        series.iter().map(|lane| lane[0]).collect()
    }
}

/// Voxels whose series are decoded together: so many that what they need of each plane are whole cache lines.
const RUN: usize = 128;

/// The series of a run of voxels, [`LANES`] by [`LANES`].
struct Run {
    /// `[voxels / LANES][k]`
    coefficients: Vec<Lane>,
    /// `[voxels / LANES][frame]`
    series: Vec<Lane>,
    /// Of one k or frame.
    row: [f64; RUN],
}

impl Run {
    fn new(basis: &dyn TimeBasis) -> Self {
        let lanes = |each: usize| vec![Lane::default(); RUN / LANES * each];
        Self { coefficients: lanes(basis.coefficients()), series: lanes(basis.frames()), row: [0.0; RUN] }
    }

    /// Loads coefficients; false if all are zero.
    fn load(&mut self, field: &Field<'_>, voxels: usize, (first, count): (usize, usize)) -> bool {
        let (each, mut any) = (self.coefficients.len() / (RUN / LANES), false);
        for k in 0..each {
            field.load(k * voxels + first, &mut self.row[..count]);
            any |= self.row[..count].iter().fold(false, |any, c| any | (*c != 0.0));
            let of_k = self.coefficients[k..].iter_mut().step_by(each);
            of_k.zip(self.row.as_chunks::<LANES>().0).for_each(|(lane, row)| *lane = *row);
        }
        any
    }

    fn invert(&mut self, basis: &dyn TimeBasis, nonzero: bool, lanes: usize) {
        if !nonzero {
            return self.series.fill(Lane::default());
        }
        let coefficients = self.coefficients.chunks_exact_mut(basis.coefficients());
        let series = self.series.chunks_exact_mut(basis.frames());
        coefficients.zip(series).take(lanes).for_each(|(coefficients, series)| basis.inverse(coefficients, series));
    }

    fn frame(&mut self, frame: usize) -> &[f64; RUN] {
        let each = self.series.len() / (RUN / LANES);
        let of_frame = self.series[frame..].iter().step_by(each);
        self.row.as_chunks_mut::<LANES>().0.iter_mut().zip(of_frame).for_each(|(row, lane)| *row = *lane);
        &self.row
    }
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn scale(step: f64, codes: &[i32], out: &mut [f64]) {
    out.iter_mut().zip(codes).for_each(|(v, code)| *v = f64::from(*code) * step);
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn widen(values: &[f32], out: &mut [f64]) {
    out.iter_mut().zip(values).for_each(|(v, c)| *v = f64::from(*c));
}

fn refined<R: Real + Pooled>(pyramid: &Pyramid, shape: [usize; 4], step: f64, codes: &[i32]) -> Buffer<R> {
    let mut field = Buffer::of(codes.len());
    Passes::new(pyramid, shape).decode(step, codes, &mut field);
    field
}
