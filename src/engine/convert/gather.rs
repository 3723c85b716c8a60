//! Prepares the windows of a source: scans them, chooses how they are coded, and gathers their blocks.

use super::candidates::SchemeSelector;
use super::coarse::CoarseBlocks;
use super::coded_input::{BRIGHTNESS, CodedInput};
use super::sampled::{self, Pixel};
use super::trial_boxes::most_samples;
use super::warnings::{self, Fill, Findings};
use super::{ConvertConfig, MissingPolicy, Plan, WindowJob, WindowsDone};
use crossbeam_channel::Sender;
use std::sync::Arc;
use std::time::{Duration, Instant};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::sample::{self, SampleType, join_ranges};
use wavesplat_core::codec::block_with_ghosts::BlockWithGhosts;
use wavesplat_core::codec::bound::{self, Bound, ErrorBound, SampleLimits};
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::scheme::Scheme;
use wavesplat_core::source::scan::{Scan, scan};
use wavesplat_core::source::{Archive, ColourWindow, FrameSource, FrameWindow, read_frames_into};
use wavesplat_format::{BlockId, Features, FileId, Packing, Window};

/// A block to encode. The last one of a window is sent only after its source was found unchanged.
#[derive(Debug)]
pub(super) struct NextBlock {
    pub(super) window: Arc<WindowJob>,
    pub(super) block: BlockSamples,
}

/// The samples of a block, frame by frame. Blocks of tier 0 have room behind them for the voxels that they are extended by.
#[derive(Debug)]
pub(super) struct BlockSamples {
    pub(super) id: BlockId,
    pub(super) samples: Buffer<u8>,
}

/// The samples that a scheme is chosen from are divided by this, if it need not be the best.
const ROUGH: usize = 4;

pub(super) struct WindowReader<'a> {
    /// Which of the conversions it is of.
    pub(super) conversion: usize,
    pub(super) config: &'a ConvertConfig,
    pub(super) plan: &'a Plan<'a>,
    /// The archive of the coded samples.
    pub(super) archive: &'a Archive,
    /// The pixels of a sampled bound.
    pixels: Vec<Pixel>,
    /// The range of the frames so far.
    range: Option<(f64, f64)>,
    id: Option<FileId>,
    /// The features of the file.
    features: Features,
    /// The result of scanning the samples.
    pub(super) findings: Findings,
    /// The scheme of the window before.
    scheme: Option<Scheme>,
    /// Whether schemes are chosen with less care, for an estimate.
    is_rough: bool,
    /// The number of frames in the file so far.
    pub(super) frames: u64,
    /// Frames of the file that precede the source's first frame.
    pub(super) before: u64,
}

impl<'a> WindowReader<'a> {
    pub(super) fn new(input: &'a CodedInput, plan: &'a Plan<'a>, done: &WindowsDone) -> Self {
        let CodedInput { config, archive, .. } = input;
        let pixels = match config.bound {
            Bound::Sampled { samples, seed } => sampled::pixels(archive.grid.dims, samples, seed),
            _ => Vec::new(),
        };
        let packing = if config.has_pyramids() { Packing::default() } else { Packing::Flat };
        let features = done.features.unwrap_or(Features {
            packing,
            described: archive.description.is_some(),
            tiered: plan.tiers > 0,
            listed: config.lists(),
            sided: !config.keep.sides.is_empty(),
            summed: config.keep.sum,
        });
        let (id, range, scheme) = (done.id, None, None);
        Self {
            conversion: 0,
            config,
            plan,
            archive,
            pixels,
            range,
            id,
            features,
            findings: Findings::default(),
            scheme,
            is_rough: false,
            frames: 0,
            before: 0,
        }
    }

    /// Chooses schemes from fewer samples, each beginning with the one before; the first with `scheme`.
    pub(super) fn choose_roughly(&mut self, scheme: Option<Scheme>) {
        (self.is_rough, self.scheme) = (true, scheme);
    }

    /// The next frames of the source, at most `count`; none at its end.
    pub(super) fn next(&self, source: &mut dyn FrameSource, count: usize) -> Result<Option<Box<dyn FrameWindow>>> {
        let first = self.first();
        let count = self.archive.frames.map_or(count, |all| count.min(all.saturating_sub(first)));
        if count == 0 {
            return Ok(None);
        }
        Ok(Some(source.window(first, count)?).filter(|window| window.frames() > 0))
    }

    /// The error if a source continues after a short last window that was already converted.
    pub(super) fn has_grown(&self, done: &WindowsDone) -> Error {
        let frames = self.frames;
        let what = format!("the input ended after {frames} frames and has grown");
        Error::changed(&done.name, Note::with(what, Remedy::AppendOrBeginAnew { frames }))
    }

