//! The encoding of samples in a format.

use std::io::{self, Write};
use wavesplat_core::base::sample::{SampleType, load, store, swap_endian};

/// Samples converted at a time.
const RUN: usize = 8 << 10;

/// How samples are converted when they are written.
#[derive(Debug, Clone, Copy)]
pub struct Encoding {
    /// The type before.
    pub from: SampleType,
    /// The type in the file; it can represent every value of `from`.
    pub to: SampleType,
    /// Whether the file is big-endian.
    pub(crate) big_endian: bool,
}

impl Encoding {
    /// Whether little-endian samples are written as they are.
    pub fn is_plain(&self) -> bool {
        self.from == self.to && !self.big_endian
    }

    /// Writes little-endian samples in the file's encoding.
    pub fn write(&self, samples: &[u8], out: &mut dyn Write) -> io::Result<()> {
        if self.is_plain() {
            return out.write_all(samples);
        }
        samples.chunks(RUN * self.from.size()).try_for_each(|run| out.write_all(&self.converted(run)))
    }

    fn converted(&self, run: &[u8]) -> Vec<u8> {
        let mut bytes = if self.from == self.to { run.to_vec() } else { self.retyped(run) };
        if self.big_endian {
            swap_endian(self.to, &mut bytes);
        }
        bytes
    }

    fn retyped(&self, run: &[u8]) -> Vec<u8> {
        let mut values = vec![0.0; run.len() / self.from.size()];
        load(self.from, run, &mut values);
        let mut bytes = vec![0; values.len() * self.to.size()];
        store(self.to, &values, &mut bytes);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_keep_their_values() {
        let values: Vec<f64> = (0..RUN + 3).map(|i| (i % 1000) as f64 - 500.0).collect();
        let mut samples = vec![0; 2 * values.len()];
        store(SampleType::F16, &values, &mut samples);
        for big_endian in [false, true] {
            let encoding = Encoding { from: SampleType::F16, to: SampleType::F32, big_endian };
            let mut out = Vec::new();
            encoding.write(&samples, &mut out).expect("written");
            let number = |b: &[u8; 4]| if big_endian { b.iter().rev().copied().collect() } else { b.to_vec() };
            let little: Vec<u8> = out.as_chunks::<4>().0.iter().flat_map(number).collect();
            let mut back = vec![0.0; values.len()];
            load(SampleType::F32, &little, &mut back);
            assert!(back == values);
        }
    }
}
