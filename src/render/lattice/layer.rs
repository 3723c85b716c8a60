//! What one pass of a pyramid adds to a block's picture, in one plane: amounts on a sublattice of nodes.
//!
//! In the picture a pass widens all sums by its interior stencil (`lattice/mod.rs`). What it adds at a node is what the node
//! then still lacks,
//!
//! ```text
//! r'(n) = v(n) - sum over o of h_o v(n - o)        v = 0 outside the block
//! ```
//!
//! which inside is the code times its step. Next to a face another rule predicts the node, and outside, where v(n) = 0, the
//! stencil spills over: both differ from the code by a few values of even nodes.

use crate::codec::field::Field;
use crate::codec::pyramid::{refine_line, taps};
use std::ops::Range;
use wavesplat_format::{Pass, Pyramid, Stencil};

/// A block as it is coded, and as it is decoded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nodes<'a> {
    /// Nodes along x, y, z, k.
    pub(super) shape: [usize; 4],
    /// Which axes are b, c and a.
    pub(super) axes: [usize; 3],
    /// The coefficients that the codes give.
    pub(super) field: &'a Field<'a>,
}

/// The codes of one pass.
#[derive(Debug, Clone, Copy)]
pub(super) struct Codes<'a> {
    pub(super) pass: &'a Pass,
    pub(super) codes: &'a [i32],
    /// What they count.
    pub(super) step: f64,
}

/// Amounts on a sublattice of a block's nodes.
#[derive(Debug, Default)]
pub(super) struct Layer {
    /// The first node along b and c, from the block's first one; may lie outside.
    pub(super) first: [isize; 2],
    /// From one node to the next.
    pub(super) distance: [usize; 2],
    /// Nodes along b, c and a.
    count: [usize; 3],
    /// b fastest, then c, then a.
    amounts: Vec<f64>,
    /// Of each row along b what is not zero.
    spans: Vec<Range<usize>>,
}

/// Where a strided sublattice is in an array: its first node, and from one to the next along b, c and a.
struct Places {
    start: usize,
    steps: [usize; 3],
}

impl Places {
    fn row(&self, c: usize, a: usize) -> usize {
        self.start + c * self.steps[1] + a * self.steps[2]
    }
}

impl Nodes<'_> {
    /// The nodes of plane `k` that a pass of such first nodes and distances has, in the field.
    fn places(&self, nodes: [(usize, usize); 3], k: usize) -> Places {
        let stride = |axis: usize| self.shape[..axis].iter().product::<usize>();
        let strides = self.axes.map(stride);
        let start = (0..3).fold(k * stride(3), |start, i| start + nodes[i].0 * strides[i]);
        Places { start, steps: std::array::from_fn(|i| nodes[i].1 * strides[i]) }
    }
}

impl Layer {
    /// The values of plane `k` at every `strides[axis]`-th node.
    pub(super) fn put_values(&mut self, nodes: &Nodes<'_>, strides: [usize; 4], k: usize) {
        let along = nodes.axes.map(|axis| (0, strides[axis]));
        let count = nodes.axes.map(|axis| nodes.shape[axis].div_ceil(strides[axis]));
        self.reset([0; 2], [along[0].1, along[1].1], count);
        let places = nodes.places(along, k);
        self.for_each_row(0..count[1], |row, c, a| {
            let start = places.row(c, a);
            row.iter_mut().enumerate().for_each(|(b, v)| *v = nodes.field.at(start + b * places.steps[0]));
        });
        self.find_spans();
    }

