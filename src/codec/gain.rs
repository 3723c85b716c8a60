//! How far leaving out level parts can move a sample: the gain of eq 25, restricted to the parts that are left out.

use super::WindowCodec;
use super::scheme::{Axis, Pyramid};
use std::ops::Range;

impl WindowCodec {
    /// `gains[part][frame]`: no sample of the frame moves by more than so many times what the directory calls the part's
    /// largest. Without a pyramid that is its largest coefficient, and parts that are left out add up; with one it is the
    /// largest change of any coefficient where the part and all finer ones are left out.
    pub(crate) fn part_gains(&self) -> Vec<Vec<f64>> {
        let gain = |ks: &Range<usize>, t: usize| self.synthesis[ks.clone()].iter().map(|u| u[t].abs()).sum();
        let of_part = |ks: Range<usize>| (0..self.frames()).map(|t| gain(&ks, t)).collect();
        if self.scheme.pyramid.is_some() {
            vec![of_part(0..self.synthesis.len()); self.parts()]
        } else {
            self.levels.iter().cloned().map(of_part).collect()
        }
    }

    /// For each level part, what squares of samples sum to at most for a coefficient of 1: multiwavelets are orthonormal as
    /// functions, not as samples.
    pub(crate) fn energy_gains(&self) -> Vec<f64> {
        let energy = |k: usize| self.synthesis[k].iter().map(|u| u * u).sum::<f64>();
        let of_part = |ks: Range<usize>| ks.map(energy).fold(0.0, f64::max);
        if self.scheme.pyramid.is_some() {
            vec![of_part(0..self.synthesis.len()); self.parts()]
        } else {
            self.levels.iter().cloned().map(of_part).collect()
        }
    }

    /// How large boxes of voxels are, along each side, whose errors are alike: for each level part where it is left out, and
    /// last for what the file itself is off. Measured, on the safe side: where data are smooth, what is left out along time
    /// moves all of a block alike, and codes in space still many voxels; roundings of a pyramid are the most random.
    pub(crate) fn sides_alike(&self) -> Vec<f64> {
        let (all, smooth, rounded): (f64, f64, f64) = (f64::INFINITY, 20.0, 8.0);
        let refines_time = |p: &Pyramid| p.order.contains(&Axis::T);
        match &self.scheme.pyramid {
            None => [vec![all; self.parts()], vec![smooth]].concat(),
            Some(pyramid) if refines_time(pyramid) => vec![all, all, smooth, all, rounded],
            Some(_) => vec![all, smooth, smooth, all, rounded],
        }
    }
}
