//! How much voxels vary over time, from a few voxels of every block: what an allowed error is compared with.

use super::spread::evenly;
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::codec::block_with_ghosts::BlockWithGhosts;

/// Approximate number of voxels sampled per window.
const VOXELS: usize = 4096;
/// Largest number of voxels sampled per block.
const MOST: usize = 64;
/// Voxels that vary less than this share of the most varied one do not count: they hold rounding errors.
const STILL: f64 = 1e-6;
/// Low bits of an f64 that the bins of the histogram ignore. A bin is given by the sign, the exponent and four bits of
/// the fraction.
const DROPPED: u32 = 48;

/// The standard deviations of voxels over the frames of a window, counted in bins of up to 6 %.
#[derive(Debug, Clone, Default)]
pub(super) struct Variation(Vec<u64>);

impl Variation {
    /// Adds some voxels of a block, one of `blocks`, from its samples, frame by frame. Which voxels these are depends on
    /// the grid alone.
    pub(super) fn add_block(
        &mut self,
        block: usize,
        blocks: usize,
        extent: &BlockWithGhosts,
        ty: SampleType,
        declared: Option<f64>,
        samples: &[u8],
    ) {
        if !block.is_multiple_of(blocks.div_ceil(VOXELS)) {
            return;
        }
        let each = (VOXELS / blocks).clamp(1, MOST);
        let [nx, ny, nz] = extent.known;
        let mut series = Vec::new();
        for voxel in 0..each {
            let [x, y, z] = evenly(block * each + voxel, extent.size);
            let at = x + nx * (y + ny * z);
            series.clear();
            for frame in samples.chunks_exact(nx * ny * nz * ty.size()) {
                let mut value = [0.0];
                sample::load(ty, &frame[at * ty.size()..(at + 1) * ty.size()], &mut value);
                series.extend(value.into_iter().filter(|v| !sample::is_missing(*v, declared)));
            }
            self.add(deviation(&series));
        }
    }

    fn add(&mut self, deviation: f64) {
        if deviation > 0.0 && deviation.is_finite() {
            self.0.resize((f64::INFINITY.to_bits() >> DROPPED) as usize, 0);
            self.0[(deviation.to_bits() >> DROPPED) as usize] += 1;
        }
    }

    /// The bins of voxels that change: the middle of each, and how many voxels it holds.
    fn changing(&self) -> impl Iterator<Item = (f64, u64)> + Clone + '_ {
        let middle = |bin: usize| f64::from_bits((bin as u64) << DROPPED | 1 << (DROPPED - 1));
        let most = self.0.iter().rposition(|count| *count > 0).map_or(0.0, middle);
        let bins = self.0.iter().enumerate().filter(|(_, count)| **count > 0);
        bins.map(move |(bin, count)| (middle(bin), *count)).filter(move |(deviation, _)| *deviation >= STILL * most)
    }

    /// The median of the voxels that change; none if no voxel does.
    pub(super) fn median(&self) -> Option<f64> {
        let all: u64 = self.changing().map(|(_, count)| count).sum();
        let mut before = 0;
        self.changing()
            .find(|(_, count)| {
                before += count;
                2 * before >= all
            })
            .map(|(deviation, _)| deviation)
    }

    /// The share of the voxels that change by less than `error`.
    pub(super) fn share_below(&self, error: f64) -> Option<f64> {
        let all: u64 = self.changing().map(|(_, count)| count).sum();
        let less: u64 = self.changing().filter(|(deviation, _)| *deviation < error).map(|(_, count)| count).sum();
        (all > 0).then(|| less as f64 / all as f64)
    }
}

/// The standard deviation of some values; 0 of none.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().map(|v| v / count).sum::<f64>();
    let most = values.iter().map(|v| (v - mean).abs()).fold(0.0, f64::max);
    if most == 0.0 || values.windows(2).all(|pair| pair[0] == pair[1]) {
        return 0.0;
    }
    most * (values.iter().map(|v| ((v - mean) / most).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_voxels_that_change() {
        let mut found = Variation::default();
        assert_eq!((found.median(), found.share_below(1.0)), (None, None));
        (0..100).for_each(|_| found.add(0.0));
        (1..=101).for_each(|i| found.add(f64::from(i)));
        (0..1000).for_each(|_| found.add(1e-9)); // rounding errors
        assert!((found.median().expect("some change") / 51.0 - 1.0).abs() < 0.07);
        assert!((found.share_below(20.0).expect("some change") - 0.19).abs() < 0.03);
    }

    #[test]
    fn deviations_are_those_of_the_definition() {
        assert_eq!(deviation(&[1.0, 3.0]), 1.0);
        assert_eq!((deviation(&[]), deviation(&[0.1; 7])), (0.0, 0.0));
        assert_eq!(deviation(&[-1e300, 1e300]), 1e300);
    }

    #[test]
    fn voxels_of_a_block_are_read_at_their_places() {
        let extent = BlockWithGhosts { size: [2, 2, 2], known: [3, 2, 2] };
        let frame = |t: u32| (0..12_u32).map(move |i| if i % 3 == 2 { t * 1000 } else { t * 4 } as f32);
        let bytes: Vec<u8> = (0..2).flat_map(frame).flat_map(f32::to_le_bytes).collect();
        let mut found = Variation::default();
        found.add_block(0, 1, &extent, SampleType::F32, None, &bytes);
        assert!((found.median().expect("some change") / 2.0 - 1.0).abs() < 0.07 && found.share_below(2.5) == Some(1.0));
    }
}
