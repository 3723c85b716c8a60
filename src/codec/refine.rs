//! The samples of a block coded by a pyramid: to a field of coefficients, through the passes, and compared.

use super::check::{Compared, Tally};
use super::encode::clear;
use super::load::{Missing, load_group};
use super::pyramid::Passes;
use super::real::Real;
use super::rows::Change;
use super::truncate::Group;
use super::weigh::Weighing;
use super::{WindowCodec, lane_groups};
use crate::bound::Measure;
use crate::sample;
use crate::wavelet::LANES;
use wavesplat_format::{Basis, Outliers, Pyramid};

/// What is known about a block after its series have been coded.
pub(super) struct Coded {
    pub(super) step: f64,
    /// With a pyramid: what leaving out each level part and all finer ones changes.
    pub(super) changes: Option<Vec<Change>>,
    pub(super) dropped: f64,
    pub(super) outliers: Outliers,
    pub(super) tally: Tally,
}

/// The samples of a block, and how to code them.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) codec: &'a WindowCodec,
    /// Voxels along x, y, z.
    pub(super) size: [usize; 3],
    /// Little-endian, frame by frame.
    pub(super) samples: &'a [u8],
    pub(super) missing: &'a Missing,
}

impl Source<'_> {
    pub(super) fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// Codes the block by a pyramid; the fields and `codes` are scratch and result. None if it must be stored exactly.
    pub(super) fn refine<R: Real>(
        &self,
        pyramid: &Pyramid,
        trial: bool,
        [field, rest]: &mut [Vec<R>; 2],
        codes: &mut Vec<i32>,
    ) -> Option<Coded> {
        let codec = self.codec;
        let weighing = Weighing::of(codec, self.samples, self.missing.magnitude)?;
        let rounding = if pyramid.single { self.missing.magnitude * SINGLE_ROUNDING } else { 0.0 };
        let step = weighing.step * codec.scheme.coarseness - rounding;
        if !step.is_normal() || step < 0.0 || self.missing.magnitude > R::LARGEST {
            return None;
        }
        let nodes = codec.basis.coefficients() * self.voxels();
        let plain = codec.scheme.basis == Basis::Samples && codec.promise.measure() == Measure::Largest;
        clear(field).resize(nodes, R::default());
        if plain {
            self.load_samples(field);
        } else {
            self.load_series(&weighing, field);
        }
        clear(codes).resize(nodes, 0);
        let passes = Passes::new(pyramid, codec.shape(self.size));
        if !passes.encode(step, field, codes) {
            return None;
        }
        let mut tally = if plain { self.check_samples(field)? } else { self.check_series(&weighing, field)? };
        let outliers = tally.take_outliers(codec, self.samples);
        let changes = (!trial).then(|| passes.changes(field, rest));
        Some(Coded { step, changes, dropped: tally.squared_error, outliers, tally })
    }

    /// The samples themselves; those that are missing as "not a number".
    fn load_samples<R: Real>(&self, field: &mut [R]) {
        sample::for_each_run(self.codec.sample, self.samples, |first, values| {
            let nodes = &mut field[first..][..values.len()];
            nodes.iter_mut().zip(values).for_each(|(node, v)| *node = R::of(*v));
            if self.missing.count > 0 {
                let missing = nodes.iter_mut().zip(&self.missing.mask[first..]).filter(|(_, missing)| **missing);
                missing.for_each(|(node, _)| *node = R::of(f64::NAN));
            }
        });
    }

    /// The coefficients of all series.
    fn load_series<R: Real>(&self, weighing: &Weighing, field: &mut [R]) {
        let (codec, voxels) = (self.codec, self.voxels());
        let mut group = Group::new(codec);
        for (first, count) in lane_groups(voxels) {
            load_group(codec, weighing, self.samples, self.missing, first, count, &mut group);
            codec.basis.forward(&group.source, &mut group.coefficients);
            for (k, lane) in group.coefficients.iter().enumerate() {
                let nodes = &mut field[k * voxels + first..][..count];
                nodes.iter_mut().zip(lane).for_each(|(node, c)| *node = R::of(*c));
            }
        }
    }

    /// Compares samples with the field, where every one is judged by itself. None if too many miss the bound.
    fn check_samples<R: Real>(&self, field: &[R]) -> Option<Tally> {
        let (mut tally, mut decoded) = (Tally::new(), Vec::new());
        sample::for_each_run(self.codec.sample, self.samples, |first, values| {
            clear(&mut decoded).extend(field[first..][..values.len()].iter().map(|node| node.to_f64()));
            let (source, last_source) = values.as_chunks::<LANES>();
            let (whole, last_whole) = decoded.as_chunks::<LANES>();
            let last = |values: &[f64]| [std::array::from_fn(|l| values.get(l).copied().unwrap_or(0.0))];
            let place = |first: usize| move |t: usize, l: usize| self.place(first + t * LANES + l);
            let present = self.missing.count == 0;
            tally.add_series(self.codec, &Compared { source, decoded: whole }, LANES, present, place(first));
            if !last_source.is_empty() {
                let first = first + values.len() - last_source.len();
                let (source, decoded) = (&last(last_source), &last(last_whole));
                tally.add_series(self.codec, &Compared { source, decoded }, last_source.len(), present, place(first));
            }
        });
        self.few(&tally).then_some(tally)
    }

    /// Compares series with what the decoder makes of the field. None if too many samples miss the bound.
    fn check_series<R: Real>(&self, weighing: &Weighing, field: &[R]) -> Option<Tally> {
        let (codec, voxels) = (self.codec, self.voxels());
        let (mut tally, mut group) = (Tally::new(), Group::new(codec));
        for (first, count) in lane_groups(voxels) {
            load_group(codec, weighing, self.samples, self.missing, first, count, &mut group);
            for (k, lane) in group.coefficients.iter_mut().enumerate() {
                let nodes = &field[k * voxels + first..][..count];
                lane.iter_mut().zip(nodes).for_each(|(c, node)| *c = node.to_f64());
            }
            codec.basis.inverse(&mut group.coefficients, &mut group.decoded);
            self.check(&group, (first, count), &mut tally)?;
        }
        Some(tally)
    }

    /// Compares a group's decoded series with the source. None if too many samples miss the bound by now.
    pub(super) fn check(&self, group: &Group, (first, count): (usize, usize), tally: &mut Tally) -> Option<()> {
        let compared = Compared { source: &group.source, decoded: &group.decoded };
        let place = |t: usize, lane: usize| self.place(t * self.voxels() + first + lane);
        tally.add_series(self.codec, &compared, count, self.missing.count == 0, place);
        self.few(tally).then_some(())
    }

    /// A sample that is there.
    fn place(&self, index: usize) -> Option<usize> {
        (!self.missing.mask[index]).then_some(index)
    }

    /// Whether so few samples miss the bound that storing them is cheaper than storing all.
    fn few(&self, tally: &Tally) -> bool {
        tally.places.len() <= self.missing.mask.len() / MOST_OUTLIERS
    }
}

/// A block in which more than one sample in this many misses the bound is stored exactly: an outlier costs more bytes.
const MOST_OUTLIERS: usize = 8;

/// What a step gives up, in units of the largest sample, so that rounding in 32-bit floats stays within the bound.
const SINGLE_ROUNDING: f64 = 1.0 / (1 << 22) as f64;
