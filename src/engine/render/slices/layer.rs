//! The voxels of one frame around the slices in work: a few layers across the principal axis.
//!
//! Samples are in the units of the table or of the largest value ([`crate::render::batches::Units`]). NaN is missing. Rows run along b and are
//! padded with zeros to whole bricks.

use super::bricks::{Ranges, ranges};
use super::taps::along;
use super::view::SlicedView;
use super::{BRICK_ROWS, GROUP};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::vectors::dispatch;

/// Some voxel layers of one frame, counted along the ray.
#[derive(Debug)]
pub(super) struct Layers {
    first: usize,
    end: usize,
    /// Numbers per row, and rows per layer.
    pub(super) stride: usize,
    pub(super) rows: usize,
    values: Vec<f32>,
    /// The ranges of each layer's bricks, and whether any of its samples is missing.
    ranges: Vec<Ranges>,
    missing: Vec<bool>,
}

impl Layers {
    /// At most `most` layers at a time.
    pub(super) fn new(view: &SlicedView, most: usize) -> Self {
        let stride = view.count[0].next_multiple_of(GROUP);
        let values = Vec::with_capacity(most * stride * view.count[1]);
        Self { first: 0, end: 0, stride, rows: view.count[1], values, ranges: vec![], missing: vec![] }
    }

    /// Bytes of `layers` layers.
    pub(super) fn bytes(view: &SlicedView, layers: usize) -> usize {
        let (stride, rows) = (view.count[0].next_multiple_of(GROUP), view.count[1]);
        layers * (stride * rows * size_of::<f32>() + stride / GROUP * rows.div_ceil(BRICK_ROWS) * 2 * size_of::<f32>())
    }

    /// Forgets layers before `first`, and makes room for those up to `end`.
    pub(super) fn advance(&mut self, first: usize, end: usize) {
        let (size, drop) = (self.stride * self.rows, first.min(self.end) - self.first);
        self.values.drain(..drop * size);
        self.values.resize((end - self.first - drop) * size, 0.0);
        self.values[(self.end - self.first - drop) * size..].fill(0.0);
        self.ranges.drain(..drop);
        self.missing.drain(..drop);
        (self.first, self.end) = (self.first + drop, end);
    }

    /// Stores the samples of a block; x runs fastest in `values`.
    pub(super) fn put(&mut self, view: &SlicedView, block: &Region, values: &[f32]) {
        let strides = [1, block.dims()[0], block.dims()[0] * block.dims()[1]];
        let step = strides[view.shear.axes[0]];
        self.each_row(view, block, |voxel, row| {
            let values = &values[block.index(voxel)..];
            match step {
                1 => row.copy_from_slice(&values[..row.len()]),
                _ => row.iter_mut().zip(values.iter().step_by(step)).for_each(|(to, from)| *to = *from),
            }
        });
    }

    /// Stores the same number for all samples of a block.
    pub(super) fn fill(&mut self, view: &SlicedView, block: &Region, value: f32) {
        self.each_row(view, block, |_, row| row.fill(value));
    }

    /// Calls `each(first voxel, row)` for all rows of a block within the region.
    fn each_row(&mut self, view: &SlicedView, block: &Region, mut each: impl FnMut([usize; 3], &mut [f32])) {
        let part = block.intersect(&view.clip);
        let ([b, c, a], (start, count)) = (view.shear.axes, along(&part, view.shear.axes));
        let origin = along(&view.clip, view.shear.axes).0;
        for layer in start[2]..start[2] + count[2] {
            for row in start[1]..start[1] + count[1] {
                let mut voxel = [0; 3];
                (voxel[b], voxel[c], voxel[a]) = (start[0], row, layer);
                let at = ((view.met_at(layer) - self.first) * self.rows + row - origin[1]) * self.stride;
                each(voxel, &mut self.values[at + start[0] - origin[0]..][..count[0]]);
            }
        }
    }

    /// Finds the ranges of the bricks of new layers. All their voxels must be in place.
    pub(super) fn seal(&mut self, columns: usize) {
        for layer in self.first + self.ranges.len()..self.end {
            let (ranges, missing) = dispatch!(ranges(self.layer(layer), (self.stride, columns)));
            self.ranges.push(ranges);
            self.missing.push(missing);
        }
    }

    /// The samples of a layer, row by row.
    pub(super) fn layer(&self, layer: usize) -> &[f32] {
        let size = self.stride * self.rows;
        &self.values[(layer - self.first) * size..][..size]
    }

    /// The ranges of a layer's bricks.
    pub(super) fn ranges(&self, layer: usize) -> &Ranges {
        &self.ranges[layer - self.first]
    }

    /// Whether any sample of a layer is missing.
    pub(super) fn is_missing(&self, layer: usize) -> bool {
        self.missing[layer - self.first]
    }
}
