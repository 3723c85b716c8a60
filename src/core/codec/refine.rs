//! Encodes a block by a pyramid: transforms samples to coefficients (eq 5), runs the passes (eq 32), and compares the
//! result with the source.
//!
//! The step is that of eq 25 times the scheme's coarseness, less a margin for rounding in 32-bit floats. With a
//! coarseness above 1, rounding alone may miss the bound; samples that miss it are stored exactly.

use super::buffer::{Buffer, clear};
use super::check::{Compared, Tally};
use super::error_weights::QuantizerSetup;
use super::field::Used;
use super::forward::forward;
use super::group::Group;
use super::lane_groups;
use super::load::{Source, load_group};
use super::pyramid::Nodes;
use super::real::Real;
use super::rows::count_nonzero;
use super::screen::{self, Screen};
use crate::base::sample;
use crate::base::vectors::dispatch;
use crate::codec::bound::Measure;
use crate::wavelet::LANES;
use wavesplat_format::{Basis, Outliers, PartStats, Pyramid};

/// The result of coding the series of a block.
pub(super) struct Coded {
    pub(super) step: f64,
    /// With a pyramid, whether each k may have nodes that are not zero.
    pub(super) marked: Vec<bool>,
    /// With a pyramid, or if there are no codes: for each level part the number of its codes, and the change from leaving out it and all
    /// finer ones.
    pub(super) parts: Option<Vec<PartStats>>,
    pub(super) dropped: f64,
    pub(super) outliers: Outliers,
    pub(super) tally: Tally,
}

/// How the field that codes give compares with the source.
struct Checked {
    /// Whether each k of the field may have nodes that are not zero.
    marked: Vec<bool>,
    /// None if too many samples miss the bound.
    tally: Option<Tally>,
}

impl Checked {
    /// An estimate of the bytes of `codes` and outliers, in those of a code.
    fn cost(&self, codes: &[i32]) -> usize {
        let outliers = self.tally.as_ref().map_or(usize::MAX, |tally| tally.outliers.len());
        count(codes).saturating_add(outliers.saturating_mul(CODES_PER_OUTLIER))
    }

    /// Whether outliers are more than a few of the block's samples, and take a large share of the bytes beside `codes`.
    fn has_many_outliers(&self, samples: usize, codes: &[i32]) -> bool {
        self.tally.as_ref().is_none_or(|tally| {
            let outliers = tally.outliers.len();
            outliers > samples / FEW_OUTLIERS && outliers * CODES_PER_OUTLIER > count(codes)
        })
    }
}

/// The number of codes that are not zero.
fn count(codes: &[i32]) -> usize {
    dispatch!(count_nonzero(codes))
}

