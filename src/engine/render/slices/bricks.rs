//! Ranges of values of bricks: 16 voxels along b times 8 along c.
//!
//! A mean lies between the least and the largest of the samples that it is made of. So cells are skipped if no value
//! between these is visible.

use super::{BRICK_ROWS, GROUP};

/// The least and the largest sample of each brick, row by row; inverted if all samples are missing.
#[derive(Debug, Clone, Default)]
pub(super) struct Ranges {
    pub(super) columns: usize,
    pub(super) least: Vec<f32>,
    pub(super) largest: Vec<f32>,
}

/// The ranges of a layer's bricks, and whether any sample is missing. The first `columns` numbers of each row are
/// samples.
#[inline(always)]
pub(super) fn ranges(layer: &[f32], (stride, columns): (usize, usize)) -> (Ranges, bool) {
    let (mut found, mut any) = (Ranges { columns: stride / GROUP, ..Ranges::default() }, false);
    for rows in layer.chunks(stride * BRICK_ROWS) {
        for brick in 0..stride / GROUP {
            let (mut least, mut largest, mut missing) =
                ([f32::INFINITY; GROUP], [f32::NEG_INFINITY; GROUP], [0; GROUP]);
            for row in rows.chunks_exact(stride) {
                let Some(values) = row[brick * GROUP..].first_chunk::<GROUP>() else { continue };
                for i in 0..GROUP {
                    // Comparisons with NaN are false.
                    least[i] = if values[i] < least[i] { values[i] } else { least[i] };
                    largest[i] = if values[i] > largest[i] { values[i] } else { largest[i] };
                    missing[i] |= i32::from(values[i].is_nan());
                }
            }
            let samples = columns.saturating_sub(brick * GROUP).min(GROUP);
            found.least.push(least[..samples].iter().copied().fold(f32::INFINITY, f32::min));
            found.largest.push(largest[..samples].iter().copied().fold(f32::NEG_INFINITY, f32::max));
            any |= missing.iter().any(|missing| *missing != 0);
        }
    }
    (found, any)
}

impl Ranges {
    /// Ranges of nothing.
    fn inverted(columns: usize, count: usize) -> Self {
        Self { columns, least: vec![f32::INFINITY; count], largest: vec![f32::NEG_INFINITY; count] }
    }

    /// The joint ranges of the same bricks in several layers.
    pub(super) fn joint<'a>(layers: impl Iterator<Item = &'a Self>, columns: usize, rows: usize) -> Self {
        layers.fold(Self::inverted(columns, columns * rows), |mut joint, layer| {
            joint.least.iter_mut().zip(&layer.least).for_each(|(to, from)| *to = to.min(*from));
            joint.largest.iter_mut().zip(&layer.largest).for_each(|(to, from)| *to = to.max(*from));
            joint
        })
    }

    /// The joint range of some columns of some rows.
    pub(super) fn joined(&self, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> (f32, f32) {
        let mut range = (f32::INFINITY, f32::NEG_INFINITY);
        for row in rows {
            for at in row * self.columns + columns.start..row * self.columns + columns.end {
                range = (range.0.min(self.least[at]), range.1.max(self.largest[at]));
            }
        }
        range
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::vectors::dispatch;

    #[test]
    fn ranges_hold_every_sample_and_no_padding() {
        let (stride, columns, rows) = (32, 19, 11);
        let value = |i: usize| if i % 13 == 5 { f32::NAN } else { ((i * 7919) % 101) as f32 + 1.0 };
        let layer: Vec<f32> = (0..stride * rows).map(|i| if i % stride < columns { value(i) } else { 0.0 }).collect();
        let (found, missing) = dispatch!(ranges(&layer[..], (stride, columns)));
        assert!(missing && found.columns == 2 && found.least.len() == 4);
        for brick in 0..4 {
            let inside =
                |i: &usize| i / stride / 8 == brick / 2 && i % stride / 16 == brick % 2 && i % stride < columns;
            let values = || (0..layer.len()).filter(inside).map(|i| layer[i]).filter(|v| !v.is_nan());
            assert_eq!(found.least[brick], values().fold(f32::INFINITY, f32::min));
            assert_eq!(found.largest[brick], values().fold(f32::NEG_INFINITY, f32::max));
        }
        assert!(!dispatch!(ranges(&vec![1.0; stride * rows][..], (stride, columns))).1);
    }
}
