//! The metadata record: grid, type, units, times, tolerance, windows, provenance.

use crate::bytes::{FieldWriter, ParseResult, ensure, finite_amount};
use crate::file_id::FileId;
use crate::header::{Features, HEADER};
use crate::keep::Keep;
use crate::limits::*;
use crate::pyramid::Packing;
use crate::record::{decode_exact, encode};
use crate::section::section_end;
use crate::window::{Window, WindowEnd, WindowRecord};
use crate::{BlockGeometry, BlockId, Error, Result, SampleType};
use bincode::{Decode, Encode};
use xxhash_rust::xxh3::xxh3_128;

/// The error measure that the tolerance bounds. New kinds are only appended.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub enum Bound {
    /// Every sample is within the window's `delta`.
    Pointwise,
    /// The root mean square of each series' errors is within the window's `delta`.
    Rms,
    /// The error of every sample v is within tolerance x max(|v|, floor); `delta` is the largest of these bounds in the window.
    Relative {
        /// Samples of smaller magnitude may have the error allowed at this magnitude; in units of the samples.
        floor: f64,
    },
    /// Like [`Bound::Rms`], but `delta` is ESTIMATED from images so that the relative error of their pixels is about the
    /// tolerance. This is an estimate, not a guarantee.
    Sampled {
        /// Random pixels on each of three faces.
        samples: u32,
        /// Seed of the random choice.
        seed: u64,
    },
}

impl Bound {
    /// The name used on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pointwise => "pointwise",
            Self::Rms => "rms",
            Self::Relative { .. } => "relative",
            Self::Sampled { .. } => "sampled",
        }
    }

    fn check(self) -> ParseResult {
        match self {
            Self::Relative { floor } => ensure(finite_amount(floor), || format!("invalid floor {floor}")),
            Self::Sampled { samples, .. } => ensure(samples > 0, || "a sampled bound with 0 samples".into()),
            Self::Pointwise | Self::Rms => Ok(()),
        }
    }
}

/// The metadata of an archive: everything except the samples.
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
    /// Number of channels, at least 1.
    pub channels: u16,
    /// Number of frames.
    pub frames: u64,
    /// Time of each frame. If empty, frames are identified by number.
    pub times: Vec<f64>,
    /// Name of the variable.
    pub variable: Option<String>,
    /// The error measure that the tolerance bounds.
    pub bound: Bound,
    /// The tolerance as requested.
    pub tolerance: f64,
    /// The value that marks a missing sample, in addition to NaN.
    pub missing_value: Option<f64>,
    /// The windows, in order from frame 0.
    pub windows: Vec<Window>,
    /// Provenance: names and values of settings, without paths.
    pub settings: Vec<(String, String)>,
    /// Name and version of the program that wrote the file.
    pub program: String,
}

impl Metadata {
    /// Encodes the record.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the metadata is invalid, [`Error::TooLarge`] if the record exceeds the limit.
    pub fn encode(&self) -> Result<Vec<u8>> {
        self.validate()?;
        let bytes = encode(self, "metadata").map_err(Error::Invalid)?;
        let (size, limit) = (bytes.len() as u64, MAX_METADATA as u64);
        if size > limit {
            return Err(Error::TooLarge { what: "bytes of metadata".into(), size, limit });
        }
        decode_exact::<Self>(&bytes, "metadata").map_err(Error::Invalid)?; // near the limit, decoding needs memory within it too
        Ok(bytes)
    }

