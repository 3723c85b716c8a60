//! Keeps decoded samples on their side of a value: so the isosurface of the value has the same pieces, holes and cases of
//! marching cubes as that of the source.
//!
//! Let d be a decoded sample, s that of the source, and V the value. If d and s are on different sides of V (below, equal, above), d becomes
//! the sample nearest to d that is on the side of s. It lies between d and s, so no error grows. The coder needs a bit only for
//! samples with |d - V| at most the reach of the block. The chance of the bit depends on |d - V|, on the side of d, and on the sides of
//! the neighbours before it, which both coder and decoder know.

use super::WindowCodec;
use super::field::Field;
use super::load::Source;
use super::refine::Coded;
use super::shifts::{self, FrameRun, largest_shift, spacing};
use crate::base::sample::{self, SampleType};
use crate::base::vectors::dispatch;
use std::ops::Range;
use wavesplat_format::{BitDecoder, BitEncoder, Chance, Side, SideCodes, SideSet, SumCodes};

/// The samples on each side of a value that are nearest to it; none if the type has no such sample.
#[derive(Debug, Clone, Copy)]
struct Nearest([Option<f64>; 3]);

impl Nearest {
    /// Those of a value, without the declared missing value.
    fn new(ty: SampleType, value: f64, missing: Option<f64>) -> Self {
        let is_sample = |sample: &f64| !sample::is_missing(*sample, missing);
        let step = |up: bool| {
            let mut samples = std::iter::successors(sample::beside(ty, value, up), |s| sample::beside(ty, *s, up));
            samples.by_ref().take(2).find(is_sample)
        };
        let equal = Some(value).filter(|value| sample::round_to(ty, *value) == *value).filter(is_sample);
        Self([step(false), equal, step(true)])
    }

    fn on(&self, side: Side) -> Option<f64> {
        self.0[side as usize]
    }
}

/// The kept values of a file, and the samples nearest to them.
pub(super) struct SidesOf(Vec<(f64, Nearest)>);

impl SidesOf {
    /// Those of a codec.
    pub(super) fn new(codec: &WindowCodec) -> Self {
        let nearest = |value: &f64| (*value, Nearest::new(codec.sample, *value, codec.missing_value));
        Self(codec.sides.iter().map(nearest).collect())
    }

    /// Moves decoded samples to the sides of the source's.
    pub(super) fn place(&self, source: &[f64], decoded: &mut [f64]) {
        for (value, nearest) in &self.0 {
            for (sample, source) in decoded.iter_mut().zip(source) {
                let side = Side::of(*source, *value);
                if let Some(moved) = nearest.on(side).filter(|_| Side::of(*sample, *value) != side) {
                    *sample = moved;
                }
            }
        }
    }
}

/// The samples of a block, and a kept value: samples stay below, at or above it.
pub(super) struct Walk<'a> {
    ty: SampleType,
    /// Voxels along x, y, z.
    size: [usize; 3],
    value: f64,
    nearest: Nearest,
    fixed: Fixed<'a>,
}

/// The samples that are stored exactly, or missing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed<'a> {
    /// The indices of those stored exactly, ascending.
    pub(super) exact: &'a [u32],
    /// Whether each is missing; empty if none is.
    pub(super) missing: &'a [bool],
}

impl Fixed<'_> {
    /// Whether a sample is one of them. Indices ascend from call to call.
    fn has(&mut self, index: usize) -> bool {
        let passed = self.exact.iter().take_while(|exact| (**exact as usize) < index).count();
        self.exact = &self.exact[passed..];
        self.exact.first().is_some_and(|exact| *exact as usize == index) || self.missing.get(index) == Some(&true)
    }
}

/// What the chance of a change depends on.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// The side of the decoded sample.
    side: Side,
    /// Its distance from the value, in [`DISTANCES`] steps of the reach that become longer.
    distance: usize,
    /// How many of the samples before it along x, y, z, t are above the value.
    above: usize,
}

/// What may become of a decoded sample.
#[derive(Debug, Clone, Copy)]
struct Choice {
    /// Whether samples of the source are on its side.
    may_stay: bool,
    /// The other sides that samples of the source have.
    first: Side,
    second: Option<Side>,
}

impl Choice {
    /// That of a sample on a side; none if it can only stay.
    fn new(sides: SideSet, side: Side) -> Option<Self> {
        let mut others = sides.without(side);
        Some(Self { may_stay: sides.has(side), first: others.next()?, second: others.next() })
    }
}

