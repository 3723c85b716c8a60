//! Synthetic archives of any size, one frame at a time, for tests and benchmarks.
//!
//! Except for noise, a frame is a sum of products a * f(x) * g(y) * h(z). The factors are computed once per frame, so
//! that a voxel costs a few multiplications. A frame depends only on the settings and its number. Coordinates and time
//! run over 0..1, so that more voxels or frames refine the same scene.

use crate::random::Random;
use clap::ValueEnum;
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::path::{Path, PathBuf};
use wavesplat::base::error::Result;
use wavesplat::base::sample::{self, SampleType};
use wavesplat_demo::output::{Format, Shape, Target};

/// What the frames show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, ValueEnum)]
pub enum Kind {
    /// Blobs that diffuse: every voxel changes slowly (values 0 to 1)
    Smooth,
    /// A front that crosses the volume, and blobs on their ways (values 0 to 1)
    Moving,
    /// Standing waves that change their sign (values -1 to 1)
    Oscillating,
    /// Every sample random, nothing to compress (values 0 to 1)
    Noise,
    /// A few blobs moving through nothing, which is exactly 0 (values 0 to 1)
    Sparse,
}

impl Kind {
    /// The name on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |value| value.get_name().into())
    }

    /// The lowest value that can occur; the highest is 1.
    pub fn lowest(self) -> f64 {
        if self == Self::Oscillating { -1.0 } else { 0.0 }
    }
}

/// The settings of a synthetic archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Synth {
    /// What it shows.
    pub kind: Kind,
    /// Voxels, frames and the type of the samples.
    pub shape: Shape,
    /// Another seed is another scene of the same kind.
    pub seed: u64,
}

impl Synth {
    /// An archive of `f32` with so many voxels along x, y and z, and frames.
    pub fn f32(kind: Kind, [nx, ny, nz, frames]: [usize; 4]) -> Self {
        Self { kind, shape: Shape { dims: [nx, ny, nz], frames, ty: SampleType::F32 }, seed: 0 }
    }

    /// Writes `KIND.npy` into a folder, and returns its path.
    pub fn write_npy(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(format!("{}.npy", self.kind.name()));
        Target::File(path.clone(), Format::Npy).write(&self.shape, |frame, bytes| self.fill(frame, bytes))?;
        Ok(path)
    }

    /// Fills `out` with frame `frame`: little-endian samples, x fastest, then y, z.
    ///
    /// Floating-point samples hold the values as they are. Unsigned integers use their whole range for the kind's
    /// lowest value to 1, signed ones have 0 for 0 and their highest number for 1.
    pub fn fill(&self, frame: usize, out: &mut [u8]) {
        let scene = Scene::at(self, frame);
        let (gain, offset) = self.scaling();
        let [nx, ny, _] = self.shape.dims;
        let mut row = vec![0.0; nx];
        for (number, bytes) in out.chunks_exact_mut(nx * self.shape.ty.size()).enumerate() {
            scene.row(&mut row, number % ny, number / ny);
            row.iter_mut().for_each(|v| *v = *v * gain + offset);
            sample::store(self.shape.ty, &row, bytes);
        }
    }

    /// Factor and summand from values to samples.
    fn scaling(&self) -> (f64, f64) {
        let limit = |v| sample::round_to(self.shape.ty, v);
        let (low, high, lowest) = (limit(f64::NEG_INFINITY), limit(f64::INFINITY), self.kind.lowest());
        match self.shape.ty {
            ty if ty.is_float() => (1.0, 0.0),
            _ if low < 0.0 => (high, 0.0),
            _ => (high / (1.0 - lowest), -lowest * high / (1.0 - lowest)),
        }
    }
}

/// The content of one frame.
enum Scene {
    Terms(Vec<Term>),
    Noise { random: Random, dims: [usize; 3] },
}

