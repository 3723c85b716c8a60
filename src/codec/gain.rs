//! How far leaving out a level part can move a sample.

use super::WindowCodec;
use super::pyramid::refine_line;
use crate::volume::BlockGrid;
use wavesplat_format::{Pyramid, Stencil};

impl WindowCodec {
    /// `gains[part][frame]`: no sample of the frame moves by more than so many times the largest coefficient of the part
    /// if that is left out, in any block of `blocks`.
    pub fn part_gains(&self, blocks: &BlockGrid) -> Vec<Vec<f64>> {
        let of_functions = |ks: std::ops::Range<usize>, t: usize| self.synthesis[ks].iter().map(|u| u[t].abs()).sum();
        let frames = || 0..self.frames();
        match &self.scheme.pyramid {
            None => self.levels.iter().map(|ks| frames().map(|t| of_functions(ks.clone(), t)).collect()).collect(),
            Some(pyramid) => {
                let all: Vec<f64> = frames().map(|t| of_functions(0..self.synthesis.len(), t)).collect();
                let parts = self.refined_gains(pyramid, blocks);
                parts.into_iter().map(|gain| all.iter().map(|g| g * gain).collect()).collect()
            }
        }
    }

    /// How far a coefficient moves: for each pass of a part the codes around a node, each as far as it reaches there.
    fn refined_gains(&self, pyramid: &Pyramid, blocks: &BlockGrid) -> Vec<f64> {
        let mut gains = vec![0.0_f64; Pyramid::PARTS.into()];
        let lengths = |axis: usize| blocks.lengths(axis);
        let shapes = lengths(0).into_iter().flat_map(|x| lengths(1).into_iter().map(move |y| (x, y)));
        for (x, y) in shapes {
            for z in lengths(2) {
                let shape = self.shape([x, y, z]);
                let mut of_shape = vec![0.0; gains.len()];
                for pass in pyramid.passes(shape) {
                    let reach = |axis: usize| line_gain(pyramid.stencil, shape[axis], pass.strides[axis]);
                    of_shape[usize::from(pass.part)] += (0..4).map(reach).product::<f64>();
                }
                gains.iter_mut().zip(of_shape).for_each(|(all, gain)| *all = all.max(gain));
            }
        }
        gains.iter().map(|gain| gain * UP).collect()
    }
}

/// More than what rounding takes.
const UP: f64 = 1.0 + 1e-5;

/// The largest sum over the nodes of a line, every `stride`-th of `length`, of what each adds to a node once the line is
/// refined.
fn line_gain(stencil: Stencil, length: usize, stride: usize) -> f64 {
    let mut sums = vec![0.0; length];
    if stride == 1 {
        return 1.0;
    }
    for node in (0..length).step_by(stride) {
        let mut line = vec![0.0; length];
        line[node] = 1.0;
        refine_line(stencil, stride, &mut line);
        sums.iter_mut().zip(&line).for_each(|(sum, v): (&mut f64, &f64)| *sum += v.abs());
    }
    sums.into_iter().fold(0.0, f64::max)
}