/// The chances of all bits.
struct Chances {
    /// Whether the side changes.
    changes: Vec<Chance>,
    /// Whether it becomes the second of the two others.
    second: [Chance; 3],
}

impl Chances {
    fn new() -> Self {
        Self { changes: vec![Chance::EVEN; 3 * DISTANCES * NEIGHBOURS], second: [Chance::EVEN; 3] }
    }

    fn of_change(&mut self, place: Place) -> &mut Chance {
        &mut self.changes[(place.side as usize * DISTANCES + place.distance) * NEIGHBOURS + place.above]
    }
}

/// The step of a distance, relative to the reach; not a number if both are 0.
fn step_of(distance: f64) -> usize {
    ((distance.sqrt() * DISTANCES as f64) as usize).min(DISTANCES - 1)
}

/// Steps of the distance from a value.
const DISTANCES: usize = 16;

/// Counts of neighbours above a value: 0 to 4.
const NEIGHBOURS: usize = 5;

impl<'a> Walk<'a> {
    /// The samples of a block of `size` voxels.
    pub(super) fn new(codec: &WindowCodec, size: [usize; 3], value: f64, fixed: Fixed<'a>) -> Self {
        let nearest = Nearest::new(codec.sample, value, codec.missing_value);
        Self { ty: codec.sample, size, value, nearest, fixed }
    }

    /// Moves each decoded sample of `samples` to its side. Returns how many changed.
    pub(super) fn apply(&self, codes: &SideCodes, samples: &mut [u8]) -> u64 {
        let (mut bits, mut chances) = (BitDecoder::new(&codes.bits), Chances::new());
        self.visit(codes.sides, codes.reach, samples, |_, place, choice| {
            let stays = choice.may_stay && !bits.take(chances.of_change(place));
            match choice.second {
                _ if stays => place.side,
                Some(second) if bits.take(&mut chances.second[place.side as usize]) => second,
                _ => choice.first,
            }
        })
    }

    /// The codes that move decoded samples to the sides of `source`, if any changes; moves them. The second number says how many.
    pub(super) fn code(&self, source: &[u8], samples: &mut [u8]) -> Option<(SideCodes, u64)> {
        let (sides, reach) = self.survey(source, samples)?;
        let (mut bits, mut chances) = (BitEncoder::default(), Chances::new());
        let count = self.visit(sides, reach, samples, |index, place, choice| {
            let side = Side::of(self.load(source, index), self.value);
            if choice.may_stay {
                bits.put(chances.of_change(place), side != place.side);
            }
            if let Some(second) = choice.second.filter(|_| side != place.side) {
                bits.put(&mut chances.second[place.side as usize], side == second);
            }
            side
        });
        Some((SideCodes { sides, reach, bits: bits.finish() }, count))
    }

    /// The sides of the source's samples, and the largest distance from the value of a decoded sample on another side; none if there is none.
    fn survey(&self, source: &[u8], samples: &[u8]) -> Option<(SideSet, f64)> {
        let (mut sides, mut reach, mut fixed) = (SideSet::default(), None::<f64>, self.fixed);
        let (row, each) = (self.size[0], self.size[0] * self.ty.size());
        let (mut of_source, mut of_decoded) = (vec![0.0; row], vec![0.0; row]);
        let rows = source.chunks_exact(each).zip(samples.chunks_exact(each));
        for (first, (source, decoded)) in (0..).step_by(row).zip(rows) {
            sample::load(self.ty, source, &mut of_source);
            sample::load(self.ty, decoded, &mut of_decoded);
            if let Some(missing) = self.fixed.missing.get(first..first + row) {
                let lost = of_source.iter_mut().zip(missing).filter(|(_, is_missing)| **is_missing);
                lost.for_each(|(sample, _)| *sample = f64::NAN); // on no side
            }
            let found = dispatch!(compare_row(self.value, &of_source, &of_decoded));
            Side::ALL.into_iter().zip(found.sides).filter(|(_, has)| *has).for_each(|(side, _)| sides.insert(side));
            if found.differ {
                let changed = (first..).zip(&of_decoded).zip(&of_source).filter(|((at, decoded), source)| {
                    Side::of(**source, self.value) != Side::of(**decoded, self.value) && !fixed.has(*at)
                });
                let distances = changed.map(|((_, decoded), _)| (decoded - self.value).abs());
                reach = distances.fold(reach, |reach, distance| Some(distance.max(reach.unwrap_or(0.0))));
            }
        }
        Some((sides, reach?))
    }

