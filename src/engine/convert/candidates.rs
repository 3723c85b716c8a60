//! What the choice of a scheme goes by, and the schemes that it tries: one for each family, and the variants of a scheme.

use super::learn::learned_functions;
use super::smoothness::AXES;
use super::trial_boxes::TrialBoxes;
use super::{ConvertConfig, SchemeConstraint, SpatialPredictor};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::bound::{ErrorBound, Measure};
use wavesplat_core::codec::scheme::{Axis, Pyramid, Scheme, Stencil};
use wavesplat_core::source::{Archive, FrameWindow};
use wavesplat_core::wavelet::Basis;
use wavesplat_format::Packing;

/// The inputs of a choice.
pub(super) struct SchemeSelector<'a> {
    pub(super) config: &'a ConvertConfig,
    pub(super) archive: &'a Archive,
    /// The window's samples, channel by channel.
    pub(super) channels: &'a [&'a dyn FrameWindow],
    pub(super) promise: ErrorBound,
    /// The largest absolute sample of the window.
    pub(super) magnitude: f64,
    /// [`most_samples`](super::trial_boxes::most_samples)
    pub(super) most: usize,
    /// Voxels a side of the file's blocks.
    pub(super) edge: usize,
    /// How the file's codes are packed.
    pub(super) packing: Packing,
    /// Whether blocks may list their values.
    pub(super) lists: bool,
    /// Whether the scheme need not be the best.
    pub(super) is_rough: bool,
    /// The tiers above the blocks of a window with a pyramid.
    pub(super) tiers: u8,
    /// The previous window's scheme, if the choice may start from it.
    pub(super) before: Option<&'a Scheme>,
}