    /// The error if a source has fewer frames than before.
    pub(super) fn ended(&self, done: &WindowsDone) -> Error {
        let had: u64 = done.windows.iter().map(|window| u64::from(window.frames)).sum();
        let what = format!("the input ends after {} frames; {} were converted before", self.frames, had);
        Error::changed(&done.name, what)
    }

    /// The number of the source's next frame.
    pub(super) fn first(&self) -> usize {
        (self.frames - self.before) as usize
    }

    /// Takes over a window's record as if the window had just been coded.
    pub(super) fn continue_after(&mut self, window: &Window) {
        self.range = Some(window.range).filter(|range| range.0 <= range.1 && self.config.range.is_none());
        self.scheme = Some(Scheme::from_window(window));
        self.frames += u64::from(window.frames);
    }

    /// Continues after a window that the file has; an error if its frames differ from the source's.
    pub(super) fn skip_done(&mut self, window: &dyn FrameWindow, known: &Window, done: &WindowsDone) -> Result<()> {
        let scan = self.scan(window)?;
        window.check_unchanged()?;
        if scan.digest != known.digest || window.frames() != known.frames as usize {
            let (first, end) = (known.first_frame, known.first_frame + u64::from(known.frames));
            let what =
                format!("frames {first}..{end} are not those that were converted before into {}", done.name.display());
            return Err(Error::changed(window.name(0), what));
        }
        self.continue_after(known);
        Ok(())
    }

    /// The file's id: that of the continued file, or a new one from the first window's digest.
    fn id(&mut self, digest: u64) -> Result<FileId> {
        let new =
            || self.plan.start.file_id(digest, self.features).map_err(|e| Error::setting("settings", e.to_string()));
        let id = self.id.map_or_else(new, Ok)?;
        self.id = Some(id);
        Ok(id)
    }

    /// Scans the samples of a window as they are read.
    fn scan(&self, window: &dyn FrameWindow) -> Result<Scan> {
        let plain = (self.archive.sample, self.config.missing_value);
        let (ty, missing_value) = self.plan.colour_transform.map_or(plain, |p| (p.sample, p.missing_value));
        scan(window, &self.archive.grid, ty, missing_value)
    }

    /// Scans a window and prepares its coding.
    pub(super) fn prepare(&mut self, window: &dyn FrameWindow, index: usize) -> Result<WindowJob> {
        let scan = self.scan(window)?;
        self.refuse_missing(window, self.first(), &scan)?;
        self.look_for_fill(window, &scan)?;
        self.job(window, index, &scan)
    }

    /// Fixes the error bound of a window and chooses its scheme, from what a scan saw. The source has its times.
    pub(super) fn job(&mut self, window: &dyn FrameWindow, index: usize, scan: &Scan) -> Result<WindowJob> {
        let config = self.config;
        let of_window = if self.plan.colour_transform.is_some() { BRIGHTNESS } else { scan.range };
        let range = self.range.map_or(of_window, |r| join_ranges(r, of_window));
        self.range = Some(range);
        let range = config.range.unwrap_or(range);
        let coloured = coloured(self.plan, window);
        let channels: Vec<&dyn FrameWindow> = match &coloured[..] {
            [] => vec![window],
            coloured => coloured.iter().map(|channel| channel as _).collect(),
        };
        let delta = self.delta(&channels, of_window, range)?;
        let Grid { dims, spacing, .. } = self.archive.grid;
        let limits = SampleLimits::new(&config.keep, dims, spacing);
        let promise = ErrorBound::new(config.bound, config.tolerance, delta).within(limits);
        let magnitude = sample::magnitude(of_window);
        let goes_on = self.is_rough || !index.is_multiple_of(config.chain);
        let before = self.scheme.as_ref().filter(|scheme| goes_on && scheme.pyramid.is_some());
        let most = most_samples(self.plan.blocks.region(0).voxels() * window.frames());
        let selector = SchemeSelector {
            config,
            archive: self.archive,
            channels: &channels,
            promise,
            magnitude,
            most: if self.is_rough { most / ROUGH } else { most },
            is_rough: self.is_rough,
            edge: self.plan.blocks.edges[0],
            packing: self.features.packing,
            lists: self.features.listed,
            tiers: if self.features.tiered { self.plan.tiers } else { 0 },
            before,
        };
        let mut codec = selector.choose()?;
        self.scheme = Some(Scheme::clone(&codec.scheme));
        codec.clip = Some(of_window).filter(|(lo, hi)| config.keep.range && lo <= hi);
        codec.sides = config.keep.sides.as_slice().into();
        codec.sums = config.keep.sum;
        self.findings.range = self.findings.range.map_or(Some(of_window), |seen| Some(join_ranges(seen, of_window)));
        let id = self.id(scan.digest)?;
        let index =
            u32::try_from(index).map_err(|_| Error::setting("window", "gives too many windows; take longer ones"))?;
        let first_frame = self.frames;
        self.frames += window.frames() as u64;
        let (times, coarse) = (Vec::new(), CoarseBlocks::new(self.plan.room(&codec).kept_above));
        let (conversion, features, digest) = (self.conversion, self.features, scan.digest);
        Ok(WindowJob { conversion, index, first_frame, id, features, codec, coarse, range, digest, times })
    }