    /// Visits the decoded samples that may change their side, in their order, and moves them to the side that `choose` returns for them.
    fn visit(
        &self,
        sides: SideSet,
        reach: f64,
        samples: &mut [u8],
        mut choose: impl FnMut(usize, Place, Choice) -> Side,
    ) -> u64 {
        let (row, size, mut fixed) = (self.size[0], self.ty.size(), self.fixed);
        let choices = Side::ALL.map(|side| Choice::new(sides, side));
        let (mut values, mut scratch, mut above, mut changed) = (vec![0.0; row], vec![0.0; row], vec![0; row], 0);
        for (number, first) in (0..samples.len() / size).step_by(row).enumerate() {
            sample::load(self.ty, &samples[first * size..][..row * size], &mut values);
            if !dispatch!(is_any_near(self.value, reach, &values)) {
                continue;
            }
            let mut is_counted = false;
            for x in 0..row {
                let (index, distance, side) =
                    (first + x, (values[x] - self.value).abs(), Side::of(values[x], self.value));
                let is_candidate = distance <= reach; // not NaN
                let Some(choice) = choices[side as usize].filter(|_| is_candidate && !fixed.has(index)) else {
                    continue;
                };
                if !is_counted {
                    self.count_above(number, samples, &mut scratch, &mut above);
                    is_counted = true;
                }
                let along_x = x > 0 && values[x - 1] > self.value;
                let place = Place {
                    side,
                    distance: step_of(distance / reach),
                    above: usize::from(above[x]) + usize::from(along_x),
                };
                let to = choose(index, place, choice);
                if let Some(nearest) = self.nearest.on(to).filter(|_| to != side) {
                    values[x] = nearest;
                    sample::store(self.ty, &[nearest], &mut samples[index * size..][..size]);
                    changed += 1;
                }
            }
        }
        changed
    }

    /// Counts the samples above the value before those of a row, along y, z and t.
    fn count_above(&self, number: usize, samples: &[u8], scratch: &mut [f64], above: &mut [u8]) {
        let ([row, y, z], size) = (self.size, self.ty.size());
        above.fill(0);
        for (rows, exists) in
            [(1, !number.is_multiple_of(y)), (y, !(number / y).is_multiple_of(z)), (y * z, number >= y * z)]
        {
            if exists {
                sample::load(self.ty, &samples[(number - rows) * row * size..][..row * size], scratch);
                dispatch!(add_above(self.value, &*scratch, &mut *above));
            }
        }
    }

    fn load(&self, samples: &[u8], index: usize) -> f64 {
        let mut value = 0.0;
        sample::load(self.ty, &samples[index * self.ty.size()..][..self.ty.size()], std::slice::from_mut(&mut value));
        value
    }
}

#[inline(always)]
fn add_above(value: f64, samples: &[f64], counts: &mut [u8]) {
    for (count, sample) in counts.iter_mut().zip(samples) {
        *count += u8::from(*sample > value);
    }
}

/// What a row of samples shows.
struct RowSides {
    /// Whether samples of the source are below, equal to and above a value.
    sides: [bool; 3],
    /// Whether a decoded sample is on another side.
    differ: bool,
}

#[inline(always)]
fn compare_row(value: f64, source: &[f64], decoded: &[f64]) -> RowSides {
    let (mut below, mut equal, mut above, mut differ) = (false, false, false, false);
    for (s, d) in source.iter().zip(decoded) {
        below |= *s < value;
        equal |= *s == value;
        above |= *s > value;
        differ |= ((*s < value) ^ (*d < value)) | ((*s > value) ^ (*d > value));
    }
    RowSides { sides: [below, equal, above], differ }
}

/// Whether a number is within a distance of a value.
#[inline(always)]
fn is_any_near(value: f64, distance: f64, numbers: &[f64]) -> bool {
    let mut any = false;
    for number in numbers {
        any |= (number - value).abs() <= distance;
    }
    any
}

/// The codes of a block for each kept value, and what they change.
pub(super) struct CodedSides {
    pub(super) codes: Vec<SideCodes>,
    /// The number of samples that change their side.
    pub(super) count: u64,
    /// The range of what they become.
    pub(super) range: (f64, f64),
}

