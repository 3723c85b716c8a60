//! The passes of a pyramid: they refine the coefficients of a block axis by axis, from a single node to all.
//!
//! A block has nodes at `[x, y, z, k]`; k is a frame, or a coefficient along time. The coarsest lattice is one node
//! along every refined axis. A pass halves the stride along one axis. It adds the nodes at odd multiples of the new
//! stride: they are predicted from their neighbours along that axis (eq 33), and a code times the step of the level is
//! added (eq 32 and 34). The method page of the package `wavesplat` has these equations; `FORMAT.md`, section 8, has
//! the arithmetic to the bit.

use crate::bytes::{ParseResult, ensure};
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

/// A pyramid over the blocks of a window.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
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
}

/// One pass, or the coarsest lattice before the first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// The refined axis; `None` for the coarsest lattice.
    pub axis: Option<Axis>,
    /// Its new stride is 2^level.
    pub level: u32,
    /// Distance of neighbouring nodes along x, y, z, k after the pass.
    pub strides: [usize; 4],
    /// The level part of the block that holds its codes.
    pub part: u8,
}

impl Pass {
    /// The first node that the pass adds along an axis, and the distance to the next one.
    pub fn nodes(&self, axis: usize) -> (usize, usize) {
        let stride = self.strides[axis];
        if self.axis.is_some_and(|a| a.index() == axis) { (stride, 2 * stride) } else { (0, stride) }
    }

    /// Number of nodes that it adds along x, y, z, k in a block of `shape` nodes.
    pub fn extent(&self, shape: [usize; 4]) -> [usize; 4] {
        std::array::from_fn(|axis| {
            let (first, distance) = self.nodes(axis);
            shape[axis].saturating_sub(first).div_ceil(distance)
        })
    }

    /// Number of nodes that it adds in a block of `shape` nodes.
    pub fn codes(&self, shape: [usize; 4]) -> usize {
        self.extent(shape).iter().product()
    }
}

impl Pyramid {
    /// Number of level parts of a block: the coarse levels together, level 1, level 0, and a last pass of level 0 along time.
    pub const PARTS: u8 = 4;

    /// The passes of a block of `shape` nodes, coarse to fine; the codes of a block come in this order.
    pub fn passes(&self, shape: [usize; 4]) -> Vec<Pass> {
        let refined = || self.order.iter().map(|axis| axis.index());
        let levels = refined().map(|a| shape[a].next_power_of_two().trailing_zeros()).max().unwrap_or(0);
        let mut strides = [1; 4];
        refined().for_each(|a| strides[a] = 1 << levels);
        let mut passes = vec![Pass { axis: None, level: levels, strides, part: 0 }];
        for level in (0..levels).rev() {
            for axis in self.order.iter().copied() {
                strides[axis.index()] = 1 << level;
                if shape[axis.index()] > 1 << level {
                    passes.push(Pass { axis: Some(axis), level, strides, part: self.part(level, axis) });
                }
            }
        }
        passes
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
        let steps = |f: f64| f.is_finite() && (1.0..=1e6).contains(&f);
        ensure(steps(self.growth) && steps(self.most), || "a pyramid's steps out of range".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pyramid(order: &[Axis]) -> Pyramid {
        Pyramid { order: order.to_vec(), stencil: Stencil::Cubic, growth: 1.5, most: 3.0, single: false }
    }

    #[test]
    fn every_node_is_coded_once() {
        let orders: [&[Axis]; 4] =
            [&[Axis::X, Axis::Y, Axis::Z, Axis::T], &[Axis::T, Axis::Z], &[Axis::Z, Axis::Y, Axis::X], &[]];
        for order in orders {
            for shape in [[1, 1, 1, 1], [5, 4, 3, 7], [8, 1, 9, 2], [2, 17, 1, 1]] {
                let mut seen = vec![0; shape.iter().product()];
                for pass in pyramid(order).passes(shape) {
                    let at = |axis: usize| {
                        let (first, distance) = pass.nodes(axis);
                        (first..shape[axis]).step_by(distance)
                    };
                    let mut codes = 0;
                    for (k, z, y, x) in at(3)
                        .flat_map(|k| at(2).map(move |z| (k, z)))
                        .flat_map(|(k, z)| at(1).flat_map(move |y| at(0).map(move |x| (k, z, y, x))))
                    {
                        seen[x + shape[0] * (y + shape[1] * (z + shape[2] * k))] += 1;
                        codes += 1;
                    }
                    assert_eq!(codes, pass.codes(shape));
                }
                assert!(seen.iter().all(|n| *n == 1), "{order:?} {shape:?}");
            }
        }
    }

    #[test]
    fn parts_come_in_the_order_of_passes() {
        for order in [[Axis::X, Axis::Y, Axis::Z, Axis::T], [Axis::T, Axis::Z, Axis::Y, Axis::X]] {
            let parts: Vec<u8> = pyramid(&order).passes([33, 20, 64, 32]).iter().map(|p| p.part).collect();
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
