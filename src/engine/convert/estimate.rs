//! Estimates the size of a coefficient file by coding some blocks of some windows.

use super::coded_input::CodedInput;
use super::gather::WindowReader;
use super::plan::check_keep;
use super::record::window_record;
use super::spread::evenly;
use super::variation::Variation;
use super::workers::{Encoders, encode_together};
use super::{ConvertConfig, Plan, WindowJob, WindowsDone, bug};
use serde::Serialize;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::{Arc, Mutex};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::BlockGrid;
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{self, join_ranges};
use wavesplat_core::codec;
use wavesplat_core::codec::block_with_ghosts::BlockWithGhosts;
use wavesplat_core::codec::bound::range_bound;
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::derived::{Computed, DerivedErrors, ResultErrors};
use wavesplat_core::codec::encode::{Encoded, Encoder};
use wavesplat_core::codec::scheme::Scheme;
use wavesplat_core::source::scan::{Scan, scan_frame};
use wavesplat_core::source::{Archive, FrameSource, FrameWindow, read_frames_into};
use wavesplat_format::{BlockId, Keep};

/// The largest number of blocks coded in a window, and of windows.
const BLOCKS: usize = 24;
const WINDOWS: usize = 3;

/// The smallest number of blocks coded in a window, if it has them.
const LEAST_BLOCKS: usize = 4;

/// Archives of at most this many samples are estimated with the same care for every tolerance. For larger ones all
/// estimates together code no more blocks than a conversion.
const FEW_SAMPLES: usize = 1 << 22;

/// The estimated size of an archive's coefficient file.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Bytes of the coefficient file.
    pub bytes: u64,
    /// The compression ratio: bytes of the samples divided by `bytes`.
    pub ratio: f64,
    /// The tolerance.
    pub tolerance: f64,
    /// The error that it allows, in the samples' unit.
    pub error: f64,
    /// Share of the changing voxels of the coded blocks whose standard deviation over a window's frames is less than
    /// this error; `None` if no voxel changes.
    pub lost: Option<f64>,
    /// The value range that it refers to, from a few frames of each coded window and the last frame.
    pub range: (f64, f64),
    /// Blocks that were coded in each window.
    pub blocks: usize,
    /// Windows with coded blocks.
    pub windows: usize,
    /// Errors of what is computed from the samples of the coded blocks if these keep only their bound; `None` of colours.
    pub results: Option<EstimatedErrors>,
    /// Bytes of the coefficient file with what is to be kept; `None` if nothing is.
    pub kept_bytes: Option<u64>,
}

/// Errors of what is computed from decoded samples.
#[derive(Debug, Clone, Serialize)]
pub struct EstimatedErrors {
    /// The root mean square of the errors of differences between frames, as a share of that of the differences; `None` if these are 0.
    pub difference: Option<f64>,
    /// The same of gradients by central differences.
    pub gradient: Option<f64>,
    /// The same of Laplacians.
    pub laplacian: Option<f64>,
    /// The largest error of the mean of a frame of a block, in the samples' unit.
    pub mean: f64,
    /// How far decoded samples lie beyond the extremes of a frame of a block, at most, in the samples' unit.
    pub overshoot: f64,
    /// For each side to be kept, the edges between neighbours that the isosurface crosses in only one of source and decoded samples, as a
    /// share of those that it crosses in the source; `None` if it crosses none.
    pub sides: Vec<Option<f64>>,
}

impl EstimatedErrors {
    pub(super) fn new(of: &DerivedErrors) -> Self {
        let [difference, gradient, laplacian] = [of.difference, of.gradient, of.laplacian].map(ResultErrors::share);
        let sides = of.crossings.iter().map(|crossings| crossings.share()).collect();
        Self { difference, gradient, laplacian, mean: of.mean, overshoot: of.overshoot, sides }
    }
}

