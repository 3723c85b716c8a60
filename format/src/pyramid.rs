//! The passes of a pyramid: they refine the coefficients of a block axis by axis, from a single node to all.
//!
//! A block has nodes at `[x, y, z, k]`; k is a frame, or a coefficient along time. The coarsest lattice is one node
//! along every refined axis. A pass halves the stride along one axis. It adds the nodes at odd multiples of the new
//! stride: they are predicted from their neighbours along that axis (eq 33), and a code times the step of the level is
//! added (eq 32 and 34). The method page of the package `wavesplat` has these equations; `FORMAT.md`, section 8, has
//! the arithmetic to the bit.

use crate::bytes::{ParseResult, ensure};
use crate::codes::sparse::{CodeBox, Places};
use crate::limits::MAX_TIERS;
use bincode::de::Decoder;
use bincode::enc::Encoder;
use bincode::error::{DecodeError, EncodeError};
use bincode::{Decode, Encode};

/// An axis of a block. New ones are only appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub enum Axis {
    /// The fastest axis in memory.
    X,
    /// The second axis.
    Y,
    /// The slowest spatial axis.
    Z,
    /// The axis of frames or coefficients.
    T,
}

impl Axis {
    /// Its index in `[x, y, z, k]`.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// The weights with which the neighbours of a node along an axis predict it (eq 33); new ones are appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub enum Stencil {
    /// (1, 1) / 2.
    Linear,
    /// (-1, 9, 9, -1) / 16.
    Cubic,
}

/// How the codes of a pyramid are divided into level parts, and how these are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Packing {
    /// Every pass is in one part: version 1.0.
    Flat,
    /// Passes along time are divided by the coarseness of their places, and long strings of symbols are packed for vector
    /// code: version 1.1.
    #[default]
    Nested,
}

/// A pyramid over the blocks of a window.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    /// The refined axes, in the order of a level's passes.
    pub order: Vec<Axis>,
    /// The weights of predictions.
    pub stencil: Stencil,
    /// The step of level l is `step / min(growth^l, most)`; at least 1.
    pub growth: f64,
    /// See `growth`; at least 1.
    pub most: f64,
    /// Whether predictions are computed in 32-bit floats instead of 64-bit floats.
    pub single: bool,
    /// How the codes are divided and packed.
    pub packing: Packing,
    /// Whether coarse lattices of blocks with an even number of voxels have ghost nodes, which make nodes between them
    /// interpolated instead of extrapolated. Only if packing is nested.
    pub ghosts: bool,
    /// The number of tiers above the blocks: coarse lattices, each with every second node of the one below along x, y, z, that
    /// are coded in blocks of their own. Each of these covers 2 x 2 x 2 blocks of the tier below. Only if packing is nested.
    pub tiers: u8,
}

/// The lowest bit of the number of tiers in the flags.
const TIERS: u32 = 3;

/// The fields of a pyramid as they are stored.
type Stored = (Vec<Axis>, Stencil, f64, f64, u8);

impl Encode for Pyramid {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        let nested = self.packing == Packing::Nested;
        let flags = u8::from(self.single) | u8::from(nested) << 1 | u8::from(self.ghosts) << 2 | self.tiers << TIERS;
        let stored: Stored = (self.order.clone(), self.stencil, self.growth, self.most, flags);
        stored.encode(encoder)
    }
}

impl<C> Decode<C> for Pyramid {
    fn decode<D: Decoder<Context = C>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let (order, stencil, growth, most, flags) = Stored::decode(decoder)?;
        let tiers = flags >> TIERS;
        if flags & 2 == 0 && (flags & 4 != 0 || tiers > 0) || tiers > MAX_TIERS {
            return Err(DecodeError::OtherString(format!("a pyramid with the flags {flags}")));
        }
        let packing = if flags & 2 == 0 { Packing::Flat } else { Packing::Nested };
        Ok(Self { order, stencil, growth, most, single: flags & 1 == 1, packing, ghosts: flags & 4 != 0, tiers })
    }
}

bincode::impl_borrow_decode!(Pyramid);

/// Nodes of a pass whose codes are packed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PassBox {
    /// The number of the pass.
    pub pass: usize,
    /// The level part that holds the codes.
    pub part: u8,
    /// Takes every n-th of the nodes that the pass adds along x, y, z.
    pub every: [usize; 3],
    /// As [`CodeBox::allowed`](crate::CodeBox::allowed).
    pub allowed: u8,
}

impl PassBox {
    /// The codes along x, y, z, k of a pass that adds `extent` nodes.
    pub fn extents(&self, [x, y, z, k]: [usize; 4]) -> [usize; 4] {
        let [of_x, of_y, of_z] = self.every;
        [x.div_ceil(of_x), y.div_ceil(of_y), z.div_ceil(of_z), k]
    }

