//! Which scheme a window is coded with: the one that makes some of its boxes smallest.

use super::ConvertConfig;
use super::learn::learned_functions;
use crate::bound::{Measure, Promise};
use crate::codec::WindowCodec;
use crate::codec::encode::Encoder;
use crate::codec::scheme::{Axis, Pyramid, Scheme, Stencil};
use crate::error::{Error, Result};
use crate::source::{Archive, FrameWindow, read_frames};
use crate::volume::Region;
use crate::wavelet::Basis;
use rayon::prelude::*;
use wavesplat_format::BlockId;

/// What of a scheme is fixed; the rest is chosen for each window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coding {
    /// The transform along time; none: any.
    pub basis: Option<Basis>,
    /// The pyramid.
    pub space: Space,
}

/// What refines coefficients in space, or samples in space and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// Whichever stencil suits.
    Any,
    /// Nothing: every series by itself.
    Alone,
    /// A pyramid with this stencil.
    Pyramid(Stencil),
}

impl Coding {
    /// Everything is chosen.
    pub const AUTO: Self = Self { basis: None, space: Space::Any };
}

impl From<Basis> for Coding {
    /// The paper's bases along time alone, others with a pyramid.
    fn from(basis: Basis) -> Self {
        let alone = matches!(basis, Basis::Haar | Basis::Multi);
        Self { basis: Some(basis), space: if alone { Space::Alone } else { Space::Any } }
    }
}

/// What a choice rests on.
pub(super) struct Chooser<'a> {
    pub(super) config: &'a ConvertConfig,
    pub(super) archive: &'a Archive,
    pub(super) window: &'a dyn FrameWindow,
    pub(super) promise: Promise,
    /// The largest absolute sample of the window.
    pub(super) magnitude: f64,
}

/// A box of samples, frame by frame.
struct Sampled {
    size: [usize; 3],
    samples: Vec<u8>,
}