/// Converts some blocks, spread over the volume and over time, and scales their size to the whole archive, for several
/// configurations, which differ only in their tolerance. For a bound that refers to a range. What they keep is estimated beside files
/// that keep nothing.
///
/// # Errors
/// Those of a conversion; also an error if the source is a stream.
pub fn estimates(
    source: &mut dyn FrameSource,
    configs: &[ConvertConfig],
    progress: &dyn Progress,
) -> Result<Vec<Estimate>> {
    let Some(config) = configs.first() else { return Ok(Vec::new()) };
    let source_archive = source.archive().clone();
    let Some(frames) = source_archive.frames.filter(|frames| *frames > 0) else {
        return Err(Error::path(
            STANDARD,
            "an estimate needs frames that can be read more than once, not standard input",
        ));
    };
    check_keep(&CodedInput::new(config, &source_archive))?;
    let source_archive = Archive { description: None, ..source_archive }; // it is not of some blocks
    let first = CodedInput::new(config, &source_archive);
    let plan = Plan::new(&first)?;
    let windows = some_windows(frames, first.config.window);
    let is_rough = source_archive.grid.whole().voxels().saturating_mul(frames) > FEW_SAMPLES;
    let all = plan.blocks.len().saturating_mul(frames.div_ceil(first.config.window));
    let runs = windows.len() * configs.len() * if config.keep.is_empty() { 1 } else { 2 };
    let most = if is_rough { blocks_of_window(all, runs) } else { BLOCKS };
    let most = if plan.tiers > 0 { (most / 2).max(LEAST_BLOCKS) } else { most }; // the blocks above are coded, too
    let blocks = some_blocks(&plan.blocks, most);
    progress.start(Some(runs as u64));
    let read = FramesRead {
        archive: &source_archive,
        missing_value: first.config.missing_value,
        plan: &plan,
        blocks: &blocks,
    };
    let (found, variation) = read.range(source, &windows)?;
    let mut scheme = None;
    let mut estimated = |config: &ConvertConfig| {
        let mut input = CodedInput::new(config, &source_archive);
        let asked = input.clone();
        let plan = Plan::new(&asked)?;
        let range = *input.config.range.get_or_insert(found);
        let (config, archive) = (&input.config, &input.archive);
        let sides = config.keep.sides.clone();
        let plain = CodedInput { config: ConvertConfig { keep: Keep::default(), ..config.clone() }, ..input.clone() };
        let computed = Computed { spacing: archive.grid.spacing, values: sides };
        let coded =
            BlocksCoded { is_rough, computed: Some(computed), ..BlocksCoded::new(&plain, &plan, &blocks, found) };
        let bytes = coded.bytes(source, &windows, frames, &mut scheme, progress)?;
        let results = coded.derived.into_inner().unwrap_or_default();
        let results = input.colour_transform.is_none().then(|| EstimatedErrors::new(&results));
        let kept_bytes = match config.keep.is_empty() {
            true => None,
            false => {
                let coded = BlocksCoded { is_rough, ..BlocksCoded::new(&input, &plan, &blocks, found) };
                Some(coded.bytes(source, &windows, frames, &mut scheme, progress)? as u64)
            }
        };
        let raw = archive.grid.whole().voxels() as f64 * frames as f64 * source_archive.sample.size() as f64;
        let error = range_bound(config.tolerance, range);
        let lost = variation.share_below(error).filter(|_| input.colour_transform.is_none());
        let (ratio, tolerance) = (raw / bytes.max(1.0), config.tolerance);
        let bytes = bytes as u64;
        let (blocks, windows) = (blocks.len(), windows.len());
        Ok(Estimate { bytes, ratio, tolerance, error, lost, range, blocks, windows, results, kept_bytes })
    };
    let estimates = configs.iter().map(&mut estimated).collect::<Result<Vec<_>>>();
    codec::release_spare();
    let estimates = estimates?;
    progress.finish();
    Ok(estimates)
}

/// The number of blocks to code in each of some windows, if those of an archive are `all`.
fn blocks_of_window(all: usize, windows: usize) -> usize {
    (all / windows.max(1)).clamp(LEAST_BLOCKS, BLOCKS)
}

/// All blocks if they are few, else up to `most`, spread evenly over the volume.
pub(super) fn some_blocks(blocks: &BlockGrid, most: usize) -> Vec<usize> {
    if blocks.len() <= most {
        return (0..blocks.len()).collect();
    }
    let [nx, ny, nz] = blocks.counts();
    let block = |number| {
        let [x, y, z] = evenly(number, [nx, ny, nz]);
        x + nx * (y + ny * z)
    };
    (0..most).map(block).collect::<BTreeSet<_>>().into_iter().collect()
}

/// The frames of all windows if they are few, else of some full ones, evenly spaced.
fn some_windows(frames: usize, window: usize) -> Vec<Range<usize>> {
    let all = frames.div_ceil(window);
    let full = if all <= WINDOWS { all } else { frames / window };
    let count = full.min(WINDOWS);
    let firsts = (0..count).map(|i| (2 * i + 1) * full / (2 * count) * window);
    firsts.map(|first| first..frames.min(first + window)).collect()
}