    /// Where the codes lie in the slices of a pass that adds `extent` nodes, the first of them at `first`, others
    /// `strides` apart along x, y, z.
    pub fn placed(&self, extent: [usize; 4], first: usize, strides: [usize; 3]) -> CodeBox {
        let strides = std::array::from_fn(|axis| strides[axis].saturating_mul(self.every[axis]));
        CodeBox { extents: self.extents(extent), first, strides, allowed: self.allowed, needed: Places::ALL }
    }
}

/// Bits of a byte for 2 x 2 x 2 nodes at even positions along x, y, z.
const EVEN: [u8; 3] = [0b0101_0101, 0b0011_0011, 0b0000_1111];

/// One pass, or the coarsest lattice before the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// The refined axis; `None` for the coarsest lattice.
    pub axis: Option<Axis>,
    /// Its new stride is 2^level.
    pub level: u32,
    /// Distance of neighbouring nodes along x, y, z, k after the pass.
    pub strides: [usize; 4],
    /// Positions along x, y, z, k that the lattice covers after the pass.
    pub limits: [usize; 4],
    /// The level part of the block that holds its codes in version 1.0.
    pub part: u8,
    /// Whether its nodes are those of the block above, so that it adds none.
    pub is_known: bool,
}

impl Pass {
    /// The first node that the pass adds along an axis, and the distance to the next one.
    pub fn nodes(&self, axis: usize) -> (usize, usize) {
        let stride = self.strides[axis];
        if self.axis.is_some_and(|a| a.index() == axis) { (stride, 2 * stride) } else { (0, stride) }
    }

    /// Number of nodes that it adds along x, y, z, k.
    pub fn extent(&self) -> [usize; 4] {
        if self.is_known {
            return [0; 4];
        }
        std::array::from_fn(|axis| {
            let (first, distance) = self.nodes(axis);
            self.limits[axis].saturating_sub(first).div_ceil(distance)
        })
    }

    /// Number of nodes after it along x, y, z, k.
    pub fn lattice(&self) -> [usize; 4] {
        std::array::from_fn(|axis| self.limits[axis].div_ceil(self.strides[axis]))
    }

    /// Number of nodes that it adds.
    pub fn codes(&self) -> usize {
        self.extent().iter().product()
    }

    /// The pass on the lattice at multiples of `2^level` along x, y and z.
    fn thinned(&self, level: u32) -> Self {
        let (strides, limits) = (self.strides, self.limits);
        let thin = |a: usize| if a < 3 { (strides[a] >> level).max(1) } else { strides[a] };
        let end = |a: usize| if a < 3 { limits[a].div_ceil(1 << level) } else { limits[a] };
        Self { strides: std::array::from_fn(thin), limits: std::array::from_fn(end), ..*self }
    }
}

impl Pyramid {
    /// Number of level parts of a block: the coarse levels together, level 1, level 0, and a last pass of level 0 along time.
    pub const PARTS: u8 = 4;

    /// Along x, y, z: 1 if the lattices above level 0 have a node more than the block of `size` voxels, or 0.
    ///
    /// With an even number of voxels, a node after the last even one would be extrapolated; this one lies behind it.
    pub fn ghost_nodes(&self, size: [usize; 3]) -> [usize; 3] {
        let ghost = |axis: Axis| self.ghosts && size[axis.index()].is_multiple_of(2) && self.order.contains(&axis);
        [Axis::X, Axis::Y, Axis::Z].map(|axis| usize::from(ghost(axis)))
    }

    /// The nodes along x, y, z of a block of a tier that covers `size` voxels; above tier 0 with ghost nodes.
    pub fn nodes(&self, size: [usize; 3], tier: u8) -> [usize; 3] {
        let ghosts = if tier > 0 { self.ghost_nodes(size) } else { [0; 3] };
        std::array::from_fn(|axis| (size[axis] + ghosts[axis]).div_ceil(1 << tier))
    }

    /// The passes of a block of a tier that covers `size` voxels with `k` coefficients each, coarse to fine; the codes of a block
    /// come in this order. Positions are those on the tier's lattice.
    ///
    /// The last tier has all passes of coarser lattices as well. In others the first pass has the nodes of the block above.
    pub fn passes(&self, size: [usize; 3], k: usize, tier: u8) -> Vec<Pass> {
        let all = self.all_passes(size, k, tier > 0);
        let (level, is_last) = (u32::from(tier), tier == self.tiers);
        let along_time = |pass: &Pass| pass.axis == Some(Axis::T);
        let adds = |pass: &&Pass| match (along_time(pass), is_last) {
            (true, true) => true,
            (true, false) => pass.level <= level && pass.strides[..3].iter().any(|stride| *stride <= 1 << level),
            (false, true) => pass.level >= level,
            (false, false) => pass.level == level && pass.axis.is_some(),
        };
        let own = all.iter().filter(adds).map(|pass| pass.thinned(level));
        let known = (!is_last).then(|| self.known_pass(&all[0], level));
        known.into_iter().chain(own).collect()
    }