impl Source<'_> {
    /// Encodes the block, which covers `size` voxels, by a pyramid, from the samples of `outer`, which also has nodes that only
    /// predict, and the known nodes. Leaves the decoded nodes in `field`, and their codes in `codes`. None if the block must be stored
    /// exactly, or, above tier 0, without codes.
    ///
    /// The scheme's step suits most blocks. Where so many samples miss the bound that storing them exactly takes a large
    /// share of the bytes, finer steps are tried. Samples of blocks above tier 0 are stored with the blocks below.
    pub(super) fn refine<R: Real>(
        &self,
        pyramid: &Pyramid,
        size: [usize; 3],
        outer: &Source<'_>,
        known: Option<Nodes<'_, R>>,
        field: &mut Buffer<R>,
        codes: &mut Buffer<i32>,
    ) -> Option<Coded> {
        let weighing = QuantizerSetup::new(self.codec, &self.samples, self.missing.magnitude)?;
        let passes = self.codec.passes(pyramid, size);
        codes.renew(passes.codes());
        let outer_nodes = self.codec.basis.coefficients() * outer.voxels();
        field.renew(outer_nodes.max(passes.nodes().iter().product()));
        if let Some(zero) = self.zero(&weighing, field) {
            return Some(zero);
        }
        let mut step = self.step::<R>(pyramid, &weighing)?;
        let singles = outer.samples.singles().filter(|_| outer.plain() && outer.missing.count == 0);
        // Coding overwrites the source's nodes, which lie in the field. So each try loads them.
        let encode = |step, field: &mut [R], codes: &mut [i32]| {
            let size = outer.samples.size();
            let fits = match singles {
                Some(values) => passes.encode(step, Nodes { values, size, marked: None }, known, field, codes),
                None => {
                    let largest = outer.load(&weighing, &mut field[..outer_nodes]);
                    let marked = passes.may_have_codes(step, &largest);
                    passes.encode_in_place(step, size, &marked, known, field, codes)
                }
            };
            fits.then_some(())
        };
        encode(step, field, codes)?;
        let check = |field: &[R], codes: &[i32]| {
            let marked = passes.marked_codes(codes, known);
            let tally = self.compared(&weighing, field, &marked);
            Checked { marked, tally }
        };
        let mut checked = check(field, codes);
        let finest = step / self.codec.scheme.coarseness.max(1.0);
        while checked.has_many_outliers(self.missing.all, codes) && step > finest {
            let (finer, cost) = ((step / FINER).max(finest), checked.cost(codes));
            let found = encode(finer, field, codes).map(|()| check(field, codes));
            let is_worse = |found: &Checked| found.tally.is_some() && found.cost(codes) > cost;
            match found {
                Some(found) if !is_worse(&found) => (step, checked) = (finer, found),
                _ => {
                    encode(step, field, codes)?; // finer steps leave the errors of known nodes
                    break;
                }
            }
        }
        let Checked { marked, tally } = checked;
        let mut tally = tally?;
        let outliers = tally.take_outliers(&self.samples);
        field.shorten(passes.nodes().iter().product());
        let (listed, counts) = passes.list_coarse(codes);
        let changes = passes.changes(&counts, step, &listed, known, passes.field(field, &marked));
        let count = |part: usize| counts.iter().map(|counts| counts[part]).sum();
        let parts = Some(changes.iter().enumerate().map(|(part, change)| change.stats(count(part))).collect());
        Some(Coded { step, marked, parts, dropped: tally.squared_error, outliers, tally })
    }

    /// The block decoded to zeros, in place of its own nodes and those above, if that is within its bound.
    fn zero<R: Real>(&self, weighing: &QuantizerSetup, field: &mut [R]) -> Option<Coded> {
        let by_sample = self.zero_by_sample();
        if by_sample.is_some() || !self.is_small() {
            return by_sample;
        }
        field.fill(R::default());
        let tally = self.compared(weighing, field, &vec![false; self.codec.basis.coefficients()])?;
        tally.outliers.is_empty().then(|| self.zeros(tally))
    }

    /// The block decoded to zeros, if the bound is one of single samples, and they are within it.
    pub(super) fn zero_by_sample(&self) -> Option<Coded> {
        let by_sample = self.codec.bound.measure() == Measure::Largest && !self.codec.is_missing(0.0);
        let applies = by_sample && self.is_small();
        applies.then(|| self.zeros(Tally::of_zeros(self.codec, &self.samples, self.missing)))
    }

    /// Whether the largest sample of a block of tier 0 is within the bound of zero.
    fn is_small(&self) -> bool {
        let magnitude = self.missing.magnitude;
        self.codec.tier == 0 && magnitude <= self.codec.bound.allowed(magnitude)
    }

    /// The block without codes.
    fn zeros(&self, tally: Tally) -> Coded {
        let parts = Some(vec![PartStats { count: 0, energy: 0.0, largest: 0.0 }; self.codec.parts()]);
        let (dropped, outliers) = (tally.squared_error, Outliers::default());
        Coded { step: 0.0, marked: Vec::new(), parts, dropped, outliers, tally }
    }

    /// Compares a field with the source; it is zero for each k that is not marked. None if too many samples miss the bound.
    fn compared<R: Real>(&self, weighing: &QuantizerSetup, field: &[R], marked: &[bool]) -> Option<Tally> {
        match self.plain() {
            _ if self.codec.tier > 0 => Some(Tally::new()), // its samples are stored with the blocks below
            true if !Screen::applies::<R>(self) => self.check_samples(field),
            _ => self.check_series(weighing, field, marked),
        }
    }

    /// The step of the finest level. None if the block must be stored exactly.
    pub(super) fn step<R: Real>(&self, pyramid: &Pyramid, weighing: &QuantizerSetup) -> Option<f64> {
        let rounding = if pyramid.single { self.missing.magnitude * SINGLE_ROUNDING } else { 0.0 };
        let step = weighing.step * self.codec.scheme.coarseness - rounding;
        (step.is_normal() && step >= 0.0 && self.missing.magnitude <= R::LARGEST).then_some(step)
    }

    /// Whether the pyramid codes samples directly, and the bound applies to each sample by itself.
    fn plain(&self) -> bool {
        self.codec.scheme.basis == Basis::Samples && self.codec.bound.measure() == Measure::Largest
    }

    /// Loads the nodes that the pyramid refines, `[k][voxel]`. Returns an upper bound of the magnitudes of each k; infinite if none is
    /// known.
    pub(super) fn load<R: Real>(&self, weighing: &QuantizerSetup, nodes: &mut [R]) -> Vec<R> {
        match self.codec.basis.rows().filter(|_| self.missing.count == 0) {
            _ if self.plain() => self.load_samples(nodes),
            Some(rows) => return forward(rows, self.codec.sample, &self.samples.contiguous(), nodes),
            None => self.load_series(weighing, nodes),
        }
        vec![R::from_f64(f64::INFINITY); self.codec.basis.coefficients()]
    }

    /// Loads the samples as nodes; missing samples become NaN.
    fn load_samples<R: Real>(&self, field: &mut [R]) {
        sample::load_as(self.codec.sample, &self.samples.contiguous(), field, R::from_f64);
        if self.missing.count > 0 {
            let missing = field.iter_mut().zip(self.missing.mask()).filter(|(_, missing)| **missing);
            missing.for_each(|(node, _)| *node = R::from_f64(f64::NAN));
        }
    }

    /// Loads the coefficients of all series.
    fn load_series<R: Real>(&self, weighing: &QuantizerSetup, field: &mut [R]) {
        let (codec, voxels) = (self.codec, self.voxels());
        let mut group = Group::new(codec);
        for (first, count) in lane_groups(voxels) {
            load_group(codec, weighing, &self.samples, self.missing, first, count, &mut group);
            codec.basis.forward(&group.source, &mut group.coefficients);
            for (k, lane) in group.coefficients.iter().enumerate() {
                let nodes = &mut field[k * voxels + first..][..count];
                match nodes.first_chunk_mut::<LANES>() {
                    Some(nodes) => *nodes = lane.map(R::from_f64),
                    None => nodes.iter_mut().zip(lane).for_each(|(node, c)| *node = R::from_f64(*c)),
                }
            }
        }
    }

    /// Compares samples with the field, each by itself. None if too many miss the bound.
    fn check_samples<R: Real>(&self, field: &[R]) -> Option<Tally> {
        let (mut tally, mut decoded) = (Tally::new(), Vec::new());
        self.samples.for_each_run(|first, values| {
            if !self.outliers_affordable(tally.outliers.len()) {
                return;
            }
            clear(&mut decoded).extend(field[first..][..values.len()].iter().map(|node| node.to_f64()));
            let (source, last_source) = values.as_chunks::<LANES>();
            let (whole, last_whole) = decoded.as_chunks::<LANES>();
            let last = |values: &[f64]| [std::array::from_fn(|l| values.get(l).copied().unwrap_or(0.0))];
            let sample_index = |first: usize| move |t: usize, l: usize| self.sample_index(first + t * LANES + l);
            let present = self.missing.count == 0;
            tally.add_series(self.codec, &Compared { source, decoded: whole }, LANES, present, sample_index(first));
            if !last_source.is_empty() {
                let first = first + values.len() - last_source.len();
                let (source, decoded) = (&last(last_source), &last(last_whole));
                tally.add_series(
                    self.codec,
                    &Compared { source, decoded },
                    last_source.len(),
                    present,
                    sample_index(first),
                );
            }
        });
        self.outliers_affordable(tally.outliers.len()).then_some(tally)
    }

    /// Compares series with the decoded field. None if too many samples miss the bound.
    fn check_series<R: Real>(&self, weighing: &QuantizerSetup, field: &[R], marked: &[bool]) -> Option<Tally> {
        let used = Used::new(self.codec.basis.as_ref(), marked);
        let mut screen = Screen::new(self, field, &used);
        let (mut tally, mut group) = (Tally::new(), Group::new(self.codec));
        for first in (0..self.voxels()).step_by(screen::RUN) {
            let run = screen::RUN.min(self.voxels() - first);
            screen.iter_mut().for_each(|screen| screen.compare(first, run));
            for (at, count) in lane_groups(run) {
                let ranges = screen.as_ref().map(|screen| screen.ranges(at, count));
                if ranges.is_some_and(|ranges| tally.add_within(&ranges, self.codec.missing_value)) {
                    continue;
                }
                self.decode_group(weighing, field, &used, first + at, count, &mut group);
                self.check(&group, first + at, count, &mut tally)?;
            }
        }
        Some(tally)
    }

    /// Loads a group of series, and decodes the field for them.
    fn decode_group<R: Real>(
        &self,
        weighing: &QuantizerSetup,
        field: &[R],
        used: &Used,
        first: usize,
        count: usize,
        group: &mut Group,
    ) {
        let (codec, voxels) = (self.codec, self.voxels());
        load_group(codec, weighing, &self.samples, self.missing, first, count, group);
        let coefficients = &mut group.coefficients[..used.ks.len()];
        for (k, lane) in used.ks.iter().zip(&mut *coefficients) {
            let nodes = &field[k * voxels + first..][..count];
            match nodes.first_chunk::<LANES>() {
                Some(nodes) => *lane = nodes.map(R::to_f64),
                None => lane.iter_mut().zip(nodes).for_each(|(c, node)| *c = node.to_f64()),
            }
        }
        used.basis(codec.basis.as_ref()).inverse(coefficients, &mut group.decoded);
    }

    /// Estimates how many samples miss the bound, from one group of series in [`SAMPLING`].
    pub(super) fn estimate_outliers<R: Real>(&self, weighing: &QuantizerSetup, field: &[R], marked: &[bool]) -> usize {
        if self.plain() && self.codec.scheme.coarseness <= 1.0 {
            return 0;
        }
        let used = Used::new(self.codec.basis.as_ref(), marked);
        let (mut tally, mut group) = (Tally::new(), Group::new(self.codec));
        for (first, count) in lane_groups(self.voxels()).step_by(SAMPLING) {
            self.decode_group(weighing, field, &used, first, count, &mut group);
            self.add(&group, first, count, &mut tally);
        }
        tally.outliers.len() * SAMPLING
    }

    /// Compares a group's decoded series with the source. None if too many samples have missed the bound so far.
    pub(super) fn check(&self, group: &Group, first: usize, count: usize, tally: &mut Tally) -> Option<()> {
        self.add(group, first, count, tally);
        self.outliers_affordable(tally.outliers.len()).then_some(())
    }

    fn add(&self, group: &Group, first: usize, count: usize, tally: &mut Tally) {
        let compared = Compared { source: &group.source, decoded: &group.decoded };
        let sample_index = |t: usize, lane: usize| self.sample_index(t * self.voxels() + first + lane);
        tally.add_series(self.codec, &compared, count, self.missing.count == 0, sample_index);
    }

    /// The index of a sample; none if it is missing.
    fn sample_index(&self, index: usize) -> Option<usize> {
        (!self.missing.has(index)).then_some(index)
    }

    /// Whether storing the samples that miss the bound is cheaper than storing all samples exactly.
    pub(super) fn outliers_affordable(&self, outliers: usize) -> bool {
        outliers <= self.missing.all / MOST_OUTLIERS
    }
}

