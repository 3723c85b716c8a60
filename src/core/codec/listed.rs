//! Tells whether listing the values of a block's samples may pay: whether they are few and often the same.

use super::box_samples::BoxSamples;
use std::collections::BTreeMap;

/// Whether a list of the values of a block's samples may take less than `bytes`. Takes the entropy of a few samples, as if a sample either equals that of the frame before or is independent of it.
pub(super) fn may_be_smaller(samples: &BoxSamples<'_>, bytes: usize) -> bool {
    let (count, voxels, sample) = (samples.len(), samples.voxels(), |at: usize| samples.sample(at));
    let starts = (0..RUNS).map(|run| run * count / RUNS);
    let places = starts.flat_map(|start| (start..count).take(count.div_ceil(RUNS).min(RUN)));
    let (mut of_value, mut of_change): (BTreeMap<&[u8], usize>, BTreeMap<bool, usize>) = Default::default();
    for at in places {
        *of_value.entry(sample(at)).or_default() += 1;
        if let Some(before) = at.checked_sub(voxels) {
            *of_change.entry(sample(at) != sample(before)).or_default() += 1;
        }
    }
    let (same, changed) = (of_change.get(&false).copied().unwrap_or(0), of_change.get(&true).copied().unwrap_or(0));
    let alone = entropy(of_value.values());
    let share = changed as f64 / (same + changed).max(1) as f64;
    let along_time = if same + changed > 0 { entropy(of_change.values()) + share * alone } else { alone };
    count as f64 * alone.min(along_time) * CONTEXTS < 8.0 * bytes as f64
}

/// The entropy of things that occur so often, in bits for each.
fn entropy<'a>(counts: impl Iterator<Item = &'a usize> + Clone) -> f64 {
    let total = counts.clone().sum::<usize>() as f64;
    counts.map(|count| *count as f64 / total).map(|share| -share * libm::log2(share)).sum()
}

/// The number of runs of samples that are looked at, spread evenly, and the samples of a run.
const RUNS: usize = 64;
const RUN: usize = 64;

/// The least share of the entropy that packed places take, because neighbours predict them, too.
const CONTEXTS: f64 = 0.6;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sample::SampleType;

    fn may_pay(samples: &[u8], size: usize, voxels: usize, bytes: usize) -> bool {
        let ty = if size == 1 { SampleType::U8 } else { SampleType::F32 };
        may_be_smaller(&BoxSamples::whole(ty, samples, [voxels, 1, 1]), bytes)
    }

    #[test]
    fn few_values_may_be_listed() {
        let voxels = 1000;
        let noise = |i: u32| i.wrapping_mul(0x9E37_79B1) >> 16;
        let labels: Vec<u8> = (0..8000).map(|i| (i % 1000 / 100) as u8).collect(); // as in the frame before
        assert!(may_pay(&labels, 1, voxels, 100));
        let counts: Vec<u8> = (0..8000).flat_map(|i| f32::from(u8::from(noise(i) % 8 == 0)).to_le_bytes()).collect();
        assert!(may_pay(&counts, 4, voxels, 400) && !may_pay(&counts, 4, voxels, 300)); // 0.54 bits
        let many: Vec<u8> = (0..8000).flat_map(|i| (noise(i) as f32).to_le_bytes()).collect();
        assert!(!may_pay(&many, 4, voxels, 6000));
        assert!(may_pay(&[7], 1, 1, 1) && may_pay(&[7; 100], 1, 1, 1));
    }
}
