//! Where rays end before the volume does: at an opaque plane.

use super::GROUP;
use super::filter::Sixteen;
use super::view::SlicedView;

/// For each cell, the number of slices up to the end of its ray.
pub(in crate::render) struct Stops {
    groups: Vec<Sixteen>,
}

impl Stops {
    /// `end` gives the end of the ray through a point of the picture: its position along the principal axis, in voxels
    /// of the grid; `None` if the ray has no end.
    pub(in crate::render) fn new(view: &SlicedView, end: impl Fn([f64; 2]) -> Option<f64>) -> Self {
        let [width, height] = view.extent;
        let mut groups = Vec::with_capacity(width / GROUP * height * view.cells * view.cells);
        for row in 0..height * view.cells {
            for phase in 0..view.cells {
                for group in 0..width / GROUP {
                    let stop = |i: usize| {
                        let column = (group * GROUP + i) * view.cells + phase;
                        end(view.pixel_of([column, row])).map_or(f32::INFINITY, |at| view.slices_before(at) as f32)
                    };
                    groups.push(std::array::from_fn(stop));
                }
            }
        }
        Self { groups }
    }

    /// The stops of some groups.
    pub(super) fn groups(&self, groups: std::ops::Range<usize>) -> &[Sixteen] {
        &self.groups[groups]
    }

    /// Bytes of the stops of a view.
    pub(in crate::render) fn bytes(view: &SlicedView) -> usize {
        view.extent[0] * view.extent[1] * view.cells * view.cells * size_of::<f32>()
    }
}

/// The shares, before these stops, of `thickness` slices from `number` on.
#[inline(always)]
pub(super) fn shares(stops: &Sixteen, number: u32, thickness: u32) -> Sixteen {
    let mut shares = [0.0; GROUP];
    for i in 0..GROUP {
        shares[i] = ((stops[i] - number as f32) / thickness as f32).clamp(0.0, 1.0);
    }
    shares
}

/// Whether all rays of a group end before slice `next`.
pub(super) fn are_over(stops: &Sixteen, next: u32) -> bool {
    stops.iter().all(|stop| *stop <= next as f32)
}
