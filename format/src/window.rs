//! A window of frames: how its blocks are coded, and what they promised and reached.

use crate::bytes::{ParseResult, ensure};
use crate::directory::{finite_amount, is_amount, is_range};
use crate::limits::*;
use crate::metadata::{CONFIG, decode_exact};
use crate::{BlockStats, EncodedBlock, PartKind, Pyramid};
use bincode::{Decode, Encode};

/// The transform along time; new kinds are appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub enum Basis {
    /// The Haar wavelet.
    Haar,
    /// The multiwavelet of Geronimo, Hardin and Massopust.
    Multi,
    /// None: the samples themselves.
    Samples,
    /// Orthonormal functions that suit the window's own series, then Haar functions that complete them.
    Learned,
}

impl Basis {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Haar => "haar",
            Self::Multi => "multi",
            Self::Samples => "samples",
            Self::Learned => "learned",
        }
    }
}

/// A run of frames that is coded together.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Window {
    /// Its first frame.
    pub first_frame: u64,
    /// Its frames, 1 to [`MAX_WINDOW_FRAMES`].
    pub frames: u32,
    /// The transform along time.
    pub basis: Basis,
    /// Coefficients of one voxel; may exceed `frames`.
    pub coefficients: u32,
    /// Coefficients of one voxel in each level part, coarse to fine; their sum is `coefficients`. Empty with a pyramid.
    pub levels: Vec<u32>,
    /// Of a learned basis: the learned functions, `frames` values each, in units of 2^-15; else empty.
    pub functions: Vec<i16>,
    /// How coefficients are refined in space, or samples in space and time.
    pub pyramid: Option<Pyramid>,
    /// What the writer took for a block's step, in units of its own; for writers that append.
    pub coarseness: f64,
    /// The value range that a pointwise or rms tolerance refers to here: as given, or that of all frames up to the window's
    /// end; (inf, -inf) without one.
    pub range: (f64, f64),
    /// The writer's digest of the samples, to tell whether a source still holds them; 0: unknown.
    pub digest: u64,
    /// The largest error that the bound allows in this window, in units of the samples.
    pub delta: f64,
    /// Largest error of a sample, rounded up; at least that of every block.
    pub reached: f64,
    /// Largest share of its bound that any series used, in the bound's own measure, rounded up; at most 1.
    pub share: f64,
    /// Sum of the squared errors of the samples; may overflow to infinity.
    pub squared_error: f64,
    /// Smallest decoded finite sample; infinity when there is none.
    pub min: f64,
    /// Largest decoded finite sample; minus infinity when there is none.
    pub max: f64,
    /// Missing samples; at least those in parts of missing samples.
    pub missing: u64,
    /// Nonzero coefficients: the sum of the counts of all level parts.
    pub coded: u64,
    /// Outliers: the sum of the counts of all parts of outliers.
    pub outliers: u64,
}

/// What the section before a window's blocks holds: with it and the file's start, they can be decoded.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct WindowRecord {
    /// Its number, from 0.
    pub number: u32,
    /// The window as it is before its first block: what adds up from blocks is still that of none.
    pub window: Window,
    /// Time of each of its frames; empty: frame numbers.
    pub times: Vec<f64>,
}

/// What the section after a window's blocks holds: what they add up to.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct WindowEnd {
    /// Its number, from 0.
    pub number: u32,
    /// [`Window::reached`]
    pub reached: f64,
    /// [`Window::share`]
    pub share: f64,
    /// [`Window::squared_error`]
    pub squared_error: f64,
    /// [`Window::min`]
    pub min: f64,
    /// [`Window::max`]
    pub max: f64,
    /// [`Window::missing`]
    pub missing: u64,
    /// [`Window::coded`]
    pub coded: u64,
    /// [`Window::outliers`]
    pub outliers: u64,
}

/// Bytes of the record of a window's end.
pub(crate) const WINDOW_END: usize = 4 + 8 * 8;

impl WindowRecord {
    pub(crate) fn encode(&self) -> ParseResult<Vec<u8>> {
        bincode::encode_to_vec(self, CONFIG).map_err(|e| format!("window: {e}"))
    }

    /// The record that is exactly `bytes`; the rest of the metadata says whether it can be.
    pub(crate) fn parse(bytes: &[u8]) -> ParseResult<Self> {
        let record: Self = decode_exact(bytes, "window record")?;
        let begun = Self { window: record.window.without_totals(), ..record.clone() };
        ensure(begun.encode()? == bytes, || "a window that begins with blocks".into())?; // to the bit
        Ok(record)
    }
}