impl Chooser<'_> {
    /// The scheme that codes some boxes of the window in the fewest bytes. The same for any number of threads.
    pub(super) fn choose(&self) -> Result<Scheme> {
        if let Coding { basis: Some(basis), space: Space::Alone } = self.config.coding
            && basis != Basis::Learned
        {
            return Ok(Scheme::along_time(basis));
        }
        if self.promise.delta <= 0.0 {
            return Ok(Scheme::along_time(self.config.coding.basis.unwrap_or(Basis::Samples))); // all is stored exactly
        }
        let boxes = self.boxes()?;
        let mut best = self.least(self.families(&boxes), &boxes, None)?;
        for variants in [Self::stencils, Self::growths] {
            let others = variants(self, &best.1);
            best = self.least(others, &boxes, Some(best))?;
        }
        self.coarsest(&boxes, best)
    }

    /// The scheme with the step that makes the boxes smallest, where rounding alone does not have to keep the promise.
    fn coarsest(&self, boxes: &[Sampled], mut best: (f64, Scheme)) -> Result<Scheme> {
        let free = best.1.pyramid.is_some() && best.1.coarseness != 1.0;
        for step in FACTORS.into_iter().filter(|_| free) {
            let before = best.0;
            let coarser = Scheme { coarseness: best.1.coarseness * step, ..best.1.clone() };
            best = self.least(vec![coarser], boxes, Some(best))?;
            if best.0 == before && step > 1.0 {
                break;
            }
        }
        Ok(best.1)
    }

    /// Boxes spread over the volume: about one voxel in fifty, at least one box.
    fn boxes(&self) -> Result<Vec<Sampled>> {
        let dims = self.archive.grid.dims;
        let size = dims.map(|n| n.min(EDGE));
        let whole: usize = dims.iter().product();
        let count = (whole / SHARE / size.iter().product::<usize>()).clamp(1, MOST_BOXES);
        let at = |i: usize, axis: usize| {
            // A low-discrepancy sequence: the same places for every window.
            let place = (0.5 + GOLDEN[axis] * i as f64).fract();
            (place * (dims[axis] - size[axis] + 1) as f64) as usize
        };
        (0..count)
            .map(|i| {
                let start = std::array::from_fn(|axis| at(i, axis));
                let region = Region { start, end: std::array::from_fn(|axis| start[axis] + size[axis]) };
                let samples = read_frames(self.window, 0..self.window.frames(), &region, self.archive.sample)?;
                Ok(Sampled { size, samples })
            })
            .collect()
    }

    /// One scheme of each kind that is allowed.
    fn families(&self, boxes: &[Sampled]) -> Vec<Scheme> {
        let Coding { basis, space } = self.config.coding;
        let frames = self.window.frames();
        let stencil = if let Space::Pyramid(stencil) = space { stencil } else { Stencil::Cubic };
        let wanted = |kind| basis.is_none_or(|b| b == kind);
        let mut found = Vec::new();
        for kind in [Basis::Haar, Basis::Multi, Basis::Learned].into_iter().filter(|k| wanted(*k)) {
            let forced = basis.is_some();
            if !forced && kind != Basis::Learned {
                continue; // never the smallest of all
            }
            let functions = match kind {
                Basis::Learned => self.functions(boxes),
                _ => Vec::new(),
            };
            let pyramid = (space != Space::Alone).then(|| self.pyramid(&[Axis::X, Axis::Y, Axis::Z], stencil));
            found.push(Scheme { basis: kind, functions, pyramid, coarseness: self.coarseness(1.5) });
        }
        if wanted(Basis::Samples) && space != Space::Alone {
            for order in ORDERS {
                let pyramid = Some(self.pyramid(&order, stencil));
                let coarseness = if self.promise.measure() == Measure::Largest { 1.0 } else { self.coarseness(1.5) };
                found.push(Scheme { basis: Basis::Samples, functions: Vec::new(), pyramid, coarseness });
            }
        }
        let many = frames > 1;
        found.retain(|s| many || s.basis == Basis::Samples || basis.is_some());
        found
    }

    fn functions(&self, boxes: &[Sampled]) -> Vec<i16> {
        let samples = boxes.iter().map(|b| &b.samples[..]);
        learned_functions(samples, self.archive.sample, self.window.frames(), self.config.missing_value, &self.promise)
    }

    fn pyramid(&self, order: &[Axis], stencil: Stencil) -> Pyramid {
        let normal = (LEAST_SINGLE..MOST_SINGLE).contains(&self.promise.delta) && self.magnitude < MOST_SINGLE;
        let single = normal && self.promise.delta >= self.magnitude * SINGLE;
        Pyramid { order: order.to_vec(), stencil, growth: GROWTHS[0].0, most: GROWTHS[0].1, single }
    }

    /// Steps under a bound of means are chosen for dropping coefficients, too ([`Promise::step`]).
    fn coarseness(&self, coarseness: f64) -> f64 {
        match self.promise.measure() {
            Measure::Largest => coarseness,
            Measure::RootMeanSquare => 1.6 * coarseness,
        }
    }

    fn stencils(&self, best: &Scheme) -> Vec<Scheme> {
        match self.config.coding.space {
            Space::Any => variants(best, |pyramid| vec![Pyramid { stencil: Stencil::Linear, ..pyramid.clone() }]),
            _ => Vec::new(),
        }
    }

    fn growths(&self, best: &Scheme) -> Vec<Scheme> {
        let others = &GROWTHS[1..];
        variants(best, |p| others.iter().map(|&(growth, most)| Pyramid { growth, most, ..p.clone() }).collect())
    }

    /// The scheme that codes the boxes in the fewest bytes, the first of equal ones; `best` is one that was tried before.
    fn least(&self, schemes: Vec<Scheme>, boxes: &[Sampled], best: Option<(f64, Scheme)>) -> Result<(f64, Scheme)> {
        let sizes: Result<Vec<f64>> = schemes.par_iter().map(|scheme| self.bytes(scheme, boxes)).collect();
        let tried = best.into_iter().chain(sizes?.into_iter().zip(schemes));
        let least = tried.reduce(|a, b| if b.0 < a.0 { b } else { a });
        least.ok_or_else(|| Error::usage("--basis: nothing to choose from"))
    }

    /// About how many bytes the window takes.
    fn bytes(&self, scheme: &Scheme, boxes: &[Sampled]) -> Result<f64> {
        let frames = self.window.frames();
        let mut codec = WindowCodec::new(scheme.clone(), frames, self.archive.sample, self.promise, EDGE);
        codec.missing_value = self.config.missing_value;
        let mut encoder = Encoder::new(self.config.level).map_err(super::bug)?;
        let (mut bytes, mut voxels) = (0, 0);
        for Sampled { size, samples } in boxes {
            let id = BlockId { window: 0, block: 0, channel: 0 };
            let encoded = encoder.block(&codec, id, *size, samples).map_err(super::bug)?;
            bytes += encoded.block.parts.iter().map(|p| p.stored.len()).sum::<usize>();
            voxels += size.iter().product::<usize>();
        }
        let whole: usize = self.archive.grid.dims.iter().product();
        Ok(bytes as f64 * whole as f64 / voxels as f64 + 2.0 * scheme.functions.len() as f64)
    }
}

fn variants(best: &Scheme, of: impl Fn(&Pyramid) -> Vec<Pyramid>) -> Vec<Scheme> {
    let pyramids = best.pyramid.as_ref().map(of).unwrap_or_default();
    pyramids.into_iter().map(|pyramid| Scheme { pyramid: Some(pyramid), ..best.clone() }).collect()
}

/// Voxels along the edge of a box that schemes are tried on.
const EDGE: usize = 24;

/// One voxel in so many is tried.
const SHARE: usize = 50;

/// Boxes that are tried at most.
const MOST_BOXES: usize = 12;

/// Fractions whose multiples spread evenly: powers of the inverse of the root of x^4 = x + 1.
const GOLDEN: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];

/// Orders of passes that are tried, x first where it pays: rows of x are then contiguous in all other passes.
const ORDERS: [[Axis; 4]; 3] =
    [[Axis::X, Axis::Y, Axis::Z, Axis::T], [Axis::Z, Axis::Y, Axis::X, Axis::T], [Axis::T, Axis::Z, Axis::Y, Axis::X]];

/// How steps of coarser levels shrink, and by how much at most; the first is taken to begin with.
const GROWTHS: [(f64, f64); 3] = [(1.5, 3.0), (1.0, 1.0), (2.0, 4.0)];

/// Factors of the step that are tried one after another, until one does not pay.
const FACTORS: [f64; 5] = [0.8, 1.3, 1.3, 1.3, 1.3];

/// The least bound, in units of the largest sample, for 32-bit floats: their rounding takes next to nothing of it.
const SINGLE: f64 = 1.0 / (1 << 15) as f64;

/// Magnitudes at which 32-bit floats have all their digits, and sums and products of some are finite.
const LEAST_SINGLE: f64 = 1e-30;
const MOST_SINGLE: f64 = 1e30;