/// The estimate of outliers samples one group of series in this many. Rows of usual lengths are no multiple of it.
const SAMPLING: usize = 3;

/// A block is stored exactly if more than one sample in this many misses the bound, because an outlier takes more bytes
/// than a sample of an exact block.
const MOST_OUTLIERS: usize = 8;

/// Finer steps are tried if more than one sample in this many misses the bound. With fewer, a try is not worth its time, which is that of
/// coding the block.
const FEW_OUTLIERS: usize = 512;

/// A finer step is tried if fewer codes than this come with an outlier. An outlier takes as many bytes as about eight.
const CODES_PER_OUTLIER: usize = 8;

/// A finer step is smaller by this factor.
const FINER: f64 = 1.4;

/// The margin subtracted from a step, relative to the largest sample, for rounding in 32-bit floats.
const SINGLE_ROUNDING: f64 = 1.0 / (1 << 22) as f64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sample::SampleType;
    use crate::codec::WindowCodec;
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::box_samples::BoxSamples;
    use crate::codec::load::Missing;
    use crate::codec::scheme::Scheme;

    /// Statistics of a block's series, each decoded and compared in doubles.
    fn all_in_doubles(source: &Source<'_>, weighing: &QuantizerSetup, field: &[f32], marked: &[bool]) -> Tally {
        let used = Used::new(source.codec.basis.as_ref(), marked);
        let (mut tally, mut group) = (Tally::new(), Group::new(source.codec));
        for (first, count) in lane_groups(source.voxels()) {
            source.decode_group(weighing, field, &used, first, count, &mut group);
            source.add(&group, first, count, &mut tally);
        }
        tally
    }

    #[test]
    fn screened_series_give_the_statistics_of_all() {
        let of = [23_usize, 9, 5];
        let size = [22, 9, 4];
        let frames = 12;
        let number = |i: usize| ((i as u32).wrapping_mul(0x9E37_79B1) >> 8) as f64 / f64::from(1 << 24) - 0.5;
        let smooth = |i: usize, t: usize| (i as f64 / 90.0).sin() * (1.0 + t as f64 / 9.0);
        let all: usize = of.iter().product();
        for (declared, noise, ty) in
            [(None, 0.01, SampleType::F32), (Some(0.0), 0.4, SampleType::F64), (None, 0.4, SampleType::F32)]
        {
            let values: Vec<f64> = (0..frames * all).map(|i| smooth(i % all, i / all) + noise * number(i)).collect();
            let mut bytes = vec![0; values.len() * ty.size()];
            sample::store(ty, &values, &mut bytes);
            let bound = ErrorBound::new(Bound::Pointwise, 0.1, 0.1);
            for basis in [Basis::Learned, Basis::Samples] {
                let functions = if basis == Basis::Learned { vec![20000; frames] } else { Vec::new() };
                let mut codec =
                    WindowCodec::new(Scheme { functions, ..Scheme::along_time(basis) }, frames, ty, bound, 8);
                codec.missing_value = declared;
                let samples = BoxSamples::new(ty, &bytes, of, size);
                let around = Missing::find(&codec, &bytes);
                let missing = Missing::within(&codec, &samples, &around);
                assert_eq!(missing.count, 0);
                let source = Source { codec: &codec, samples, missing: &missing };
                let weighing = QuantizerSetup::new(&codec, &samples, missing.magnitude).expect("a bound");
                let mut field = vec![0.0_f32; codec.basis.coefficients() * source.voxels()];
                source.load(&weighing, &mut field);
                field.iter_mut().enumerate().for_each(|(i, node)| *node += 0.15 * number(7 * i) as f32);
                let marked = vec![true; codec.basis.coefficients()];
                assert!(Screen::applies::<f32>(&source));
                let screened = source.check_series(&weighing, &field, &marked).expect("few outliers");
                let all = all_in_doubles(&source, &weighing, &field, &marked);
                assert_eq!((&screened.outliers, screened.min, screened.max), (&all.outliers, all.min, all.max));
                assert_eq!((screened.reached, screened.share), (all.reached, all.share));
                assert!((screened.squared_error - all.squared_error).abs() <= 1e-5 * all.squared_error);
            }
        }
    }
}
