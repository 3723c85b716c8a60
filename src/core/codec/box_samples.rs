//! The samples of a block within an array of more voxels.

use super::block_with_ghosts::{SampleBytes, copied};
use crate::base::sample::{self, SampleType};
use crate::wavelet::{LANES, Lane};

/// Samples of a box, frame by frame, in an array that may have more voxels along each axis. An index is `frame * voxels + voxel` in the
/// box.
#[derive(Clone, Copy)]
pub(super) struct BoxSamples<'a> {
    ty: SampleType,
    /// Little-endian, for every voxel of the array.
    bytes: &'a [u8],
    /// Voxels of the array along x, y, z.
    of: [usize; 3],
    /// Voxels of the box, which begins with the array's first one.
    size: [usize; 3],
}

impl<'a> BoxSamples<'a> {
    /// The box of `size` voxels at the beginning of an array of `of` voxels.
    pub(super) fn new(ty: SampleType, bytes: &'a [u8], of: [usize; 3], size: [usize; 3]) -> Self {
        Self { ty, bytes, of, size }
    }

    /// An array.
    pub(super) fn whole(ty: SampleType, bytes: &'a [u8], size: [usize; 3]) -> Self {
        Self::new(ty, bytes, size, size)
    }

    /// Voxels of the box along x, y, z.
    pub(super) fn size(&self) -> [usize; 3] {
        self.size
    }

    /// The number of voxels in the box.
    pub(super) fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// The number of samples in the box.
    pub(super) fn len(&self) -> usize {
        self.frames() * self.voxels()
    }

    fn frames(&self) -> usize {
        self.bytes.len() / (self.of.iter().product::<usize>() * self.ty.size())
    }

    /// Whether it is the whole array.
    pub(super) fn is_whole(&self) -> bool {
        self.of == self.size
    }

    /// The bytes of a sample.
    pub(super) fn sample(&self, index: usize) -> &'a [u8] {
        let (frame, voxel) = (index / self.voxels(), index % self.voxels());
        &self.bytes[self.place(frame, voxel) * self.ty.size()..][..self.ty.size()]
    }

    /// The samples side by side.
    pub(super) fn contiguous(&self) -> SampleBytes<'a> {
        match self.is_whole() {
            true => SampleBytes::Lent(self.bytes),
            false => SampleBytes::Own(copied(self.ty, self.bytes, self.size, self.of, self.size)),
        }
    }

    /// The samples of a whole array of 32-bit floats.
    pub(super) fn singles(&self) -> Option<&'a [[u8; 4]]> {
        (self.is_whole() && self.ty == SampleType::F32).then_some(self.bytes.as_chunks().0)
    }

    /// Calls `visit(index of the first, values)` for runs of samples, in order.
    pub(super) fn for_each_run(&self, mut visit: impl FnMut(usize, &[f64])) {
        if self.is_whole() {
            return sample::for_each_run(self.ty, self.bytes, visit);
        }
        let (each, mut values, mut first, mut held) = (self.ty.size(), [0.0; RUN], 0, 0);
        for row in self.rows() {
            for part in row.chunks(RUN * each) {
                let (now, later) = part.split_at(part.len().min((RUN - held) * each));
                sample::load(self.ty, now, &mut values[held..held + now.len() / each]);
                held += now.len() / each;
                if held == RUN {
                    visit(first, &values);
                    (first, held) = (first + RUN, later.len() / each);
                    sample::load(self.ty, later, &mut values[..held]);
                }
            }
        }
        if held > 0 {
            visit(first, &values[..held]);
        }
    }

    /// The largest magnitude. No sample may be missing.
    pub(super) fn magnitude(&self) -> f64 {
        let ([x, y, z], row) = (self.size, self.of[0] * self.ty.size());
        let plane = row * self.of[1];
        let planes = self.bytes.chunks_exact(plane * self.of[2]).flat_map(|frame| frame.chunks_exact(plane).take(z));
        planes.fold(0.0, |most, plane| most.max(sample::magnitude_of_rows(self.ty, &plane[..row * y], row, x)))
    }

    /// Loads the series of `count` voxels, beginning with `first`: one lane for each frame. Unused elements of lanes are zero.
    pub(super) fn load_lanes(&self, first: usize, count: usize, out: &mut [Lane]) {
        let (each, stride) = (self.ty.size(), self.of.iter().product());
        let is_row = self.is_whole() || first % self.size[0] + count <= self.size[0];
        if is_row && count == LANES {
            return sample::load_strided(self.ty, &self.bytes[self.place(0, first) * each..], stride, out);
        }
        for (frame, lane) in out.iter_mut().enumerate() {
            *lane = Lane::default();
            for (n, value) in lane[..count].iter_mut().enumerate() {
                let bytes = &self.bytes[self.place(frame, first + n) * each..][..each];
                sample::load(self.ty, bytes, std::slice::from_mut(value));
            }
        }
    }

    /// Loads the series of `count` voxels, beginning with `first`, as 32-bit floats: one row for each frame. Leaves the rest of rows
    /// as it is.
    pub(super) fn load_singles<const N: usize>(&self, first: usize, count: usize, out: &mut [[f32; N]]) {
        let (each, stride) = (self.ty.size(), self.of.iter().product::<usize>());
        let mut at = 0;
        while at < count {
            let (voxel, row) = (first + at, if self.is_whole() { self.voxels() } else { self.size[0] });
            let (start, len) = (self.place(0, voxel), (row - voxel % row).min(count - at));
            for (frame, out) in out.iter_mut().enumerate() {
                let bytes = &self.bytes[(start + frame * stride) * each..][..len * each];
                sample::load_as(self.ty, bytes, &mut out[at..at + len], |v| v as f32);
            }
            at += len;
        }
    }

    /// The number of a sample in the array.
    fn place(&self, frame: usize, voxel: usize) -> usize {
        let ([nx, ny, nz], [x, y, _]) = (self.of, self.size);
        voxel % x + nx * (voxel / x % y + ny * (voxel / (x * y) + nz * frame))
    }

    /// The rows along x.
    pub(super) fn rows(&self) -> impl Iterator<Item = &'a [u8]> {
        let ([x, y, z], each, me) = (self.size, self.ty.size(), *self);
        let starts = (0..self.frames()).flat_map(move |t| (0..y * z).map(move |row| me.place(t, row * x)));
        starts.map(move |start| &me.bytes[start * each..][..x * each])
    }
}