    /// The delta of a window. `of_window` is the range of its samples, `range` that of all samples up to its end.
    fn delta(&self, channels: &[&dyn FrameWindow], of_window: (f64, f64), range: (f64, f64)) -> Result<f64> {
        let ConvertConfig { tolerance, missing_value, .. } = *self.config;
        let magnitude = sample::magnitude(of_window);
        match self.config.bound {
            Bound::Pointwise | Bound::Rms => Ok(bound::range_bound(tolerance, range)),
            Bound::Relative { floor } => Ok(bound::relative_bound(tolerance, floor, magnitude)),
            Bound::Sampled { .. } => {
                let Archive { ref grid, sample, .. } = *self.archive;
                let of_channel = |window: &&dyn FrameWindow| {
                    let view = sampled::View { window: *window, grid, sample, missing_value, magnitude };
                    view.bound(tolerance, &self.pixels)
                };
                let deltas = channels.iter().map(of_channel).collect::<Result<Vec<_>>>()?;
                // A channel that is black everywhere meets every bound, so it does not count.
                Ok(deltas.into_iter().filter(|delta| *delta > 0.0).reduce(f64::min).unwrap_or(0.0))
            }
        }
    }

    fn refuse_missing(&self, window: &dyn FrameWindow, first: usize, scan: &Scan) -> Result<()> {
        let (MissingPolicy::Error, Some((frame, voxel))) = (self.config.missing, scan.first_missing) else {
            return Ok(());
        };
        let [x, y, z] = self.archive.grid.whole().voxel(voxel);
        let what = format!(
            "frame {} has a missing value (NaN, infinite or as declared) at x {x}, y {y}, z {z}, the first of {} in \
             frames {first}..{}",
            first + frame,
            scan.missing,
            first + window.frames()
        );
        Err(Error::input(window.name(frame), Note::with(what, Remedy::MaskMissing)))
    }

    /// Notes a value that may mean "missing"; an error if it would leave nothing of the others.
    fn look_for_fill(&mut self, window: &dyn FrameWindow, scan: &Scan) -> Result<()> {
        let extreme = scan.extremes.extreme().filter(|_| self.plan.colour_transform.is_none());
        let Some(extreme) = extreme else { return Ok(()) };
        let ConvertConfig { bound, tolerance, range, refuse_fill, .. } = *self.config;
        let of_range = matches!(bound, Bound::Pointwise | Bound::Rms) && range.is_none() && refuse_fill;
        let range = self.range.map_or(scan.range, |r| join_ranges(r, scan.range));
        let allowed = of_range.then(|| bound::range_bound(tolerance, range));
        let samples = (self.archive.grid.whole().voxels() * window.frames()) as u64 - scan.missing;
        match warnings::fill(&extreme, samples, self.archive.sample, allowed) {
            Some(Fill::Refuse(note)) => return Err(Error::input(window.name(0), note)),
            Some(Fill::Warn(note)) => _ = self.findings.fill.get_or_insert(note),
            None => {}
        }
        Ok(())
    }

    /// Looks at how some voxels of a block vary.
    fn look_at_variation(&mut self, job: &WindowJob, read: &BlockSamples) {
        if self.plan.colour_transform.is_some() {
            return;
        }
        let (block, all) = (read.id.block as usize, self.plan.blocks.len());
        let (extent, ty) = (self.plan.block_with_ghosts(&job.codec, block), self.archive.sample);
        let samples = &read.samples[..window_bytes(job, extent.known, ty)];
        self.findings.variation.add_block(block, all, &extent, ty, self.config.missing_value, samples);
    }

