//! The sums of a block that has an amount for each of its voxels: row by row, every weight the same for a whole row.

use super::cells::{Cells, Row};
use super::{Slice, Spreading};
use crate::render::terms::Layout;
use crate::volume::Region;
use multiversion::multiversion;

/// The sums of a block in the making.
#[derive(Debug)]
pub(in crate::render) struct Dense {
    spreading: Spreading,
    pub(super) cells: Cells,
    slices: Vec<Slice>,
    /// Voxels along b, c and a, and from one to the next in an array.
    count: [usize; 3],
    steps: [usize; 3],
    /// exp(-tau z) from the first voxel along b and c.
    fading: [Vec<f64>; 2],
    /// A row, with zeros in the cells between its voxels.
    row: Vec<f64>,
    work: Vec<f64>,
}

impl Dense {
    /// Of the voxels of `region`, with all planes at zero.
    pub(super) fn new(spreading: &Spreading, region: &Region, planes: usize) -> Self {
        let (shear, dims) = (&spreading.shear, region.dims());
        let stride = |axis: usize| dims[..axis].iter().product::<usize>();
        let (count, steps) = (shear.axes.map(|axis| dims[axis]), shear.axes.map(stride));
        let slices: Vec<Slice> = (0..count[2]).map(|k| Slice::new(region.start, spreading, k)).collect();
        let (first, size) = spreading.reached(&slices, [count[0], count[1]], 0);
        let fading = [0, 1].map(|i| spreading.fading(i, 0..count[i] as isize));
        let row = vec![0.0; (count[0] - 1) * shear.fineness + 1];
        let cells = Cells::new(first, size, planes);
        Self { spreading: *spreading, cells, slices, count, steps, fading, row, work: Vec::new() }
    }

    /// Adds an amount for every voxel, x fastest, to a plane.
    pub(in crate::render) fn add(&mut self, plane: usize, amounts: &[f64]) {
        let (q, degree) = (self.spreading.shear.fineness, self.spreading.degree);
        let Self { cells, slices, count, steps, fading, row, work, .. } = self;
        for (k, slice) in slices.iter().enumerate() {
            for c in 0..count[1] {
                fade(&amounts[k * steps[2] + c * steps[1]..], steps[0], &fading[0], q, row);
                let across = slice.across.map(|w| w * fading[1][c]);
                let cell = [slice.cell[0], slice.cell[1] + (c * q) as isize];
                let row = Row { cell, distance: 1, amounts: row, degree, along: &slice.along, across: &across };
                cells.add_row(plane, &row, work);
            }
        }
    }
}

impl Dense {
    /// Adds samples of a frame of the group to its planes; those that are missing only to their weights.
    pub(in crate::render) fn add_samples(
        &mut self,
        layout: &Layout,
        frame: usize,
        samples: &mut [f64],
        is_missing: impl Fn(usize, f64) -> bool,
    ) {
        if layout.absent {
            let take = |(i, sample): (usize, &mut f64)| {
                let missing = is_missing(i, *sample);
                *sample = if missing { 0.0 } else { *sample };
                f64::from(u8::from(missing))
            };
            let absent: Vec<f64> = samples.iter_mut().enumerate().map(take).collect();
            self.add(layout.absent(frame), &absent);
        }
        self.add(layout.value(frame), samples);
    }
}

/// Every `step`-th amount times its fading, into every `q`-th of a row.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn fade(amounts: &[f64], step: usize, fading: &[f64], q: usize, row: &mut [f64]) {
    match (step, q) {
        (1, 1) => row.iter_mut().zip(amounts.iter().zip(fading)).for_each(|(r, (a, f))| *r = a * f),
        (1, 2) => row.iter_mut().step_by(2).zip(amounts.iter().zip(fading)).for_each(|(r, (a, f))| *r = a * f),
        _ => {
            let amounts = amounts.iter().step_by(step).zip(fading);
            row.iter_mut().step_by(q).zip(amounts).for_each(|(r, (a, f))| *r = a * f);
        }
    }
}
