//! Bounds on how far omitted level parts can move a sample: the gain of eq 25, restricted to the omitted parts.

use super::WindowCodec;
use super::scheme::{Axis, Pyramid, Stencil};
use std::ops::Range;

impl WindowCodec {
    /// `gains[part][frame]`: omitting the part moves no sample of the frame by more than this times the part's largest
    /// value in the directory. Without a pyramid that is its largest coefficient, and the effects of omitted parts add
    /// up. With a pyramid it is the largest change of any coefficient from leaving out the part and all finer ones.
    pub fn part_gains(&self) -> Vec<Vec<f64>> {
        let gain = |ks: &Range<usize>, t: usize| self.synthesis[ks.clone()].iter().map(|u| u[t].abs()).sum();
        let of_part = |ks: Range<usize>| (0..self.frames()).map(|t| gain(&ks, t)).collect();
        if self.scheme.pyramid.is_some() {
            vec![of_part(0..self.synthesis.len()); self.parts()]
        } else {
            self.levels.iter().cloned().map(of_part).collect()
        }
    }

    /// The largest coefficient that predictions give a block of the codec's tier that begins with nodes of at most 1: the sum of
    /// absolute weights of eq 33, pass after pass.
    pub fn prediction_gain(&self) -> f64 {
        let Some(pyramid) = &self.scheme.pyramid else { return 1.0 };
        let is_interpolated = pyramid.ghosts && self.tier == 0; // others may extrapolate their last node
        let in_space: f64 = match pyramid.stencil {
            _ if !is_interpolated => 2.0,
            Stencil::Cubic => 1.25,
            Stencil::Linear => 1.0,
        };
        let along_time = if pyramid.order.contains(&Axis::T) { 2_u64 << self.tier } else { 1 }; // each level has at most one pass along time
        in_space * in_space * in_space * along_time as f64
    }

    /// For each level part, the largest sum of squared samples that a coefficient of 1 causes. It can differ from 1
    /// because multiwavelets are orthonormal as functions, not as samples.
    pub fn energy_gains(&self) -> Vec<f64> {
        let energy = |k: usize| self.synthesis[k].iter().map(|u| u * u).sum::<f64>();
        let of_part = |ks: Range<usize>| ks.map(energy).fold(0.0, f64::max);
        if self.scheme.pyramid.is_some() {
            vec![of_part(0..self.synthesis.len()); self.parts()]
        } else {
            self.levels.iter().cloned().map(of_part).collect()
        }
    }

    /// The side, in voxels, of boxes with similar errors: one entry for each omitted level part, and the last for the
    /// error of the file itself. These are measured, conservative values. In smooth data, parts omitted along time move
    /// all of a block alike, and parts omitted in space still move many voxels alike. Rounding in a pyramid is the most
    /// random.
    pub fn sides_alike(&self) -> Vec<f64> {
        let (all, smooth, rounded): (f64, f64, f64) = (f64::INFINITY, 20.0, 8.0);
        let refines_time = |p: &Pyramid| p.order.contains(&Axis::T);
        match &self.scheme.pyramid {
            None => [vec![all; self.parts()], vec![smooth]].concat(),
            Some(pyramid) if refines_time(pyramid) => vec![all, all, smooth, all, rounded],
            Some(_) => vec![all, smooth, smooth, all, rounded],
        }
    }
}