    /// Reads and sends the window's blocks. False if the receiver is gone.
    pub(super) fn send_blocks(
        &mut self,
        window: &dyn FrameWindow,
        job: &Arc<WindowJob>,
        out: &Sender<NextBlock>,
        busy: &mut Duration,
    ) -> Result<bool> {
        for id in self.in_order_of_coding(job) {
            let started = Instant::now();
            let block = self.gather(window, job, id)?;
            if id.tier == 0 {
                self.look_at_variation(job, &block);
            }
            if id == self.plan.last_block(job.index) {
                window.check_unchanged()?;
            }
            *busy += started.elapsed();
            if out.send(NextBlock { window: job.clone(), block }).is_err() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The blocks of a window in the order in which they are coded, tier after tier. Blocks with the same block above follow each other,
    /// so that it is decoded once.
    fn in_order_of_coding(&self, job: &WindowJob) -> Vec<BlockId> {
        let (plan, tiers) = (self.plan, job.codec.tiers());
        let mut ids: Vec<BlockId> = plan.ids(job.index, tiers).collect();
        let above = |id: &BlockId| if id.tier < tiers { plan.start.above(*id).block } else { id.block };
        ids.sort_by_key(|id| (tiers - id.tier, id.channel, above(id)));
        ids
    }

    /// Reads the samples that coding one block takes, frame by frame.
    pub(super) fn gather(&self, window: &dyn FrameWindow, job: &WindowJob, id: BlockId) -> Result<BlockSamples> {
        if id.tier > 0 {
            return self.gather_coarse(window, job, id);
        }
        let Region { start, .. } = self.plan.blocks.region(id.block as usize);
        let BlockWithGhosts { size, known } = self.plan.block_with_ghosts(&job.codec, id.block as usize);
        let region = Region { start, end: std::array::from_fn(|a| start[a] + known[a]) };
        let sample = self.plan.colour_transform.map_or(self.archive.sample, |colour_transform| colour_transform.sample);
        let mut samples = Buffer::with_len(window_bytes(job, job.codec.outer_size(size), sample));
        read_frames_into(window, 0..window.frames(), &region, &mut samples[..window_bytes(job, known, sample)])?;
        Ok(BlockSamples { id, samples })
    }

    /// Reads the samples at the nodes of a block of a tier above 0, frame by frame.
    fn gather_coarse(&self, window: &dyn FrameWindow, job: &WindowJob, id: BlockId) -> Result<BlockSamples> {
        let [xs, ys, zs] = &self.plan.coarse_voxels(&job.codec.at(id.tier, 0), id);
        let sample = self.plan.colour_transform.map_or(self.archive.sample, |colour_transform| colour_transform.sample);
        let each = sample.size();
        let end = |places: &[usize]| places.last().map_or(0, |last| last + 1);
        let mut samples = Buffer::with_len(window_bytes(job, [xs, ys, zs].map(Vec::len), sample));
        let (mut left, mut rows) = (samples.chunks_exact_mut(each), Vec::new());
        let row = (end(xs) - xs[0]) * each;
        let together = (ROWS_BYTES / (row << id.tier)).max(1);
        for (frame, z) in (0..window.frames()).flat_map(|frame| zs.iter().map(move |z| (frame, *z))) {
            for ys in ys.chunks(together) {
                let part = Region { start: [xs[0], ys[0], z], end: [end(xs), end(ys), z + 1] };
                rows.resize(part.voxels() * each, 0);
                window.read_box(frame, &part, &mut rows)?;
                for row in ys.iter().map(|y| &rows[(y - ys[0]) * row..]) {
                    let nodes = xs.iter().map(|x| &row[(x - xs[0]) * each..][..each]);
                    nodes.zip(&mut left).for_each(|(node, sample)| sample.copy_from_slice(node));
                }
            }
        }
        Ok(BlockSamples { id, samples })
    }
}

/// Bytes of so many voxels in all frames of a window.
fn window_bytes(job: &WindowJob, voxels: [usize; 3], sample: SampleType) -> usize {
    job.codec.frames() * voxels.iter().product::<usize>() * sample.size()
}

/// Bytes of the rows that are read together for blocks of tiers above 0: each read of some sources takes long.
const ROWS_BYTES: usize = 1 << 20;

/// The colour channels of a window; empty if samples are coded directly.
fn coloured<'a>(plan: &Plan<'a>, window: &'a dyn FrameWindow) -> Vec<ColourWindow<'a, &'a dyn FrameWindow>> {
    let all =
        |colour_transform| (0..plan.channels()).map(move |channel| ColourWindow { window, colour_transform, channel });
    plan.colour_transform.into_iter().flat_map(all).collect()
}
