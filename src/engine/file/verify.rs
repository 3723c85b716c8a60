//! Verifies that a coefficient file is intact, and that it keeps its error bound.

use crate::file::CoefficientFile;
use crate::file::budget::blocks_within;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{join_ranges, magnitude};
use wavesplat_core::codec::bound;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::shifts::{CompensatedSum, allowed_sum};
use wavesplat_core::codec::{WindowCodec, lane_groups, load_lanes};
use wavesplat_core::source::{CHANNELS, ColourWindow, FrameSource, FrameWindow, read_frames};
use wavesplat_core::wavelet::Lane;
use wavesplat_format::{BlockEntry, BlockId, LeafEntry, PartKind, Side};

/// The result of checking a file, with its source if one is given.
#[derive(Debug, Clone, Default, Serialize)]
pub struct VerifyReport {
    /// Blocks that were read and decoded.
    pub blocks: u64,
    /// Bytes of the file, all of them checked.
    pub bytes: u64,
    /// Places where it is damaged, and blocks that were lost before it was recovered.
    pub damaged: u64,
    /// Blocks that could not be checked, since what lists them is damaged.
    pub unchecked: u64,
    /// Blocks that are stored intact and could not be decoded, since a block above them is damaged.
    pub undecoded: u64,
    /// Descriptions of the first damage, at most [`MOST_NAMED`].
    pub damage: Vec<String>,
    /// The comparison of all intact blocks with the source.
    pub against: Option<Comparison>,
}

/// Damage that is named; the rest is counted.
pub const MOST_NAMED: usize = 1000;

impl VerifyReport {
    fn damage(&mut self, wrong: &Error) {
        self.damaged += 1;
        if self.damage.len() < MOST_NAMED {
            self.damage.push(match wrong {
                Error::CoefficientFile { source, .. } => source.to_string(),
                other => other.to_string(),
            });
        }
    }

    /// The result of a read; `None` if it found damage, which is noted. Other failures are errors.
    fn whole<T>(&mut self, read: Result<T>) -> Result<Option<T>> {
        match read {
            Ok(read) => Ok(Some(read)),
            Err(wrong) if matches!(&wrong, Error::CoefficientFile { source, .. } if !source.is_io()) => {
                self.damage(&wrong);
                Ok(None)
            }
            Err(other) => Err(other),
        }
    }
}

/// The result of a comparison with the source.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Comparison {
    /// Samples compared.
    pub samples: u64,
    /// Largest error of a sample, as it is extracted and as it is splatted, rounded up.
    pub largest_error: f64,
    /// Root of the mean squared error over all samples that are not missing.
    pub rms_error: f64,
    /// Missing samples, found missing and with the same bytes in both.
    pub missing: u64,
    /// The largest share of its bound that a series uses, in the bound's own measure; more than 1 is outside.
    pub largest_share_of_bound: f64,
    /// Where that was, if there was any error: the worst sample of the series.
    pub worst: Option<SampleLocation>,
    /// Series (of a voxel in a window) outside the bound.
    pub series_outside: u64,
    /// Samples and sums of blocks' frames that do not keep what the file [keeps](wavesplat_format::Keep), and windows beyond the source's
    /// extremes.
    pub not_kept: u64,
    /// The first of them, or the beginning of the block or window.
    pub first_not_kept: Option<SampleLocation>,
    /// Blocks with an error or a value beyond what the directory or the window's record states.
    pub blocks_beyond_stated: u64,
    /// The first of them.
    pub first_beyond: Option<BlockPlace>,
    #[serde(skip)]
    squares: f64,
    /// The range of the source's samples.
    #[serde(skip)]
    source: Option<(f64, f64)>,
}

/// A block of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct BlockPlace {
    /// The window, counted from 0.
    pub window: u32,
    /// The block in it, x fastest.
    pub block: u32,
    /// Its channel, if the file has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<&'static str>,
}

/// A sample of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SampleLocation {
    /// The frame, counted from the file's first.
    pub frame: usize,
    /// The voxel: x, y, z, counted from the file's first.
    pub voxel: [usize; 3],
    /// Its channel, if the file has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<&'static str>,
}

