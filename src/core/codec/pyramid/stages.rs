//! The order in which the lattices of a pyramid are refined: slice by slice along time, so that the spatial passes over a
//! slice stay in the cache.
//!
//! A stage refines slices in space and then, if there is a pass along time, adds the slices between them. Arrays hold
//! `[slice][z][y][x]` of the lattice at its current refinement. Before a pass along time, slices lie at even places.

use super::corrections::Correction;
use super::refine::{AddedNodes, Reach, Rows, refine_across, refine_lines, refine_slices};
use super::stencil::taps;
use super::within::Within;
use crate::base::grid::Region;
use crate::base::vectors::dispatch;
use crate::codec::buffer::Buffer;
use crate::codec::real::Real;
use std::ops::Range;
use wavesplat_format::{Axis, Pass, Stencil};

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
    /// What is computed of it.
    within: Within,
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
    /// The lattice after a pass, and the nodes that the pass adds; `before` is the one before it.
    fn new(Step { axis, lattice, added }: &Step, before: Option<&Self>) -> Self {
        let (extents, slices) = ([lattice[0], lattice[1], lattice[2]], lattice[3]);
        let rows = match (axis, before) {
            (Some(axis), Some(before)) if *axis != Axis::T => {
                let (axis, odds) = (axis.index(), if added.contains(&0) { 0 } else { added[axis.index()] });
                Rows::new(before.extents, axis, odds, extents[axis] - odds)
            }
            _ => Rows::default(),
        };
        let within = Within::new(extents, 0..extents[1], 0..extents[2]);
        Self { axis: *axis, extents, slices, added: added[..3].iter().product(), rows, within }
    }

    /// The rows along the refined axis that are computed.
    fn reach(&self) -> Reach {
        let ([x, y, _], Within { y: in_y, z: in_z, .. }) = (self.extents, self.within.clone());
        match self.axis {
            Some(Axis::Z) => Reach { outer: 0..1, rows: in_z, inner: in_y.start * x..in_y.end * x, width: x * y },
            Some(Axis::Y) => Reach { outer: in_z, rows: in_y, inner: 0..x, width: x },
            _ => Reach { outer: in_z, rows: 0..x, inner: in_y, width: y },
        }
    }

    /// The number of nodes in a slice.
    fn slice(&self) -> usize {
        self.extents.iter().product()
    }
}

/// A pass: its axis, the nodes along x, y, z, k after it, and the nodes that it adds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub(super) axis: Option<Axis>,
    pub(super) lattice: [usize; 4],
    pub(super) added: [usize; 4],
}

impl From<&Pass> for Step {
    fn from(pass: &Pass) -> Self {
        Self { axis: pass.axis, lattice: pass.lattice(), added: pass.extent() }
    }
}