/// The frames that are read to find a value range.
struct FramesRead<'a> {
    archive: &'a Archive,
    missing_value: Option<f64>,
    plan: &'a Plan<'a>,
    /// The coded blocks.
    blocks: &'a [usize],
}

impl FramesRead<'_> {
    /// The value range of the last frame and, in each window, of the first frame and of those with the least and the
    /// largest sample of the coded blocks.
    /// Also how much voxels of the coded blocks vary.
    fn range(&self, source: &mut dyn FrameSource, windows: &[Range<usize>]) -> Result<((f64, f64), Variation)> {
        let (mut range, mut variation) = (Scan::NOTHING.range, Variation::default());
        for frames in windows {
            let window = source.window(frames.start, frames.len())?;
            for frame in self.extreme_frames(window.as_ref(), &mut variation)? {
                range = join_ranges(range, self.range_of_frame(window.as_ref(), frame)?);
            }
        }
        let last = source.window(self.archive.frames.unwrap_or(1) - 1, 1)?;
        range = join_ranges(range, self.range_of_frame(last.as_ref(), 0)?);
        Ok((if range.0 <= range.1 { range } else { (0.0, 0.0) }, variation))
    }

    /// The first frame of a window, and the frames with the least and the largest sample of the coded blocks.
    fn extreme_frames(&self, window: &dyn FrameWindow, variation: &mut Variation) -> Result<BTreeSet<usize>> {
        let mut ranges = vec![Scan::NOTHING.range; window.frames()];
        for (number, block) in self.blocks.iter().enumerate() {
            let (region, ty) = (self.plan.blocks.region(*block), self.archive.sample);
            let mut samples = Buffer::with_len(window.frames() * region.voxels() * ty.size());
            read_frames_into(window, 0..window.frames(), &region, &mut samples)?;
            let extent = BlockWithGhosts { size: region.dims(), known: region.dims() };
            variation.add_block(number, self.blocks.len(), &extent, ty, self.missing_value, &samples);
            for (range, frame) in ranges.iter_mut().zip(samples.chunks_exact(region.voxels() * ty.size())) {
                *range = join_ranges(*range, sample::range_of_present(ty, frame, self.missing_value, |_| {}));
            }
        }
        let least = (0..ranges.len()).min_by(|a, b| ranges[*a].0.total_cmp(&ranges[*b].0));
        let largest = (0..ranges.len()).max_by(|a, b| ranges[*a].1.total_cmp(&ranges[*b].1));
        Ok([0].into_iter().chain(least).chain(largest).collect())
    }

    fn range_of_frame(&self, window: &dyn FrameWindow, frame: usize) -> Result<(f64, f64)> {
        let Archive { grid, sample, .. } = self.archive;
        Ok(scan_frame(Scan::NOTHING, window, frame, grid, *sample, self.missing_value)?.range)
    }
}

/// The blocks that are coded, as those of a file.
struct BlocksCoded<'a> {
    /// With the range that was found, if none is given.
    input: &'a CodedInput,
    plan: &'a Plan<'a>,
    blocks: &'a [usize],
    /// The value range that was found.
    range: (f64, f64),
    /// Whether schemes are chosen with less care.
    is_rough: bool,
    encoders: Encoders,
    /// Results whose errors are measured.
    computed: Option<Computed>,
    /// The errors measured so far.
    derived: Mutex<DerivedErrors>,
}

/// The compressed share of a leaf of the directory, as measured on files of many kinds.
const LEAF_SHARE: f64 = 0.5;

impl<'a> BlocksCoded<'a> {
    fn new(input: &'a CodedInput, plan: &'a Plan<'a>, blocks: &'a [usize], range: (f64, f64)) -> Self {
        let (encoders, derived) = (Encoders::default(), Mutex::default());
        Self { input, plan, blocks, range, is_rough: false, encoders, computed: None, derived }
    }