impl std::fmt::Display for SampleLocation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.voxel;
        write!(f, "frame {}, x {x}, y {y}, z {z}", self.frame)?;
        self.channel.map_or(Ok(()), |channel| write!(f, ", {channel}"))
    }
}

impl Comparison {
    fn join(self, other: Self) -> Self {
        let worse = other.largest_share_of_bound > self.largest_share_of_bound;
        Self {
            worst: if worse { other.worst } else { self.worst },
            samples: self.samples + other.samples,
            largest_error: self.largest_error.max(other.largest_error),
            rms_error: 0.0,
            missing: self.missing + other.missing,
            largest_share_of_bound: self.largest_share_of_bound.max(other.largest_share_of_bound),
            series_outside: self.series_outside + other.series_outside,
            not_kept: self.not_kept + other.not_kept,
            first_not_kept: self.first_not_kept.or(other.first_not_kept),
            blocks_beyond_stated: self.blocks_beyond_stated + other.blocks_beyond_stated,
            first_beyond: self.first_beyond.or(other.first_beyond),
            squares: self.squares + other.squares,
            source: self.source.zip(other.source).map(|(a, b)| join_ranges(a, b)).or(self.source).or(other.source),
        }
    }
}

/// Checks every byte of the file, also after finding damage, and with a source every sample. The source must have the
/// frames and the region that were converted. `memory` is the number of bytes that may be allocated.
///
/// # Errors
/// `memory` is too small for a block, the source has another shape, or something cannot be read.
pub fn verify(
    file: &CoefficientFile,
    mut source: Option<&mut dyn FrameSource>,
    memory: usize,
    progress: &dyn Progress,
) -> Result<VerifyReport> {
    progress.start(Some(file.metadata().blocks()));
    if let Some(source) = &source {
        same_shape(file, *source)?;
    }
    let held = source.as_ref().map_or(0, |source| source.archive().memory);
    file.limit_shared(memory);
    let block = bytes_of_block(file, source.is_some());
    let at_once = blocks_within(memory, held, |memory| file.shared_bytes(memory), block, "verifying")?;
    let mut check = Check::new(file, at_once);
    file.check_structure(&mut |wrong| check.report.damage(&wrong))?;
    for window in 0..file.metadata().windows.len() as u32 {
        let range = file.window_range(window);
        let frames = source.as_mut().map(|s| s.window(range.start, range.len())).transpose()?;
        if let Some(frames) = frames.as_ref().filter(|f| f.frames() < range.len()) {
            let what = format!("ends after {} frames, {} were converted", range.start + frames.frames(), file.frames());
            return Err(Error::input(frames.name(0), what));
        }
        check.window(window, frames.as_deref(), progress)?;
        frames.map_or(Ok(()), |frames| frames.check_unchanged())?;
    }
    file.check_unchanged()?;
    progress.finish();
    Ok(check.finished(source.is_some()))
}

/// A check of a file, and what it has found so far.
struct Check<'a> {
    file: &'a CoefficientFile,
    /// Blocks that are decoded together.
    at_once: usize,
    report: VerifyReport,
    all: Comparison,
    /// Blocks of the window above others that are damaged, or begin with the nodes of one that is.
    damaged: BTreeSet<BlockId>,
    /// The bytes of a remote file before this one were fetched.
    fetched: u64,
}

impl<'a> Check<'a> {
    fn new(file: &'a CoefficientFile, at_once: usize) -> Self {
        let report = VerifyReport { bytes: file.bytes(), ..VerifyReport::default() };
        Self { file, at_once, report, all: Comparison::default(), damaged: BTreeSet::new(), fetched: 0 }
    }

    fn window(&mut self, window: u32, source: Option<&dyn FrameWindow>, progress: &dyn Progress) -> Result<()> {
        let codec = self.file.codec(window)?;
        self.damaged.clear();
        self.all.source = None;
        for leaf in self.file.leaves(window) {
            let coarse = (leaf.tier > 0).then(|| codec.at(leaf.tier, 0));
            self.leaf(leaf, coarse.as_ref().unwrap_or(&codec), source)?;
            progress.advance(leaf.count.into());
        }
        self.range(window, &codec);
        Ok(())
    }