impl Stages {
    pub(super) fn new(stencil: Stencil, steps: &[Step]) -> Self {
        let mut lattices: Vec<Lattice> = Vec::new();
        for step in steps {
            lattices.push(Lattice::new(step, lattices.last()));
        }
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

    /// Computes only what the nodes of a region, along y and z, depend on. The region is not empty.
    pub(super) fn narrow(&mut self, region: &Region) {
        let [mut y, mut z] = [1, 2].map(|axis| region.start[axis]..region.end[axis]);
        for lattice in self.lattices.iter_mut().rev() {
            lattice.within = Within::new(lattice.extents, y.clone(), z.clone());
            match lattice.axis {
                Some(Axis::Y) => y = lattice.rows.needed_before(self.stencil, y),
                Some(Axis::Z) => z = lattice.rows.needed_before(self.stencil, z),
                _ => {}
            }
        }
    }

    /// What is computed of the lattice after each pass.
    pub(super) fn within(&self) -> impl Iterator<Item = &Within> + Clone {
        self.lattices.iter().map(|lattice| &lattice.within)
    }

    /// Where the nodes that a pass adds lie in the slices that it refines: the first, and their distances along x, y, z.
    pub(super) fn places(&self, pass: usize) -> (usize, [usize; 3]) {
        let Lattice { axis, extents: [x, y, _], .. } = self.lattices[pass];
        let mut strides = [1, x, x * y];
        match axis {
            Some(axis) if axis != Axis::T => {
                strides[axis.index()] *= 2;
                (strides[axis.index()] / 2, strides)
            }
            _ => (0, strides),
        }
    }

    /// The number of the node at `place`, counted among the nodes that a pass adds to a slice, x fastest.
    pub(super) fn number(&self, pass: usize, place: usize) -> usize {
        let Lattice { axis, extents: [x, y, z], .. } = self.lattices[pass];
        let (mut node, mut added) = ([place % x, place / x % y, place / (x * y)], [x, y, z]);
        if let Some(axis) = axis.filter(|axis| *axis != Axis::T).map(Axis::index) {
            (node[axis], added[axis]) = (node[axis] / 2, added[axis] / 2);
        }
        node[0] + added[0] * (node[1] + added[1] * node[2])
    }

    /// Refines a pyramid from its coarsest nodes on: predicts nodes and has them corrected. `out` gets the slices that
    /// `wanted` marks; others are unspecified.
    pub(super) fn refine<R: Real>(&self, wanted: &[bool], out: &mut [R], correction: &mut impl Correction<R>) {
        let coarse = self.refine_others(wanted, correction);
        let Some(last) = self.stages.last() else { return out.copy_from_slice(&coarse) };
        self.refine_stage(last, wanted, &coarse, out, correction);
    }

    /// As [`Self::refine`], for all slices. Calls `visit(number, nodes)` for each. Only one is in memory if the last stage is in space
    /// alone.
    pub(super) fn for_each_slice<R: Real>(
        &self,
        correction: &mut impl Correction<R>,
        mut visit: impl FnMut(usize, &[R]),
    ) {
        let (slices, each) = self.lattices.last().map_or((0, 0), |last| (last.slices, last.slice()));
        let all = vec![true; slices];
        let Some(last) = self.stages.last().filter(|stage| stage.time.is_none()) else {
            let mut nodes = self.buffer(slices * each);
            self.refine(&all, &mut nodes, correction);
            return nodes.chunks_exact(each).enumerate().for_each(|(n, slice)| visit(n, slice));
        };
        let (coarse, mut fine) = (self.refine_others(&all, correction), self.buffer(each));
        for (n, slice) in coarse.chunks_exact(coarse.len() / slices).enumerate() {
            self.refine_slice(last, n, slice, &mut fine, correction);
            visit(n, &fine);
        }
    }

    /// The nodes before the last stage that the wanted slices need.
    fn refine_others<R: Real>(&self, wanted: &[bool], correction: &mut impl Correction<R>) -> Buffer<R> {
        let needed = self.needed(wanted);
        let first = &self.lattices[0];
        let mut coarse = self.buffer(first.slices * first.slice());
        for (n, slice) in coarse.chunks_exact_mut(first.slice()).enumerate() {
            slice[first.within.places.clone()].fill(R::default());
            correction.correct(0, n * first.added, slice);
            correction.complete(0, n, slice, &first.within);
        }
        let others = self.stages.split_last().map_or(&[][..], |(_, others)| others);
        for (stage, needed) in others.iter().zip(&needed) {
            let fine = &self.lattices[stage.ends()[1]];
            let mut nodes = self.buffer(fine.slices * fine.slice());
            self.refine_stage(stage, needed, &coarse, &mut nodes, correction);
            coarse = nodes;
        }
        coarse
    }

    fn refine_stage<R: Real>(
        &self,
        stage: &Stage,
        needed: &[bool],
        coarse: &[R],
        fine: &mut [R],
        correction: &mut impl Correction<R>,
    ) {
        let [before, after] = stage.ends().map(|pass| self.lattices[pass].slice());
        let needed_before = self.needed_before(stage, needed);
        for (n, slice) in coarse.chunks_exact(before).enumerate().filter(|(n, _)| needed_before[*n]) {
            let to = &mut fine[n * stage.apart() * after..][..after];
            self.refine_slice(stage, n, slice, to, correction);
        }
        let Some(time) = stage.time else { return };
        let within = &self.lattices[time].within;
        dispatch!(refine_slices(self.stencil, after, &within.places, needed, &mut *fine));
        for (n, slice) in fine.chunks_exact_mut(after).skip(1).step_by(2).enumerate() {
            if needed[2 * n + 1] {
                correction.correct(time, n * after, slice);
                correction.complete(time, n, slice, within);
            }
        }
    }

    /// Refines one slice in space.
    fn refine_slice<R: Real>(
        &self,
        stage: &Stage,
        n: usize,
        coarse: &[R],
        fine: &mut [R],
        correction: &mut impl Correction<R>,
    ) {
        let Some(last) = stage.spatial.clone().last() else {
            let places = self.lattices[stage.spatial.start].within.places.clone();
            return fine[places.clone()].copy_from_slice(&coarse[places]);
        };
        let mut nodes: Option<Buffer<R>> = None;
        for pass in stage.spatial.start..last {
            let mut finer = self.buffer(self.lattices[pass].slice());
            self.refine_pass(pass, n, nodes.as_deref().unwrap_or(coarse), &mut finer, correction);
            nodes = Some(finer);
        }
        self.refine_pass(last, n, nodes.as_deref().unwrap_or(coarse), fine, correction);
    }

    fn refine_pass<R: Real>(
        &self,
        pass: usize,
        n: usize,
        coarse: &[R],
        fine: &mut [R],
        correction: &mut impl Correction<R>,
    ) {
        let Lattice { rows, added, within, .. } = &self.lattices[pass];
        let (added, reach) = (AddedNodes { pass, first: n * added }, self.lattices[pass].reach());
        if rows.inner == 1 {
            dispatch!(refine_lines(self.stencil, rows, &reach, coarse, &mut *fine, added, &mut *correction));
        } else {
            dispatch!(refine_across(self.stencil, rows, &reach, coarse, &mut *fine, added, &mut *correction));
        }
        correction.complete(pass, n, fine, within);
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

    fn buffer<R: Real>(&self, len: usize) -> Buffer<R> {
        let is_whole = self.lattices.last().is_none_or(|last| last.within.is_whole(last.extents));
        if is_whole { Buffer::with_len(len) } else { Buffer::for_part(len) }
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