    /// The bytes of a file of all `frames`, from those of some blocks in some windows. Rough choices begin with `scheme`, and leave
    /// the last one.
    fn bytes(
        &self,
        source: &mut dyn FrameSource,
        windows: &[Range<usize>],
        frames: usize,
        scheme: &mut Option<Scheme>,
        progress: &dyn Progress,
    ) -> Result<f64> {
        let mut reader = WindowReader::new(self.input, self.plan, &WindowsDone::default());
        if self.is_rough {
            reader.choose_roughly(scheme.take());
        }
        let mut bytes = 0.0;
        for (index, frames) in windows.iter().enumerate() {
            let window = source.window(frames.start, frames.len())?;
            let job = Arc::new(reader.job(window.as_ref(), index, &Scan { range: self.range, ..Scan::NOTHING })?);
            *scheme = Some(Scheme::clone(&job.codec.scheme));
            bytes += window_record(&job).stored_len().map_err(bug)? as f64;
            for tier in (0..=job.codec.tiers()).rev() {
                bytes += self.bytes_of_tier(tier, &reader, window.as_ref(), &job)?;
            }
            progress.advance(1);
        }
        let coded: usize = windows.iter().map(ExactSizeIterator::len).sum();
        Ok(FIXED_BYTES + bytes * frames as f64 / coded as f64)
    }

    fn new_encoder(&self) -> wavesplat_format::Result<Encoder> {
        let encoder = Encoder::new(self.input.config.level)?;
        Ok(match &self.computed {
            Some(computed) => encoder.measuring(computed.clone()),
            None => encoder,
        })
    }

    /// The bytes of all blocks of a tier, if the others are like the coded ones.
    fn bytes_of_tier(
        &self,
        tier: u8,
        reader: &WindowReader<'_>,
        window: &dyn FrameWindow,
        job: &Arc<WindowJob>,
    ) -> Result<f64> {
        let (ids, mut bytes, mut voxels) = (self.ids(job.index, tier), 0.0, 0);
        for ids in ids.chunks(self.plan.room(&job.codec).flight) {
            let blocks = ids.iter().map(|id| reader.gather(window, job, *id)).collect::<Result<_>>()?;
            for Encoded { block, derived, .. } in
                encode_together(|| self.new_encoder(), self.plan, &self.encoders, job, blocks)?
            {
                if let (Some(derived), Ok(mut all)) = (derived, self.derived.lock()) {
                    *all = std::mem::take(&mut *all).join(&derived);
                }
                bytes += block.stored_len() as f64 + LEAF_SHARE * block.entry_len() as f64;
                voxels += self.plan.size(block.id).iter().product::<usize>();
            }
        }
        let all = self.plan.channels() * self.input.archive.grid.whole().voxels();
        Ok(bytes * all as f64 / voxels as f64)
    }

    /// The coded blocks of a tier: those that were chosen, or the ones above them.
    fn ids(&self, window: u32, tier: u8) -> Vec<BlockId> {
        let start = &self.plan.start;
        let above = |block: &usize| start.above_in(BlockId::new(window, 0, *block as u32), tier);
        let of_channel = self.blocks.iter().map(above).collect::<BTreeSet<_>>();
        let channels = 0..self.plan.channels() as u16;
        channels.flat_map(|channel| of_channel.iter().map(move |id| BlockId { channel, ..*id })).collect()
    }
}

/// Bytes of a file beside its windows.
const FIXED_BYTES: f64 = 1024.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_spread_evenly() {
        assert_eq!(some_blocks(&BlockGrid::cubes([30, 20, 10], 10), BLOCKS), [0, 1, 2, 3, 4, 5]);
        let blocks = some_blocks(&BlockGrid::cubes([100, 100, 100], 10), BLOCKS);
        assert!((20..=BLOCKS).contains(&blocks.len()) && blocks.is_sorted() && blocks[0] < 250 && blocks[19] >= 750);
        assert_eq!(some_blocks(&BlockGrid::cubes([100, 100, 100], 10), LEAST_BLOCKS).len(), LEAST_BLOCKS);
        assert_eq!(some_windows(70, 32), [0..32, 32..64, 64..70]);
        assert_eq!(some_windows(100, 32), [0..32, 32..64, 64..96]);
        assert_eq!(some_windows(640, 32), [96..128, 320..352, 512..544]);
    }

    #[test]
    fn estimates_together_code_no_more_blocks_than_a_conversion() {
        for all in [54, 200, 1000, 5000] {
            for windows in [2, 10, 15] {
                assert!(blocks_of_window(all, windows) * windows <= all.max(LEAST_BLOCKS * windows));
            }
        }
        assert_eq!((blocks_of_window(54, 2), blocks_of_window(54, 10), blocks_of_window(5000, 15)), (24, 5, BLOCKS));
    }
}