    /// What a pass adds to plane `k`, the `n`-th that it adds nodes to.
    pub(super) fn put_codes(
        &mut self,
        nodes: &Nodes<'_>,
        pyramid: &Pyramid,
        codes: &Codes<'_>,
        (n, k): (usize, usize),
    ) {
        let pass = codes.pass;
        let across = (0..2).find(|i| pass.axis.is_some_and(|axis| axis.index() == nodes.axes[*i]));
        let along = nodes.axes.map(|axis| pass.nodes(axis));
        let extent = pass.extent(nodes.shape);
        let mut count = nodes.axes.map(|axis| extent[axis]);
        let mut first = [along[0].0 as isize, along[1].0 as isize];
        let mut ghosts = [0; 2];
        if let Some(i) = across {
            let lead = ghosts_before(pyramid.stencil);
            ghosts[i] = lead;
            first[i] -= (lead * along[i].1) as isize;
            count[i] = nodes.shape[nodes.axes[i]].div_ceil(along[i].1) + 2 * lead - 1;
        }
        self.reset(first, [along[0].1, along[1].1], count);
        self.add_codes(nodes, codes, extent, ghosts, n);
        if let Some(i) = across {
            self.add_faces(nodes, pyramid.stencil, pass, (i, ghosts[i]), k);
        }
        self.find_spans();
    }

    fn reset(&mut self, first: [isize; 2], distance: [usize; 2], count: [usize; 3]) {
        (self.first, self.distance, self.count) = (first, distance, count);
        self.amounts.clear();
        self.amounts.resize(count.iter().product(), 0.0);
    }

    /// Calls `visit(row along b, c, a)` for rows of all a and some c.
    fn for_each_row(&mut self, c: Range<usize>, mut visit: impl FnMut(&mut [f64], usize, usize)) {
        let [width, height, _] = self.count;
        for (a, slice) in self.amounts.chunks_exact_mut((width * height).max(1)).enumerate() {
            let rows = slice.chunks_exact_mut(width).enumerate().skip(c.start).take(c.len());
            rows.for_each(|(c, row)| visit(row, c, a));
        }
    }

    fn add_codes(&mut self, nodes: &Nodes<'_>, codes: &Codes<'_>, extent: [usize; 4], ghosts: [usize; 2], n: usize) {
        let stride = |axis: usize| extent[..axis].iter().product::<usize>();
        let places = Places { start: n * stride(3), steps: nodes.axes.map(stride) };
        let (inside_b, inside_c) = (extent[nodes.axes[0]], extent[nodes.axes[1]]);
        let step = codes.step;
        self.for_each_row(ghosts[1]..ghosts[1] + inside_c, |row, c, a| {
            let start = places.row(c - ghosts[1], a);
            let row = &mut row[ghosts[0]..ghosts[0] + inside_b];
            if places.steps[0] == 1 {
                row.iter_mut().zip(&codes.codes[start..]).for_each(|(v, code)| *v = f64::from(*code) * step);
            } else {
                let codes = codes.codes[start..].iter().step_by(places.steps[0]);
                row.iter_mut().zip(codes).for_each(|(v, code)| *v = f64::from(*code) * step);
            }
        });
    }

    /// Adds what nodes next to the faces across b (0) or c (1), and outside, need.
    fn add_faces(&mut self, nodes: &Nodes<'_>, stencil: Stencil, pass: &Pass, (i, lead): (usize, usize), k: usize) {
        let axis = nodes.axes[i];
        let mut along = nodes.axes.map(|axis| pass.nodes(axis));
        along[i].0 = 0; // even nodes
        let places = nodes.places(along, k);
        let [width, height, depth] = self.count;
        for face in faces(stencil, nodes.shape[axis], pass.strides[axis]) {
            let at = (face.node + lead as isize) as usize;
            for a in 0..depth {
                for other in 0..self.count[1 - i] {
                    let [b, c] = if i == 0 { [at, other] } else { [other, at] };
                    let origin = places.start + a * places.steps[2] + other * places.steps[1 - i];
                    let value = |(even, w): &(usize, f64)| w * nodes.field.at(origin + even * places.steps[i]);
                    self.amounts[(a * height + c) * width + b] += face.evens.iter().map(value).sum::<f64>();
                }
            }
        }
    }