    /// Decodes and validates a record that must take up all of `bytes`.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the reason.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        Self::parse(bytes).map_err(Error::Invalid)
    }

    pub(crate) fn parse(bytes: &[u8]) -> ParseResult<Self> {
        let metadata: Self = decode_exact(bytes, "metadata record")?;
        ensure(metadata.frames > 0, || "no frames".into())?;
        metadata.check()?;
        Ok(metadata)
    }

    /// Like [`Self::parse`], for the record in the start section.
    pub(crate) fn parse_start(bytes: &[u8]) -> ParseResult<Self> {
        let start: Self = decode_exact(bytes, "metadata record")?;
        ensure(start.frames == 0, || "the start section has frames".into())?;
        start.check()?;
        Ok(start)
    }

    /// The metadata that is known before the first frame: without frames, times and windows.
    pub fn start(&self) -> Self {
        let (frames, times, windows) = (0, Vec::new(), Vec::new());
        let Self { dims, spacing, origin, sample, block_edge, channels, bound, tolerance, missing_value, .. } = *self;
        let (variable, settings, program) = (self.variable.clone(), self.settings.clone(), self.program.clone());
        #[rustfmt::skip]
        let start = Self {
            dims, spacing, origin, sample, block_edge, channels, frames, times, variable, bound, tolerance, missing_value,
            windows, settings, program,
        };
        start
    }

    /// What decoded samples keep.
    pub fn keep(&self) -> Keep {
        Keep::of_settings(&self.settings)
    }

    /// The features that its windows have. Whether blocks list their values is not known from here.
    pub fn features(&self) -> Features {
        let nested = self.windows.iter().any(|window| window.packing() == Packing::Nested);
        let packing = if nested { Packing::Nested } else { Packing::Flat };
        let tiered = self.windows.iter().any(|window| window.tiers() > 0);
        let keep = self.keep();
        Features { packing, tiered, sided: !keep.sides.is_empty(), summed: keep.sum, ..Features::default() }
    }

    /// The id of the file that a conversion writes: XXH3-128 of the start record's bytes followed by the digest of the
    /// first window, and with any feature by the header's required features (FORMAT.md, section 3). The same settings and
    /// samples give the same id everywhere.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the metadata cannot be encoded.
    pub fn file_id(&self, first_digest: u64, features: Features) -> Result<FileId> {
        let mut bytes = self.start().encode()?;
        bytes.put_u64(first_digest);
        if features.bits() != 0 {
            bytes.put_u64(features.bits());
        }
        Ok(FileId(xxh3_128(&bytes).to_le_bytes()))
    }

    /// The offset at which the start section ends.
    pub(crate) fn start_end(&self) -> ParseResult<u64> {
        let record = self.start().encode().map_err(|e| e.to_string())?;
        Ok(section_end(HEADER as u64, record.len()))
    }

    /// The record of a window's section. Panics if there is no such window.
    pub fn window_record(&self, number: u32) -> WindowRecord {
        let window = self.windows[number as usize].without_totals();
        let first = window.first_frame as usize;
        let times = self.times.get(first..first + window.frames as usize).unwrap_or_default().to_vec();
        WindowRecord { number, window, times }
    }

    /// The record of a window's end. Panics if there is no such window.
    pub fn window_end(&self, number: u32) -> WindowEnd {
        WindowEnd::from_window(number, &self.windows[number as usize])
    }

    /// Adds a window; fails if it cannot be the next one.
    pub(crate) fn push(&mut self, record: WindowRecord, end: &WindowEnd) -> ParseResult {
        let WindowRecord { number, window, times } = record;
        let next = self.windows.len();
        ensure([number, end.number] == [next as u32; 2], || format!("window {number} instead of {next}"))?;
        let window = window.with_totals(end);
        self.check_window(next, &window, self.frames)?;
        let timed = times.is_empty() && self.times.is_empty()
            || times.len() == window.frames as usize && self.times.len() as u64 == self.frames;
        ensure(timed && times.iter().all(|t| t.is_finite()), || {
            "times that are not finite or are not given for every frame".into()
        })?;
        self.frames += u64::from(window.frames);
        self.times.extend(times);
        self.windows.push(window);
        Ok(())
    }

    /// Keeps only the first `windows` windows.
    pub(crate) fn truncate(&mut self, windows: usize) {
        self.windows.truncate(windows);
        self.frames = self.windows.iter().map(|window| u64::from(window.frames)).sum();
        self.times.truncate(self.frames as usize);
    }

    /// The value range that a pointwise or rms tolerance refers to: a given range, or the range of all frames.
    /// (inf, -inf) if there is none.
    pub fn range(&self) -> (f64, f64) {
        self.windows.last().map_or((f64::INFINITY, f64::NEG_INFINITY), |window| window.range)
    }

    /// Checks that the metadata is consistent and within the limits.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the reason.
    pub fn validate(&self) -> Result<()> {
        self.check().map_err(|what| Error::Invalid(format!("metadata: {what}")))
    }

    fn check(&self) -> ParseResult {
        self.check_grid()?;
        self.check_times()?;
        ensure(finite_amount(self.tolerance), || format!("invalid tolerance {}", self.tolerance))?;
        self.bound.check()?;
        let sides = self.keep().sides.len();
        ensure(sides <= MAX_SIDES, || format!("sides of {sides} values are kept, at most {MAX_SIDES}"))?;
        self.check_windows()
    }

    fn check_grid(&self) -> ParseResult {
        let sized = self.dims.iter().all(|d| (1..=MAX_DIM).contains(d));
        ensure(sized, || format!("dimensions {:?}: each must be 1 to {MAX_DIM}", self.dims))?;
        let spaced = self.spacing.iter().all(|s| s.is_finite() && *s > 0.0);
        ensure(spaced && self.origin.iter().all(|o| o.is_finite()), || "spacing or origin out of range".into())?;
        ensure((1..=MAX_CHANNELS).contains(&self.channels), || format!("{} channels", self.channels))?;
        ensure(self.block_edge > 0, || "a block edge of 0".into())?;
        let blocks = self.count_blocks(0).and_then(|n| u32::try_from(n).ok());
        ensure(blocks.is_some(), || "too many blocks in a window".into())
    }

    fn check_times(&self) -> ParseResult {
        ensure(self.frames <= MAX_FRAMES, || format!("{} frames, at most {MAX_FRAMES}", self.frames))?;
        let timed = self.times.is_empty() || self.times.len() as u64 == self.frames;
        ensure(timed, || format!("{} times for {} frames", self.times.len(), self.frames))?;
        ensure(self.times.iter().all(|t| t.is_finite()), || "a time that is not finite".into())
    }

    fn check_windows(&self) -> ParseResult {
        let mut next = 0u64;
        for (number, window) in self.windows.iter().enumerate() {
            self.check_window(number, window, next)?;
            next = next.saturating_add(window.frames.into());
        }
        ensure(next == self.frames, || format!("windows cover {next} of {} frames", self.frames))
    }

    /// Checks that `window` can have this number and start at frame `next`.
    fn check_window(&self, number: usize, window: &Window, next: u64) -> ParseResult {
        let place = |what: String| format!("window {number}: {what}");
        ensure(window.first_frame == next, || {
            place(format!("starts at frame {} instead of {next}", window.first_frame))
        })?;
        let voxels_in_all = self.dims.iter().fold(u64::from(self.channels), |n, d| n.saturating_mul(*d));
        let tiers = window.tiers() == 0 || self.block_edge.is_multiple_of(2);
        ensure(tiers, || place(format!("tiers of blocks of {} voxels a side", self.block_edge)))?;
        window.check(self.largest_box(), voxels_in_all).map_err(place)
    }

    /// Number of voxels in the largest box.
    fn largest_box(&self) -> u64 {
        let edge = u64::from(self.block_edge);
        self.dims.iter().fold(1, |voxels: u64, &dim| voxels.saturating_mul(dim.min(edge)))
    }

    /// Number of boxes of a tier along x, y, z.
    pub fn blocks_per_axis(&self, tier: u8) -> [u64; 3] {
        self.dims.map(|dim| dim.div_ceil(self.edge(tier).max(1)))
    }

    /// Voxels along each edge of the boxes of a tier.
    fn edge(&self, tier: u8) -> u64 {
        u64::from(self.block_edge) << tier.min(MAX_TIERS)
    }

    fn count_blocks(&self, tier: u8) -> Option<u64> {
        self.blocks_per_axis(tier).iter().try_fold(1, |count: u64, &blocks| count.checked_mul(blocks))
    }

    /// Number of blocks of a tier in one window and channel; meaningful for valid metadata.
    pub fn blocks_per_channel(&self, tier: u8) -> u32 {
        self.count_blocks(tier).and_then(|n| u32::try_from(n).ok()).unwrap_or(u32::MAX)
    }

    /// Number of tiers above the blocks of a window.
    pub fn tiers(&self, window: u32) -> u8 {
        self.windows.get(window as usize).map_or(0, Window::tiers)
    }

    /// Number of blocks in the whole archive, or `u64::MAX` on overflow.
    pub fn blocks(&self) -> u64 {
        let windows = 0..self.windows.len() as u32;
        windows.fold(0, |sum: u64, window| sum.saturating_add(self.blocks_of_window(window)))
    }

    /// Number of blocks in a window, of all tiers and channels.
    pub fn blocks_of_window(&self, window: u32) -> u64 {
        let tiers = 0..=self.tiers(window);
        tiers.map(|tier| u64::from(self.blocks_per_channel(tier))).sum::<u64>() * u64::from(self.channels)
    }

    /// The block of the next tier, whose box contains the block's box.
    pub fn above(&self, id: BlockId) -> BlockId {
        let tier = id.tier.saturating_add(1);
        let ([nx, ny, _], [of_x, of_y, _]) = (self.blocks_per_axis(id.tier), self.blocks_per_axis(tier));
        let block = u64::from(id.block);
        let [x, y, z] = [block % nx / 2, block / nx % ny / 2, block / nx / ny / 2];
        BlockId { block: (x + of_x * (y + of_y * z)) as u32, tier, ..id }
    }

    /// The block of a tier whose box contains a block's box.
    pub fn above_in(&self, mut id: BlockId, tier: u8) -> BlockId {
        while id.tier < tier {
            id = self.above(id);
        }
        id
    }

    /// Number of leaves that describe a window.
    pub(crate) fn leaves_of_window(&self, window: u32) -> u64 {
        let leaves = |tier| u64::from(self.blocks_per_channel(tier).div_ceil(BLOCKS_PER_LEAF));
        (0..=self.tiers(window)).map(leaves).sum::<u64>() * u64::from(self.channels)
    }

    /// First voxel and size of the box of a tier's block along x, y, z; `None` if the grid has no such block.
    pub fn block_box(&self, tier: u8, block: u32) -> Option<([u64; 3], [u64; 3])> {
        if block >= self.blocks_per_channel(tier) {
            return None;
        }
        let [nx, ny, _] = self.blocks_per_axis(tier);
        let (block, edge) = (u64::from(block), self.edge(tier));
        let first = [block % nx * edge, block / nx % ny * edge, block / nx / ny * edge];
        let size = std::array::from_fn(|axis| edge.min(self.dims[axis] - first[axis]));
        Some((first, size))
    }

    /// The sizes of a block; `None` if the archive has no such block.
    pub fn geometry(&self, id: BlockId) -> Option<BlockGeometry<'_>> {
        let window = self.windows.get(id.window as usize).filter(|_| id.channel < self.channels)?;
        let (_, size) = self.block_box(id.tier, id.block).filter(|_| id.tier <= window.tiers())?;
        let nodes = size.map(|n| n.div_ceil(1 << id.tier));
        usize::try_from(nodes.iter().product::<u64>()).ok()?;
        let (size, sample_size) = (size.map(|n| n as usize), self.sample.size());
        Some(BlockGeometry { size, window, sample_size, tier: id.tier })
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
        let changes: [Change; 22] = [
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
            |m| m.windows[1].range = (2.0, 1.0),
            |m| m.windows[0].coarseness = f64::NAN,
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
        let boxes = (0..metadata.blocks_per_channel(0)).filter_map(|block| metadata.block_box(0, block));
        let voxels: u64 = boxes.map(|(_, size)| size.iter().product::<u64>()).sum();
        assert_eq!(voxels, metadata.dims.iter().product::<u64>());
        assert_eq!(metadata.block_box(0, metadata.blocks_per_channel(0)), None);
    }
}
