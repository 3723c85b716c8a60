//! Exact samples that have few values: a list of the values, and the places of the samples in it.
//!
//! Labels and counts take far fewer bytes this way than as numbers near each other.

use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure};
use crate::codes::max_packed;
use crate::codes::sparse::{CodeBox, DenseCodes, SparseCodes};
use crate::limits::MAX_LISTED;
use crate::planes::{pack_planes, unpack_planes};
use crate::pyramid::Packing;
use std::collections::HashMap;
use std::ops::Range;

/// Which sample predicts another's place in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Predictor {
    /// None: the same place is expected everywhere.
    Base,
    /// The voxel before it along x.
    X,
    /// The same voxel in the frame before.
    T,
}

impl Predictor {
    /// All, by the number in a file.
    const ALL: [Self; 3] = [Self::Base, Self::X, Self::T];
}

/// Samples that have few values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Voxels along x, y, z, and frames.
    extents: [usize; 4],
    /// Bytes of a sample.
    size: usize,
    /// The values, little-endian, ascending as unsigned integers.
    values: Vec<u8>,
    /// The place of each sample's value in the list: `frame * voxels + voxel`.
    places: Vec<u16>,
}

impl Listed {
    /// The samples of a box, little-endian, with `extents` along x, y, z, t, in runs one after another. None if they have more than
    /// `most` or [`MAX_LISTED`] values, or if there are none.
    pub fn new<'a>(
        runs: impl IntoIterator<Item = &'a [u8]>,
        size: usize,
        extents: [usize; 4],
        most: usize,
    ) -> Option<Self> {
        let (most, mut found) = (most.min(MAX_LISTED), HashMap::<u64, u16>::new());
        let mut recent = [None; RECENT];
        let mut places = Vec::with_capacity(extents.iter().product());
        for value in runs.into_iter().flat_map(|run| run.chunks_exact(size)).map(number) {
            let slot = &mut recent[(value.wrapping_mul(SPREADS) >> 54) as usize];
            let place = match *slot {
                Some((known, place)) if known == value => place,
                _ => {
                    let next = found.len();
                    *found.entry(value).or_insert(next as u16)
                }
            };
            if found.len() > most {
                return None;
            }
            *slot = Some((value, place));
            places.push(place);
        }
        let mut ascending: Vec<(u64, u16)> = found.into_iter().collect();
        ascending.sort_unstable();
        let mut places_of = vec![0; ascending.len()];
        ascending.iter().enumerate().for_each(|(place, (_, found))| places_of[usize::from(*found)] = place as u16);
        places.iter_mut().for_each(|place| *place = places_of[usize::from(*place)]);
        let values = ascending.iter().flat_map(|(value, _)| value.to_le_bytes().into_iter().take(size)).collect();
        (!places.is_empty()).then_some(Self { extents, size, values, places })
    }

    /// The place that most samples have; the first of them.
    fn base(&self) -> u16 {
        let mut counts = vec![0usize; self.values.len() / self.size];
        self.places.iter().for_each(|place| counts[usize::from(*place)] += 1);
        let most = counts.iter().max().copied().unwrap_or(0);
        counts.iter().position(|count| *count == most).unwrap_or(0) as u16
    }

    /// How far each sample's place is from the predicted one, in some frames.
    fn codes(&self, predictor: Predictor, base: u16, frames: Range<usize>, codes: &mut Vec<i32>) {
        let voxels: usize = self.extents[..3].iter().product();
        let of_frames = frames.start * voxels..frames.end * voxels;
        let (base, places) =
            (i32::from(base), |at: Range<usize>| self.places[at].iter().map(|place| i32::from(*place)));
        codes.clear();
        match predictor {
            Predictor::Base => codes.extend(places(of_frames).map(|place| place - base)),
            Predictor::X => {
                for row in self.places[of_frames].chunks(self.extents[0]) {
                    codes.push(i32::from(row[0]) - base);
                    codes.extend(row.windows(2).map(|pair| i32::from(pair[1]) - i32::from(pair[0])));
                }
            }
            Predictor::T => {
                let first = of_frames.start.max(voxels);
                codes.extend(places(of_frames.start..first).map(|place| place - base)); // the first frame of all
                let before = places(first - voxels..of_frames.end - voxels);
                codes.extend(places(first..of_frames.end).zip(before).map(|(place, before)| place - before));
            }
        }
    }

    /// The predictor that makes the codes of some frames smallest.
    fn best(&self, base: u16, codes: &mut Vec<i32>) -> Predictor {
        let [x, y, z, frames] = self.extents;
        let rest = frames - 1;
        let some = rest.div_ceil(FRAMES_PER_COMPARED).max(FEW_SAMPLES.div_ceil(x * y * z)).min(rest);
        let first = 1 + (rest - some) / 2;
        let mut bytes = |predictor, frames| {
            self.codes(predictor, base, frames, codes);
            Packing::Nested.estimate(&self.boxes(codes))
        };
        let estimated = |predictor: &Predictor| {
            let of_rest = if rest > 0 { bytes(*predictor, first..first + some) * rest / some } else { 0 };
            bytes(*predictor, 0..1) + of_rest
        };
        Predictor::ALL.into_iter().min_by_key(estimated).unwrap_or(Predictor::Base)
    }

    /// The codes of all frames by the best predictor.
    fn best_codes(&self, base: u16, codes: &mut Vec<i32>) -> Predictor {
        let predictor = self.best(base, codes);
        self.codes(predictor, base, 0..self.extents[3], codes);
        predictor
    }

    /// About how many bytes the payload takes. `codes` is scratch.
    pub fn estimate(&self, codes: &mut Vec<i32>) -> usize {
        self.best_codes(self.base(), codes);
        FIELDS + self.values.len() + Packing::Nested.estimate(&self.boxes(codes))
    }

    /// Appends the payload with the predictor that makes some frames smallest. `codes` is scratch.
    pub fn pack(&self, codes: &mut Vec<i32>, out: &mut Vec<u8>) {
        let base = self.base();
        let predictor = self.best_codes(base, codes);
        out.put_u32((self.values.len() / self.size) as u32);
        out.put_u16(base);
        out.put_u16(predictor as u16);
        pack_planes(&self.values, self.size, out);
        Packing::Nested.pack(&self.boxes(codes), out);
    }

    /// The box of the codes of some frames.
    fn boxes<'a>(&self, codes: &'a [i32]) -> Vec<DenseCodes<'a>> {
        let [x, y, z, _] = self.extents;
        DenseCodes::one_after_another(codes, &[CodeBox::contiguous([x, y, z, codes.len() / (x * y * z)])])
    }
}