impl WindowEnd {
    /// Before the first block.
    pub fn of_nothing(number: u32) -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        let (reached, share, squared_error, missing, coded, outliers) = (0.0, 0.0, 0.0, 0, 0, 0);
        Self { number, reached, share, squared_error, min, max, missing, coded, outliers }
    }

    /// Of a window that is whole.
    pub fn of(number: u32, window: &Window) -> Self {
        let Window { reached, share, squared_error, min, max, missing, coded, outliers, .. } = *window;
        Self { number, reached, share, squared_error, min, max, missing, coded, outliers }
    }

    /// Adds a block, but for its share, which it does not tell.
    pub fn add(&mut self, block: &EncodedBlock) {
        let BlockStats { reached, squared_error, min, max, .. } = block.stats;
        self.reached = self.reached.max(reached);
        self.squared_error += squared_error;
        (self.min, self.max) = (self.min.min(min), self.max.max(max));
        for part in &block.parts {
            match part.kind {
                PartKind::Level(_) => self.coded += part.stats.count,
                PartKind::Outliers => self.outliers += part.stats.count,
                PartKind::Missing => self.missing += part.stats.count,
                PartKind::Exact => {}
            }
        }
    }

    pub(crate) fn encode(&self) -> ParseResult<Vec<u8>> {
        bincode::encode_to_vec(self, CONFIG).map_err(|e| format!("window: {e}"))
    }

    pub(crate) fn parse(bytes: &[u8]) -> ParseResult<Self> {
        decode_exact(bytes, "record of a window's end")
    }
}

impl Window {
    /// As it is before its first block.
    pub(crate) fn without_totals(&self) -> Self {
        self.with_totals(&WindowEnd::of_nothing(0))
    }

    /// As it is with what its blocks add up to.
    pub fn with_totals(&self, end: &WindowEnd) -> Self {
        let WindowEnd { reached, share, squared_error, min, max, missing, coded, outliers, .. } = *end;
        Self { reached, share, squared_error, min, max, missing, coded, outliers, ..self.clone() }
    }

    /// Level parts that a block can have.
    pub fn parts(&self) -> usize {
        if self.pyramid.is_some() { Pyramid::PARTS.into() } else { self.levels.len() }
    }

    /// Whether it is within the limits for boxes of `voxels` in a grid of `voxels_in_all`.
    pub(crate) fn check(&self, voxels: u64, voxels_in_all: u64) -> ParseResult {
        let Self { frames, coefficients, .. } = *self;
        ensure((1..=MAX_WINDOW_FRAMES).contains(&frames), || format!("{frames} frames"))?;
        ensure((1..=MAX_COEFFICIENTS).contains(&coefficients), || format!("{coefficients} coefficients"))?;
        let samples = voxels.saturating_mul(frames.max(coefficients).into());
        ensure(samples <= MAX_BLOCK_SAMPLES, || format!("blocks of {samples}, at most {MAX_BLOCK_SAMPLES} samples"))?;
        self.check_coding()?;
        let counted = voxels_in_all.saturating_mul(frames.into());
        let coded = voxels_in_all.saturating_mul(coefficients.into());
        let possible = self.missing.max(self.outliers) <= counted && self.coded <= coded;
        ensure(possible, || "more missing samples, outliers or coefficients than there are samples".into())?;
        let errors = finite_amount(self.delta) && finite_amount(self.reached) && is_amount(self.squared_error);
        let ranges = is_range(self.min, self.max) && is_range(self.range.0, self.range.1);
        ensure(errors && ranges, || "an error or value range out of range".into())?;
        ensure(finite_amount(self.coarseness), || format!("a coarseness of {}", self.coarseness))?;
        ensure((0.0..=1.0).contains(&self.share), || format!("a share of {} of the bound", self.share))
    }

    fn check_coding(&self) -> ParseResult {
        let Self { frames, coefficients, .. } = *self;
        let sum: u64 = self.levels.iter().map(|&k| u64::from(k)).sum();
        let levels = match self.pyramid {
            Some(_) => self.levels.is_empty(),
            None => (1..=MAX_LEVELS).contains(&self.levels.len()) && !self.levels.contains(&0),
        };
        let levels = levels && (self.pyramid.is_some() || sum == coefficients.into());
        ensure(levels, || format!("{coefficients} coefficients in levels of {sum}"))?;
        self.pyramid.as_ref().map_or(Ok(()), |pyramid| pyramid.check(self.basis == Basis::Samples))?;
        let (functions, frames) = (self.functions.len(), frames as usize);
        let learned = functions.is_multiple_of(frames) && functions / frames <= frames;
        let fits = if self.basis == Basis::Learned { learned } else { functions == 0 };
        ensure(fits, || format!("functions of {functions} values for {frames} frames"))
    }
}
