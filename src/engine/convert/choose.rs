//! Chooses the scheme of a window: the one that makes some of its boxes smallest.
//!
//! Candidates are a learned basis along time (eq 20) with a pyramid in space, pyramids in space and time (eq 32) whose passes
//! along time come first or last, pyramids in space alone, frame by frame, and pyramids in time alone, voxel by voxel. The first
//! suits slow change and noise, the next two fronts and moving things, space alone what moves by more than its size from frame to
//! frame, time alone series that have nothing to do with each other. Axes come in the order of their smoothness
//! ([`smoothness`](super::smoothness)).
//!
//! The promising candidates are tuned in small boxes: first the step (eq 25 times a coarseness), then the order of passes, the
//! stencil (eq 33) and the growth of steps (eq 34). Larger boxes confirm that ghost nodes may be left out. With a linear stencil,
//! all orders are tried again.

use super::learn::learned_functions;
use super::smoothness::{AXES, roughest_first};
use super::trial_boxes::{BoxSize, Boxes, Sampled, TrialBoxes};
use super::{ConvertConfig, SchemeConstraint, SpatialPredictor};
use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::sample;
use wavesplat_core::codec::bound::{ErrorBound, Measure};
use wavesplat_core::codec::real::Real;
use wavesplat_core::codec::scheme::{Axis, Pyramid, Scheme, Stencil};
use wavesplat_core::codec::trial::Trial;
use wavesplat_core::codec::{self, WindowCodec};
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

/// A transform along time, and the transformed boxes.
struct Transformed<'a, R: Real> {
    /// For the scheme that is tried now: making the functions of a long window takes longer than a trial.
    codec: Mutex<WindowCodec>,
    basis: Basis,
    boxes: Vec<Trial<'a, R>>,
    /// The voxels that the boxes stand for.
    voxels: f64,
}

impl<'a, R: Real + Send + Sync> Transformed<'a, R> {
    /// Some boxes under the transform of a codec.
    fn new(codec: WindowCodec, of: &'a Boxes) -> Self {
        let trial = |b: &'a Sampled| Trial::new(&codec, b.size, b.outer, &b.samples);
        let boxes = of.sampled.par_iter().map(trial).collect();
        Self { basis: codec.scheme.basis, boxes, voxels: of.voxels, codec: Mutex::new(codec) }
    }

    /// The voxels of all boxes.
    fn sampled(&self) -> f64 {
        self.boxes.iter().map(Trial::voxels).sum::<usize>() as f64
    }
}

/// A scheme that was tried.
#[derive(Clone)]
struct Tried {
    scheme: Scheme,
    /// The estimated bytes of the window.
    bytes: f64,
    /// The estimated bytes of each box.
    of_boxes: Vec<usize>,
}

