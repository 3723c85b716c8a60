//! Weighted sums of rows, 16 numbers at a time: the kernel along each of the three axes.

use super::GROUP;

/// Sixteen neighbouring numbers.
pub(super) type Sixteen = [f32; GROUP];

/// The place of a strip of [`GROUP`] columns and some rows: its first number, and numbers from row to row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strip {
    pub(super) at: usize,
    pub(super) stride: usize,
}

/// The sums of one slice along some axes: of values, and of the weights of present samples.
#[derive(Debug, Default)]
pub(super) struct AxisSums {
    pub(super) values: Vec<f32>,
    pub(super) present: Vec<f32>,
}

impl AxisSums {
    pub(super) fn zeros(count: usize) -> Self {
        Self { values: vec![0.0; count], present: Vec::new() }
    }

    /// Makes room for the weights of present samples.
    pub(super) fn with_present(&mut self) {
        self.present.resize(self.values.len(), 0.0);
    }
}

/// Stores the weighted sums of a strip of several layers. Layers may be one array from several first numbers on, so
/// this filters along any axis.
#[inline(always)]
pub(super) fn mix(layers: &[&[f32]], weights: &[f32], from: Strip, rows: usize, (to, out): (Strip, &mut [f32])) {
    for row in 0..rows {
        let sum = weighted(layers.iter().copied(), weights, from.at + row * from.stride);
        put(out, to.at + row * to.stride, &sum);
    }
}

/// The same with zeros for missing samples; and the sums of the weights of samples that are present, where `mask` is 1
/// for columns with samples.
#[inline(always)]
pub(super) fn mix_present(
    layers: &[&[f32]],
    weights: &[f32],
    from: Strip,
    mask: &Sixteen,
    rows: usize,
    to: Strip,
    sums: &mut AxisSums,
) {
    for row in 0..rows {
        let (mut sum, mut weight_sum) = ([0.0; GROUP], [0.0; GROUP]);
        for (layer, weight) in layers.iter().zip(weights) {
            let values = sixteen(layer, from.at + row * from.stride);
            for i in 0..GROUP {
                let missing = values[i].is_nan();
                sum[i] += if missing { 0.0 } else { weight * values[i] };
                weight_sum[i] += if missing { 0.0 } else { weight * mask[i] };
            }
        }
        put(&mut sums.values, to.at + row * to.stride, &sum);
        put(&mut sums.present, to.at + row * to.stride, &weight_sum);
    }
}

/// The weighted sum of the numbers from `at` on of several layers.
#[inline(always)]
pub(super) fn weighted<'a>(layers: impl Iterator<Item = &'a [f32]>, weights: &[f32], at: usize) -> Sixteen {
    let mut sum = [0.0; GROUP];
    for (layer, weight) in layers.zip(weights) {
        let values = sixteen(layer, at);
        for i in 0..GROUP {
            sum[i] += weight * values[i];
        }
    }
    sum
}

/// Sixteen numbers from `at` on.
#[inline(always)]
fn sixteen(values: &[f32], at: usize) -> &Sixteen {
    const NONE: &Sixteen = &[0.0; GROUP];
    values.get(at..at + GROUP).and_then(|sixteen| sixteen.try_into().ok()).unwrap_or(NONE)
}

/// The weighted sum of sixteen numbers of each row from `at` on.
#[inline(always)]
pub(super) fn weighted_rows(values: &[f32], stride: usize, weights: &[f32], mut at: usize) -> Sixteen {
    let mut sum = [0.0; GROUP];
    for weight in weights {
        let row = sixteen(values, at);
        for i in 0..GROUP {
            sum[i] += weight * row[i];
        }
        at += stride;
    }
    sum
}

#[inline(always)]
fn put(out: &mut [f32], at: usize, values: &Sixteen) {
    if let Some(to) = out.get_mut(at..at + GROUP) {
        to.copy_from_slice(values);
    }
}