/// Unpacks the little-endian bytes of all samples of a box, `size` bytes each.
///
/// # Errors
/// The reason if `raw` is not what [`Listed::pack`] writes.
pub fn unpack_listed(raw: &[u8], size: usize, extents: [usize; 4]) -> Result<Vec<u8>, String> {
    let mut fields = FieldReader::new(raw);
    let (count, base, predictor) = (fields.u32()? as usize, fields.u16()?, fields.u16()?);
    let predictor = Predictor::ALL.get(usize::from(predictor)).ok_or("no such predictor of listed values")?;
    let rest = &raw[FIELDS..];
    ensure(count <= MAX_LISTED && count * size <= rest.len(), || format!("a list of {count} values"))?;
    ensure(usize::from(base) < count, || format!("place {base} in a list of {count} values"))?;
    let (planes, packed) = rest.split_at(count * size);
    let values = unpack_planes(planes, size);
    let ascend = values.chunks_exact(size).is_sorted_by(|a, b| number(a) < number(b));
    ensure(ascend, || "listed values that do not ascend".into())?;
    let mut codes = SparseCodes::default();
    Packing::Nested.unpack(packed, &[CodeBox::contiguous(extents)], &mut codes)?;
    let list = List { values: &values, size, base, predictor: *predictor };
    list.samples(&codes, extents)
}

/// A list of values, and how samples are predicted.
struct List<'a> {
    values: &'a [u8],
    size: usize,
    base: u16,
    predictor: Predictor,
}

impl List<'_> {
    fn samples(&self, codes: &SparseCodes, extents: [usize; 4]) -> ParseResult<Vec<u8>> {
        let (voxels, base) = (extents[..3].iter().product::<usize>(), i32::from(self.base));
        let (mut places, mut samples) = (vec![base; voxels], Vec::with_capacity(voxels * extents[3] * self.size));
        for frame in 0..extents[3] {
            if self.predictor != Predictor::T {
                places.fill(if self.predictor == Predictor::X { 0 } else { base });
            }
            let (at, changes) = codes.run(frame);
            at.iter().zip(changes).for_each(|(at, change)| {
                let place = &mut places[*at as usize];
                *place = place.wrapping_add(*change);
            });
            if self.predictor == Predictor::X {
                places.chunks_mut(extents[0]).for_each(|row| sum_up(base, row));
            }
            self.look_up(&places, &mut samples)?;
        }
        Ok(samples)
    }

    /// Appends the values at some places.
    fn look_up(&self, places: &[i32], samples: &mut Vec<u8>) -> ParseResult {
        let count = self.values.len() / self.size;
        let is_listed = places.iter().all(|place| (*place as u32 as usize) < count);
        ensure(is_listed, || format!("a place outside a list of {count} values"))?;
        match self.size {
            1 => samples.extend(places.iter().map(|place| self.values[*place as usize])),
            2 => self.look_up_each::<2>(places, samples),
            4 => self.look_up_each::<4>(places, samples),
            _ => self.look_up_each::<8>(places, samples),
        }
        Ok(())
    }

    fn look_up_each<const SIZE: usize>(&self, places: &[i32], samples: &mut Vec<u8>) {
        let values = self.values.as_chunks::<SIZE>().0;
        places.iter().for_each(|place| samples.extend_from_slice(&values[*place as usize]));
    }
}

/// Replaces changes along a row by places.
fn sum_up(base: i32, row: &mut [i32]) {
    let mut place = base;
    for change in row {
        place = place.wrapping_add(*change);
        *change = place;
    }
}

