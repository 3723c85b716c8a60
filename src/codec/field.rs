//! The coefficients of a block, whatever scheme they were coded with.

use super::WindowCodec;
use super::pyramid::Passes;
use super::real::Real;
use crate::wavelet::{LANES, Lane, TimeBasis};
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
    Single(Vec<f32>),
    /// What a pyramid in 64-bit floats gives.
    Double(Vec<f64>),
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

    /// `count` coefficients from `first` on, and zeros.
    fn lane(&self, first: usize, count: usize) -> Lane {
        match self {
            Self::Zero => Lane::default(),
            Self::Codes { step, codes } => lane(&codes[first..][..count], |code| f64::from(code) * step),
            Self::Single(values) => lane(&values[first..][..count], f64::from),
            Self::Double(values) => lane(&values[first..][..count], |v| v),
        }
    }

    /// Calls `visit(index of the first, coefficients)` for all `count`, a run at a time.
    pub(super) fn for_each_run(&self, count: usize, mut visit: impl FnMut(usize, &[f64])) {
        const RUN: usize = 512;
        let mut run = [0.0; RUN];
        for first in (0..count).step_by(RUN) {
            let run = &mut run[..RUN.min(count - first)];
            match self {
                Self::Zero => {}
                Self::Codes { step, codes } => {
                    run.iter_mut().zip(&codes[first..]).for_each(|(v, code)| *v = f64::from(*code) * step);
                }
                Self::Single(values) => run.iter_mut().zip(&values[first..]).for_each(|(v, c)| *v = f64::from(*c)),
                Self::Double(values) => run.copy_from_slice(&values[first..first + run.len()]),
            }
            visit(first, run);
        }
    }

    /// The series of `count` of `voxels` voxels from `first` on.
    pub(super) fn series(
        &self,
        basis: &dyn TimeBasis,
        voxels: usize,
        (first, count): (usize, usize),
        work: &mut [Lane],
        series: &mut [Lane],
    ) {
        for (k, lane) in work.iter_mut().enumerate() {
            *lane = self.lane(k * voxels + first, count);
        }
        basis.inverse(work, series);
    }
}

fn lane<T: Copy>(values: &[T], number: impl Fn(T) -> f64) -> Lane {
    if let Some(values) = values.first_chunk::<LANES>() {
        return values.map(number);
    }
    std::array::from_fn(|l| values.get(l).map_or(0.0, |v| number(*v)))
}

fn refined<R: Real>(pyramid: &Pyramid, shape: [usize; 4], step: f64, codes: &[i32]) -> Vec<R> {
    let mut field = vec![R::default(); codes.len()];
    Passes::new(pyramid, shape).decode(step, codes, &mut field);
    field
}
