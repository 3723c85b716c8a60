//! The nodes with which a block below the last tier begins: those of the block above that lie in it (eq 44).

use super::within::{Within, around};
use crate::base::grid::Region;
use crate::codec::real::Real;
use crate::codec::rows;
use std::ops::Range;
use wavesplat_format::{Axis, Pass};

/// Nodes of a lattice, `[k][z][y][x]`, x fastest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nodes<'a, R> {
    /// Their values; empty if all are zero.
    pub(crate) values: &'a [R],
    /// Their number along x, y, z.
    pub(crate) size: [usize; 3],
    /// Whether each k may have nodes that are not zero; the values of others are arbitrary. `None` if all may.
    pub(crate) marked: Option<&'a [bool]>,
}

impl<V> Nodes<'_, V> {
    /// Whether a k may have nodes that are not zero.
    pub(super) fn has(&self, k: usize) -> bool {
        self.marked.is_none_or(|marked| marked[k])
    }
}

impl<R: Real> Nodes<'_, R> {
    /// Whether all nodes of all these k are zero.
    pub(crate) fn is_zero(&self, mut ks: Range<usize>) -> bool {
        let each: usize = self.size.iter().product();
        let nodes = |k: usize| self.values.get(k * each..(k + 1) * each).unwrap_or_default();
        ks.all(|k| !self.has(k) || rows::is_zero(nodes(k)))
    }

    /// The rest of a row of nodes, from the `x`-th on, and what follows it. Empty if all are zero.
    fn row(&self, k: usize, [x, y, z]: [usize; 3]) -> &[R] {
        let [nx, ny, nz] = self.size;
        let first = x + nx * (y + ny * (z + nz * k));
        self.values.get(first..).filter(|_| self.has(k)).unwrap_or_default()
    }

    /// Copies a region of every k that has some; only the rows along x of `part`, counted from the region's first node.
    pub(crate) fn copy(&self, region: &Region, part: &Region, out: &mut [R]) {
        let (Region { start: [x, y, z], .. }, [nx, ny, nz]) = (*region, region.dims());
        let [of_y, of_z] = [1, 2].map(|axis| part.start[axis]..part.end[axis]);
        for (k, of_k) in out.chunks_exact_mut(nx * ny * nz).enumerate().filter(|(k, _)| self.has(*k)) {
            for (row_z, row_y) in of_z.clone().flat_map(|z| of_y.clone().map(move |y| (z, y))) {
                let to = &mut of_k[nx * (row_y + ny * row_z)..][..nx];
                put(self.row(k, [x, y + row_y, z + row_z]), 1, to);
            }
        }
    }
}

/// The known nodes on the lattices of one pyramid's passes.
#[derive(Debug)]
pub(super) struct KnownNodes<'a, R> {
    known: Nodes<'a, R>,
    /// The k of the pyramid's first nodes.
    first: usize,
    passes: Vec<Option<Place>>,
}

/// Where known nodes lie on the lattice after a pass.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Nodes of the lattice along x, y, z.
    extents: [usize; 3],
    /// Every how many of these is known.
    every: [usize; 3],
    /// The first frame that the pass adds, and the distance to the next.
    frames: (usize, usize),
}

impl Place {
    fn new(pass: &Pass) -> Option<Self> {
        let [x, y, z, _] = pass.lattice();
        let every = |a: usize| if pass.is_known { 1 } else { (2 / pass.strides[a]).max(1) };
        let place = Self { extents: [x, y, z], every: std::array::from_fn(every), frames: pass.nodes(3) };
        (pass.is_known || pass.axis == Some(Axis::T)).then_some(place)
    }

    /// The known nodes along y and z that lie in what is computed of the lattice.
    fn known(&self, within: &Within) -> [Range<usize>; 2] {
        let known = |of: &Range<usize>, every: usize| of.start.div_ceil(every)..of.end.div_ceil(every);
        [known(&within.y, self.every[1]), known(&within.z, self.every[2])]
    }
}

/// A box around all known nodes in what is computed after some passes; along x all.
pub(super) fn needed<'w>(passes: &[Pass], within: impl Iterator<Item = &'w Within>) -> Region {
    let known = passes.iter().zip(within).filter_map(|(pass, within)| Some(Place::new(pass)?.known(within)));
    let known: Vec<[Range<usize>; 2]> = known.collect();
    let [y, z] = [0, 1].map(|of| around(known.iter().map(|known| known[of].clone())));
    Region { start: [0, y.start, z.start], end: [passes[0].lattice()[0], y.end, z.end] }
}

impl<'a, R: Real> KnownNodes<'a, R> {
    pub(super) fn new(known: Nodes<'a, R>, first: usize, passes: &[Pass]) -> Self {
        Self { known, first, passes: passes.iter().map(Place::new).collect() }
    }

    /// Puts the known nodes back into what is computed of a slice that a pass has predicted. Calls `found` with the first place of
    /// each row of known nodes, their distance and their number.
    pub(super) fn restore(
        &self,
        pass: usize,
        slice: usize,
        nodes: &mut [R],
        within: &Within,
        mut found: impl FnMut(usize, usize, usize),
    ) {
        let Some(place) = self.passes[pass] else { return };
        let Place { extents: [nx, ny, _], every: [of_x, of_y, of_z], frames } = place;
        let (k, [in_y, in_z]) = (self.first + frames.0 + slice * frames.1, place.known(within));
        for (z, y) in in_z.flat_map(|z| in_y.clone().map(move |y| (z, y))) {
            let at = nx * (of_y * y + ny * of_z * z);
            put(self.known.row(k, [0, y, z]), of_x, &mut nodes[at..][..nx]);
            found(at, of_x, nx.div_ceil(of_x));
        }
    }
}

/// Copies a row to every n-th place of another. A row that is too short continues with zeros.
fn put<R: Real>(from: &[R], n: usize, to: &mut [R]) {
    if n == 1 && from.len() >= to.len() {
        return to.copy_from_slice(&from[..to.len()]);
    }
    let from = from.iter().copied().chain(std::iter::repeat(R::default()));
    to.iter_mut().step_by(n).zip(from).for_each(|(to, from)| *to = from);
}