/// The largest number of bytes that [`Listed::pack`] appends.
pub(crate) fn max_listed(size: usize, extents: [usize; 4]) -> usize {
    let samples = extents.iter().fold(1, |product: usize, extent| product.saturating_mul(*extent));
    FIELDS + samples.min(MAX_LISTED) * size + max_packed(&[CodeBox::contiguous(extents)])
}

/// Bytes of the fields before the values.
const FIELDS: usize = 8;

/// Predictors are compared in the first frame and in one of so many others, but in at least [`FEW_SAMPLES`] if there are so many.
const FRAMES_PER_COMPARED: usize = 8;
const FEW_SAMPLES: usize = 1 << 16;

/// Slots for values that were found lately, because a hash map is slow; and a factor that spreads values over them.
const RECENT: usize = 1 << 10;
const SPREADS: u64 = 0x9E37_79B9_7F4A_7C15;

/// A sample's bytes as an unsigned integer.
fn number(sample: &[u8]) -> u64 {
    sample.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(listed: &Listed) -> Vec<u8> {
        let (mut codes, mut out) = (Vec::new(), Vec::new());
        listed.pack(&mut codes, &mut out);
        out
    }

    #[test]
    fn values_have_the_documented_bytes() {
        let listed = Listed::new([&[7, 7, 9, 7][..]], 1, [2, 1, 1, 2], MAX_LISTED).expect("two values");
        let head = [2, 0, 0, 0, 0, 0, 0, 0, 7, 9];
        let cells = [2, 0, 0, 0, 0, 1, 0, 0, 0, 0x18, 0, 1, 1];
        assert_eq!(packed(&listed), [&head[..], &cells].concat());
    }

    #[test]
    fn many_values_are_not_listed() {
        let all: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect();
        let extents = [256, 16, 16, 1];
        let listed = Listed::new([&all[..]], 2, extents, MAX_LISTED).expect("all values of 16 bits");
        assert_eq!(unpack_listed(&packed(&listed), 2, extents).expect("packed"), all);
        let more: Vec<u8> = (0..=u32::from(u16::MAX) + 1).flat_map(u32::to_le_bytes).collect();
        assert_eq!(Listed::new([&more[..]], 4, [65537, 1, 1, 1], usize::MAX), None);
        assert_eq!(Listed::new([&[7, 7, 9, 7][..]], 1, [2, 1, 1, 2], 1), None);
    }

    #[test]
    fn hostile_lists_are_refused() {
        let good = packed(&Listed::new([&[7, 7, 9, 7][..]], 1, [2, 1, 1, 2], MAX_LISTED).expect("two values"));
        let change = |at: usize, byte: u8| {
            let mut raw = good.clone();
            raw[at] = byte;
            unpack_listed(&raw, 1, [2, 1, 1, 2])
        };
        assert_eq!(change(0, 2).expect("the same"), [7, 7, 9, 7]);
        for (at, byte) in [(0, 0), (0, 1), (0, 3), (3, 1), (4, 2), (6, 3), (7, 1), (8, 9), (9, 7), (22, 0), (22, 9)] {
            assert!(change(at, byte).is_err(), "byte {at} is {byte}");
        }
        for len in 0..good.len() {
            assert!(unpack_listed(&good[..len], 1, [2, 1, 1, 2]).is_err(), "{len} bytes");
        }
        assert!(unpack_listed(&[&good[..], &[0]].concat(), 1, [2, 1, 1, 2]).is_err());
    }

    proptest! {
        #[test]
        fn samples_round_trip(
            extents in [1usize..9, 1usize..5, 1usize..4, 1usize..6],
            size in prop::sample::select(vec![1usize, 2, 4, 8]),
            values in prop::collection::vec(any::<u64>(), 1..40),
            run in 1usize..7,
            seed: u64,
        ) {
            let total = extents.iter().product::<usize>() as u64;
            let value = |i: u64| values[((i / run as u64).wrapping_mul(seed) >> 7) as usize % values.len()];
            let samples: Vec<u8> = (0..total).flat_map(|i| value(i).to_le_bytes().into_iter().take(size)).collect();
            let listed = Listed::new(samples.chunks(size * run), size, extents, MAX_LISTED).expect("few values");
            let raw = packed(&listed);
            prop_assert!(raw.len() <= max_listed(size, extents));
            prop_assert_eq!(&unpack_listed(&raw, size, extents).expect("packed"), &samples);
            let mut codes = Vec::new();
            for predictor in Predictor::ALL {
                listed.codes(predictor, listed.base(), 0..extents[3], &mut codes);
                let sparse = {
                    let (mut raw, mut sparse) = (Vec::new(), SparseCodes::default());
                    Packing::Nested.pack(&listed.boxes(&codes), &mut raw);
                    Packing::Nested.unpack(&raw, &[CodeBox::contiguous(extents)], &mut sparse).expect("packed");
                    sparse
                };
                let list = List { values: &listed.values, size, base: listed.base(), predictor };
                prop_assert_eq!(&list.samples(&sparse, extents).expect("listed"), &samples);
            }
        }
    }
}
