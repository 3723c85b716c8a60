//! The order in which coefficients are dropped: the smallest first; among those nearly equal, the finer.

use crate::base::vectors::dispatch;
use crate::wavelet::{LANES, Lane};

/// The coefficients of [`LANES`] series in this order.
#[derive(Debug)]
pub(super) struct Order {
    /// For each k with a code that is not zero, the sort key of each lane; sorted lane by lane.
    keys: Vec<[u32; LANES]>,
    /// The networks that sort 2^n rows of keys.
    networks: Vec<Vec<[u16; 2]>>,
    /// The bits of keys that hold k, all set.
    low: u32,
}

impl Order {
    /// Prepares for series of so many coefficients.
    pub(super) fn new(coefficients: usize) -> Self {
        let rows = coefficients.next_power_of_two();
        let networks = (0..=rows.ilog2()).map(sorting_network).collect();
        Self { keys: Vec::with_capacity(coefficients), networks, low: rows as u32 - 1 }
    }

    /// Sorts the coefficients whose codes are not zero, lane by lane.
    pub(super) fn sort(&mut self, codes: &[[i32; LANES]], coefficients: &[Lane], step: f64) {
        self.keys.clear();
        dispatch!(make_keys(codes, coefficients, step, self.low, &mut self.keys));
        let levels = self.keys.len().next_power_of_two().ilog2();
        dispatch!(sort_lanes(&mut self.keys[..], &self.networks[levels as usize][..]));
    }

    /// The coefficients of a lane, the first to drop first.
    #[inline(always)]
    pub(super) fn of_lane(&self, lane: usize) -> impl Iterator<Item = usize> {
        let keys = self.keys.iter().map(move |keys| keys[lane]).take_while(|key| *key != NONE);
        keys.map(|key| (self.low - (key & self.low)) as usize)
    }
}

/// The sort key of a zero code, larger than any other.
const NONE: u32 = u32::MAX;

/// Makes the sort keys. Their high bits are the coefficient's size in steps. Their low bits count k backwards, so that the finer of two
/// nearly equal ones comes first.
#[inline(always)]
fn make_keys(codes: &[[i32; LANES]], coefficients: &[Lane], step: f64, low: u32, keys: &mut Vec<[u32; LANES]>) {
    let per_step = 1.0 / step;
    for (k, (codes, coefficients)) in codes.iter().zip(coefficients).enumerate() {
        let mut row = [NONE; LANES];
        let mut any = 0;
        for l in 0..LANES {
            // The bits of positive floats sort as the floats do.
            let size = (coefficients[l] * per_step).abs() as f32;
            let key = size.to_bits() & !low | (low - k as u32);
            row[l] = if codes[l] == 0 { NONE } else { key };
            any |= codes[l];
        }
        if any != 0 {
            keys.push(row);
        }
    }
}

/// The pairs of rows whose exchange sorts 2^levels rows: [Batcher](crate::bibliography)'s merges of odd and even entries.
fn sorting_network(levels: u32) -> Vec<[u16; 2]> {
    let mut pairs = Vec::new();
    for sorted in 0..levels {
        for apart in (0..=sorted).rev() {
            let first = if apart < sorted { 1 << apart } else { 0 };
            let lows = (first..(1_usize << levels) - (1 << apart)).filter(|low| (low - first) >> apart & 1 == 0);
            let pair = lows.map(|low| [low, low + (1 << apart)]);
            pairs.extend(
                pair.filter(|[low, high]| low >> (sorted + 1) == high >> (sorted + 1))
                    .map(|rows| rows.map(|row| row as u16)),
            );
        }
    }
    pairs
}

/// Sorts the lanes of rows by a network, which may be one for more rows.
#[inline(always)]
fn sort_lanes(rows: &mut [[u32; LANES]], network: &[[u16; 2]]) {
    for [low, high] in network {
        if usize::from(*high) < rows.len() {
            exchange(rows, usize::from(*low), usize::from(*high));
        }
    }
}

/// Sorts two rows lane by lane.
#[inline(always)]
fn exchange(rows: &mut [[u32; LANES]], low: usize, high: usize) {
    let (a, b) = (rows[low], rows[high]);
    for l in 0..LANES {
        rows[low][l] = if a[l] < b[l] { a[l] } else { b[l] };
        rows[high][l] = if a[l] < b[l] { b[l] } else { a[l] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn networks_sort_any_number_of_rows() {
        for len in 1..70_usize {
            let mut rows: Vec<[u32; LANES]> = (0..len)
                .map(|i| std::array::from_fn(|l| ((i + 7 * l) as u32).wrapping_mul(0x9E37_79B1) >> 27))
                .collect();
            let mut expected = rows.clone();
            for lane in 0..LANES {
                let mut sorted: Vec<u32> = rows.iter().map(|row| row[lane]).collect();
                sorted.sort_unstable();
                expected.iter_mut().zip(sorted).for_each(|(row, key)| row[lane] = key);
            }
            sort_lanes(&mut rows, &sorting_network(len.next_power_of_two().ilog2()));
            assert_eq!(rows, expected);
        }
    }
}
