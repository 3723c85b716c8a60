//! Corrections of predicted nodes: codes are added to them (decoding), or computed from them (encoding).

use super::known::KnownNodes;
use super::within::Within;
use crate::codec::real::Real;
use crate::codec::rows;
use wavesplat_format::SparseCodes;

/// Corrects predicted nodes: adds codes, or computes them.
pub(super) trait Correction<R> {
    /// Corrects consecutive nodes that a pass adds, from number `first` of them on.
    fn correct(&mut self, pass: usize, first: usize, predicted: &mut [R]);

    /// Completes what is computed of the `slice`-th of the slices that a pass adds nodes to.
    fn complete(&mut self, pass: usize, slice: usize, nodes: &mut [R], within: &Within);
}

/// Adds the codes of a pyramid to complete slices, times the step of their level (eq 32).
pub(super) struct Decoding<'a, R> {
    pub(super) codes: &'a SparseCodes,
    /// For each pass the step, and the first run of each of its boxes.
    pub(super) passes: Vec<(R, Vec<usize>)>,
    /// Nodes that have their value from the block above.
    pub(super) known: Option<KnownNodes<'a, R>>,
}

impl<R: Real> Correction<R> for Decoding<'_, R> {
    #[inline(always)]
    fn correct(&mut self, _: usize, _: usize, _: &mut [R]) {}

    fn complete(&mut self, pass: usize, slice: usize, nodes: &mut [R], within: &Within) {
        if let Some(known) = &self.known {
            known.restore(pass, slice, nodes, within, |_, _, _| {});
        }
        let ((step, runs), first) = (&self.passes[pass], within.places.start);
        let computed = &mut nodes[within.places.clone()];
        for run in runs {
            let (places, values) = self.codes.run(run + slice);
            for (place, code) in places.iter().zip(values) {
                if let Some(node) = computed.get_mut((*place as usize).wrapping_sub(first)) {
                    *node = *node + R::from_code(*code) * *step;
                }
            }
        }
    }
}

/// Computes the codes of a pyramid, and turns predictions into decoded nodes (eq 32).
pub(super) struct Encoding<'a, R> {
    /// The source's nodes, pass after pass.
    pub(super) split: &'a [R],
    /// The codes of each pass.
    pub(super) codes: Vec<&'a mut [i32]>,
    /// For each pass its first node in `split`, its step and the inverse of that.
    pub(super) passes: Vec<(usize, [R; 2])>,
    /// Nodes that have their value from the block above, and no code.
    pub(super) known: Option<KnownNodes<'a, R>>,
    /// Whether all codes fit.
    pub(super) fits: bool,
}

impl<R: Real> Correction<R> for Encoding<'_, R> {
    #[inline(always)]
    fn correct(&mut self, pass: usize, first: usize, predicted: &mut [R]) {
        let (start, steps) = self.passes[pass];
        self.fits &= rows::encode(&self.split[start + first..], predicted, &mut self.codes[pass][first..], steps);
    }

    fn complete(&mut self, pass: usize, slice: usize, nodes: &mut [R], within: &Within) {
        let Some(known) = &self.known else { return };
        let (codes, count) = (&mut *self.codes[pass], nodes.len());
        known.restore(pass, slice, nodes, within, |at, apart, nodes| {
            let codes = codes.get_mut(slice * count + at..).unwrap_or_default(); // known passes have none
            codes.iter_mut().step_by(apart).take(nodes).for_each(|code| *code = 0);
        });
    }
}