    /// Checks that the range to which decoded samples are clamped lies in that of the source's.
    fn range(&mut self, window: u32, codec: &WindowCodec) {
        let is_whole = self.report.damaged == 0 && self.report.unchecked == 0 && self.file.colour_transform().is_none();
        let Some(((lo, hi), source)) = codec.clip.zip(self.all.source).filter(|_| is_whole) else { return };
        if lo < source.0 || hi > source.1 {
            let frame = self.file.window_range(window).start;
            let first = SampleLocation { frame, voxel: [0; 3], channel: None };
            self.all.not_kept += 1;
            self.all.first_not_kept = self.all.first_not_kept.or(Some(first));
        }
    }

    fn leaf(&mut self, leaf: &LeafEntry, codec: &WindowCodec, source: Option<&dyn FrameWindow>) -> Result<()> {
        if leaf.data_offset >= self.fetched {
            self.fetched = self.file.fetch_on(leaf.data_offset)?;
        }
        let Some(entries) = self.report.whole(self.file.leaf(leaf))? else {
            self.report.unchecked += u64::from(leaf.count);
            self.damaged.extend(leaf.ids().filter(|id| id.tier > 0));
            return self.file.check_leaf_end(leaf, &mut |wrong| self.report.damage(&wrong));
        };
        let mut at = leaf.data_offset;
        for entries in entries.chunks(self.at_once) {
            self.file.fetch_whole(entries)?;
            at = self.file.check_blocks(at, entries, &mut |wrong| self.report.damage(&wrong))?;
            self.blocks(entries, codec, source)?;
        }
        self.file.check_leaf_end(leaf, &mut |wrong| self.report.damage(&wrong))
    }

    /// Checks the parts of some blocks. Those that begin with damaged nodes are not decoded.
    fn blocks(&mut self, entries: &[BlockEntry], codec: &WindowCodec, source: Option<&dyn FrameWindow>) -> Result<()> {
        let file = self.file;
        let begins_damaged =
            |entry: &&BlockEntry| entry.block_above(file.metadata()).is_some_and(|above| self.damaged.contains(&above));
        let (below, whole): (Vec<_>, Vec<_>) = entries.iter().partition(begins_damaged);
        let stored = |entry: &&BlockEntry| file.reader.check_stored(entry).map_err(|e| file.failed(e));
        for found in below.par_iter().map(stored).collect::<Vec<_>>() {
            self.report.undecoded += u64::from(self.report.whole(found)?.is_some());
        }
        self.damaged.extend(below.iter().map(|entry| entry.id).filter(|id| id.tier > 0));
        self.report.blocks += whole.len() as u64;
        let wanted = vec![true; codec.basis.coefficients()];
        let mut checked = Vec::new();
        for group in file.by_shared(whole) {
            _ = file.decode_shared(codec, group.iter().copied(), &wanted); // damaged blocks above were reported before
            let check = |entry: &&BlockEntry| (entry.id, check_block(file, codec, entry, source));
            checked.extend(group.par_iter().map(check).collect::<Vec<_>>());
        }
        checked.sort_by_key(|(id, _)| *id); // so that nothing depends on the groups
        for (id, found) in checked {
            match self.report.whole(found)? {
                Some(found) => self.all = self.all.join(found),
                None => self.damaged.extend(Some(id).filter(|id| id.tier > 0)),
            }
        }
        Ok(())
    }

    fn finished(self, is_compared: bool) -> VerifyReport {
        let Self { report, all, .. } = self;
        let rms_error = (all.squares / all.samples.saturating_sub(all.missing).max(1) as f64).sqrt();
        VerifyReport { against: is_compared.then_some(Comparison { rms_error, ..all }), ..report }
    }
}

/// Bytes to check a block, and to compare it: the samples of the source, also before they became colours, and the
/// extracted ones, and the splatted values.
fn bytes_of_block(file: &CoefficientFile, is_compared: bool) -> usize {
    let compared = file.of_source().0.size() + 2 * file.sample().size() + size_of::<f64>();
    let compared = compared + if file.keeps_sides() { size_of::<f64>() } else { 0 };
    file.block_bytes() + if is_compared { file.largest_block() * compared } else { 0 }
}

