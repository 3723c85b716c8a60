//! The conventional method: splats every frame of an archive separately (eq 4).

use super::overview;
use crate::render::batches::{
    BatchOutcome, BatchRequest, BlockPlanes, FrameBatch, FrameBounds, Inverse, Layout, OverviewRequest, PlaneValues,
    SampleErrors, Scene, Scratch, Selection,
};
use crate::render::config::RenderConfig;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{self, is_any_missing, is_missing, magnitude};
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::scan::{Scan, scan_frame};
use wavesplat_core::source::{Archive, CHANNELS, ColourTransform, ColourWindow, FrameSource, FrameWindow};

/// Frames that are splatted together, so that the weights of voxels or pixels are computed once for all of them.
const BATCH: usize = 32;
/// Voxels of the boxes in which frames are read: rows long enough to read memory in order, and few enough voxels for
/// the second-level cache.
const EDGES: [usize; 3] = [128, 32, 32];

/// An archive as a scene.
pub struct FrameScene {
    source: Box<dyn FrameSource>,
    /// Grid, frames and sample type of the splatted samples.
    archive: Archive,
    missing_value: Option<f64>,
    /// Turns the samples that are read into colours, if colours are splatted.
    colour_transform: Option<ColourTransform>,
    /// Whether a missing sample was found. From then on frames are scanned before they are splatted.
    found_missing: AtomicBool,
}

impl FrameScene {
    /// A scene of a source. `missing_value` means "missing", like NaN and infinities.
    pub fn new(source: Box<dyn FrameSource>, missing_value: Option<f64>) -> Self {
        let archive = source.archive().clone();
        let missing_value = sample::missing_value(archive.sample, missing_value);
        Self { source, archive, missing_value, colour_transform: None, found_missing: AtomicBool::new(false) }
    }

    /// The same as [`Self::new`], with samples turned into colours: three channels, 0 to 1.
    pub fn coloured(source: Box<dyn FrameSource>, missing_value: Option<f64>, colours: TransferFunction) -> Self {
        let plain = Self::new(source, missing_value);
        let (sample, missing_value) = (plain.archive.sample, plain.missing_value);
        let archive = Archive { sample: ColourTransform::SAMPLE, ..plain.archive };
        let colour_transform = Some(ColourTransform { colours, sample, missing_value });
        Self { archive, colour_transform, missing_value: None, ..plain }
    }

    /// The same frames on another grid of as many voxels.
    pub fn with_grid(mut self, grid: Grid) -> Self {
        self.archive.grid = Grid { dims: self.archive.grid.dims, ..grid };
        self
    }
}

impl Scene for FrameScene {
    fn grid(&self) -> &Grid {
        &self.archive.grid
    }

    fn blocks(&self) -> BlockGrid {
        BlockGrid { dims: self.archive.grid.dims, edges: EDGES }
    }

    fn channels(&self) -> usize {
        self.colour_transform.as_ref().map_or(1, |_| CHANNELS.len())
    }

    fn frames(&self) -> Option<usize> {
        self.archive.frames
    }

    fn batch_end(&self, frame: usize) -> usize {
        frame + BATCH
    }

    fn most_planes(&self, frames: usize, _config: &RenderConfig) -> usize {
        2 * frames + 1
    }

    fn block_bytes(&self, _frames: usize, _config: &RenderConfig) -> usize {
        // One plane of a block, in the type of the samples and as f64.
        let read = self.colour_transform.as_ref().map_or(0, |colour_transform| colour_transform.sample.size());
        self.blocks().region(0).voxels() * (self.archive.sample.size() + read + 8)
    }

