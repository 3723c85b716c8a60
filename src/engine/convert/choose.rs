//! Chooses the scheme of a window: the one that makes some of its boxes smallest.
//!
//! Candidates are a learned basis along time (eq 20) with a pyramid in space, pyramids in space and time (eq 32) whose passes
//! along time come first or last, pyramids in space alone, frame by frame, and pyramids in time alone, voxel by voxel. The first
//! suits slow change and noise, the next two fronts and moving things, space alone what moves by more than its size from frame to
//! frame, time alone series that have nothing to do with each other. Axes come in the order of their smoothness
//! ([`smoothness`](super::smoothness)).
//!
//! The promising [candidates](super::candidates) are tuned in small boxes: first the step (eq 25 times a coarseness), then the order of
//! passes and the stencil (eq 33). Larger boxes confirm another growth of steps (eq 34) and that ghost nodes may be left out. With a linear
//! stencil, all orders are tried again.

use super::candidates::{COARSE, SchemeSelector};
use super::smoothness::roughest_first;
use super::trial_boxes::{BoxSize, Boxes, Sampled};
use super::{SchemeConstraint, SpatialPredictor};
use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::sample;
use wavesplat_core::codec::real::Real;
use wavesplat_core::codec::scheme::{Axis, Scheme};
use wavesplat_core::codec::trial::Trial;
use wavesplat_core::codec::{self, WindowCodec};
use wavesplat_core::wavelet::Basis;

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
        for variants in [Self::orders, Self::stencils] {
            best = self.or_variants(best, variants, &trials);
        }
        trials.retain(|of| of.basis == best.scheme.basis);
        best = self.confirmed(&best, &trials)?;
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
        let clearly = clearly(&best.of_boxes);
        others.reduce(fewer).filter(|other| other.bytes < best.bytes * clearly).unwrap_or(best)
    }

    /// A scheme with the best growth of steps, with ghost nodes or without. Small boxes have fewer coarse levels and more ghost nodes than
    /// blocks, so large boxes decide if another growth or no ghost nodes win in small ones. They also decide the coarseness if small ones
    /// have so few bytes that they hardly show how rare outliers are.
    fn confirmed<R: Real + Send + Sync>(&self, best: &Tried, trials: &[Transformed<'_, R>]) -> Result<Tried> {
        let varied = |tried, trials: &[_]| {
            let grown = self.or_variants(tried, Self::growths, trials);
            self.or_variants(grown, Self::ghosts, trials)
        };
        let of_small = varied(best.clone(), trials);
        let is_doubtful =
            best.scheme.coarseness > self.coarseness(COARSE) && best.of_boxes.iter().sum::<usize>() < FEW_BYTES;
        let sizes = [BoxSize::Small, BoxSize::Large].map(|size| self.boxes().voxels_of(size));
        let is_needed = sizes[0] != sizes[1] && (is_doubtful || of_small.scheme != best.scheme);
        let of_basis = of_basis(&best.scheme, trials).filter(|_| is_needed);
        let Some(of_basis) = of_basis else { return Ok(of_small) };
        let boxes = self.boxes().read(BoxSize::Large)?;
        let codec = self.with_scheme(&best.scheme, of_basis).clone(); // shares the functions
        let large = [Transformed::<R>::new(codec, &boxes)];
        let mut of_large = self.tried(best.scheme.clone(), &large);
        if is_doubtful {
            of_large = self.while_smaller(&of_large, 1.0 / COARSER, &large);
        }
        Ok(self.tried(varied(of_large, &large).scheme, trials))
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

    /// The scheme with a step that grows or shrinks by a factor while boxes become smaller.
    fn while_smaller<R: Real + Send + Sync>(&self, first: &Tried, factor: f64, trials: &[Transformed<'_, R>]) -> Tried {
        let (mut before, mut best) = (first.clone(), first.clone());
        loop {
            let scheme = Scheme { coarseness: best.scheme.coarseness * factor, ..best.scheme.clone() };
            let next = self.tried(scheme, trials);
            if next.bytes >= best.bytes {
                let is_near_outliers = factor > 1.0 && next.bytes > best.bytes * FAR_LARGER;
                return if is_near_outliers { before } else { best };
            }
            before = std::mem::replace(&mut best, next);
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

/// The factor by which a variant must make boxes of these bytes smaller.
fn clearly(of_boxes: &[usize]) -> f64 {
    let bytes = of_boxes.iter().sum::<usize>() as f64;
    CLEARLY.min(1.0 - bytes.max(1.0).sqrt().recip())
}

/// A scheme is tuned only if its estimate is at most this many times the smallest.
const PROMISING: f64 = 1.3;

/// A variant is used only if it makes boxes smaller by this factor: smaller gains do not carry over to blocks, which
/// are larger. Boxes of a few bytes differ by chance: a gain must be above one part in the root of their bytes.
const CLEARLY: f64 = 0.99;

/// Steps grow or shrink by this factor while the estimate improves.
const COARSER: f64 = 1.4;

/// If the next coarser step makes boxes larger by this factor, many samples just keep the bound, and in other places they miss it: the step
/// before the best one is used.
const FAR_LARGER: f64 = 2.0;

/// Coarser steps are confirmed in larger boxes if all boxes have fewer bytes.
const FEW_BYTES: usize = 8192;