fn same_shape(file: &CoefficientFile, source: &dyn FrameSource) -> Result<()> {
    let (a, b) = (source.archive(), file);
    let (sample, _) = file.of_source();
    if a.grid.dims != b.grid.dims || a.sample != sample || a.frames.is_some_and(|f| f != b.frames()) {
        let [x, y, z] = a.grid.dims;
        let [fx, fy, fz] = b.grid.dims;
        let frames = a.frames.map_or("unknown".into(), |f| f.to_string());
        let source = format!("{frames} frames of {x}x{y}x{z} {} samples", a.sample);
        let what = format!("{source}, but the file holds {} of {fx}x{fy}x{fz} {sample}", b.frames());
        return Err(Error::setting("against", Note::with(what, Remedy::ChooseFrames)));
    }
    Ok(())
}

/// Decodes a block, which checks all its parts, and compares it with the source, if there is one.
fn check_block(
    file: &CoefficientFile,
    codec: &WindowCodec,
    entry: &BlockEntry,
    source: Option<&dyn FrameWindow>,
) -> Result<Comparison> {
    let block = file.block(codec, entry, &vec![true; codec.basis.coefficients()])?;
    check_coefficients(file, entry, &block, codec)?;
    let Some(source) = source.filter(|_| entry.id.tier == 0) else { return Ok(Comparison::default()) };
    let region = file.blocks.region(entry.id.block as usize);
    let original = original(file, source, codec, entry, &region)?;
    let first_frame = file.window_range(entry.id.window).start;
    let channel = file.colour_transform().and_then(|_| CHANNELS.get(usize::from(entry.id.channel)).copied());
    let place =
        |frame: usize, voxel: usize| SampleLocation { frame: first_frame + frame, voxel: region.voxel(voxel), channel };
    let (mut found, (lo, hi)) = compare(codec, &original, &block, place);
    let stated = entry.stats.reached.min(file.metadata().windows[entry.id.window as usize].reached);
    if found.largest_error > stated || lo < entry.stats.min || hi > entry.stats.max {
        found.blocks_beyond_stated = 1;
        found.first_beyond = Some(BlockPlace { window: entry.id.window, block: entry.id.block, channel });
    }
    Ok(found)
}

/// The samples of a block as they were coded.
fn original(
    file: &CoefficientFile,
    source: &dyn FrameWindow,
    codec: &WindowCodec,
    entry: &BlockEntry,
    region: &Region,
) -> Result<Vec<u8>> {
    let frames = 0..codec.frames();
    let Some(colour_transform) = file.colour_transform() else {
        return read_frames(source, frames, region, codec.sample);
    };
    let channel = ColourWindow { window: source, colour_transform, channel: entry.id.channel.into() };
    read_frames(&channel, frames, region, codec.sample)
}

/// Checks that no coefficient is larger than the directory states; skipping of parts relies on this.
fn check_coefficients(file: &CoefficientFile, entry: &BlockEntry, block: &Block, codec: &WindowCodec) -> Result<()> {
    if entry.parts.iter().all(|part| !matches!(part.kind, PartKind::Level(_))) {
        return Ok(());
    }
    let largest_of_parts = match entry.id.tier {
        0 => block.largest(codec, &block.field(codec)),
        _ => block.largest(codec, &*file.field(codec, entry.id, vec![true; codec.basis.coefficients()])?),
    };
    for part in &entry.parts {
        let PartKind::Level(level) = part.kind else { continue };
        let largest = largest_of_parts[usize::from(level)];
        if largest > part.stats.largest {
            let what =
                format!("{} holds {largest:e}, larger than the directory says: {:e}", entry.id, part.stats.largest);
            return Err(file.contradiction(what));
        }
    }
    Ok(())
}