impl Scene {
    fn at(synth: &Synth, frame: usize) -> Self {
        let time = frame as f64 / (synth.shape.frames - 1).max(1) as f64;
        let (random, dims) = (Random::new(synth.seed, synth.kind as u64), synth.shape.dims);
        match synth.kind {
            Kind::Smooth => Self::Terms(smooth(random, dims, time)),
            Kind::Moving => Self::Terms(moving(random, dims, time)),
            Kind::Oscillating => Self::Terms(oscillating(random, dims, time)),
            Kind::Sparse => Self::Terms(blobs(random, dims, time, 4, 1.0, bump)),
            Kind::Noise => Self::Noise { random: Random::new(synth.seed, frame as u64), dims },
        }
    }

    fn row(&self, row: &mut [f64], y: usize, z: usize) {
        match self {
            Self::Terms(terms) => {
                row.fill(0.0);
                terms.iter().for_each(|t| t.add_row(row, y, z));
            }
            Self::Noise { random, dims } => {
                let first = (z * dims[1] + y) * dims[0];
                row.iter_mut().zip(first..).for_each(|(v, n)| *v = random.nth(n as u64));
            }
        }
    }
}

/// A product of three functions of one coordinate each.
struct Term {
    factors: [Vec<f64>; 3],
    /// Where the factor along x is not 0.
    support: Range<usize>,
}

impl Term {
    /// Samples `factor(axis, coordinate)` at the middles of the voxels; the factor along z also takes `amplitude`.
    fn new(dims: [usize; 3], amplitude: f64, factor: impl Fn(usize, f64) -> f64) -> Self {
        let mut factors = std::array::from_fn(|a| {
            (0..dims[a]).map(|i| factor(a, (i as f64 + 0.5) / dims[a] as f64)).collect::<Vec<_>>()
        });
        factors[2].iter_mut().for_each(|v| *v *= amplitude);
        let first = factors[0].iter().position(|v| *v != 0.0).unwrap_or(0);
        let end = factors[0].iter().rposition(|v| *v != 0.0).map_or(first, |last| last + 1);
        Self { factors, support: first..end }
    }

    fn add_row(&self, row: &mut [f64], y: usize, z: usize) {
        let weight = self.factors[1][y] * self.factors[2][z];
        if weight != 0.0 {
            let along = &self.factors[0][self.support.clone()];
            row[self.support.clone()].iter_mut().zip(along).for_each(|(v, f)| *v += weight * f);
        }
    }
}

/// exp(-u^2 / 2).
fn gaussian(u: f64) -> f64 {
    libm::exp(-0.5 * u * u)
}

/// A bell from 1 down to exactly 0 at |u| = 2, with a continuous slope.
fn bump(u: f64) -> f64 {
    let inside = (1.0 - 0.25 * u * u).max(0.0);
    inside * inside
}

/// Gaussians that keep their content while their widths grow: w^2 = w0^2 + 2 D t.
fn smooth(mut random: Random, dims: [usize; 3], time: f64) -> Vec<Term> {
    let mut blob = |_| {
        let centre = [(); 3].map(|()| random.between(0.1, 0.9));
        let (width, spread) = (random.between(0.06, 0.15), random.between(0.005, 0.02));
        let grown = (width * width + 2.0 * spread * time).sqrt();
        Term::new(dims, (width / grown).powi(3) / 6.0, |a, u| gaussian((u - centre[a]) / grown))
    };
    (0..6).map(&mut blob).collect()
}

/// A smooth step that runs along x, and four blobs.
fn moving(mut random: Random, dims: [usize; 3], time: f64) -> Vec<Term> {
    let (start, speed) = (random.between(0.05, 0.2), random.between(0.5, 0.75));
    let front = move |a, u| if a == 0 { 0.5 - 0.5 * libm::tanh((u - start - speed * time) / 0.03) } else { 1.0 };
    let mut terms = blobs(random, dims, time, 4, 0.5, gaussian);
    terms.push(Term::new(dims, 0.5, front));
    terms
}

/// `count` blobs of a profile that move straight and bounce off the faces; their peaks add up to `total`.
fn blobs(mut random: Random, dims: [usize; 3], time: f64, count: u8, total: f64, profile: fn(f64) -> f64) -> Vec<Term> {
    let mut blob = |_| {
        let centre = [(); 3].map(|()| bounce(random.between(0.0, 1.0) + time * random.between(-0.8, 0.8)));
        let width = random.between(0.03, 0.06);
        Term::new(dims, total / f64::from(count), |a, u| profile((u - centre[a]) / width))
    };
    (0..count).map(&mut blob).collect()
}

