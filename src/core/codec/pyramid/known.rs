//! The nodes with which a block below the last tier begins: those of the block above that lie in it (eq 44).

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

impl<R: Real> Nodes<'_, R> {
    /// Whether all nodes of all these k are zero.
    pub(crate) fn is_zero(&self, mut ks: Range<usize>) -> bool {
        let each: usize = self.size.iter().product();
        let nodes = |k: usize| self.values.get(k * each..(k + 1) * each).unwrap_or_default();
        ks.all(|k| !self.has(k) || rows::is_zero(nodes(k)))
    }

    /// Whether a k may have nodes that are not zero.
    pub(super) fn has(&self, k: usize) -> bool {
        self.marked.is_none_or(|marked| marked[k])
    }

    /// The rest of a row of nodes, from the `x`-th on, and what follows it. Empty if all are zero.
    fn row(&self, k: usize, [x, y, z]: [usize; 3]) -> &[R] {
        let [nx, ny, nz] = self.size;
        let first = x + nx * (y + ny * (z + nz * k));
        self.values.get(first..).filter(|_| self.has(k)).unwrap_or_default()
    }

    /// Copies a box of `[nx, ny, nz]` nodes from `start` on, of every k that has some.
    pub(crate) fn copy(&self, [x, y, z]: [usize; 3], [nx, ny, nz]: [usize; 3], out: &mut [R]) {
        for (k, of_k) in out.chunks_exact_mut(nx * ny * nz).enumerate().filter(|(k, _)| self.has(*k)) {
            for (n, to) in of_k.chunks_exact_mut(nx).enumerate() {
                put(self.row(k, [x, y + n % ny, z + n / ny]), 1, to);
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
}

impl<'a, R: Real> KnownNodes<'a, R> {
    pub(super) fn new(known: Nodes<'a, R>, first: usize, passes: &[Pass]) -> Self {
        Self { known, first, passes: passes.iter().map(Place::new).collect() }
    }

    /// Puts the known nodes back into a slice that a pass has predicted. Calls `found` with the first place of each row of known
    /// nodes, their distance and their number.
    pub(super) fn restore(
        &self,
        pass: usize,
        slice: usize,
        nodes: &mut [R],
        mut found: impl FnMut(usize, usize, usize),
    ) {
        let Some(Place { extents: [nx, ny, nz], every: [of_x, of_y, of_z], frames }) = self.passes[pass] else {
            return;
        };
        let k = self.first + frames.0 + slice * frames.1;
        for (z, y) in (0..nz).step_by(of_z).flat_map(|z| (0..ny).step_by(of_y).map(move |y| (z, y))) {
            let at = nx * (y + ny * z);
            put(self.known.row(k, [0, y / of_y, z / of_z]), of_x, &mut nodes[at..][..nx]);
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