    fn find_spans(&mut self) {
        let span = |row: &[f64]| {
            let first = row.iter().position(|v| *v != 0.0)?;
            let last = row.iter().rposition(|v| *v != 0.0)?;
            Some(first..last + 1)
        };
        self.spans.clear();
        let rows = self.amounts.chunks_exact(self.count[0].max(1));
        self.spans.extend(rows.map(|row| span(row).unwrap_or(0..0)));
    }

    /// Calls `visit(c, first b, amounts)` for the rows of a slice that are not zero; `taps` are (node along a, weight).
    pub(super) fn for_each_row_of(
        &self,
        taps: &[(usize, f64)],
        work: &mut Vec<f64>,
        mut visit: impl FnMut(usize, usize, &[f64]),
    ) {
        let [width, height, _] = self.count;
        for c in 0..height {
            let spans = taps.iter().map(|(a, _)| &self.spans[a * height + c]).filter(|s| !s.is_empty());
            let Some(span) = spans.cloned().reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)) else { continue };
            work.clear();
            work.resize(span.len(), 0.0);
            for (a, weight) in taps.iter().filter(|(a, _)| !self.spans[a * height + c].is_empty()) {
                let row = &self.amounts[(a * height + c) * width..][span.clone()];
                work.iter_mut().zip(row).for_each(|(sum, v)| *sum += weight * v);
            }
            visit(c, span.start, work);
        }
    }
}

/// What a node near a face needs: weights of even nodes.
struct Face {
    /// Odd node `node` lies between the even nodes `node` and `node` + 1.
    node: isize,
    evens: Vec<(usize, f64)>,
}

/// Odd nodes before a block that the stencil spills to.
fn ghosts_before(stencil: Stencil) -> usize {
    match stencil {
        Stencil::Linear => 1,
        Stencil::Cubic => 2,
    }
}

/// The interior stencil: (offset in strides, weight).
pub(super) fn interior(stencil: Stencil) -> &'static [(isize, f64)] {
    match stencil {
        Stencil::Linear => &[(-1, 0.5), (1, 0.5)],
        Stencil::Cubic => &[(-3, -0.0625), (-1, 0.5625), (1, 0.5625), (3, -0.0625)],
    }
}

/// The odd nodes of a line that are not predicted by the interior stencil, and those outside that it spills to.
fn faces(stencil: Stencil, length: usize, stride: usize) -> Vec<Face> {
    let (evens, odds) = (length.div_ceil(2 * stride), length.saturating_sub(stride).div_ceil(2 * stride));
    let lead = ghosts_before(stencil) as isize;
    let of_node = |node: isize| {
        let mut weights = vec![0.0; evens];
        if (0..odds as isize).contains(&node) {
            let taps = taps(stencil, node as usize, evens);
            (0..taps.count).for_each(|t| weights[taps.first + t] += taps.weights[t]);
        }
        for (offset, weight) in interior(stencil) {
            let even = node + (1 - offset) / 2; // the even node that lies `offset` strides before
            if let Some(w) = usize::try_from(even).ok().and_then(|even| weights.get_mut(even)) {
                *w -= weight;
            }
        }
        let evens = weights.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect();
        Face { node, evens }
    };
    let nodes = -lead..evens as isize + lead - 1;
    nodes.map(of_node).filter(|face| !face.evens.is_empty()).collect()
}

/// For every slice along a: the nodes, of those at `first` and every `distance` further, of which finer passes without
/// codes make it, and their weights. Passes down to `stride` are done.
pub(super) fn slices(
    stencil: Stencil,
    length: usize,
    (first, distance): (usize, usize),
    stride: usize,
) -> Vec<Vec<(usize, f64)>> {
    let mut slices = vec![Vec::new(); length];
    for (n, node) in (first..length).step_by(distance).enumerate() {
        let mut line = vec![0.0; length];
        line[node] = 1.0;
        refine_line(stencil, stride, &mut line);
        slices.iter_mut().zip(line).filter(|(_, w)| *w != 0.0).for_each(|(slice, w)| slice.push((n, w)));
    }
    slices
}
