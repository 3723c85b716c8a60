//! Codes to pictures without a footprint for each voxel: one accumulator per plane on the sheared lattice of the view.
//!
//! Voxels of a slice across the principal axis a are whole cells apart ([`shear`]), so the picture of a pass of a pyramid
//! across b or c is a convolution in whole cells: with s the stride of the new nodes and h the interior stencil,
//!
//! ```text
//! A(u) <- A(u) + sum over o of h_o exp(-tau z_o) A(u - o) + what the pass adds        o = -s, s, ...
//! ```
//!
//! where o moves by the depth z_o. The passes of levels 0 and 1 are done so; what is coarser is a 64th of the nodes, and
//! its values are spread as they are. Passes along a do nothing in the picture: what came before is expanded along a, slice
//! by slice, as the decoder would with no more codes. Passes along time act on whole planes. Operators along different axes
//! commute, so that in the end the sums are those of the decoded values, each spread over the cells around it by B-splines
//! and weighted by its depth: equal but for rounding, faces included ([`layer`]).
//!
//! Samples of frames, one for every voxel, are spread as they are, row by row ([`dense`]).

mod cells;
mod dense;
mod kernel;
mod layer;
mod picture;
mod shear;
mod spline;
#[cfg(test)]
mod tests;

use crate::codec::field::Field;
use crate::codec::pyramid::taps;
pub(super) use cells::Cells;
use cells::Row;
pub(super) use dense::Dense;
use layer::{Codes, Layer, Nodes, interior, slices};
pub(super) use picture::{Lattice, Sums};
use shear::Shear;
use spline::{Spread, spread};
use std::ops::Range;
use wavesplat_format::{Axis, Pass, Pyramid, Stencil};

/// A decoded block and its codes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Coded<'a> {
    /// The voxel that its first one is.
    pub(super) start: [usize; 3],
    /// Nodes along x, y, z, k.
    pub(super) shape: [usize; 4],
    pub(super) pyramid: Option<&'a Pyramid>,
    /// What codes of level 0 count.
    pub(super) step: f64,
    /// Pass after pass; used with a pyramid only.
    pub(super) codes: &'a [i32],
    pub(super) field: &'a Field<'a>,
}

/// How amounts are spread over the cells of a view.
#[derive(Debug, Clone, Copy)]
struct Spreading {
    shear: Shear,
    /// Of the B-splines; odd.
    degree: usize,
    tau: f64,
}

impl Spreading {
    /// The cells that slices of `count` nodes along b and c reach, and of `pad` nodes around them: the first ones, and how
    /// many.
    fn reached(&self, slices: &[Slice], count: [usize; 2], pad: usize) -> ([isize; 2], [usize; 2]) {
        let q = self.shear.fineness;
        let range = |i: usize| {
            let cells = || slices.iter().map(|s| s.cell[i]);
            let (low, high) = (cells().min().unwrap_or(0), cells().max().unwrap_or(0));
            (low - (q * pad) as isize, (high - low) as usize + q * (count[i] - 1 + 2 * pad) + self.degree + 1)
        };
        let (u, v) = (range(0), range(1));
        ([u.0, v.0], [u.1, v.1])
    }

    /// exp(-tau z) from a node to some others along b (0) or c (1).
    fn fading(&self, i: usize, nodes: Range<isize>) -> Vec<f64> {
        nodes.map(|n| libm::exp(-self.tau * self.shear.depths[i] * n as f64)).collect()
    }
}

/// A slice of a block across the principal axis.
#[derive(Debug)]
struct Slice {
    /// The first cell that the block's first node reaches.
    cell: [isize; 2],
    along: Spread,
    /// Times exp(-tau z) of the block's first node in the slice.
    across: Spread,
}

/// The sums of a block's planes `ks`, ascending; all of its planes if it is refined along time.
fn block_cells(block: &Coded<'_>, spreading: &Spreading, ks: &[usize]) -> Cells {
    let mut splat = BlockSplat::new(block, spreading, ks);
    match block.pyramid {
        None => splat.add_values([1; 4], None),
        Some(pyramid) => splat.add_pyramid(pyramid),
    }
    splat.cells
}

