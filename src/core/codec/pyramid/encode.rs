//! Encoding of a field: codes and decoded nodes from the source's nodes (eq 32).

use super::PredictionPasses;
use super::corrections::Encoding;
use super::known::Nodes;
use super::refine::gather;
use crate::base::vectors::dispatch;
use crate::codec::buffer::Buffer;
use crate::codec::real::{IntoNode, Real};
use std::ops::Range;
use wavesplat_format::Pass;

impl PredictionPasses<'_> {
    /// Whether each k may have codes that are not zero without known nodes. `largest` are upper bounds of the magnitudes of its nodes.
    pub(crate) fn may_have_codes<R: Real>(&self, step: f64, largest: &[R]) -> Vec<bool> {
        let least = self.negligible(step);
        largest.iter().map(|largest| *largest >= least).collect()
    }

    /// Nodes of smaller magnitude get codes of zero, if they are predicted to be zero.
    fn negligible<R: Real>(&self, step: f64) -> R {
        let steps = self.passes.iter().map(|pass| self.pyramid.step(step, pass.level));
        R::from_f64(LESS_THAN_HALF * steps.fold(step, f64::min))
    }

    /// Encodes the source's nodes, and fills the field with the decoded ones. The source may have more nodes than are needed.
    /// NaN nodes get the code 0. False if a code does not fit. `codes` are in order, pass after pass. Where neither the source nor
    /// known nodes mark a k, its codes are zero, and its nodes in the field arbitrary.
    pub(crate) fn encode<R: Real, V: IntoNode<R>>(
        &self,
        step: f64,
        source: Nodes<'_, V>,
        known: Option<Nodes<'_, R>>,
        field: &mut [R],
        codes: &mut [i32],
    ) -> bool {
        let each = source.size.iter().product::<usize>() * self.shape[3];
        let has_nodes = |number| self.ks(number).any(|k| source.has(k));
        let split = |number: usize, _: &[R], split: &mut [R]| {
            self.split(&source.values[number * each..][..each], source.size, split);
        };
        self.encode_each(step, has_nodes, split, known, field, codes)
    }

    /// As [`Self::encode`]. The source's nodes lie in the field, with `size` along x, y, z, and are overwritten.
    pub(crate) fn encode_in_place<R: Real>(
        &self,
        step: f64,
        size: [usize; 3],
        marked: &[bool],
        known: Option<Nodes<'_, R>>,
        field: &mut [R],
        codes: &mut [i32],
    ) -> bool {
        let each = size.iter().product::<usize>() * self.shape[3];
        let has_nodes = |number| self.ks(number).any(|k| marked[k]);
        let split = |number: usize, field: &[R], split: &mut [R]| {
            self.split(&field[number * each..][..each], size, split);
        };
        self.encode_each(step, has_nodes, split, known, field, codes)
    }

    /// Encodes one pyramid after the other. `split_source(number, field, nodes)` sorts the source's nodes of one.
    fn encode_each<R: Real>(
        &self,
        step: f64,
        has_nodes: impl Fn(usize) -> bool,
        split_source: impl Fn(usize, &[R], &mut [R]),
        known: Option<Nodes<'_, R>>,
        field: &mut [R],
        codes: &mut [i32],
    ) -> bool {
        let mut fits = true;
        let ranges: Vec<_> = (0..self.pyramids).map(|number| self.code_ranges(number)).collect();
        let mut split = Buffer::with_len(self.codes() / self.pyramids);
        for (number, ranges) in ranges.iter().enumerate() {
            if !has_nodes(number) && known.is_none_or(|known| known.is_zero(self.ks(number))) {
                apart(codes, ranges).into_iter().for_each(|codes| codes.fill(0));
                continue;
            }
            split_source(number, field, &mut split);
            let nodes = &mut field[number * self.pyramid_nodes()..][..self.pyramid_nodes()]; // it ends no later than the source's nodes that are already sorted
            let (codes, known) = (apart(codes, ranges), known.map(|known| self.known(number, known)));
            let mut encoding = Encoding { split: &split, codes, passes: self.inverses(step), known, fits: true };
            self.stages.refine(&vec![true; self.shape[3]], nodes, &mut encoding);
            fits &= encoding.fits;
        }
        fits
    }

    /// Sorts the source's nodes of a pyramid by the passes that add them.
    fn split<R: Real, V: IntoNode<R>>(&self, source: &[V], size: [usize; 3], split: &mut [R]) {
        let mut rest = split;
        for pass in &self.passes {
            let (added, after) = std::mem::take(&mut rest).split_at_mut(pass.codes());
            if !added.is_empty() {
                dispatch!(gather(source, size, pass, added));
            }
            rest = after;
        }
    }

    /// For each pass its first node in a pyramid's nodes pass after pass, its step and the inverse of that.
    fn inverses<R: Real>(&self, step: f64) -> Vec<(usize, [R; 2])> {
        let mut start = 0;
        let of_pass = |pass: &Pass| {
            let step = self.pyramid.step(step, pass.level);
            let first = start;
            start += pass.codes();
            (first, [R::from_f64(step), R::from_f64(1.0 / step)])
        };
        self.passes.iter().map(of_pass).collect()
    }
}

/// Less than half, so that products with a rounded inverse of a step are, too.
const LESS_THAN_HALF: f64 = 0.499;

/// The parts of a slice at ascending ranges.
fn apart<'a>(codes: &'a mut [i32], ranges: &[Range<usize>]) -> Vec<&'a mut [i32]> {
    let (mut rest, mut start) = (codes, 0);
    let part = |range: &Range<usize>| {
        let (part, after) = std::mem::take(&mut rest)[range.start - start..].split_at_mut(range.len());
        (rest, start) = (after, range.end);
        part
    };
    ranges.iter().map(part).collect()
}
