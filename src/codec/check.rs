//! What the decoder gives, compared with the source: errors, range, and the samples that miss the bound.

use super::WindowCodec;
use crate::sample;
use crate::wavelet::{LANES, Lane};
use wavesplat_format::Outliers;

/// Samples that are compared, [`LANES`] series together; one lane for each frame.
#[derive(Debug)]
pub(super) struct Compared<'a> {
    /// The samples, missing ones filled.
    pub(super) source: &'a [Lane],
    /// What the decoder gives.
    pub(super) decoded: &'a [Lane],
}

/// Errors and range of what the decoder gives back, and where it misses the bound.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) reached: f64,
    pub(super) squared_error: f64,
    /// The largest share of its bound that a series uses.
    pub(super) share: f64,
    /// Samples that must be stored exactly.
    pub(super) places: Vec<u32>,
}

impl Tally {
    pub(super) fn new() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { min, max, reached: 0.0, squared_error: 0.0, share: 0.0, places: Vec::new() }
    }

    pub(super) fn add(&mut self, decoded: f64, error: f64) {
        self.min = self.min.min(decoded);
        self.max = self.max.max(decoded);
        self.reached = self.reached.max(error);
        self.squared_error += error * error;
    }

    /// Adds `count` series; `whole` if none of them is missing a sample. The sample of a frame and lane is at
    /// `place(frame, lane)` of the block; none if it is missing.
    pub(super) fn add_series(
        &mut self,
        codec: &WindowCodec,
        compared: &Compared<'_>,
        count: usize,
        whole: bool,
        place: impl Fn(usize, usize) -> Option<usize>,
    ) {
        if count < LANES || !whole || !self.add_clearly_within(codec, compared) {
            (0..count).for_each(|lane| self.add_one(codec, compared, lane, |t| place(t, lane)));
        }
    }

    /// Adds a group of present samples whose errors are clearly within the bound, by vector code and with one
    /// rounding up at the end. False if they are not, so that each must be looked at; nothing is added then.
    fn add_clearly_within(&mut self, codec: &WindowCodec, compared: &Compared<'_>) -> bool {
        let (mut all, mut largest, mut squares) = ((self.min, self.max), Lane::default(), Lane::default());
        let mut sums = Lane::default();
        for (decoded, source) in compared.decoded.iter().zip(compared.source) {
            let (rounded, mut errors) = (sample::round_all(codec.sample, decoded), Lane::default());
            for l in 0..LANES {
                let (a, b) = ((decoded[l] - source[l]).abs(), (rounded[l] - source[l]).abs());
                let e = if a > b { a } else { b };
                largest[l] = if e > largest[l] { e } else { largest[l] };
                squares[l] += e * e;
                errors[l] = e;
            }
            codec.promise.add(&errors, source, &mut sums);
            match sample::range_unless_missing(&rounded, codec.missing_value) {
                Some(range) => all = (all.0.min(range.0), all.1.max(range.1)),
                None => return false,
            }
        }
        let share = codec.promise.largest_share(&sums, compared.source.len());
        if share > 1.0 {
            return false;
        }
        let largest = largest.into_iter().fold(0.0, f64::max);
        let largest = if largest > 0.0 { largest.next_up() } else { largest };
        self.reached = self.reached.max(largest);
        self.share = self.share.max(share);
        self.squared_error += squares.iter().sum::<f64>();
        (self.min, self.max) = all;
        true
    }

    /// Adds one series, sample by sample, and notes the places of those that miss the bound.
    fn add_one(
        &mut self,
        codec: &WindowCodec,
        compared: &Compared<'_>,
        lane: usize,
        place: impl Fn(usize) -> Option<usize>,
    ) {
        let error = |t: usize| {
            let (decoded, source) = (compared.decoded[t][lane], compared.source[t][lane]);
            let rounded = sample::round_to(codec.sample, decoded);
            let found = if place(t).is_some() { codec.error(decoded, rounded, source) } else { 0.0 };
            (found, codec.promise.allowed(source))
        };
        let mut errors: Vec<(f64, f64)> = (0..compared.source.len()).map(error).collect(); // each with what is allowed
        let holds = codec.promise.holds(errors.iter().copied());
        for (t, (error, allowed)) in errors.iter_mut().enumerate() {
            let Some(place) = place(t) else { continue };
            if holds || *error <= *allowed {
                self.add(sample::round_to(codec.sample, compared.decoded[t][lane]), *error);
            } else {
                *error = 0.0;
                self.add(compared.source[t][lane], 0.0);
                self.places.push(place as u32);
            }
        }
        let share = codec.promise.share(errors.iter().copied());
        self.share = self.share.max(share.min(1.0)); // rounded up beyond what holds
    }

    /// The samples that must be stored exactly.
    pub(super) fn take_outliers(&mut self, codec: &WindowCodec, samples: &[u8]) -> Outliers {
        let size = codec.sample.size();
        let mut positions = std::mem::take(&mut self.places);
        positions.sort_unstable();
        let bytes = |p: &u32| &samples[*p as usize * size..(*p as usize + 1) * size];
        let samples = positions.iter().flat_map(bytes).copied().collect();
        Outliers { positions, samples }
    }
}
