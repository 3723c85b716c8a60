//! A window of frames: how its blocks are coded, and their error bounds and totals.

use crate::bytes::{ParseResult, ensure, finite_amount, is_amount, is_range};
use crate::limits::*;
use crate::pyramid::Packing;
use crate::record::{decode_exact, encode};
use crate::section::FRAME;
use crate::{BlockStats, EncodedBlock, Features, PartKind, Pyramid};
use bincode::{Decode, Encode};

/// The transform along time. New kinds are only appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub enum Basis {
    /// The Haar wavelet.
    Haar,
    /// The multiwavelet of Geronimo, Hardin and Massopust.
    Multi,
    /// No transform: the coefficients are the samples.
    Samples,
    /// Orthonormal functions fitted to the window's series, completed by Haar functions.
    Learned,
}

impl Basis {
    /// The name used in reports. The command line differs for [`Self::Samples`]: this basis is only useful with a
    /// pyramid, and is called "pyramid" there.
    pub fn name(self) -> &'static str {
        match self {
            Self::Haar => "haar",
            Self::Multi => "multi",
            Self::Samples => "samples",
            Self::Learned => "learned",
        }
    }
}

/// A run of consecutive frames that are coded together.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Window {
    /// Its first frame.
    pub first_frame: u64,
    /// Number of frames, 1 to [`MAX_WINDOW_FRAMES`].
    pub frames: u32,
    /// The transform along time.
    pub basis: Basis,
    /// Number of coefficients per voxel; may exceed `frames`.
    pub coefficients: u32,
    /// Number of coefficients per voxel in each level part, coarse to fine; their sum is `coefficients`. Empty with a
    /// pyramid.
    pub levels: Vec<u32>,
    /// For a learned basis: the learned functions, `frames` values each, in units of 2^-15. Otherwise empty.
    pub functions: Vec<i16>,
    /// How coefficients are predicted in space, or samples in space and time, if they are.
    pub pyramid: Option<Pyramid>,
    /// For writers that append: the value from which the writer chose the blocks' steps, in its own units.
    pub coarseness: f64,
    /// The value range that a pointwise or rms tolerance refers to: a given range, or the range of all frames up to the
    /// window's end. (inf, -inf) if there is none.
    pub range: (f64, f64),
    /// The writer's digest of the samples, by which it recognises a source; 0 if unknown.
    pub digest: u64,
    /// The largest error that the bound allows in this window, in units of the samples.
    pub delta: f64,
    /// Largest error of a sample, rounded up; at least that of every block.
    pub reached: f64,
    /// Largest share of its bound that any series uses, in the bound's own measure, rounded up; at most 1.
    pub share: f64,
    /// About the sum of the squared errors of the samples; may overflow to infinity.
    pub squared_error: f64,
    /// Smallest decoded finite sample; infinity if there is none.
    pub min: f64,
    /// Largest decoded finite sample; minus infinity if there is none.
    pub max: f64,
    /// Number of missing samples; at least as many as the parts of missing samples hold.
    pub missing: u64,
    /// Number of nonzero coefficients: the sum of the counts of all level parts.
    pub coded: u64,
    /// Number of outliers: the sum of the counts of all parts of outliers.
    pub outliers: u64,
}

/// The section before a window's blocks. It and the file's start are enough to decode them.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct WindowRecord {
    /// Number of the window, from 0.
    pub number: u32,
    /// The window with the totals of no blocks.
    pub window: Window,
    /// Time of each of its frames. If empty, frames are identified by number.
    pub times: Vec<f64>,
}

/// The section after a window's blocks: their totals.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct WindowEnd {
    /// Number of the window, from 0.
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

impl Window {
    /// Bytes of a decoded coefficient: 32-bit floats if a pyramid refines them, otherwise 64-bit floats.
    pub fn coefficient_size(&self) -> usize {
        let is_single = self.pyramid.as_ref().is_some_and(|pyramid| pyramid.single);
        if is_single { size_of::<f32>() } else { size_of::<f64>() }
    }
}

impl WindowRecord {
    /// Bytes that a window takes in a file beside its blocks and leaves: its section and its end, and both in the metadata.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) if it cannot be stored.
    pub fn stored_len(&self) -> crate::Result<u64> {
        let record = self.encode().map_err(crate::Error::Invalid)?.len();
        Ok(2 * (align((FRAME + record) as u64) + align((FRAME + WINDOW_END) as u64)))
    }

    pub(crate) fn encode(&self) -> ParseResult<Vec<u8>> {
        encode(self, "window")
    }

    /// Parses a record that must take up all of `bytes`. Does not compare it with the rest of the metadata.
    pub(crate) fn parse(bytes: &[u8]) -> ParseResult<Self> {
        let record: Self = decode_exact(bytes, "window record")?;
        let empty = Self { window: record.window.without_totals(), ..record.clone() };
        // compare bytes, because totals of -0 must fail too
        ensure(empty.encode()? == bytes, || "a window section with totals of blocks".into())?;
        Ok(record)
    }
}

