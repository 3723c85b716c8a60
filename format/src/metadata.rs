//! The metadata record: grid, type, units, times, tolerance, windows, provenance. The only user of bincode.
//!
//! bincode 2.0.1 needs the limit and the check for leftovers: without them it aborts on nine hostile bytes and ignores
//! what follows a value.

use crate::bytes::{Check, ensure};
use crate::directory::{finite_amount, is_amount, is_range};
use crate::limits::*;
use crate::{BlockGeometry, BlockId, Error, Pyramid, Result, SampleType};
use bincode::{Decode, Encode, config};

/// Fixed-width little-endian integers, nothing larger than the limit.
const CONFIG: config::Configuration<config::LittleEndian, config::Fixint, config::Limit<MAX_METADATA>> =
    config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<MAX_METADATA>();

/// What the tolerance promises; new kinds are appended.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub enum Bound {
    /// Every sample is within the window's `delta`.
    Pointwise,
    /// The root mean square of each series' errors is within it.
    Rms,
    /// Every sample v is within tolerance x max(|v|, floor); `delta` is the largest of these in the window.
    Relative {
        /// Below this magnitude samples may be as wrong as at it; in units of the samples.
        floor: f64,
    },
    /// As [`Bound::Rms`], but `delta` is ESTIMATED from images, so that the relative error of their pixels is about the
    /// tolerance: an estimate, not a guarantee.
    Sampled {
        /// Random pixels on each of three faces.
        samples: u32,
        /// What chose them.
        seed: u64,
    },
}

impl Bound {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pointwise => "pointwise",
            Self::Rms => "rms",
            Self::Relative { .. } => "relative",
            Self::Sampled { .. } => "sampled",
        }
    }

    fn check(self) -> Check {
        match self {
            Self::Relative { floor } => ensure(finite_amount(floor), || format!("a floor of {floor}")),
            Self::Sampled { samples, .. } => ensure(samples > 0, || "a bound sampled nowhere".into()),
            Self::Pointwise | Self::Rms => Ok(()),
        }
    }
}

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

/// Everything about an archive but its samples.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Metadata {
    /// Voxels along x, y, z; x is fastest.
    pub dims: [u64; 3],
    /// Distance of neighbouring voxels along each axis, in world units.
    pub spacing: [f64; 3],
    /// Position of the first voxel, in world units.
    pub origin: [f64; 3],
    /// Type of the samples.
    pub sample: SampleType,
    /// Voxels along the edge of a block's box; boxes are clipped at the far faces.
    pub block_edge: u32,
    /// Channels, at least 1.
    pub channels: u16,
    /// Frames.
    pub frames: u64,
    /// Time of each frame; empty: frame numbers.
    pub times: Vec<f64>,
    /// Name of the variable.
    pub variable: Option<String>,
    /// What the tolerance promises.
    pub bound: Bound,
    /// The tolerance as asked for.
    pub tolerance: f64,
    /// The value range at the end of the archive, or as given, that a pointwise or rms tolerance refers to; (inf, -inf)
    /// when there is none.
    pub range: (f64, f64),
    /// The value that marks a missing sample, besides NaN.
    pub missing_value: Option<f64>,
    /// The windows, one after another from frame 0.
    pub windows: Vec<Window>,
    /// Provenance: names and values of settings, no paths.
    pub settings: Vec<(String, String)>,
    /// Name and version of the program that wrote the file.
    pub program: String,
}

impl Metadata {
    /// The record's bytes; an error if the metadata is invalid or too large.
    pub fn encode(&self) -> Result<Vec<u8>> {
        self.validate()?;
        let bytes = bincode::encode_to_vec(self, CONFIG).map_err(|e| Error::Invalid(format!("metadata: {e}")))?;
        let (size, limit) = (bytes.len() as u64, MAX_METADATA as u64);
        if size > limit {
            return Err(Error::TooLarge { what: "bytes of metadata".into(), size, limit });
        }
        Self::parse(&bytes).map_err(Error::Invalid)?; // a record near the limit must also fit in memory under it
        Ok(bytes)
    }