/// Compares the samples of a block, in the order `frame * voxels + voxel`; `place(frame, voxel)` is the place of a
/// sample in messages. Also returns the range of the extracted samples that are not missing.
fn compare(
    codec: &WindowCodec,
    original: &[u8],
    decoded: &Block,
    place: impl Fn(usize, usize) -> SampleLocation,
) -> (Comparison, (f64, f64)) {
    let size = codec.sample.size();
    let samples = original.len() / size;
    let voxels = samples / codec.frames();
    let (bytes, splatted) = decoded.samples_and_values(codec);
    let same = |i: usize| original[i * size..(i + 1) * size] == bytes[i * size..(i + 1) * size];
    let mut found = Comparison { samples: samples as u64, ..Comparison::default() };
    let (mut missing, mut range) = (0, (f64::INFINITY, f64::NEG_INFINITY));
    let (mut not_kept, mut first_not_kept, mut of_source) = (0, None, range);
    let mut sums = vec![FrameSum::default(); codec.frames()];
    // The error of a sample, and what is allowed; none if it is missing in both.
    let mut compared = |i: usize, source: f64, extracted: f64| {
        if codec.is_missing(source) {
            missing += u64::from(same(i));
            return (!same(i)).then_some((f64::INFINITY, 0.0));
        }
        range = join_ranges(range, (extracted, extracted));
        let all = [splatted[i], extracted];
        if codec.sides.iter().any(|value| all.iter().any(|s| Side::of(*s, *value) != Side::of(source, *value))) {
            not_kept += 1;
            first_not_kept = first_not_kept.or(Some(place(i / voxels, i % voxels)));
        }
        of_source = join_ranges(of_source, (source, source));
        if codec.sums {
            sums[i / voxels].add(extracted - source);
        }
        Some((codec.error(splatted[i], extracted, source), codec.bound.allowed(source)))
    };
    let lanes = vec![Lane::default(); codec.frames()];
    let (mut source, mut extracted, mut errors) = (lanes.clone(), lanes, Vec::new());
    for (first, count) in lane_groups(voxels) {
        load_lanes(codec, original, first, count, voxels, &mut source);
        load_lanes(codec, &bytes, first, count, voxels, &mut extracted);
        for lane in 0..count {
            let voxel = first + lane;
            errors.clear();
            errors.extend((0..codec.frames()).filter_map(|frame| {
                let found = compared(frame * voxels + voxel, source[frame][lane], extracted[frame][lane]);
                found.map(|(error, allowed)| FrameError { frame, error, allowed })
            }));
            add_series(codec, &errors, |frame| place(frame, voxel), &mut found);
        }
    }
    for (frame, sum) in sums.iter().enumerate().filter(|_| codec.sums) {
        if !sum.is_kept(codec, magnitude(of_source)) {
            not_kept += 1;
            first_not_kept = first_not_kept.or(Some(place(frame, 0)));
        }
    }
    found.missing = missing;
    (found.not_kept, found.first_not_kept, found.source) = (not_kept, first_not_kept, Some(of_source));
    (found, range)
}

/// The errors of the samples of a block in a frame.
#[derive(Debug, Clone, Copy, Default)]
struct FrameSum {
    errors: CompensatedSum,
    samples: usize,
}

impl FrameSum {
    fn add(&mut self, error: f64) {
        self.errors.add(error);
        self.samples += 1;
    }

    /// Whether the sum of the samples is kept; the largest of the block has this magnitude.
    fn is_kept(&self, codec: &WindowCodec, magnitude: f64) -> bool {
        self.errors.total().abs() <= allowed_sum(codec.sample, magnitude, codec.bound.delta, self.samples)
    }
}

/// The error of a sample in a frame of the window, and what is allowed.
struct FrameError {
    frame: usize,
    error: f64,
    allowed: f64,
}

/// Adds the errors of a series. Samples that are missing in both have none.
fn add_series(
    codec: &WindowCodec,
    errors: &[FrameError],
    place: impl Fn(usize) -> SampleLocation,
    found: &mut Comparison,
) {
    let pairs = || errors.iter().map(|e| (e.error, e.allowed));
    let largest = pairs().fold(0.0, |largest, (e, _)| e.max(largest));
    found.largest_error = found.largest_error.max(largest);
    found.squares += pairs().map(|(e, _)| e * e).sum::<f64>();
    let holds = codec.bound.holds(pairs());
    found.series_outside += u64::from(!holds);
    let share = codec.bound.share(pairs());
    let share = if holds { share.min(1.0) } else { share }; // rounded up beyond what holds
    if share > found.largest_share_of_bound {
        found.largest_share_of_bound = share;
        let shares = errors.iter().map(|e| (e.frame, bound::share(e.error, e.allowed)));
        found.worst = shares.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(frame, _)| place(frame));
    }
}