/// Folds any position into 0..1, as if by mirrors at 0 and 1.
fn bounce(position: f64) -> f64 {
    let phase = position.rem_euclid(2.0);
    phase.min(2.0 - phase)
}

/// Six standing waves with peaks of 1/6 each.
fn oscillating(mut random: Random, dims: [usize; 3], time: f64) -> Vec<Term> {
    let mut wave = |_| {
        let waves = [(); 3].map(|()| libm::floor(random.between(1.0, 6.0)));
        let phases = [(); 3].map(|()| random.between(0.0, TAU));
        let (turns, begin) = (random.between(1.0, 4.0), random.between(0.0, TAU));
        let amplitude = libm::cos(TAU * turns * time + begin) / 6.0;
        Term::new(dims, amplitude, |a, u| libm::sin(PI * waves[a] * u + phases[a]))
    };
    (0..6).map(&mut wave).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;
    use wavesplat::base::sample::SampleType;

    fn frame(kind: Kind, ty: SampleType, seed: u64, frame: usize) -> Vec<u8> {
        let shape = Shape { dims: [17, 12, 9], frames: 8, ty };
        let mut bytes = vec![0; shape.frame_bytes()];
        Synth { kind, shape, seed }.fill(frame, &mut bytes);
        bytes
    }

    fn values(kind: Kind, ty: SampleType, number: usize) -> Vec<f64> {
        let bytes = frame(kind, ty, 5, number);
        let mut values = vec![0.0; bytes.len() / ty.size()];
        sample::load(ty, &bytes, &mut values);
        values
    }

    #[test]
    fn a_seed_gives_the_same_bytes_and_another_seed_others() {
        for kind in Kind::value_variants() {
            let bytes = frame(*kind, SampleType::F32, 3, 2);
            assert_eq!(bytes, frame(*kind, SampleType::F32, 3, 2));
            assert_ne!(bytes, frame(*kind, SampleType::F32, 4, 2), "{kind:?}");
            assert_ne!(bytes, frame(*kind, SampleType::F32, 3, 3), "{kind:?}");
        }
    }

    #[test]
    fn kinds_differ() {
        let all: std::collections::HashSet<_> =
            Kind::value_variants().iter().map(|kind| frame(*kind, SampleType::F32, 0, 0)).collect();
        assert_eq!(all.len(), Kind::value_variants().len());
    }

    #[test]
    fn values_stay_in_their_ranges_and_use_them() {
        for kind in Kind::value_variants() {
            let values: Vec<f64> = (0..8).flat_map(|f| values(*kind, SampleType::F64, f)).collect();
            let (low, high) = values.iter().fold((1.0_f64, -1.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
            assert!(low >= kind.lowest() && high <= 1.0 && high > 0.1, "{kind:?}: {low} to {high}");
            assert_eq!(low < -0.05, *kind == Kind::Oscillating, "{kind:?}: {low}");
        }
    }

    #[test]
    fn integers_are_the_scaled_values() {
        let exact = values(Kind::Oscillating, SampleType::F64, 3);
        let scales =
            [(SampleType::U8, 127.5, 127.5), (SampleType::U16, 32767.5, 32767.5), (SampleType::I16, 32767.0, 0.0)];
        for (ty, gain, offset) in scales {
            let close = |(v, i): (&f64, f64)| (v * gain + offset - i).abs() <= 0.5 + 1e-9;
            assert!(exact.iter().zip(values(Kind::Oscillating, ty, 3)).all(close), "{ty}");
        }
    }

    #[test]
    fn sparse_is_mostly_empty_and_moves() {
        let (first, last) = (values(Kind::Sparse, SampleType::F32, 0), values(Kind::Sparse, SampleType::F32, 7));
        let filled = |v: &[f64]| v.iter().filter(|v| **v != 0.0).count();
        assert!(filled(&first) > 0 && filled(&first) * 10 < first.len());
        assert_ne!(first, last);
    }
}