/// Levels below this one are refined in the picture.
const LEVELS: u32 = 2;

/// The sums of a block in the making.
struct BlockSplat<'a> {
    block: &'a Coded<'a>,
    spreading: &'a Spreading,
    ks: &'a [usize],
    nodes: Nodes<'a>,
    cells: Cells,
    slices: Vec<Slice>,
    /// exp(-tau z) from the block's first node to those at `-pad`, ... along b and c.
    fading: [Vec<f64>; 2],
    pad: usize,
    layer: Layer,
    work: [Vec<f64>; 2],
}

impl<'a> BlockSplat<'a> {
    fn new(block: &'a Coded<'a>, spreading: &'a Spreading, ks: &'a [usize]) -> Self {
        let shear = &spreading.shear;
        let nodes = Nodes { shape: block.shape, axes: shear.axes, field: block.field };
        let pad = block.pyramid.map_or(0, |p| reach(p.stencil) << (LEVELS - 1));
        let count = shear.axes.map(|axis| block.shape[axis]);
        let slices: Vec<Slice> = (0..count[2]).map(|k| Slice::new(block.start, spreading, k)).collect();
        let (first, size) = spreading.reached(&slices, [count[0], count[1]], pad);
        let cells = Cells::new(first, size, ks.len());
        let outside = pad as isize;
        let fading = [0, 1].map(|i| spreading.fading(i, -outside..count[i] as isize + outside));
        let (layer, work) = (Layer::default(), [Vec::new(), Vec::new()]);
        Self { block, spreading, ks, nodes, cells, slices, fading, pad, layer, work }
    }

    /// The values at every `strides[axis]`-th node, expanded along the principal axis.
    fn add_values(&mut self, strides: [usize; 4], stencil: Option<Stencil>) {
        let stride = strides[self.nodes.axes[2]];
        let slices = self.slices_of((0, stride), stride, stencil);
        for k in (0..self.block.shape[3]).step_by(strides[3]) {
            if let Ok(plane) = self.ks.binary_search(&k) {
                self.layer.put_values(&self.nodes, strides, k);
                self.add_layer(plane, &slices);
            }
        }
    }

    fn slices_of(&self, nodes: (usize, usize), stride: usize, stencil: Option<Stencil>) -> Vec<Vec<(usize, f64)>> {
        let length = self.block.shape[self.nodes.axes[2]];
        slices(stencil.unwrap_or(Stencil::Linear), length, nodes, stride)
    }

    /// The values of the coarse lattice, then pass after pass.
    fn add_pyramid(&mut self, pyramid: &Pyramid) {
        let passes = pyramid.passes(self.block.shape);
        let is_coarse = |pass: &Pass| pass.axis.is_none() || pass.level >= LEVELS;
        let split = passes.partition_point(is_coarse);
        let mut before = passes[0].strides.map(|s| s.min(1 << LEVELS));
        (0..4).filter(|a| !pyramid.order.iter().any(|o| o.index() == *a)).for_each(|a| before[a] = 1);
        self.add_values(before, Some(pyramid.stencil));
        let mut at: usize = passes[..split].iter().map(|pass| pass.codes(self.block.shape)).sum();
        for pass in &passes[split..] {
            let count = pass.codes(self.block.shape);
            let codes = &self.block.codes[at..at + count];
            at += count;
            let step = pyramid.step(self.block.step, pass.level);
            self.widen(pyramid, pass);
            self.add_codes(pyramid, &Codes { pass, codes, step });
        }
    }