    /// The valid metadata whose record is exactly `bytes`; [`Error::Invalid`] says why not.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        Self::parse(bytes).map_err(Error::Invalid)
    }

    pub(crate) fn parse(bytes: &[u8]) -> Check<Self> {
        let decoded = bincode::decode_from_slice::<Self, _>(bytes, CONFIG);
        let (metadata, used) = decoded.map_err(|e| format!("not a metadata record: {e}"))?;
        ensure(used == bytes.len(), || format!("{} bytes after the record", bytes.len() - used))?;
        metadata.check()?;
        Ok(metadata)
    }

    /// Whether everything is within the limits and consistent; [`Error::Invalid`] says why not.
    pub fn validate(&self) -> Result<()> {
        self.check().map_err(|what| Error::Invalid(format!("metadata: {what}")))
    }

    fn check(&self) -> Check {
        self.check_grid()?;
        self.check_times()?;
        ensure(finite_amount(self.tolerance), || format!("a tolerance of {}", self.tolerance))?;
        self.bound.check()?;
        ensure(is_range(self.range.0, self.range.1), || "a value range out of order".into())?;
        self.check_windows()
    }

    fn check_grid(&self) -> Check {
        let sized = self.dims.iter().all(|d| (1..=MAX_DIM).contains(d));
        ensure(sized, || format!("dimensions {:?}, each 1 to {MAX_DIM}", self.dims))?;
        let spaced = self.spacing.iter().all(|s| s.is_finite() && *s > 0.0);
        ensure(spaced && self.origin.iter().all(|o| o.is_finite()), || "a spacing or origin out of range".into())?;
        ensure(self.channels > 0 && self.block_edge > 0, || "no channel, or empty blocks".into())?;
        let blocks = self.count_blocks().and_then(|n| u32::try_from(n).ok());
        ensure(blocks.is_some(), || "too many blocks in a window".into())
    }

    fn check_times(&self) -> Check {
        let framed = (1..=MAX_FRAMES).contains(&self.frames);
        ensure(framed, || format!("{} frames, 1 to {MAX_FRAMES}", self.frames))?;
        let timed = self.times.is_empty() || self.times.len() as u64 == self.frames;
        ensure(timed, || format!("{} times for {} frames", self.times.len(), self.frames))?;
        ensure(self.times.iter().all(|t| t.is_finite()), || "a time that is not finite".into())
    }

    fn check_windows(&self) -> Check {
        let mut next = 0u64;
        let voxels_in_all = self.dims.iter().fold(u64::from(self.channels), |n, d| n.saturating_mul(*d));
        for (number, window) in self.windows.iter().enumerate() {
            let place = |what: String| format!("window {number}: {what}");
            ensure(window.first_frame == next, || place(format!("starts at {} not {next}", window.first_frame)))?;
            window.check(self.largest_box(), voxels_in_all).map_err(place)?;
            next = next.saturating_add(window.frames.into());
        }
        ensure(next == self.frames, || format!("windows cover {next} of {} frames", self.frames))
    }

    /// Voxels of the largest box.
    fn largest_box(&self) -> u64 {
        let edge = u64::from(self.block_edge);
        self.dims.iter().fold(1, |voxels: u64, &dim| voxels.saturating_mul(dim.min(edge)))
    }

    /// Boxes along x, y, z.
    pub fn blocks_per_axis(&self) -> [u64; 3] {
        self.dims.map(|dim| dim.div_ceil(u64::from(self.block_edge).max(1)))
    }

    fn count_blocks(&self) -> Option<u64> {
        self.blocks_per_axis().iter().try_fold(1, |count: u64, &blocks| count.checked_mul(blocks))
    }

    /// Blocks of one window and channel, of valid metadata.
    pub fn blocks_per_channel(&self) -> u32 {
        self.count_blocks().and_then(|n| u32::try_from(n).ok()).unwrap_or(u32::MAX)
    }

    /// Blocks of the whole archive, or the largest number where there are more.
    pub fn blocks(&self) -> u64 {
        let per_window = u64::from(self.blocks_per_channel()) * u64::from(self.channels);
        per_window.saturating_mul(self.windows.len() as u64)
    }

    /// Leaves of one window's directory.
    pub(crate) fn leaves_per_window(&self) -> u64 {
        u64::from(self.blocks_per_channel().div_ceil(BLOCKS_PER_LEAF)) * u64::from(self.channels)
    }

    /// First voxel and size of a block's box along x, y, z; none for a block that the grid lacks.
    pub fn block_box(&self, block: u32) -> Option<([u64; 3], [u64; 3])> {
        if block >= self.blocks_per_channel() {
            return None;
        }
        let [nx, ny, _] = self.blocks_per_axis();
        let (block, edge) = (u64::from(block), u64::from(self.block_edge));
        let first = [block % nx * edge, block / nx % ny * edge, block / nx / ny * edge];
        let size = std::array::from_fn(|axis| edge.min(self.dims[axis] - first[axis]));
        Some((first, size))
    }

    /// The sizes of a block; none for a block that the archive lacks.
    pub fn geometry(&self, id: BlockId) -> Option<BlockGeometry<'_>> {
        let window = self.windows.get(id.window as usize).filter(|_| id.channel < self.channels)?;
        let (_, size) = self.block_box(id.block)?;
        usize::try_from(size.iter().product::<u64>()).ok()?;
        Some(BlockGeometry { size: size.map(|n| n as usize), window, sample_size: self.sample.size() })
    }
}

