//! Transforms the series of many voxels together, by a basis that is a matrix.
//!
//! ```text
//! c_{i,k} = sum over the frames j of u_k(t_j) v_i(t_j)                                                    (eq 5)
//! ```
//!
//! Sums have the type of the pyramid's nodes. Their rounding needs no bound: blocks are decoded and compared with the source.

use super::real::Real;
use crate::base::sample::{self, SampleType};
use crate::base::vectors::dispatch;

/// The coefficients of all series: `coefficients[k * voxels + voxel]`. `rows[k][j]` is u_k(t_j); `samples` are `[j][voxel]`,
/// little-endian. Returns an upper bound of the magnitudes of each k.
pub(super) fn forward<R: Real>(rows: &[Vec<f64>], ty: SampleType, samples: &[u8], coefficients: &mut [R]) -> Vec<R> {
    let (frames, voxels) = (rows.first().map_or(0, Vec::len), coefficients.len() / rows.len().max(1));
    let rows: Vec<Vec<R>> = rows.iter().map(|row| row.iter().copied().map(R::from_f64).collect()).collect();
    let (mut some, mut sums) = (vec![[R::default(); VOXELS]; frames], vec![[R::default(); VOXELS]; rows.len()]);
    let mut largest = vec![R::default(); rows.len()];
    for first in (0..voxels).step_by(VOXELS) {
        let count = VOXELS.min(voxels - first);
        for (series, frame) in some.iter_mut().zip(samples.chunks_exact(voxels * ty.size())) {
            sample::load_as(ty, &frame[first * ty.size()..][..count * ty.size()], &mut series[..count], R::from_f64);
        }
        dispatch!(products(&rows[..], &some[..], &mut sums[..]));
        dispatch!(keep_largest(&sums[..], &mut largest[..]));
        for (sums, of_k) in sums.iter().zip(coefficients.chunks_exact_mut(voxels)) {
            of_k[first..][..count].copy_from_slice(&sums[..count]);
        }
    }
    largest
}

/// Replaces each number by the largest magnitude of its row of sums, if that is larger. Ignores NaN.
#[inline(always)]
pub(super) fn keep_largest<R: Real>(sums: &[[R; VOXELS]], largest: &mut [R]) {
    for (sums, largest) in sums.iter().zip(largest) {
        let mut lanes = [*largest; WIDTH];
        for sums in sums.as_chunks::<WIDTH>().0 {
            for l in 0..WIDTH {
                let (plus, minus) = (sums[l], R::default() - sums[l]);
                let magnitude = if plus > minus { plus } else { minus };
                lanes[l] = if magnitude > lanes[l] { magnitude } else { lanes[l] };
            }
        }
        *largest = lanes.into_iter().fold(*largest, |a, b| if b > a { b } else { a });
    }
}

/// For each row, the sums over j of `row[j] * samples[j]` for some voxels, in the order of j.
#[inline(always)]
pub(super) fn products<R: Real>(rows: &[Vec<R>], samples: &[[R; VOXELS]], sums: &mut [[R; VOXELS]]) {
    let (some, last) = rows.as_chunks::<SIDE_BY_SIDE>();
    let (some_sums, last_sums) = sums.as_chunks_mut::<SIDE_BY_SIDE>();
    for (rows, sums) in some.iter().zip(some_sums) {
        for first in (0..VOXELS).step_by(WIDTH) {
            products_of(rows, samples, first, sums);
        }
    }
    for (row, sums) in last.iter().zip(last_sums) {
        for first in (0..VOXELS).step_by(WIDTH) {
            products_of(std::array::from_ref(row), samples, first, std::array::from_mut(sums));
        }
    }
}

/// The sums of `N` rows for `WIDTH` voxels from `first` on.
#[inline(always)]
fn products_of<R: Real, const N: usize>(
    rows: &[Vec<R>; N],
    samples: &[[R; VOXELS]],
    first: usize,
    sums: &mut [[R; VOXELS]; N],
) {
    let rows = rows.each_ref().map(|row| &row[..samples.len()]);
    let mut own = [[R::default(); WIDTH]; N];
    for (j, samples) in samples.iter().enumerate() {
        let samples = &samples[first..first + WIDTH];
        for n in 0..N {
            for l in 0..WIDTH {
                own[n][l] = own[n][l] + samples[l] * rows[n][j];
            }
        }
    }
    sums.iter_mut().zip(own).for_each(|(sums, own)| sums[first..first + WIDTH].copy_from_slice(&own));
}

/// Voxels whose samples in 32 frames stay in the first-level cache.
pub(super) const VOXELS: usize = 128;

/// Voxels whose sums stay in registers.
const WIDTH: usize = 16;

/// The number of sums of a voxel that are computed together, because each must wait for its last addition.
const SIDE_BY_SIDE: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wavelet::{LANES, Lane, Learned, TimeBasis};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn coefficients_are_those_of_single_series(frames in 1usize..40, voxels in 1usize..300, seed in any::<u32>()) {
            let scramble = |i: usize| f64::from((i as u32 ^ seed).wrapping_mul(0x9E37_79B1) >> 8);
            let functions: Vec<i16> = (0..2 * frames).map(|i| scramble(i) as i16).collect();
            let (basis, ty) = (Learned::new(&functions, frames), SampleType::F32);
            let values: Vec<f64> = (0..frames * voxels).map(scramble).collect();
            let mut samples = vec![0; values.len() * ty.size()];
            sample::store(ty, &values, &mut samples);
            let rows = basis.rows().expect("a matrix");
            let mut found = vec![0.0_f64; basis.coefficients() * voxels];
            let mut singles = vec![0.0_f32; basis.coefficients() * voxels];
            let largest = forward(rows, ty, &samples, &mut found);
            forward(rows, ty, &samples, &mut singles);
            for (found, largest) in found.chunks_exact(voxels).zip(largest) {
                prop_assert!(found.iter().all(|c| c.abs() <= largest));
            }
            for voxel in 0..voxels {
                let series: Vec<Lane> = (0..frames).map(|t| [f64::from(values[t * voxels + voxel] as f32); LANES]).collect();
                let mut expected = vec![Lane::default(); basis.coefficients()];
                basis.forward(&series, &mut expected);
                for (k, expected) in expected.iter().enumerate() {
                    prop_assert_eq!(found[k * voxels + voxel], expected[0]);
                    let single = f64::from(singles[k * voxels + voxel]);
                    prop_assert!((single - expected[0]).abs() <= 2.0 * frames as f64 * f64::from(f32::EPSILON) * f64::from(1 << 24));
                }
            }
        }
    }
}
