//! Tells whether listing the values of a block's samples may pay: whether they are few and often the same.

use super::box_samples::BoxSamples;

/// Whether a list of the values of a block's samples may take less than `bytes`. Takes the entropy of a few samples, as if a sample
/// either equals that of the frame before or is independent of it.
pub(super) fn may_be_smaller(samples: &BoxSamples<'_>, bytes: usize) -> bool {
    let (count, voxels, sample) = (samples.len(), samples.voxels(), |at: usize| samples.sample(at));
    let starts = (0..RUNS).map(|run| run * count / RUNS);
    let places = starts.flat_map(|start| (start..count).take(count.div_ceil(RUNS).min(RUN)));
    let (mut values, mut of_change) = (Vec::with_capacity(RUNS * RUN), [0; 2]);
    for at in places {
        values.push(number(sample(at)));
        if let Some(before) = at.checked_sub(voxels) {
            of_change[usize::from(sample(at) != sample(before))] += 1;
        }
    }
    values.sort_unstable();
    let alone = entropy(values.chunk_by(u64::eq).map(<[u64]>::len));
    let looked_at = of_change[0] + of_change[1];
    let share = of_change[1] as f64 / looked_at.max(1) as f64;
    let along_time = if looked_at > 0 { entropy(of_change.into_iter()) + share * alone } else { alone };
    count as f64 * alone.min(along_time) * CONTEXTS < 8.0 * bytes as f64
}

/// The entropy of things that occur so often, in bits for each.
fn entropy(counts: impl Iterator<Item = usize> + Clone) -> f64 {
    let total = counts.clone().sum::<usize>() as f64;
    counts.filter(|count| *count > 0).map(|count| count as f64 / total).map(|share| -share * libm::log2(share)).sum()
}

/// The bytes of a sample as a number.
fn number(sample: &[u8]) -> u64 {
    let mut bytes = [0; 8];
    bytes[..sample.len()].copy_from_slice(sample);
    u64::from_le_bytes(bytes)
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
