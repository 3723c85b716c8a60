//! How far leaving out level parts can move a sample.

use super::WindowCodec;
use std::ops::Range;

impl WindowCodec {
    /// `gains[part][frame]`: no sample of the frame moves by more than so many times what the directory calls the part's
    /// largest. Without a pyramid that is its largest coefficient, and parts that are left out add up; with one it is the
    /// largest change of any coefficient where the part and all finer ones are left out.
    pub fn part_gains(&self) -> Vec<Vec<f64>> {
        let gain = |ks: &Range<usize>, t: usize| self.synthesis[ks.clone()].iter().map(|u| u[t].abs()).sum();
        let of_part = |ks: Range<usize>| (0..self.frames()).map(|t| gain(&ks, t)).collect();
        if self.scheme.pyramid.is_some() {
            vec![of_part(0..self.synthesis.len()); self.parts()]
        } else {
            self.levels.iter().cloned().map(of_part).collect()
        }
    }
}
