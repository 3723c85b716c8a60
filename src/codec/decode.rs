//! A coded block back to samples: the one decoder of the project.

use super::{WindowCodec, lane_groups, reconstruct};
use crate::sample;
use crate::wavelet::{LANES, Lane};
use wavesplat_format::{BlockEntry, Outliers, PartKind, Reader, Result, Storage};

/// One block in memory, decompressed but not yet transformed.
#[derive(Debug)]
pub struct Block {
    /// Voxels of the block.
    pub voxels: usize,
    /// A coefficient is its code times this.
    pub step: f64,
    /// Codes, `k * voxels + voxel`; empty if no level part was read.
    pub codes: Vec<i32>,
    /// Samples stored exactly because the coefficients miss them.
    pub outliers: Outliers,
    /// Which samples are missing (`frame * voxels + voxel`), and their bytes one after another; empty if none is.
    pub missing: (Vec<bool>, Vec<u8>),
    /// All samples, if the block is stored exactly.
    pub exact: Option<Vec<u8>>,
    /// Stored bytes that were read.
    pub bytes_read: u64,
}

impl Block {
    /// Reads what a block holds of the coefficients that `wanted` marks, and all that overrides them.
    pub fn read<S: Storage>(
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
        voxels: usize,
        wanted: &[bool],
    ) -> Result<Self> {
        let mut block = Self {
            voxels,
            step: entry.stats.step,
            codes: Vec::new(),
            outliers: reader.outliers(entry)?,
            missing: reader.missing(entry)?.unwrap_or_default(),
            exact: reader.exact(entry)?,
            bytes_read: 0,
        };
        for part in &entry.parts {
            if let PartKind::Level(level) = part.kind {
                let range = codec.parts[usize::from(level)].clone();
                if !wanted[range.clone()].contains(&true) {
                    continue;
                }
                block.codes.resize(codec.basis.coefficients() * voxels, 0);
                reader.codes(entry, level, &mut block.codes[range.start * voxels..range.end * voxels])?;
            }
            block.bytes_read += u64::from(part.stored_len);
        }
        Ok(block)
    }

    /// Whether a sample is missing.
    pub fn is_missing(&self, index: usize) -> bool {
        self.missing.0.get(index).copied().unwrap_or(false)
    }

    /// Calls `visit(first voxel, count, series)` for every group of voxels, with what the coefficients give:
    /// outliers and missing samples not yet in place.
    pub fn for_each_group(&self, codec: &WindowCodec, mut visit: impl FnMut(usize, usize, &[Lane])) {
        let mut work = vec![Lane::default(); codec.basis.coefficients()];
        let mut series = vec![Lane::default(); codec.frames()];
        for (first, count) in lane_groups(self.voxels) {
            let code = |k: usize| {
                let codes = &self.codes[k * self.voxels + first..][..count];
                std::array::from_fn(|l| codes.get(l).copied().unwrap_or(0))
            };
            if !self.codes.is_empty() {
                reconstruct(codec.basis.as_ref(), self.step, code, &mut work, &mut series);
            }
            visit(first, count, &series);
        }
    }

    /// The series of one voxel as the coefficients give it.
    pub fn series(&self, codec: &WindowCodec, voxel: usize) -> Vec<f64> {
        let mut work = vec![Lane::default(); codec.basis.coefficients()];
        let mut series = vec![Lane::default(); codec.frames()];
        let code = |k: usize| [self.codes[k * self.voxels + voxel]; LANES];
        if !self.codes.is_empty() {
            reconstruct(codec.basis.as_ref(), self.step, code, &mut work, &mut series);
        }
        series.iter().map(|lane| lane[0]).collect()
    }

    /// All samples of the block in their own type, little-endian, `frame * voxels + voxel`.
    pub fn samples(&self, codec: &WindowCodec) -> Vec<u8> {
        self.decode(codec, |_, _| {})
    }

    /// What [`Self::samples`] gives, and the numbers that are splatted, not rounded to the samples' type.
    pub fn samples_and_values(&self, codec: &WindowCodec) -> (Vec<u8>, Vec<f64>) {
        let mut values = vec![0.0; codec.frames() * self.voxels];
        let samples = self.decode(codec, |at, run| values[at..at + run.len()].copy_from_slice(run));
        if self.exact.is_some() {
            sample::load(codec.sample, &samples, &mut values);
        }
        let outliers = self.outliers.samples.chunks_exact(codec.sample.size());
        for (index, bytes) in self.outliers.positions.iter().map(|p| *p as usize).zip(outliers) {
            sample::load(codec.sample, bytes, &mut values[index..=index]);
        }
        (samples, values)
    }

    /// All samples; `visit(index of the first, values)` sees what coefficients give before it is rounded.
    fn decode(&self, codec: &WindowCodec, mut visit: impl FnMut(usize, &[f64])) -> Vec<u8> {
        let size = codec.sample.size();
        let mut out = match &self.exact {
            Some(exact) => exact.clone(),
            None => vec![0; codec.frames() * self.voxels * size],
        };
        if self.exact.is_none() {
            self.for_each_group(codec, |first, count, series| {
                for (frame, lane) in series.iter().enumerate() {
                    let (at, values) = (frame * self.voxels + first, &lane[..count.min(LANES)]);
                    visit(at, values);
                    sample::store(codec.sample, values, &mut out[at * size..(at + count) * size]);
                }
            });
        }
        self.put_overrides(size, &mut out);
        out
    }

    /// Puts outliers and missing samples in their places.
    fn put_overrides(&self, size: usize, out: &mut [u8]) {
        let outliers =
            self.outliers.positions.iter().map(|p| *p as usize).zip(self.outliers.samples.chunks_exact(size));
        let places = self.missing.0.iter().enumerate().filter(|(_, missing)| **missing).map(|(i, _)| i);
        for (index, bytes) in outliers.chain(places.zip(self.missing.1.chunks_exact(size))) {
            out[index * size..(index + 1) * size].copy_from_slice(bytes);
        }
    }
}