impl SchemeSelector<'_> {
    /// One scheme with a pyramid for each allowed transform along time.
    pub(super) fn families(&self, order: &[Axis; 4]) -> Result<Vec<Scheme>> {
        let SchemeConstraint { basis, space } = self.config.coding;
        let stencil = if let SpatialPredictor::Pyramid(stencil) = space { stencil } else { Stencil::Cubic };
        let along_time = match basis {
            // Other transforms are never the smallest. For a few series, the functions themselves take too many bytes.
            None => (self.frames() > 1 && self.boxes().voxels() >= LEAST_SERIES).then_some(Basis::Learned),
            Some(Basis::Samples) => None,
            forced => forced,
        };
        let in_space: Vec<Axis> = order.iter().copied().filter(|axis| *axis != Axis::T).collect();
        let mut found = Vec::new();
        if let Some(basis) = along_time {
            let functions = if basis == Basis::Learned { self.functions()? } else { Vec::new() };
            let pyramid = Some(self.pyramid(&in_space, stencil));
            found.push(Scheme { basis, functions, pyramid, coarseness: self.coarseness(COARSE) });
        }
        if basis.is_none_or(|b| b == Basis::Samples) {
            for order in self.orders_of_samples(&in_space) {
                let (coarseness, pyramid) = (self.coarseness(1.0), Some(self.pyramid(&order, stencil)));
                found.push(Scheme { pyramid, coarseness, ..Scheme::along_time(Basis::Samples) });
            }
        }
        if let Some(before) = self.before {
            let begin = |scheme: &mut Scheme| {
                scheme.pyramid =
                    before.pyramid.as_ref().map(|p| Pyramid { single: self.single(), tiers: 0, ..p.clone() });
                scheme.coarseness = before.coarseness;
            };
            found.iter_mut().filter(|scheme| scheme.basis == before.basis).for_each(begin);
            found.dedup();
        }
        Ok(found)
    }

    /// Where boxes are taken from.
    pub(super) fn boxes(&self) -> TrialBoxes<'_> {
        let pyramid = self.pyramid(&AXES, Stencil::Cubic);
        TrialBoxes {
            archive: self.archive,
            channels: self.channels,
            missing_value: self.config.missing_value,
            bound: self.promise,
            most: self.most,
            is_rough: self.is_rough,
            pyramid,
        }
    }

    /// The number of frames in the window.
    pub(super) fn frames(&self) -> usize {
        self.channels[0].frames()
    }

    /// Where samples may be refined along time: before the axes in space, after them, not at all, or alone.
    fn orders_of_samples(&self, in_space: &[Axis]) -> Vec<Vec<Axis>> {
        let (time_first, time_last) = ([&[Axis::T], in_space].concat(), [in_space, &[Axis::T]].concat());
        let mut orders = vec![time_first, time_last, in_space.to_vec()];
        let voxels = self.archive.grid.whole().voxels();
        if self.frames() > 1 && voxels <= FEW_SERIES {
            orders.push(vec![Axis::T]);
        }
        orders
    }

    /// The learned functions, from rows all over the volume in which samples change, and not from the boxes of trials.
    pub(super) fn functions(&self) -> Result<Vec<i16>> {
        let size = [self.archive.grid.dims[0], 1, 1];
        let rows = ROWS.min(self.most / (size[0] * self.frames())).max(1);
        let boxes = self.boxes();
        let places = boxes.active(LEARNING, rows, size)?.places;
        let samples = places.iter().map(|place| boxes.sampled(place)).collect::<Result<Vec<_>>>()?;
        let (ty, frames) = (self.archive.sample, self.frames());
        let samples = samples.iter().map(|row| &row.samples[..]);
        Ok(learned_functions(samples, ty, frames, self.config.missing_value, &self.promise))
    }

    /// The pyramid that a choice begins with.
    pub(super) fn pyramid(&self, order: &[Axis], stencil: Stencil) -> Pyramid {
        let ((growth, most), ghosts) = (GROWTHS[0], self.packing == Packing::Nested);
        Pyramid {
            order: order.to_vec(),
            stencil,
            growth,
            most,
            single: self.single(),
            packing: self.packing,
            ghosts,
            tiers: 0,
        }
    }

    /// Whether 32-bit floats are precise enough.
    pub(super) fn single(&self) -> bool {
        let error = self.promise.allowed(self.magnitude);
        let normal = (LEAST_SINGLE..MOST_SINGLE).contains(&error) && self.magnitude < MOST_SINGLE;
        normal && error >= self.magnitude * SINGLE
    }

    /// The first coarseness to try. Under a bound of the mean, steps leave a budget for dropped coefficients
    /// ([`ErrorBound::step`]).
    pub(super) fn coarseness(&self, of_largest: f64) -> f64 {
        match self.promise.measure() {
            Measure::Largest => of_largest,
            Measure::RootMeanSquare => COARSE_OF_MEANS,
        }
    }

    /// The next order: the last two axes are those that are predicted best, and nearly equally well.
    pub(super) fn orders(&self, best: &Scheme) -> Vec<Scheme> {
        let swapped = |p: &Pyramid| {
            let mut order = p.order.clone();
            let Some(last) = order.len().checked_sub(1).filter(|last| *last > 0) else { return Vec::new() };
            order.swap(last - 1, last);
            vec![Pyramid { order, ..p.clone() }]
        };
        variants(best, swapped)
    }

    /// The linear stencil.
    pub(super) fn stencils(&self, best: &Scheme) -> Vec<Scheme> {
        match self.config.coding.space {
            SpatialPredictor::Any => {
                variants(best, |pyramid| vec![Pyramid { stencil: Stencil::Linear, ..pyramid.clone() }])
            }
            _ => Vec::new(),
        }
    }

    /// All orders of samples if the linear stencil is the best: families were compared with the other one.
    pub(super) fn linear_orders(&self, best: &Scheme) -> Vec<Scheme> {
        let is_linear = |p: &Pyramid| p.stencil == Stencil::Linear && p.order != [Axis::T];
        if !best.pyramid.as_ref().is_some_and(is_linear)
            || best.basis != Basis::Samples
            || self.config.coding.space != SpatialPredictor::Any
        {
            return Vec::new();
        }
        let of_order = |p: &Pyramid, order| Pyramid { order, ..p.clone() };
        variants(best, |p| {
            let in_space: Vec<Axis> = p.order.iter().copied().filter(|axis| *axis != Axis::T).collect();
            self.orders_of_samples(&in_space).into_iter().map(|order| of_order(p, order)).collect()
        })
    }

    /// Other growths of steps.
    pub(super) fn growths(&self, best: &Scheme) -> Vec<Scheme> {
        let others = &GROWTHS[1..];
        variants(best, |p| others.iter().map(|&(growth, most)| Pyramid { growth, most, ..p.clone() }).collect())
    }

    /// No ghost nodes.
    pub(super) fn ghosts(&self, best: &Scheme) -> Vec<Scheme> {
        let other = |p: &Pyramid| if p.ghosts { vec![Pyramid { ghosts: false, ..p.clone() }] } else { Vec::new() };
        variants(best, other)
    }
}

/// The scheme with each of some pyramids in place of its own.
fn variants(best: &Scheme, of: impl Fn(&Pyramid) -> Vec<Pyramid>) -> Vec<Scheme> {
    let pyramids = best.pyramid.as_ref().map(of).unwrap_or_default();
    pyramids.into_iter().map(|pyramid| Scheme { pyramid: Some(pyramid), ..best.clone() }).collect()
}

/// The number of rows that functions are learned from, and the number of the first position.
const ROWS: usize = 64;
const LEARNING: usize = 1000;

/// Functions are learned for this many series and more.
const LEAST_SERIES: usize = 16;

/// The most voxels whose series are refined along time alone: that leaves no coarse lattices to read.
const FEW_SERIES: usize = 256;

/// The shrinkage of steps of coarser levels, and its limit; the choice begins with the first.
const GROWTHS: [(f64, f64); 3] = [(1.5, 3.0), (1.0, 1.0), (2.0, 4.0)];

/// The first step to try with learned functions, relative to the step for which rounding alone stays within the bound.
pub(super) const COARSE: f64 = 3.92;

/// As [`COARSE`], for any basis under a bound of the mean. A first step further from the best would reject families
/// that win when tuned.
const COARSE_OF_MEANS: f64 = 2.8;

/// The smallest bound relative to the largest sample at which 32-bit floats are used: their rounding then takes almost
/// none of it.
const SINGLE: f64 = 1.0 / (1 << 15) as f64;

/// Magnitudes at which 32-bit floats have full precision, and their sums and products are finite.
const LEAST_SINGLE: f64 = 1e-30;
const MOST_SINGLE: f64 = 1e30;