impl Source<'_> {
    /// Codes how decoded samples get to their sides; none if all are there. `field` has the block's decoded coefficients, and `sums` what
    /// keeps the sums of its frames.
    pub(super) fn sides(&self, coded: &Coded, field: &Field<'_>, sums: Option<&SumCodes>) -> Option<CodedSides> {
        let (codec, source, outliers) = (self.codec, self.samples.contiguous(), &coded.outliers);
        // A sample that changes is as near to the value as to its source. So its source is within twice that. All others stay on their
        // sides, so the source stands for them.
        let reached = coded.tally.reached;
        let reached = sums.map_or(reached, |sums| {
            let shifted = reached + largest_shift(codec.sample, sums, self.voxels());
            shifted + spacing(codec.sample, self.missing.magnitude + shifted)
        });
        let near = self.near(&source, 2.0 * reached);
        if near.is_empty() {
            return None;
        }
        let (mut samples, size, voxels) = (source.to_vec(), codec.sample.size(), self.voxels());
        self.for_each_run(field, near.into_iter(), |first, values| {
            let bytes = &mut samples[first * size..][..values.len() * size];
            shifts::store(codec, sums, FrameRun::of(first, voxels), values, bytes);
        });
        let missing = if self.missing.count > 0 { self.missing.mask() } else { &[] };
        let are_missing = missing.iter().enumerate().filter(|(_, is_missing)| **is_missing).map(|(index, _)| index);
        let restored = outliers.positions.iter().map(|position| *position as usize).chain(are_missing);
        restored.for_each(|index| samples[index * size..][..size].copy_from_slice(&source[index * size..][..size]));
        let mut coded = CodedSides { codes: Vec::new(), count: 0, range: (f64::INFINITY, f64::NEG_INFINITY) };
        for value in codec.sides.iter() {
            let fixed = Fixed { exact: &outliers.positions, missing };
            let walk = Walk::new(codec, self.samples.size(), *value, fixed);
            let (codes, count) = walk.code(&source, &mut samples).unwrap_or_default();
            let of_sides = Side::ALL.into_iter().filter(|side| codes.sides.has(*side));
            let becomes = of_sides.filter_map(|side| walk.nearest.on(side)).map(|sample| (sample, sample));
            coded.range = becomes.fold(coded.range, sample::join_ranges);
            coded.count += count;
            coded.codes.push(codes);
        }
        (coded.count > 0).then_some(coded)
    }

    /// The runs of voxels in which a sample of any frame may be within `distance` of a kept value.
    fn near(&self, source: &[u8], distance: f64) -> Vec<Range<usize>> {
        let (codec, voxels) = (self.codec, self.voxels());
        let run = self.run();
        let (size, mut is_near) = (codec.sample.size(), vec![false; voxels.div_ceil(run)]);
        for frame in source.chunks_exact(voxels * size) {
            for (samples, is_near) in frame.chunks(run * size).zip(&mut is_near).filter(|(_, is_near)| !**is_near) {
                let (lo, hi) = sample::range_of_present(codec.sample, samples, codec.missing_value, |_| {});
                *is_near = codec.sides.iter().any(|value| lo - distance <= *value && *value <= hi + distance);
            }
        }
        let runs = is_near.into_iter().enumerate().filter(|(_, is_near)| *is_near);
        runs.map(|(at, _)| at * run..voxels.min((at + 1) * run)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [7, 5, 4];
    const FRAMES: usize = 6;

    /// Numbers between 0 and 1 that look random.
    fn random(seed: u32) -> impl FnMut() -> f64 {
        let mut state = seed | 1;
        move || {
            state = state.wrapping_mul(0x9E37_79B1).rotate_left(13) ^ 0x5bd1_e995;
            f64::from(state >> 8) / f64::from(1 << 24)
        }
    }

    fn stored(ty: SampleType, values: &[f64]) -> Vec<u8> {
        let mut bytes = vec![0; values.len() * ty.size()];
        sample::store(ty, values, &mut bytes);
        bytes
    }

    fn loaded(ty: SampleType, bytes: &[u8]) -> Vec<f64> {
        let mut values = vec![0.0; bytes.len() / ty.size()];
        sample::load(ty, bytes, &mut values);
        values
    }

    #[test]
    fn samples_get_to_the_sides_of_the_source_and_no_error_grows() {
        let types = [SampleType::F32, SampleType::F64, SampleType::F16, SampleType::I16, SampleType::U8];
        for (seed, ty) in (1..).zip(types.into_iter().cycle().take(60)) {
            let (mut next, count) = (random(seed), SIZE.iter().product::<usize>() * FRAMES);
            let scale = if ty.is_float() { 1.0 } else { 60.0 };
            // Values of interest: zeros, values that occur, and numbers between two samples.
            let low = if ty == SampleType::U8 { 7.25 } else { -0.25 * scale };
            let value = [0.0, 0.5 * scale, 0.3001 * scale, low][seed as usize % 4];
            let source: Vec<f64> = (0..count).map(|_| [value, next() * scale, 0.0][(3.0 * next()) as usize]).collect();
            let decoded: Vec<f64> = source.iter().map(|s| s + 0.3 * scale * (next() - 0.5)).collect();
            let (source, decoded) = (stored(ty, &source), stored(ty, &decoded));
            let missing = (ty == SampleType::I16).then_some(f64::from(value.floor() as i16 - 1));
            let is_missing = |samples: &[u8], index: usize| missing == Some(loaded(ty, samples)[index]);
            let is_fixed = |index| index % 11 == 3 || is_missing(&source, index) || is_missing(&decoded, index);
            let nearest = Nearest::new(ty, value, missing);
            let exact: Vec<u32> = (0..count as u32).filter(|index| is_fixed(*index as usize)).collect();
            let (exact, mask) = exact.split_at(exact.len() / 2); // some are missing, some stored exactly
            let missing_mask: Vec<bool> = (0..count).map(|index| mask.contains(&(index as u32))).collect();
            let walk = Walk { ty, size: SIZE, value, nearest, fixed: Fixed { exact, missing: &missing_mask } };
            let mut coded = decoded.clone();
            let Some((codes, changed)) = walk.code(&source, &mut coded) else { panic!("{ty}: noise changes sides") };
            let mut read = decoded.clone();
            assert_eq!(walk.apply(&codes, &mut read), changed);
            assert!(read == coded, "{ty}: other samples than the coder's");
            for (index, (s, d)) in loaded(ty, &source).into_iter().zip(loaded(ty, &decoded)).enumerate() {
                let now = loaded(ty, &read)[index];
                if is_fixed(index) {
                    assert_eq!(now, d);
                } else {
                    assert_eq!(Side::of(now, value), Side::of(s, value), "{ty}: {s} as {d}, now {now}");
                    assert!((now - s).abs() <= (d - s).abs(), "{ty}: {s} as {d}, now {now}");
                    assert!(missing != Some(now), "{ty}: {now} would be read as missing");
                }
            }
        }
    }

    #[test]
    fn samples_on_one_side_take_no_bits() {
        let (ty, value, mut next) = (SampleType::F32, 0.0, random(9));
        let count = SIZE.iter().product::<usize>() * FRAMES;
        let source: Vec<f64> = (0..count).map(|_| 1e-6 * next()).map(|v| v.max(1e-9)).collect();
        let decoded: Vec<f64> = source.iter().map(|v| v + 1e-3 * (next() - 0.5)).collect();
        let (source, mut decoded) = (stored(ty, &source), stored(ty, &decoded));
        let nearest = Nearest::new(ty, value, None);
        let walk = Walk { ty, size: SIZE, value, nearest, fixed: Fixed { exact: &[], missing: &[] } };
        let (codes, changed) = walk.code(&source, &mut decoded).expect("noise changes signs");
        assert!(codes.bits.is_empty() && changed > 100);
        assert!(loaded(ty, &decoded).iter().all(|sample| *sample > 0.0));
    }

    #[test]
    fn any_bits_and_samples_are_read() {
        let mut next = random(3);
        let count = SIZE.iter().product::<usize>() * FRAMES;
        let mut samples: Vec<u8> = (0..4 * count).map(|_| (256.0 * next()) as u8).collect(); // not only numbers
        let mut sides = SideSet::default();
        Side::ALL.into_iter().for_each(|side| sides.insert(side));
        let codes = SideCodes { sides, reach: f64::MAX, bits: (0..count).map(|_| (256.0 * next()) as u8).collect() };
        let nearest = Nearest::new(SampleType::F32, f64::MAX, None);
        let walk = Walk {
            ty: SampleType::F32,
            size: SIZE,
            value: f64::MAX,
            nearest,
            fixed: Fixed { exact: &[], missing: &[] },
        };
        walk.apply(&codes, &mut samples);
    }
}