    /// What a pass makes of what is there.
    fn widen(&mut self, pyramid: &Pyramid, pass: &Pass) {
        let Some(axis) = pass.axis else { return };
        let stride = pass.strides[axis.index()];
        if axis == Axis::T {
            return self.widen_time(pyramid.stencil, stride);
        }
        let Some(i) = (0..2).find(|i| self.nodes.axes[*i] == axis.index()) else { return };
        let Spreading { shear, tau, .. } = self.spreading;
        let moved = |(offset, weight): &(isize, f64)| {
            let nodes = offset * stride as isize;
            let mut cells = [0; 2];
            cells[i] = nodes * shear.fineness as isize;
            (cells, weight * libm::exp(-tau * shear.depths[i] * nodes as f64))
        };
        let moves: Vec<([isize; 2], f64)> = interior(pyramid.stencil).iter().map(moved).collect();
        for k in (0..self.block.shape[3]).step_by(pass.strides[3]) {
            if let Ok(plane) = self.ks.binary_search(&k) {
                self.cells.widen(plane, &moves, &mut self.work[0]);
            }
        }
    }

    fn widen_time(&mut self, stencil: Stencil, stride: usize) {
        let evens = self.block.shape[3].div_ceil(2 * stride);
        for (i, k) in (stride..self.block.shape[3]).step_by(2 * stride).enumerate() {
            let taps = taps(stencil, i, evens);
            let others: Vec<(usize, f64)> =
                (0..taps.count).map(|t| ((taps.first + t) * 2 * stride, taps.weights[t])).collect();
            self.cells.add_planes(k, &others);
        }
    }

    fn add_codes(&mut self, pyramid: &Pyramid, codes: &Codes<'_>) {
        let axis = self.nodes.axes[2];
        let slices = self.slices_of(codes.pass.nodes(axis), codes.pass.strides[axis], Some(pyramid.stencil));
        let (first, distance) = codes.pass.nodes(3);
        for (n, k) in (first..self.block.shape[3]).step_by(distance).enumerate() {
            if let Ok(plane) = self.ks.binary_search(&k) {
                self.layer.put_codes(&self.nodes, pyramid, codes, (n, k));
                self.add_layer(plane, &slices);
            }
        }
    }

    /// Adds the layer, `slices` saying what of it each slice is made of.
    fn add_layer(&mut self, plane: usize, slices: &[Vec<(usize, f64)>]) {
        let (q, degree, pad) = (self.spreading.shear.fineness, self.spreading.degree, self.pad as isize);
        let Self { layer, cells, fading, work: [work, line], .. } = self;
        let [distance_b, distance_c] = layer.distance;
        let mut amounts = Vec::new();
        for (slice, taps) in self.slices.iter().zip(slices).filter(|(_, taps)| !taps.is_empty()) {
            layer.for_each_row_of(taps, work, |c, b, row| {
                let node = [layer.first[0] + (b * distance_b) as isize, layer.first[1] + (c * distance_c) as isize];
                let [first_b, first_c] = node.map(|n| (n + pad) as usize);
                let faded = fading[0][first_b..].iter().step_by(distance_b);
                amounts.clear();
                amounts.extend(row.iter().zip(faded).map(|(v, f)| v * f));
                let across = slice.across.map(|w| w * fading[1][first_c]);
                let cell = [0, 1].map(|i| slice.cell[i] + node[i] * q as isize);
                let distance = q * distance_b;
                let row = Row { cell, distance, amounts: &amounts, degree, along: &slice.along, across: &across };
                cells.add_row(plane, &row, line);
            });
        }
    }
}

impl Slice {
    /// Of the `k`-th slice of a block that begins at voxel `start`.
    fn new(start: [usize; 3], spreading: &Spreading, k: usize) -> Self {
        let mut voxel = start;
        voxel[spreading.shear.axes[2]] += k;
        let [u, v] = spreading.shear.place(voxel).map(|place| spread(spreading.degree, place));
        let fading = libm::exp(-spreading.tau * spreading.shear.depth(voxel));
        Self { cell: [u.0, v.0], along: u.1, across: v.1.map(|w| w * fading) }
    }
}

/// Strides that a stencil reaches.
fn reach(stencil: Stencil) -> usize {
    match stencil {
        Stencil::Linear => 1,
        Stencil::Cubic => 3,
    }
}
