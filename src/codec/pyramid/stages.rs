//! The order in which the lattices of a pyramid are refined: slice by slice along time, so that the spatial passes over a
//! slice stay in the cache.
//!
//! A stage refines slices in space and then, if there is a pass along time, adds the slices between them. Arrays hold
//! `[slice][z][y][x]`, each the lattice as far as it is refined. Before a pass along time, slices lie at even places.

use super::Correction;
use super::refine::{Rows, refine_across, refine_lines, refine_slices, split};
use super::stencil::taps;
use crate::codec::buffer::Buffer;
use crate::codec::real::Real;
use std::ops::Range;
use wavesplat_format::{Axis, CodeBox, Pass, Stencil};

/// The passes of a pyramid in stages.
#[derive(Debug)]
pub(super) struct Stages {
    stencil: Stencil,
    lattices: Vec<Lattice>,
    stages: Vec<Stage>,
}

/// The lattice after a pass, and the pass.
#[derive(Debug)]
struct Lattice {
    axis: Option<Axis>,
    /// The nodes after the pass along x, y, z.
    extents: [usize; 3],
    /// The slices after the pass.
    slices: usize,
    /// The nodes that it adds to a slice.
    added: usize,
    /// The rows that a pass in space refines.
    rows: Rows,
}

/// Passes in space over all slices, and a pass along time.
#[derive(Debug)]
struct Stage {
    spatial: Range<usize>,
    time: Option<usize>,
}

impl Stage {
    /// The last pass before and in the stage.
    fn ends(&self) -> [usize; 2] {
        [self.spatial.start - 1, self.time.unwrap_or(self.spatial.end - 1)]
    }

    /// The distance of the slices that the passes in space refine.
    fn apart(&self) -> usize {
        1 + usize::from(self.time.is_some())
    }
}

impl Lattice {
    fn new(pass: &Pass, shape: [usize; 4]) -> Self {
        let after: [usize; 4] = std::array::from_fn(|a| shape[a].div_ceil(pass.strides[a]));
        let added = pass.extent(shape);
        let (extents, slices) = ([after[0], after[1], after[2]], after[3]);
        let rows = match pass.axis {
            Some(axis) if axis != Axis::T => {
                let odds = added[axis.index()];
                let mut before = extents;
                before[axis.index()] -= odds;
                Rows::new(before, axis.index(), odds)
            }
            _ => Rows::default(),
        };
        Self { axis: pass.axis, extents, slices, added: added[..3].iter().product(), rows }
    }

    /// The number of nodes in a slice.
    fn slice(&self) -> usize {
        self.extents.iter().product()
    }

    /// The number of slices to which the pass adds nodes.
    fn slices_refined(&self) -> usize {
        if self.axis == Some(Axis::T) { self.slices / 2 } else { self.slices }
    }
}

impl Stages {
    pub(super) fn new(stencil: Stencil, passes: &[Pass], shape: [usize; 4]) -> Self {
        let lattices: Vec<Lattice> = passes.iter().map(|pass| Lattice::new(pass, shape)).collect();
        let mut stages: Vec<Stage> = Vec::new();
        for (n, lattice) in lattices.iter().enumerate().skip(1) {
            let open = stages.last_mut().filter(|stage| stage.time.is_none());
            match (lattice.axis, open) {
                (Some(Axis::T), Some(stage)) => stage.time = Some(n),
                (Some(Axis::T), None) => stages.push(Stage { spatial: n..n, time: Some(n) }),
                (_, Some(stage)) => stage.spatial.end = n + 1,
                (_, None) => stages.push(Stage { spatial: n..n + 1, time: None }),
            }
        }
        Self { stencil, lattices, stages }
    }

    /// Where the codes of a pass over `extents` nodes lie in the slices that it refines.
    pub(super) fn placed(&self, pass: usize, extents: [usize; 4]) -> CodeBox {
        let Lattice { axis, extents: [x, y, _], .. } = self.lattices[pass];
        let mut of = CodeBox { extents, first: 0, strides: [1, x, x * y] };
        if let Some(axis) = axis.filter(|axis| *axis != Axis::T) {
            of.first = of.strides[axis.index()];
            of.strides[axis.index()] *= 2;
        }
        of
    }

    /// Refines a pyramid from its coarsest nodes on: predicts nodes and has them corrected. `out` gets the slices that
    /// `wanted` marks; others are unspecified.
    pub(super) fn refine<R: Real>(&self, wanted: &[bool], out: &mut [R], correction: &mut impl Correction<R>) {
        let needed = self.needed(wanted);
        let mut coarse = Buffer::of(self.lattices[0].slice());
        coarse.fill(R::default());
        correction.correct(0, 0, &mut coarse);
        correction.complete(0, 0, &mut coarse);
        let Some((last, others)) = self.stages.split_last() else { return out.copy_from_slice(&coarse) };
        for (stage, needed) in others.iter().zip(&needed) {
            let fine = &self.lattices[stage.ends()[1]];
            let mut nodes = Buffer::of(fine.slices * fine.slice());
            self.refine_stage(stage, needed, (&coarse, &mut nodes), correction);
            coarse = nodes;
        }
        self.refine_stage(last, wanted, (&coarse, out), correction);
    }