    /// The nodes of the block above that a block of the tier `level` begins with.
    fn known_pass(&self, first: &Pass, level: u32) -> Pass {
        let [apart, frames] = match self.order.iter().position(|axis| *axis == Axis::T) {
            None => [2 << level, 1],
            Some(0) => [2 << level, 1 << level],
            Some(_) => [2 << level; 2],
        };
        let strides = [apart, apart, apart, frames];
        Pass { strides, level: level + 1, is_known: true, ..*first }.thinned(level)
    }

    /// The passes of a block with all its nodes. `has_ghosts` says whether ghost nodes remain on the finest lattice.
    fn all_passes(&self, size: [usize; 3], k: usize, has_ghosts: bool) -> Vec<Pass> {
        let ([x, y, z], [gx, gy, gz]) = (size, self.ghost_nodes(size));
        let (inner, outer) = ([x, y, z, k], [x + gx, y + gy, z + gz, k]);
        let refined = || self.order.iter().map(|axis| axis.index());
        let levels = refined().map(|a| outer[a].next_power_of_two().trailing_zeros()).max().unwrap_or(0);
        let levels = levels.max(self.tiers.into());
        let mut strides = [1; 4];
        refined().for_each(|a| strides[a] = 1 << levels);
        let lattice = |axis, level, strides: [usize; 4], part| {
            let limits = std::array::from_fn(|a| if strides[a] > 1 || has_ghosts { outer[a] } else { inner[a] });
            Pass { axis, level, strides, limits, part, is_known: false }
        };
        let mut passes = vec![lattice(None, levels, strides, 0)];
        for level in (0..levels).rev() {
            for axis in self.order.iter().copied() {
                strides[axis.index()] = 1 << level;
                if outer[axis.index()] > 1 << level {
                    passes.push(lattice(Some(axis), level, strides, self.part(level, axis)));
                }
            }
        }
        passes
    }

    /// The boxes of codes of some passes, part after part, coarse to fine.
    ///
    /// If nested, passes along time are divided: what coarse pictures of all frames need is in the coarse parts. Part 0
    /// has nodes at multiples of 4 along the refined axes x, y and z, part 1 those at multiples of 2, and the others are
    /// where the pass is in version 1.0. With tiers, multiples are those on the lattice of the last tier, and blocks of the others
    /// have only the nodes that no tier above has.
    pub fn boxes(&self, passes: &[Pass]) -> Vec<PassBox> {
        let whole = |pass, part| PassBox { pass, part, every: [1; 3], allowed: 0xFF };
        let has_known = passes.first().is_some_and(|pass| pass.is_known);
        let of_pass = |(number, pass): (usize, &Pass)| match (self.packing, pass.axis) {
            _ if pass.is_known => Vec::new(),
            (Packing::Nested, Some(Axis::T)) => self.boxes_along_time(number, pass, has_known),
            _ => vec![whole(number, pass.part)],
        };
        let mut boxes: Vec<PassBox> = passes.iter().enumerate().flat_map(of_pass).collect();
        boxes.sort_by_key(|of| of.part);
        boxes
    }

    fn boxes_along_time(&self, number: usize, pass: &Pass, has_known: bool) -> Vec<PassBox> {
        let refined = [Axis::X, Axis::Y, Axis::Z].map(|axis| self.order.contains(&axis));
        // Every n-th node along an axis lies at a multiple of 2^level.
        let every = |level: u32| -> [usize; 3] {
            std::array::from_fn(|a| if refined[a] { ((1 << level) / pass.strides[a]).max(1) } else { 1 })
        };
        let coarsest = PassBox { pass: number, part: 0, every: every(2), allowed: 0xFF };
        let mut boxes = if has_known { Vec::new() } else { vec![coarsest] };
        let finer = [(1, pass.part.min(1)), (0, pass.part)];
        for (level, part) in finer.into_iter().skip(has_known.into()) {
            let (coarse, fine) = (every(level + 1), every(level));
            if coarse != fine {
                let even = (0..3).filter(|a| coarse[*a] != fine[*a]).fold(0xFF, |bits, a| bits & EVEN[a]);
                boxes.push(PassBox { pass: number, part: part.max(1), every: fine, allowed: !even });
            }
        }
        boxes
    }

    fn part(&self, level: u32, axis: Axis) -> u8 {
        match level.saturating_sub(self.tiers.into()) {
            0 if level == 0 && axis == Axis::T && self.order.last() == Some(&Axis::T) => 3,
            0 => 2,
            1 => 1,
            _ => 0,
        }
    }

