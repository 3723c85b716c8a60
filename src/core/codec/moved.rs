//! The samples of a decoded block that go to their sides of kept values.

use super::WindowCodec;
use super::decode::{Block, WantedFrames};
use super::field::Field;
use super::sides::{Fixed, Walk};
use crate::base::sample;
use wavesplat_format::{BlockEntry, Error, Reader, Result, Side, SideCodes, Storage};

impl Block {
    /// Reads how samples get to their sides, if they are decoded with all detail.
    pub(super) fn read_sides<S: Storage>(
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
    ) -> Result<Vec<SideCodes>> {
        if !codec.decodes_sides(entry) {
            return Ok(Vec::new());
        }
        let sides = reader.sides(entry)?.unwrap_or_default();
        if sides.len() == codec.sides.len() {
            return Ok(sides);
        }
        let (has, keeps) = (sides.len(), codec.sides.len());
        Err(Error::Invalid(format!("{}: sides of {has} values, but the file keeps those of {keeps}", entry.id)))
    }

    /// Whether samples keep their sides of some values: not where detail is left out, and exact samples have them anyway.
    pub fn keeps_sides(&self, codec: &WindowCodec) -> bool {
        !codec.sides.is_empty() && codec.lod == 0 && self.exact.is_none()
    }

    /// The samples of some frames that are on another side of a kept value than what their coefficients give, by index. Those stored
    /// exactly or missing are left out. `field` has the coefficients that the frames need.
    pub fn moved(&self, codec: &WindowCodec, field: &Field<'_>, wanted: &WantedFrames) -> Vec<(usize, f64)> {
        if !self.keeps_sides(codec) {
            return Vec::new();
        }
        let (samples, size, mut moved, mut run) = (self.samples(codec), codec.sample.size(), Vec::new(), Vec::new());
        self.for_each_run_of(codec, field, wanted, |first, values| {
            run.resize(values.len(), 0.0);
            sample::load(codec.sample, &samples[first * size..][..values.len() * size], &mut run);
            let pairs = (first..).zip(values.iter().zip(&run));
            let beside = pairs.filter(|(_, (value, sample))| is_beside(codec, **value, **sample));
            moved.extend(
                beside.filter(|(index, _)| !self.is_fixed(*index)).map(|(index, (_, sample))| (index, *sample)),
            );
        });
        moved
    }

    /// Whether a sample is stored exactly or missing.
    fn is_fixed(&self, index: usize) -> bool {
        self.is_missing(index) || self.outliers.positions.binary_search(&(index as u32)).is_ok()
    }

    /// Moves samples to their sides of the kept values.
    pub(super) fn put_on_sides(&self, codec: &WindowCodec, samples: &mut [u8]) {
        let fixed = Fixed { exact: &self.outliers.positions, missing: &self.missing.0 };
        for (value, codes) in codec.sides.iter().zip(&self.sides) {
            Walk::new(codec, self.size, *value, fixed).apply(codes, samples);
        }
    }

    /// Replaces values by samples where these are on another side of a kept value.
    pub(super) fn put_moved(&self, codec: &WindowCodec, samples: &[u8], values: &mut [f64]) {
        if self.keeps_sides(codec) {
            let mut rounded = vec![0.0; values.len()];
            sample::load(codec.sample, samples, &mut rounded);
            let moved = values.iter_mut().zip(rounded).filter(|(value, sample)| is_beside(codec, **value, *sample));
            moved.for_each(|(value, sample)| *value = sample);
        }
    }
}

/// Whether two numbers are on different sides of a kept value.
fn is_beside(codec: &WindowCodec, a: f64, b: f64) -> bool {
    codec.sides.iter().any(|side| Side::of(a, *side) != Side::of(b, *side))
}