impl SchemeSelector<'_> {
    /// The codec of the scheme that codes some boxes of the window in the fewest bytes. It does not depend on the number
    /// of threads.
    pub(super) fn choose(&self) -> Result<WindowCodec> {
        if let SchemeConstraint { basis: Some(basis), space: SpatialPredictor::Alone } = self.config.coding
            && basis != Basis::Learned
        {
            return Ok(self.codec(&Scheme::along_time(basis)));
        }
        if self.promise.delta <= 0.0 {
            let basis = self.config.coding.basis.unwrap_or(Basis::Samples);
            return Ok(self.codec(&Scheme::along_time(basis))); // all is stored exactly
        }
        if self.config.coding.space == SpatialPredictor::Alone {
            let (basis, functions) = (Basis::Learned, self.functions()?);
            let coarseness = self.coarseness(COARSE);
            return Ok(self.codec(&Scheme { functions, coarseness, ..Scheme::along_time(basis) }));
        }
        if self.single() { self.smallest::<f32>() } else { self.smallest::<f64>() }
    }

    /// The smallest of all families with a pyramid and their variants.
    fn smallest<R: Real + Send + Sync>(&self) -> Result<WindowCodec> {
        let block = |more: usize| self.archive.grid.dims.iter().map(|n| n.min(&self.edge) + more).product::<usize>();
        codec::make_spare::<R>(self.frames() * block(1), self.archive.sample); // trials use these before blocks do
        let smallest = self.smallest_of::<R>();
        codec::release_spare_below::<R>(self.frames() * block(0));
        smallest
    }

    fn smallest_of<R: Real + Send + Sync>(&self) -> Result<WindowCodec> {
        let boxes = self.boxes().read(BoxSize::Small)?;
        let families = self.families(&self.order(&boxes))?;
        let (mut learned, others): (Vec<_>, Vec<_>) = families.into_iter().partition(|f| f.basis == Basis::Learned);
        let mut trials = self.transformed::<R>(&others, &boxes);
        let others: Vec<_> = others.into_iter().map(|scheme| self.tried(scheme, &trials)).collect();
        // Making long functions orthonormal takes a time of the cube of their length: only if they can win.
        let least = others.iter().map(|tried| tried.bytes).fold(f64::INFINITY, f64::min);
        learned.retain(|scheme| bytes_of_functions(scheme) < least);
        trials.extend(self.transformed(&learned, &boxes));
        let learned = learned.into_iter().map(|scheme| self.tried(scheme, &trials));
        let families: Vec<_> = learned.chain(others).collect();
        let least = families.iter().map(|tried| tried.bytes).fold(f64::INFINITY, f64::min);
        let promising = families.into_iter().filter(|tried| tried.bytes <= least * PROMISING);
        if let Some(before) = self.before {
            let best = promising.clone().reduce(fewer);
            if let Some(best) = best.filter(|best| best.scheme.basis == before.basis) {
                return Ok(self.finished(best, trials));
            }
        }
        let tuned = promising.map(|tried| self.coarsest(tried, &trials));
        let mut best = tuned.reduce(fewer).ok_or_else(|| Error::setting("basis", "leaves nothing to choose from"))?;
        for variants in [Self::orders, Self::stencils, Self::growths] {
            best = self.or_variants(best, variants, &trials);
        }
        trials.retain(|of| of.basis == best.scheme.basis);
        best = self.with_or_without_ghosts(best, &trials)?;
        best = self.or_variants(best, Self::linear_orders, &trials);
        Ok(self.finished(best, trials))
    }

    /// A scheme, or one of its variants that is clearly smaller.
    fn or_variants<R: Real + Send + Sync>(
        &self,
        best: Tried,
        variants: fn(&Self, &Scheme) -> Vec<Scheme>,
        trials: &[Transformed<'_, R>],
    ) -> Tried {
        let others = variants(self, &best.scheme).into_iter().map(|scheme| self.tried(scheme, trials));
        others.reduce(fewer).filter(|other| other.bytes < best.bytes * CLEARLY).unwrap_or(best)
    }

    /// A scheme with ghost nodes or without. Ghost nodes are a larger share of a small box than of a block, so they are left out only if
    /// large boxes are smaller without them, too.
    fn with_or_without_ghosts<R: Real + Send + Sync>(
        &self,
        best: Tried,
        trials: &[Transformed<'_, R>],
    ) -> Result<Tried> {
        let of_small = self.or_variants(best.clone(), Self::ghosts, trials);
        let sizes = [BoxSize::Small, BoxSize::Large].map(|size| self.boxes().voxels_of(size));
        if of_small.scheme == best.scheme || sizes[0] == sizes[1] {
            return Ok(of_small);
        }
        let Some(of_basis) = of_basis(&best.scheme, trials) else { return Ok(best) };
        let boxes = self.boxes().read(BoxSize::Large)?;
        let codec = self.with_scheme(&best.scheme, of_basis).clone(); // shares the functions
        let trials = [Transformed::<R>::new(codec, &boxes)];
        let of_large = self.or_variants(self.tried(best.scheme.clone(), &trials), Self::ghosts, &trials);
        Ok(if of_large.scheme == best.scheme { best } else { of_small })
    }

    /// Whether most samples take less by lists of their values than by a scheme: then no blocks are above others.
    fn is_listed<R: Real + Send + Sync>(&self, tried: &Tried, trials: &[Transformed<'_, R>]) -> bool {
        let Some(of_basis) = of_basis(&tried.scheme, trials).filter(|_| self.lists) else { return false };
        let codec = self.with_scheme(&tried.scheme, of_basis);
        let boxes = of_basis.boxes.iter().zip(&tried.of_boxes);
        let listed = boxes.filter(|(of_box, bytes)| of_box.listed_bytes(&codec, **bytes).is_some());
        let share = listed.map(|(of_box, _)| of_box.voxels()).sum::<usize>() as f64 / of_basis.sampled();
        2.0 * share * of_basis.voxels > self.boxes().voxels() as f64
    }

    /// The codec of the chosen scheme.
    fn finished<R: Real + Send + Sync>(&self, best: Tried, trials: Vec<Transformed<'_, R>>) -> WindowCodec {
        let is_listed = self.is_listed(&best, &trials);
        let mut scheme = best.scheme;
        let is_in_space = scheme.pyramid.as_ref().is_some_and(|p| p.order.iter().any(|axis| *axis != Axis::T));
        let tiers = if is_in_space && !is_listed { self.tiers } else { 0 };
        scheme.pyramid.iter_mut().for_each(|pyramid| pyramid.tiers = tiers);
        let of_basis = trials.into_iter().find(|b| b.basis == scheme.basis);
        match of_basis {
            Some(of_basis) => {
                let codec = of_basis.codec.into_inner().unwrap_or_else(PoisonError::into_inner);
                WindowCodec { scheme: scheme.into(), ..codec }
            }
            None => self.codec(&scheme),
        }
    }

    /// The boxes under each of the schemes' transforms along time.
    fn transformed<'a, R: Real + Send + Sync>(&self, schemes: &[Scheme], boxes: &'a Boxes) -> Vec<Transformed<'a, R>> {
        let mut found: Vec<Transformed<'a, R>> = Vec::new();
        for scheme in schemes {
            if found.iter().all(|f| f.basis != scheme.basis) {
                found.push(Transformed::new(self.codec(scheme), boxes));
            }
        }
        found
    }

    /// The scheme with the step that makes the boxes smallest. A coarseness of exactly 1 stays.
    fn coarsest<R: Real + Send + Sync>(&self, first: Tried, trials: &[Transformed<'_, R>]) -> Tried {
        if first.scheme.coarseness == 1.0 {
            return first;
        }
        let coarser = self.while_smaller(&first, COARSER, trials);
        if coarser.bytes < first.bytes { coarser } else { self.while_smaller(&first, 1.0 / COARSER, trials) }
    }

    fn while_smaller<R: Real + Send + Sync>(&self, first: &Tried, factor: f64, trials: &[Transformed<'_, R>]) -> Tried {
        let mut best = first.clone();
        loop {
            let scheme = Scheme { coarseness: best.scheme.coarseness * factor, ..best.scheme.clone() };
            let next = self.tried(scheme, trials);
            if next.bytes >= best.bytes {
                return best;
            }
            best = next;
        }
    }

    /// A scheme with its estimated bytes.
    fn tried<R: Real + Send + Sync>(&self, scheme: Scheme, trials: &[Transformed<'_, R>]) -> Tried {
        let (Some(pyramid), Some(of_basis)) = (&scheme.pyramid, of_basis(&scheme, trials)) else {
            return Tried { scheme, bytes: f64::INFINITY, of_boxes: Vec::new() };
        };
        let codec = &*self.with_scheme(&scheme, of_basis);
        let of_boxes: Vec<usize> = of_basis.boxes.par_iter().map(|b| b.bytes(codec, pyramid)).collect();
        let of_sampled = of_boxes.iter().sum::<usize>() as f64;
        let bytes = of_sampled * of_basis.voxels / of_basis.sampled() + bytes_of_functions(&scheme);
        Tried { scheme, bytes, of_boxes }
    }

    /// Where boxes are taken from.
    fn boxes(&self) -> TrialBoxes<'_> {
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
    fn frames(&self) -> usize {
        self.channels[0].frames()
    }

    /// The axes from the roughest to the smoothest.
    fn order<'b>(&self, boxes: &'b Boxes) -> [Axis; 4] {
        let (ty, missing) = (self.archive.sample, self.config.missing_value);
        let values = |b: &'b Sampled| {
            let samples = &b.samples;
            let value = move |i: usize| {
                let mut value = 0.0;
                sample::load(ty, &samples[i * ty.size()..][..ty.size()], std::slice::from_mut(&mut value));
                if sample::is_missing(value, missing) { f64::NAN } else { value }
            };
            let [x, y, z] = b.size.known;
            (value, [x, y, z, self.frames()])
        };
        roughest_first(boxes.sampled.iter().map(values), self.promise.delta)
    }

    /// One scheme with a pyramid for each allowed transform along time.
    fn families(&self, order: &[Axis; 4]) -> Result<Vec<Scheme>> {
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
    fn functions(&self) -> Result<Vec<i16>> {
        let size = [self.archive.grid.dims[0], 1, 1];
        let rows = ROWS.min(self.most / (size[0] * self.frames())).max(1);
        let boxes = self.boxes();
        let places = boxes.active(LEARNING, rows, size)?.places;
        let samples = places.iter().map(|place| boxes.sampled(place)).collect::<Result<Vec<_>>>()?;
        let (ty, frames) = (self.archive.sample, self.frames());
        let samples = samples.iter().map(|row| &row.samples[..]);
        Ok(learned_functions(samples, ty, frames, self.config.missing_value, &self.promise))
    }

    fn pyramid(&self, order: &[Axis], stencil: Stencil) -> Pyramid {
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
    fn single(&self) -> bool {
        let normal = (LEAST_SINGLE..MOST_SINGLE).contains(&self.promise.delta) && self.magnitude < MOST_SINGLE;
        normal && self.promise.delta >= self.magnitude * SINGLE
    }

    /// The first coarseness to try. Under a bound of the mean, steps leave a budget for dropped coefficients
    /// ([`ErrorBound::step`]).
    fn coarseness(&self, of_largest: f64) -> f64 {
        match self.promise.measure() {
            Measure::Largest => of_largest,
            Measure::RootMeanSquare => COARSE_OF_MEANS,
        }
    }

    /// The next order: the last two axes are those that are predicted best, and nearly equally well.
    fn orders(&self, best: &Scheme) -> Vec<Scheme> {
        let swapped = |p: &Pyramid| {
            let mut order = p.order.clone();
            let Some(last) = order.len().checked_sub(1).filter(|last| *last > 0) else { return Vec::new() };
            order.swap(last - 1, last);
            vec![Pyramid { order, ..p.clone() }]
        };
        variants(best, swapped)
    }

    fn stencils(&self, best: &Scheme) -> Vec<Scheme> {
        match self.config.coding.space {
            SpatialPredictor::Any => {
                variants(best, |pyramid| vec![Pyramid { stencil: Stencil::Linear, ..pyramid.clone() }])
            }
            _ => Vec::new(),
        }
    }

    /// All orders of samples if the linear stencil is the best: families were compared with the other one.
    fn linear_orders(&self, best: &Scheme) -> Vec<Scheme> {
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

    fn growths(&self, best: &Scheme) -> Vec<Scheme> {
        let others = &GROWTHS[1..];
        variants(best, |p| others.iter().map(|&(growth, most)| Pyramid { growth, most, ..p.clone() }).collect())
    }

    fn ghosts(&self, best: &Scheme) -> Vec<Scheme> {
        let other = |p: &Pyramid| if p.ghosts { vec![Pyramid { ghosts: false, ..p.clone() }] } else { Vec::new() };
        variants(best, other)
    }

    /// The codec of a scheme with the same functions as those of a transform along time.
    fn with_scheme<'a, R: Real>(
        &self,
        scheme: &Scheme,
        of_basis: &'a Transformed<'_, R>,
    ) -> MutexGuard<'a, WindowCodec> {
        let mut codec = of_basis.codec.lock().unwrap_or_else(PoisonError::into_inner);
        codec.scheme = scheme.clone().into();
        codec
    }

    fn codec(&self, scheme: &Scheme) -> WindowCodec {
        let frames = self.frames();
        let mut codec = WindowCodec::new(scheme.clone(), frames, self.archive.sample, self.promise, self.edge);
        codec.missing_value = self.config.missing_value;
        codec.lists = self.lists;
        codec
    }
}

/// The transform along time of a scheme.
fn of_basis<'t, 'a, R: Real>(scheme: &Scheme, trials: &'t [Transformed<'a, R>]) -> Option<&'t Transformed<'a, R>> {
    trials.iter().find(|of| of.basis == scheme.basis)
}

/// Bytes that describe the functions of a scheme.
fn bytes_of_functions(scheme: &Scheme) -> f64 {
    (size_of::<i16>() * scheme.functions.len()) as f64
}

/// The scheme with fewer bytes; the first if equal.
fn fewer(a: Tried, b: Tried) -> Tried {
    if b.bytes < a.bytes { b } else { a }
}

fn variants(best: &Scheme, of: impl Fn(&Pyramid) -> Vec<Pyramid>) -> Vec<Scheme> {
    let pyramids = best.pyramid.as_ref().map(of).unwrap_or_default();
    pyramids.into_iter().map(|pyramid| Scheme { pyramid: Some(pyramid), ..best.clone() }).collect()
}

/// The number of rows that functions are learned from, and the number of the first position.
const ROWS: usize = 64;
const LEARNING: usize = 1000;

/// Functions are learned for this many series and more.
const LEAST_SERIES: usize = 16;

/// A scheme is tuned only if its estimate is at most this many times the smallest.
const PROMISING: f64 = 1.3;

/// A variant is used only if it makes boxes smaller by this factor: smaller gains do not carry over to blocks, which
/// are larger.
const CLEARLY: f64 = 0.99;

/// The most voxels whose series are refined along time alone: that leaves no coarse lattices to read.
const FEW_SERIES: usize = 256;

/// The shrinkage of steps of coarser levels, and its limit; the choice begins with the first.
const GROWTHS: [(f64, f64); 3] = [(1.5, 3.0), (1.0, 1.0), (2.0, 4.0)];

/// The first step to try with learned functions, relative to the step for which rounding alone stays within the bound.
const COARSE: f64 = 3.92;

/// As [`COARSE`], for any basis under a bound of the mean. A first step further from the best would reject families
/// that win when tuned.
const COARSE_OF_MEANS: f64 = 2.8;

/// Steps grow or shrink by this factor while the estimate improves.
const COARSER: f64 = 1.4;

/// The smallest bound relative to the largest sample at which 32-bit floats are used: their rounding then takes almost
/// none of it.
const SINGLE: f64 = 1.0 / (1 << 15) as f64;

/// Magnitudes at which 32-bit floats have full precision, and their sums and products are finite.
const LEAST_SINGLE: f64 = 1e-30;
const MOST_SINGLE: f64 = 1e30;