    /// The step of the codes of a level: `step / min(growth^level, most)` (eq 34).
    pub fn step(&self, step: f64, level: u32) -> f64 {
        let grown = (0..level).fold(1.0, |product: f64, _| (product * self.growth).min(self.most));
        step / grown
    }

    pub(crate) fn check(&self, basis_is_samples: bool) -> ParseResult {
        let mut seen = [false; 4];
        for axis in &self.order {
            let again = std::mem::replace(&mut seen[axis.index()], true);
            ensure(!again, || format!("a pyramid that refines {axis:?} twice"))?;
        }
        ensure(basis_is_samples || !seen[Axis::T.index()], || {
            "a pyramid along time with a transform along time".into()
        })?;
        let nested = self.packing == Packing::Nested;
        ensure(!self.ghosts && self.tiers == 0 || nested, || "ghost nodes or tiers without nested parts".into())?;
        let in_space = [Axis::X, Axis::Y, Axis::Z].iter().all(|axis| seen[axis.index()]);
        ensure(self.tiers == 0 || in_space && self.tiers <= MAX_TIERS, || {
            format!("{} tiers of a pyramid that refines {:?}", self.tiers, self.order)
        })?;
        let steps = |f: f64| f.is_finite() && (1.0..=1e6).contains(&f);
        ensure(steps(self.growth) && steps(self.most), || "a pyramid's steps out of range".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pyramid(order: &[Axis]) -> Pyramid {
        Pyramid {
            order: order.to_vec(),
            stencil: Stencil::Cubic,
            growth: 1.5,
            most: 3.0,
            single: false,
            packing: Packing::Nested,
            ghosts: true,
            tiers: 0,
        }
    }

    #[test]
    fn every_node_is_coded_once() {
        let orders: [&[Axis]; 4] =
            [&[Axis::X, Axis::Y, Axis::Z, Axis::T], &[Axis::T, Axis::Z], &[Axis::Z, Axis::Y, Axis::X], &[]];
        for order in orders {
            for shape in [[1, 1, 1, 1], [5, 4, 3, 7], [8, 1, 9, 2], [2, 17, 1, 1]] {
                let [x, y, z, k] = shape;
                let pyramid = pyramid(order);
                let [gx, gy, gz] = pyramid.ghost_nodes([x, y, z]);
                let outer = [x + gx, y + gy, z + gz, k];
                let mut seen = vec![0; outer.iter().product()];
                for pass in pyramid.passes([x, y, z], k, 0) {
                    let at = |axis: usize| {
                        let (first, distance) = pass.nodes(axis);
                        (first..pass.limits[axis]).step_by(distance)
                    };
                    let mut codes = 0;
                    for (k, z, y, x) in at(3)
                        .flat_map(|k| at(2).map(move |z| (k, z)))
                        .flat_map(|(k, z)| at(1).flat_map(move |y| at(0).map(move |x| (k, z, y, x))))
                    {
                        seen[x + outer[0] * (y + outer[1] * (z + outer[2] * k))] += 1;
                        codes += 1;
                    }
                    assert_eq!(codes, pass.codes());
                }
                for (i, times) in seen.iter().enumerate() {
                    let at = [i % outer[0], i / outer[0] % outer[1], i / (outer[0] * outer[1]) % outer[2]];
                    let is_ghost = (0..3).any(|axis| at[axis] == shape[axis]);
                    assert!(*times == 1 || is_ghost && *times == 0, "{order:?} {shape:?} {at:?}: {times}");
                }
            }
        }
    }

    #[test]
    fn parts_come_in_the_order_of_passes() {
        for order in [[Axis::X, Axis::Y, Axis::Z, Axis::T], [Axis::T, Axis::Z, Axis::Y, Axis::X]] {
            let parts: Vec<u8> = pyramid(&order).passes([33, 20, 64], 32, 0).iter().map(|p| p.part).collect();
            assert!(parts.is_sorted() && parts.iter().all(|p| *p < Pyramid::PARTS), "{parts:?}");
        }
    }

    #[test]
    fn coarser_levels_have_finer_steps_up_to_a_limit() {
        let steps: Vec<f64> = (0..4).map(|l| pyramid(&[Axis::X]).step(9.0, l)).collect();
        assert_eq!(steps, [9.0, 6.0, 4.0, 3.0]);
    }

    #[test]
    fn impossible_pyramids_are_refused() {
        assert!(pyramid(&[Axis::X, Axis::X]).check(true).is_err());
        assert!(pyramid(&[Axis::X, Axis::T]).check(false).is_err());
        assert!(pyramid(&[Axis::X, Axis::T]).check(true).is_ok());
        assert!(Pyramid { growth: 0.5, ..pyramid(&[]) }.check(true).is_err());
        assert!(Pyramid { most: f64::NAN, ..pyramid(&[]) }.check(true).is_err());
    }
}
