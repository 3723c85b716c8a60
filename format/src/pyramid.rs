//! The passes of a pyramid: they refine the coefficients of a block axis by axis, from a single node to all.
//!
//! A block has nodes at `[x, y, z, k]`; k is a frame, or a coefficient along time. The coarsest lattice is one node
//! along every refined axis. A pass halves the stride along one axis. It adds the nodes at odd multiples of the new
//! stride: they are predicted from their neighbours along that axis (eq 33), and a code times the step of the level is
//! added (eq 32 and 34). The method page of the package `wavesplat` has these equations; `FORMAT.md`, section 8, has
//! the arithmetic to the bit.

use crate::bytes::{ParseResult, ensure};
use crate::codes::sparse::CodeBox;
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
}

/// The fields of a pyramid as they are stored.
type Stored = (Vec<Axis>, Stencil, f64, f64, u8);

impl Encode for Pyramid {
    fn encode<E: Encoder>(&self, encoder: &mut E) -> Result<(), EncodeError> {
        let nested = self.packing == Packing::Nested;
        let flags = u8::from(self.single) | u8::from(nested) << 1 | u8::from(self.ghosts) << 2;
        let stored: Stored = (self.order.clone(), self.stencil, self.growth, self.most, flags);
        stored.encode(encoder)
    }
}

impl<C> Decode<C> for Pyramid {
    fn decode<D: Decoder<Context = C>>(decoder: &mut D) -> Result<Self, DecodeError> {
        let (order, stencil, growth, most, flags) = Stored::decode(decoder)?;
        if flags > 7 || flags & 6 == 4 {
            return Err(DecodeError::OtherString(format!("a pyramid with the flags {flags}")));
        }
        let packing = if flags & 2 == 0 { Packing::Flat } else { Packing::Nested };
        Ok(Self { order, stencil, growth, most, single: flags & 1 == 1, packing, ghosts: flags & 4 != 0 })
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
        CodeBox { extents: self.extents(extent), first, strides, allowed: self.allowed }
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
}

impl Pass {
    /// The first node that the pass adds along an axis, and the distance to the next one.
    pub fn nodes(&self, axis: usize) -> (usize, usize) {
        let stride = self.strides[axis];
        if self.axis.is_some_and(|a| a.index() == axis) { (stride, 2 * stride) } else { (0, stride) }
    }

    /// Number of nodes that it adds along x, y, z, k.
    pub fn extent(&self) -> [usize; 4] {
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

    /// The passes of a block of `size` voxels with `k` coefficients each, coarse to fine; the codes of a block come in this
    /// order.
    pub fn passes(&self, size: [usize; 3], k: usize) -> Vec<Pass> {
        let ([x, y, z], [gx, gy, gz]) = (size, self.ghost_nodes(size));
        let (inner, outer) = ([x, y, z, k], [x + gx, y + gy, z + gz, k]);
        let refined = || self.order.iter().map(|axis| axis.index());
        let levels = refined().map(|a| outer[a].next_power_of_two().trailing_zeros()).max().unwrap_or(0);
        let mut strides = [1; 4];
        refined().for_each(|a| strides[a] = 1 << levels);
        let lattice = |axis, level, strides: [usize; 4], part| {
            let limits = std::array::from_fn(|a| if strides[a] > 1 { outer[a] } else { inner[a] });
            Pass { axis, level, strides, limits, part }
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
    /// where the pass is in version 1.0.
    pub fn boxes(&self, passes: &[Pass]) -> Vec<PassBox> {
        let whole = |pass, part| PassBox { pass, part, every: [1; 3], allowed: 0xFF };
        let of_pass = |(number, pass): (usize, &Pass)| match (self.packing, pass.axis) {
            (Packing::Nested, Some(Axis::T)) => self.boxes_along_time(number, pass),
            _ => vec![whole(number, pass.part)],
        };
        let mut boxes: Vec<PassBox> = passes.iter().enumerate().flat_map(of_pass).collect();
        boxes.sort_by_key(|of| of.part);
        boxes
    }

    fn boxes_along_time(&self, number: usize, pass: &Pass) -> Vec<PassBox> {
        let refined = [Axis::X, Axis::Y, Axis::Z].map(|axis| self.order.contains(&axis));
        // Every n-th node along an axis lies at a multiple of 2^level.
        let every = |level: u32| -> [usize; 3] {
            std::array::from_fn(|a| if refined[a] { ((1 << level) / pass.strides[a]).max(1) } else { 1 })
        };
        let mut boxes = vec![PassBox { pass: number, part: 0, every: every(2), allowed: 0xFF }];
        for (level, part) in [(1, pass.part.min(1)), (0, pass.part)] {
            let (coarse, fine) = (every(level + 1), every(level));
            if coarse != fine {
                let even = (0..3).filter(|a| coarse[*a] != fine[*a]).fold(0xFF, |bits, a| bits & EVEN[a]);
                boxes.push(PassBox { pass: number, part: part.max(1), every: fine, allowed: !even });
            }
        }
        boxes
    }

    fn part(&self, level: u32, axis: Axis) -> u8 {
        match level {
            0 if axis == Axis::T && self.order.last() == Some(&Axis::T) => 3,
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
        ensure(!self.ghosts || self.packing == Packing::Nested, || "ghost nodes without nested parts".into())?;
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
                for pass in pyramid.passes([x, y, z], k) {
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
            let parts: Vec<u8> = pyramid(&order).passes([33, 20, 64], 32).iter().map(|p| p.part).collect();
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