impl WindowEnd {
    /// The totals of no blocks.
    pub fn empty(number: u32) -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        let (reached, share, squared_error, missing, coded, outliers) = (0.0, 0.0, 0.0, 0, 0, 0);
        Self { number, reached, share, squared_error, min, max, missing, coded, outliers }
    }

    /// The totals of a complete window.
    pub fn from_window(number: u32, window: &Window) -> Self {
        let Window { reached, share, squared_error, min, max, missing, coded, outliers, .. } = *window;
        Self { number, reached, share, squared_error, min, max, missing, coded, outliers }
    }

    /// Adds a block's statistics. These do not include a share, so `share` stays as it is.
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
                PartKind::Exact | PartKind::Listed | PartKind::Sides | PartKind::Sums => {}
            }
        }
    }

    pub(crate) fn encode(&self) -> ParseResult<Vec<u8>> {
        encode(self, "window")
    }

    pub(crate) fn parse(bytes: &[u8]) -> ParseResult<Self> {
        decode_exact(bytes, "record of a window's end")
    }
}

impl Window {
    /// A window whose coding is unknown: all its blocks are lost. It has no range, no bound and no totals.
    pub fn lost(first_frame: u64, frames: u32) -> Self {
        Self {
            first_frame,
            frames,
            basis: Basis::Samples,
            coefficients: frames,
            levels: vec![frames],
            functions: Vec::new(),
            pyramid: None,
            coarseness: 0.0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
            digest: 0,
            delta: 0.0,
            reached: 0.0,
            share: 0.0,
            squared_error: 0.0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            missing: 0,
            coded: 0,
            outliers: 0,
        }
    }

    /// The window with the totals of no blocks.
    pub(crate) fn without_totals(&self) -> Self {
        self.with_totals(&WindowEnd::empty(0))
    }

    /// The window with these totals.
    pub fn with_totals(&self, end: &WindowEnd) -> Self {
        let WindowEnd { reached, share, squared_error, min, max, missing, coded, outliers, .. } = *end;
        Self { reached, share, squared_error, min, max, missing, coded, outliers, ..self.clone() }
    }

    /// How its codes are packed; without a pyramid, in the way of version 1.0.
    pub fn packing(&self) -> Packing {
        self.pyramid.as_ref().map_or(Packing::Flat, |pyramid| pyramid.packing)
    }

    /// Checks that the file's header announces what the window has.
    pub(crate) fn check_announced(&self, announced: Features) -> ParseResult {
        let known = announced.packing == Packing::Nested || self.packing() == Packing::Flat;
        ensure(known, || "a window with nested parts, which the header does not announce".into())?;
        ensure(announced.tiered || self.tiers() == 0, || {
            "a window with tiers, which the header does not announce".into()
        })
    }

    /// Number of tiers above its blocks.
    pub fn tiers(&self) -> u8 {
        self.pyramid.as_ref().map_or(0, |pyramid| pyramid.tiers)
    }

    /// Number of level parts that a block can have.
    pub fn parts(&self) -> usize {
        if self.pyramid.is_some() { Pyramid::PARTS.into() } else { self.levels.len() }
    }

    /// Checks the window for boxes of at most `voxels` in a grid of `voxels_in_all`, channels included.
    pub(crate) fn check(&self, voxels: u64, voxels_in_all: u64) -> ParseResult {
        let Self { frames, coefficients, .. } = *self;
        ensure((1..=MAX_WINDOW_FRAMES).contains(&frames), || format!("{frames} frames, at most {MAX_WINDOW_FRAMES}"))?;
        ensure((1..=MAX_COEFFICIENTS).contains(&coefficients), || {
            format!("{coefficients} coefficients, at most {MAX_COEFFICIENTS}")
        })?;
        let samples = voxels.saturating_mul(frames.max(coefficients).into());
        ensure(samples <= MAX_BLOCK_SAMPLES, || format!("blocks of {samples} samples, at most {MAX_BLOCK_SAMPLES}"))?;
        self.check_coding()?;
        let counted = voxels_in_all.saturating_mul(frames.into());
        // With ghost nodes, a block of 2 x 2 x 2 voxels has 27 nodes.
        let nodes = if self.pyramid.as_ref().is_some_and(|pyramid| pyramid.ghosts) { 4 } else { 1 };
        let coded = voxels_in_all.saturating_mul(coefficients.into()).saturating_mul(nodes);
        let possible = self.missing.max(self.outliers) <= counted && self.coded <= coded;
        ensure(possible, || "more missing samples, outliers or coefficients than there are samples".into())?;
        let errors = finite_amount(self.delta) && finite_amount(self.reached) && is_amount(self.squared_error);
        let ranges = is_range(self.min, self.max) && is_range(self.range.0, self.range.1);
        ensure(errors && ranges, || "an error or value range is invalid".into())?;
        ensure(finite_amount(self.coarseness), || format!("invalid coarseness {}", self.coarseness))?;
        ensure((0.0..=1.0).contains(&self.share), || format!("share {} is not between 0 and 1", self.share))
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
        ensure(fits, || format!("{functions} values of functions for {frames} frames"))
    }
}