    fn overview(&mut self, request: &OverviewRequest<'_>, progress: &dyn Progress) -> Result<Option<Vec<f32>>> {
        let (sample, missing_value, channels) = (self.archive.sample, self.missing_value, self.channels());
        progress.start(Some((channels * request.frames.len()) as u64));
        let mut samples = vec![f32::NAN; channels * request.samples()];
        let of_frame = request.samples() / request.frames.len();
        let frames = (0..channels).flat_map(|channel| request.frames.iter().map(move |frame| (channel, *frame)));
        for ((channel, frame), samples) in frames.zip(samples.chunks_exact_mut(of_frame)) {
            progress.check()?;
            let window = self.source.window(frame, 1)?;
            let window = in_channel(window, self.colour_transform.as_ref(), channel);
            overview::Frames { window: window.as_ref(), sample, missing_value }.thin(0, request, samples)?;
            window.check_unchanged()?;
            progress.advance(1);
        }
        progress.finish();
        Ok(Some(samples))
    }

    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>> {
        let BatchRequest { frames, channel, config, .. } = *request;
        let (first, last) = (frames[0], frames[frames.len() - 1]);
        let window = self.source.window(first, last + 1 - first)?;
        let window = in_channel(window, self.colour_transform.as_ref(), channel);
        let (archive, declared) = (&self.archive, self.missing_value);
        let can_miss = archive.sample.is_float() || declared.is_some();
        let scan = |frame: &usize| {
            scan_frame(Scan::NOTHING, window.as_ref(), frame - first, &archive.grid, archive.sample, declared)
        };
        let scan_first = can_miss && self.found_missing.load(Relaxed);
        let scanned = if scan_first || config.certify { frames } else { &[] };
        let scans = scanned.iter().map(scan).collect::<Result<Vec<Scan>>>()?;
        let absent = scans.iter().any(|s| s.missing > 0);
        let layout = Layout { absent, ..Layout::of_values(frames.len()) };
        let errors = scans.iter().map(|s| FrameBounds { error: 0.0, range: s.range, absolute_sum: magnitude(s.range) });
        let errors = SampleErrors { factors: Vec::new(), frames: errors.collect() };
        let frames = frames.iter().map(|f| f - first).collect();
        let (blocks, found_missing) = (self.blocks(), &self.found_missing);
        let selection = Selection::of_all(blocks, request);
        let unexpected = (can_miss && scanned.is_empty()).then_some(found_missing);
        Ok(Box::new(SampleBatch {
            archive,
            blocks,
            missing_value: declared,
            unexpected,
            window,
            frames,
            layout,
            selection,
            errors,
        }))
    }
}

/// One channel of a window, if it has several.
fn in_channel<'a>(
    window: Box<dyn FrameWindow>,
    colour_transform: Option<&'a ColourTransform>,
    channel: usize,
) -> Box<dyn FrameWindow + 'a> {
    match colour_transform {
        Some(colour_transform) => Box::new(ColourWindow { window, colour_transform, channel }),
        None => window,
    }
}

/// A batch of frames of an archive.
struct SampleBatch<'a> {
    archive: &'a Archive,
    blocks: BlockGrid,
    missing_value: Option<f64>,
    /// The flag to set if a sample is missing; `None` if the frames were scanned before.
    unexpected: Option<&'a AtomicBool>,
    window: Box<dyn FrameWindow + 'a>,
    /// Frame numbers, counted from the first frame of the window.
    frames: Vec<usize>,
    layout: Layout,
    selection: Selection,
    errors: SampleErrors,
}

impl FrameBatch for SampleBatch<'_> {
    fn layout(&self) -> Layout {
        self.layout
    }

    fn selection(&self) -> &Selection {
        &self.selection
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        Ok(Box::new(FrameBlock { batch: self, region: self.blocks.region(block) }))
    }

    fn inverse(&self, _: &[usize]) -> Box<Inverse<'_>> {
        Box::new(|planes, frames| frames.copy_from_slice(&planes[..frames.len()]))
    }

    fn errors(&self) -> &SampleErrors {
        &self.errors
    }

    fn finish(&self) -> Result<BatchOutcome> {
        self.window.check_unchanged()?;
        let unexpected = self.unexpected.is_some_and(|found| found.load(Relaxed));
        Ok(if unexpected { BatchOutcome::NeedsRelayout } else { BatchOutcome::Complete })
    }
}

impl SampleBatch<'_> {
    fn note_missing<T: Copy + Into<f64>>(&self, values: &[T]) {
        if let Some(found) = self.unexpected.filter(|_| dispatch!(is_any_missing(values, self.missing_value))) {
            found.store(true, Relaxed);
        }
    }
}

/// A block whose frames are read on demand.
struct FrameBlock<'a> {
    batch: &'a SampleBatch<'a>,
    region: Region,
}

impl BlockPlanes for FrameBlock<'_> {
    fn voxels(&self) -> usize {
        self.region.voxels()
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let SampleBatch { archive, layout, window, frames, missing_value, .. } = self.batch;
        let Some((frame, absent)) = layout.samples(plane) else { return Ok(PlaneValues::Nothing) };
        scratch.bytes.resize(self.region.voxels() * archive.sample.size(), 0);
        window.read_box(frames[frame], &self.region, &mut scratch.bytes)?;
        if layout.absent {
            return Ok(scratch.masked(archive.sample, absent, |_, v| is_missing(v, *missing_value)));
        }
        let samples = scratch.samples(archive.sample);
        match samples {
            PlaneValues::Single(values) => self.batch.note_missing(values),
            PlaneValues::Double(values) => self.batch.note_missing(values),
            PlaneValues::Few(_) | PlaneValues::Nothing => {}
        }
        Ok(samples)
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}