impl Window {
    /// Level parts that a block can have.
    pub fn parts(&self) -> usize {
        if self.pyramid.is_some() { Pyramid::PARTS.into() } else { self.levels.len() }
    }

    /// Whether it is within the limits for boxes of `voxels` in a grid of `voxels_in_all`.
    fn check(&self, voxels: u64, voxels_in_all: u64) -> Check {
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
        ensure(errors && is_range(self.min, self.max), || "an error or value range out of range".into())?;
        ensure((0.0..=1.0).contains(&self.share), || format!("a share of {} of the bound", self.share))
    }

    fn check_coding(&self) -> Check {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::metadata;

    #[test]
    fn record_round_trips_and_must_end() {
        let metadata = metadata();
        let mut bytes = metadata.encode().expect("valid");
        assert_eq!(Metadata::decode(&bytes).expect("whole"), metadata);
        assert!((0..bytes.len()).all(|len| Metadata::decode(&bytes[..len]).is_err()));
        bytes.push(0);
        assert!(Metadata::decode(&bytes).is_err());
    }

    #[test]
    fn hostile_lengths_do_not_allocate() {
        let bytes = metadata().encode().expect("valid");
        for at in 0..bytes.len().saturating_sub(8) {
            let mut hostile = bytes.clone();
            hostile[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
            let _ = Metadata::decode(&hostile);
        }
    }

    #[test]
    fn impossible_metadata_is_refused() {
        type Change = fn(&mut Metadata);
        let changes: [Change; 21] = [
            |m| m.dims[1] = 0,
            |m| m.dims = [MAX_DIM; 3],
            |m| m.spacing[0] = 0.0,
            |m| m.origin[2] = f64::NAN,
            |m| m.block_edge = 0,
            |m| m.channels = 0,
            |m| m.frames += 1,
            |m| m.times = vec![1.0],
            |m| m.times = vec![f64::NAN; m.frames as usize],
            |m| m.tolerance = -1.0,
            |m| m.range = (2.0, 1.0),
            |m| m.windows[1].first_frame += 1,
            |m| m.windows[0].levels.push(1),
            |m| m.windows[0].frames = 0,
            |m| m.windows[0].reached = f64::INFINITY,
            |m| m.windows[0].share = 1f64.next_up(),
            |m| m.windows[0].share = f64::NAN,
            |m| m.bound = Bound::Relative { floor: -1.0 },
            |m| m.bound = Bound::Relative { floor: f64::INFINITY },
            |m| m.bound = Bound::Sampled { samples: 0, seed: 7 },
            |m| m.windows.clear(),
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut metadata = metadata();
            change(&mut metadata);
            assert!(matches!(metadata.validate(), Err(Error::Invalid(_))), "change {number}");
        }
    }

    #[test]
    fn boxes_tile_the_grid() {
        let metadata = metadata();
        let boxes = (0..metadata.blocks_per_channel()).filter_map(|block| metadata.block_box(block));
        let voxels: u64 = boxes.map(|(_, size)| size.iter().product::<u64>()).sum();
        assert_eq!(voxels, metadata.dims.iter().product::<u64>());
        assert_eq!(metadata.block_box(metadata.blocks_per_channel()), None);
    }
}