    fn refine_stage<R: Real>(
        &self,
        stage: &Stage,
        needed: &[bool],
        (coarse, fine): (&[R], &mut [R]),
        correction: &mut impl Correction<R>,
    ) {
        let [before, after] = stage.ends().map(|pass| self.lattices[pass].slice());
        let needed_before = self.needed_before(stage, needed);
        for (n, slice) in coarse.chunks_exact(before).enumerate().filter(|(n, _)| needed_before[*n]) {
            let to = &mut fine[n * stage.apart() * after..][..after];
            self.refine_slice(stage, (n, slice, to), correction);
        }
        let Some(time) = stage.time else { return };
        refine_slices(self.stencil, after, needed, fine);
        for (n, slice) in fine.chunks_exact_mut(after).skip(1).step_by(2).enumerate() {
            if needed[2 * n + 1] {
                correction.correct(time, n * after, slice);
                correction.complete(time, n, slice);
            }
        }
    }

    /// Refines one slice in space.
    fn refine_slice<R: Real>(
        &self,
        stage: &Stage,
        (n, coarse, fine): (usize, &[R], &mut [R]),
        correction: &mut impl Correction<R>,
    ) {
        let Some(last) = stage.spatial.clone().last() else { return fine.copy_from_slice(coarse) };
        let mut nodes: Option<Buffer<R>> = None;
        for pass in stage.spatial.start..last {
            let mut finer = Buffer::of(self.lattices[pass].slice());
            self.refine_pass(pass, (n, nodes.as_deref().unwrap_or(coarse), &mut finer), correction);
            nodes = Some(finer);
        }
        self.refine_pass(last, (n, nodes.as_deref().unwrap_or(coarse), fine), correction);
    }

    fn refine_pass<R: Real>(
        &self,
        pass: usize,
        (n, coarse, fine): (usize, &[R], &mut [R]),
        correction: &mut impl Correction<R>,
    ) {
        let Lattice { rows, added, .. } = &self.lattices[pass];
        let refine = if rows.inner == 1 { refine_lines } else { refine_across };
        refine(self.stencil, rows, coarse, fine, (pass, n * added, correction));
        correction.complete(pass, n, fine);
    }

    /// Splits the nodes of a pyramid into those that its passes add, pass after pass: the opposite of [`Self::refine`].
    pub(super) fn split<R: Real>(&self, nodes: &[R], added: &mut [R]) {
        let mut rest = added;
        let mut of_pass = |lattice: &Lattice| {
            let (own, after) = std::mem::take(&mut rest).split_at_mut(lattice.added * lattice.slices_refined());
            rest = after;
            own
        };
        let mut added: Vec<&mut [R]> = self.lattices.iter().map(&mut of_pass).collect();
        let mut fine: Option<Buffer<R>> = None;
        for stage in self.stages.iter().rev() {
            let before = &self.lattices[stage.ends()[0]];
            let mut coarse = Buffer::of(before.slices * before.slice());
            self.split_stage(stage, (fine.as_deref().unwrap_or(nodes), &mut coarse), &mut added);
            fine = Some(coarse);
        }
        added[0].copy_from_slice(fine.as_deref().unwrap_or(nodes));
    }

    fn split_stage<R: Real>(&self, stage: &Stage, (fine, coarse): (&[R], &mut [R]), added: &mut [&mut [R]]) {
        let [before, after] = stage.ends().map(|pass| self.lattices[pass].slice());
        if let Some(time) = stage.time {
            let odd = fine.chunks_exact(after).skip(1).step_by(2);
            odd.zip(added[time].chunks_exact_mut(after)).for_each(|(slice, to)| to.copy_from_slice(slice));
        }
        let even = fine.chunks_exact(after).step_by(stage.apart());
        for (n, (slice, to)) in even.zip(coarse.chunks_exact_mut(before)).enumerate() {
            self.split_slice(stage, (n, slice, to), added);
        }
    }

    /// Splits one slice in space.
    fn split_slice<R: Real>(&self, stage: &Stage, (n, fine, coarse): (usize, &[R], &mut [R]), added: &mut [&mut [R]]) {
        let mut nodes: Option<Buffer<R>> = None;
        for pass in stage.spatial.clone().rev() {
            let Lattice { rows, added: own, .. } = &self.lattices[pass];
            let mut even = Buffer::of(rows.even_nodes());
            split(rows, nodes.as_deref().unwrap_or(fine), &mut even, &mut added[pass][n * own..][..*own]);
            nodes = Some(even);
        }
        coarse.copy_from_slice(nodes.as_deref().unwrap_or(fine));
    }

    /// For every stage but the last, the slices after it that the wanted ones need.
    fn needed(&self, wanted: &[bool]) -> Vec<Vec<bool>> {
        let mut needed = vec![wanted.to_vec()];
        for stage in self.stages.iter().skip(1).rev() {
            needed.push(self.needed_before(stage, &needed[needed.len() - 1]));
        }
        needed.reverse();
        needed
    }

    /// The slices before a stage that those after it need.
    fn needed_before(&self, stage: &Stage, needed: &[bool]) -> Vec<bool> {
        if stage.time.is_none() {
            return needed.to_vec();
        }
        let mut before: Vec<bool> = needed.iter().copied().step_by(2).collect();
        for odd in (1..needed.len()).step_by(2).filter(|odd| needed[*odd]) {
            let taps = taps(self.stencil, odd / 2, before.len());
            before[taps.first..][..taps.count].fill(true);
        }
        before
    }
}