/// Samples that are visited together.
const RUN: usize = 512;

#[cfg(test)]
mod tests {
    use super::*;

    fn values_of(bytes: &[u8]) -> Vec<f64> {
        let mut values = vec![0.0; bytes.len() / 4];
        sample::load(SampleType::F32, bytes, &mut values);
        values
    }

    #[test]
    fn a_box_in_an_array_has_the_samples_of_a_copy() {
        let (ty, of, frames) = (SampleType::F32, [29, 7, 5], 9);
        let values: Vec<f64> =
            (0..of.iter().product::<usize>() * frames).map(|i| (i * 7919 % 10007) as f64 - 6000.0).collect();
        let mut bytes = vec![0; values.len() * ty.size()];
        sample::store(ty, &values, &mut bytes);
        for size in [of, [28, 6, 4], [8, 7, 5], [1, 1, 1], [29, 6, 5]] {
            let some = BoxSamples::new(ty, &bytes, of, size);
            let copy = some.contiguous();
            let whole = BoxSamples::whole(ty, &copy, size);
            let runs = |of: &BoxSamples<'_>| {
                let mut runs = Vec::new();
                of.for_each_run(|first, values| runs.push((first, values.to_vec())));
                runs
            };
            assert_eq!(runs(&some), runs(&whole));
            let all = values_of(&copy);
            let largest = all.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
            assert_eq!(some.magnitude(), largest);
            assert!((0..some.len()).all(|index| some.sample(index) == whole.sample(index)));
            for (first, count) in crate::codec::lane_groups(some.voxels()) {
                let lanes = |of: &BoxSamples<'_>| {
                    let mut lanes = vec![[f64::NAN; LANES]; frames];
                    of.load_lanes(first, count, &mut lanes);
                    lanes
                };
                assert_eq!(lanes(&some), lanes(&whole), "{size:?} {first}");
                let mut singles = vec![[f32::NAN; LANES]; frames];
                some.load_singles(first, count, &mut singles);
                let all_lanes = lanes(&some);
                assert!((0..frames).all(|t| (0..count).all(|l| f64::from(singles[t][l]) == all_lanes[t][l])));
                let expected = |t: usize, l: usize| {
                    let (v, [x, y, _]) = (first + l, size);
                    values[v % x + of[0] * (v / x % y + of[1] * (v / (x * y) + of[2] * t))]
                };
                assert!((0..frames).all(|t| (0..count).all(|l| lanes(&some)[t][l] == expected(t, l))));
            }
        }
    }
}
