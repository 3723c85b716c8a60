//! Converts frames to a coefficient file: a reader, workers and a writer, with bounded channels between them.
//!
//! ```text
//! reader thread            workers (rayon)           writer (the caller's thread)
//! scan a window      ->    encode a batch       ->   append in order, directory, footer
//! gather its blocks        of blocks                 window by window
//! ```
//!
//! Batches keep their order. So the bytes do not depend on the number of threads, nor on the memory budget, which only
//! sets the size of a batch. The workers are rayon's global pool. The bound of a window follows from its own samples,
//! or, if the tolerance refers to the value range, from the range of all frames up to its end. That range never exceeds
//! the archive's. So conversion needs only one pass over the data, and a pipe gives the same bytes as files.
//!
//! A window is completed in the file only after its source was found unchanged; then `out` is flushed. So a killed
//! conversion leaves a file that is valid up to its last complete window, and [`resume`] continues there. Each window's
//! record holds all that the next window needs, so the resumed file has the same bytes as an uninterrupted one.

mod choose;
pub mod estimate;
mod gather;
mod learn;
mod record;
#[doc(hidden)]
pub mod sampled;
mod settings;
mod smoothness;
mod task;
mod to_file;

use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::BlockGrid;
use crate::base::memory;
use crate::base::progress::Progress;
use crate::codec::WindowCodec;
pub use crate::codec::bound::{Bound, range_bound};
use crate::codec::encode::{Encoded, Encoder};
use crate::codec::sampled_box::SampledBox;
use crate::colour::TransferFunction;
use crate::file::report::{BoundReport, WindowReport};
use crate::source::{Archive, CHANNELS, ColourTransform, FrameSource};
use crate::wavelet;
pub use choose::{SchemeConstraint, SpatialPredictor};
use crossbeam_channel::{Receiver, Sender, bounded};
use gather::Batch;
use rayon::prelude::*;
use record::Recorder;
use serde::Serialize;
#[doc(hidden)]
pub use settings::{of_file, options};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use task::Task;
pub use to_file::convert_to_file;
pub use wavesplat_format::{Basis, Packing, Stencil};
use wavesplat_format::{BlockId, CompletePrefix, FileId, Metadata, Window};

/// What to do with NaN, infinities and the declared missing value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissingPolicy {
    /// Reject the input; the error names the first one and their number.
    Error,
    /// Keep their bits; they add nothing to pictures.
    Mask,
}

/// How to convert. [`ConvertConfig::new`] has the defaults; change others by struct update:
///
/// ```
/// use wavesplat::convert::{Bound, ConvertConfig};
///
/// let config = ConvertConfig { bound: Bound::Rms, window: 16, ..ConvertConfig::new(0.001) };
/// ```
#[derive(Debug, Clone)]
pub struct ConvertConfig {
    /// Restricts the choice of scheme. Default: the smallest is found for every window.
    pub coding: SchemeConstraint,
    /// Frames in a window: a power of two for [`Basis::Haar`], one more for [`Basis::Multi`]. Default: 32.
    pub window: usize,
    /// The error allowed, as a share of what the bound refers to, 0 to 1; 0 keeps every bit.
    pub tolerance: f64,
    /// What is promised. Default: no sample is off by more than the tolerance times the value range.
    pub bound: Bound,
    /// The value range that a pointwise or rms tolerance refers to. Default: that of the frames so far.
    pub range: Option<(f64, f64)>,
    /// What to do with missing samples. Default: refuse them.
    pub missing: MissingPolicy,
    /// A value that means "missing", besides NaN and infinities. Default: none.
    pub missing_value: Option<f64>,
    /// Colours that samples are turned into before all else: three channels, 0 to 1, which the bound then refers to. Their
    /// value range is 0 to 1 by default. Default: none.
    pub colours: Option<TransferFunction>,
    /// Voxels a side of a block. Default: as many as suit the window.
    pub block: Option<usize>,
    /// zstd level, 1 to 19. Default: 3.
    pub level: i32,
    /// Bytes that may be allocated. Default: 512 MiB.
    pub memory: usize,
    /// What was asked of the input (frames, region, variable), to find the same samples again. Default: nothing.
    pub settings: Vec<(String, String)>,
}

impl ConvertConfig {
    /// The defaults, which are those of `wavesplat convert`, with a tolerance: 0.01 allows every sample to be off by 1 % of
    /// the value range.
    pub fn new(tolerance: f64) -> Self {
        Self {
            coding: SchemeConstraint::AUTO,
            window: 32,
            tolerance,
            bound: Bound::Pointwise,
            range: None,
            missing: MissingPolicy::Error,
            missing_value: None,
            colours: None,
            block: None,
            level: 3,
            memory: memory::DEFAULT,
            settings: Vec::new(),
        }
    }
}

/// The report of a conversion.
#[derive(Debug, Clone, Serialize)]
pub struct ConvertReport {
    /// Frames of the file.
    pub frames: u64,
    /// Frames that were in the file before.
    pub frames_before: u64,
    /// Windows of the file.
    pub windows: usize,
    /// Bytes of the samples of all frames.
    pub input_bytes: u64,
    /// Bytes of the coefficient file.
    pub output_bytes: u64,
    /// Nonzero coefficients kept.
    pub coefficients: u64,
    /// Nonzero coefficients per sample.
    pub coefficients_per_sample: f64,
    /// Samples stored exactly because coefficients missed the bound.
    pub outliers: u64,
    /// Missing samples.
    pub missing: u64,
    /// The error bound.
    #[serde(flatten)]
    pub promise: BoundReport,
    /// The value range that a pointwise or rms tolerance refers to.
    pub range: (f64, f64),
    /// The largest bound in any window.
    pub delta: f64,
    /// The largest error reached in any sample.
    pub reached: f64,
    /// The largest share of its bound that any series uses.
    pub share: f64,
    /// The bound and the errors of each window.
    pub per_window: Vec<WindowReport>,
    /// Seconds spent scanning and gathering samples, on the reader's thread.
    pub read_seconds: f64,
    /// Seconds of wall time in which the workers encoded.
    pub encode_seconds: f64,
    /// Seconds spent writing.
    pub write_seconds: f64,
    /// Seconds from start to end.
    pub seconds: f64,
}

/// The complete windows of a file that more frames are added to.
#[derive(Debug)]
pub struct PartialFile {
    /// The file's complete windows.
    pub complete: CompletePrefix,
    /// The number of the first window whose frames the source still has, from its first frame on. Windows before it are
    /// not compared with the source.
    pub first_window: usize,
}

/// Converts all frames of `source` into a coefficient file written to `out`, in one pass and without seeking.
///
/// `out` is flushed when a window is complete. Messages call it `name`.
pub fn convert<W: Write>(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    name: &Path,
    out: W,
    progress: &dyn Progress,
) -> Result<ConvertReport> {
    resume(source, config, None, name, out, progress)
}

/// As [`convert`], continuing a partial file after its complete windows; `out` must be at their end.
///
/// # Errors
/// Those of [`convert`]; also an error if the partial file has other settings, or was converted from other frames.
pub fn resume<W: Write>(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    begun: Option<PartialFile>,
    name: &Path,
    out: W,
    progress: &dyn Progress,
) -> Result<ConvertReport> {
    let started = Instant::now();
    let Task { config, archive, colour_transform } = &Task::new(config, source.archive());
    let plan = Plan::new(config, archive, colour_transform.as_ref())?;
    let done = WindowsDone::of(begun.as_ref(), &plan, name)?;
    let windows = archive.frames.map(|f| f.div_ceil(config.window) + done.first_window);
    progress.start(windows.map(|w| (w * plan.blocks_of_window()) as u64));
    progress.resume((done.windows.len() * plan.blocks_of_window()) as u64);
    let mut recorder = Recorder::new(config, &plan, name, out, begun);
    let (to_workers, from_reader) = bounded(0);
    let (to_writer, from_workers) = bounded(0);
    let idle = Pool::default();
    let (read_time, encode_time) = std::thread::scope(|scope| {
        // Each stage owns its ends of the channels. When a stage ends, even by an error, its neighbours end too.
        let (plan, done, idle) = (&plan, &done, &idle);
        let reader = scope.spawn(move || gather::read(source, (config, archive), plan, done, idle, &to_workers));
        let workers = scope.spawn(move || encode(config.level, plan, idle, &from_reader, &to_writer));
        let written = recorder.write(from_workers, progress);
        let (encoded, read) = (join(workers), join(reader));
        Ok((read?, encoded?, written?)).map(|(read, encoded, ())| (read, encoded))
    })?;
    let report = recorder.finish(started, read_time, encode_time)?;
    progress.finish();
    Ok(report)
}

/// The metadata of a file of `archive` before its first frame: all that is decided without reading samples.
#[doc(hidden)]
pub fn open_partial(config: &ConvertConfig, archive: &Archive) -> Result<Metadata> {
    let Task { config, archive, colour_transform } = &Task::new(config, archive);
    Plan::new(config, archive, colour_transform.as_ref()).map(|plan| plan.start)
}

/// Propagates the panic of a stage, which is a bug and not an error.
fn join<T>(stage: std::thread::ScopedJoinHandle<'_, T>) -> T {
    stage.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Decisions made from the configuration and the archive before any frame is read.
#[derive(Debug)]
struct Plan<'a> {
    /// Converts samples to channels, if there are several.
    colour_transform: Option<&'a ColourTransform>,
    /// The metadata before the first frame.
    start: Metadata,
    blocks: BlockGrid,
    /// Blocks that are gathered, encoded and written together.
    batch: usize,
}

/// The default block edge in voxels. Without a pyramid at most 32, less for long windows, so that a block stays near 4
/// MiB. With a pyramid up to 48, because larger blocks compress better, even beside small ones at the far faces; and a
/// multiple of 16 allows coarse lattices.
fn block_edge(coding: SchemeConstraint, dims: [usize; 3], window: usize) -> usize {
    let (largest, samples) =
        if coding.space == SpatialPredictor::Alone { (32, 33 * 32 * 32 * 32) } else { (48, 33 * 48 * 48 * 48) };
    let fits = |e: &usize| e * e * e * window <= samples;
    let edge = [largest, largest / 2, largest / 4, 4, 2].into_iter().find(fits).unwrap_or(1);
    let longest = dims.into_iter().max().unwrap_or(1);
    if coding.space == SpatialPredictor::Alone { edge } else { longest.min(edge) }
}

impl<'a> Plan<'a> {
    /// Whether blocks may have `edge` voxels a side.
    fn takes(config: &ConvertConfig, edge: usize) -> bool {
        let coefficients = most_coefficients(config) as u64;
        edge > 0
            && (edge as u64).saturating_pow(3).saturating_mul(coefficients)
                <= wavesplat_format::limits::MAX_BLOCK_SAMPLES
    }

    /// A block, with the voxels around it that help to code it.
    fn sampled_box(&self, codec: &WindowCodec, block: usize) -> SampledBox {
        let region = self.blocks.region(block);
        let (start, size) = (region.start, region.dims());
        let outer = codec.outer_size(size);
        SampledBox { size, known: std::array::from_fn(|a| (start[a] + outer[a]).min(self.blocks.dims[a]) - start[a]) }
    }

    fn new(config: &ConvertConfig, archive: &Archive, colour_transform: Option<&'a ColourTransform>) -> Result<Self> {
        wavelet::check_window(config.coding.basis.unwrap_or(Basis::Samples), config.window)?;
        if !(0.0..=1.0).contains(&config.tolerance) {
            return Err(Error::setting("tolerance", "takes a share, 0 to 1; 2 % is 0.02"));
        }
        let edge = config.block.unwrap_or(block_edge(config.coding, archive.grid.dims, config.window));
        let most = wavesplat_format::limits::MAX_BLOCK_SAMPLES;
        if !Self::takes(config, edge) {
            return Err(Error::setting(
                "block",
                format!("holds 1 to {most} samples over a window, not {edge} voxels a side"),
            ));
        }
        let blocks = BlockGrid::cubes(archive.grid.dims, edge);
        if u32::try_from(blocks.len()).is_err() {
            return Err(Error::setting(
                "block",
                format!("{edge} voxels a side give more than 2^32 blocks; take larger ones"),
            ));
        }
        let batch = batch_len(config, blocks, archive, colour_transform)?;
        Ok(Self { start: start(config, archive, colour_transform, edge), colour_transform, blocks, batch })
    }

    /// The plan of a file that has `count` blocks, side by side.
    fn of_blocks(&self, count: usize) -> Self {
        let edge = self.blocks.edges[0];
        let blocks = BlockGrid::cubes([edge * count, edge, edge], edge);
        let start = Metadata { dims: blocks.dims.map(|n| n as u64), ..self.start.clone() };
        Self { start, blocks, ..*self }
    }

    fn channels(&self) -> usize {
        self.start.channels.into()
    }

    fn blocks_of_window(&self) -> usize {
        self.blocks.len() * self.channels()
    }
}

/// The metadata before the first frame.
fn start(
    config: &ConvertConfig,
    archive: &Archive,
    colour_transform: Option<&ColourTransform>,
    edge: usize,
) -> Metadata {
    Metadata {
        dims: archive.grid.dims.map(|n| n as u64),
        spacing: archive.grid.spacing,
        origin: archive.grid.origin,
        sample: archive.sample,
        block_edge: edge as u32,
        channels: colour_transform.map_or(1, |_| CHANNELS.len() as u16),
        frames: 0,
        times: Vec::new(),
        variable: archive.variable.clone(),
        bound: config.bound,
        tolerance: config.tolerance,
        missing_value: config.missing_value,
        windows: Vec::new(),
        settings: settings::stored_settings(config, archive, colour_transform),
        program: format!("wavesplat {}", env!("CARGO_PKG_VERSION")),
    }
}

/// The windows that a file already has, and their relation to the source's frames.
#[derive(Debug, Default)]
struct WindowsDone {
    id: Option<FileId>,
    packing: Packing,
    windows: Vec<Window>,
    /// [`PartialFile::first_window`]
    first_window: usize,
    name: PathBuf,
}

impl WindowsDone {
    fn of(begun: Option<&PartialFile>, plan: &Plan<'_>, name: &Path) -> Result<Self> {
        let Some(PartialFile { complete, first_window }) = begun else { return Ok(Self::default()) };
        let held = complete.metadata();
        if let Some(what) = settings::difference(&held.start(), &plan.start, *first_window == 0) {
            return Err(Error::path(name, format!("was begun with another {what}")));
        }
        if *first_window == 0 && held.start() != plan.start {
            return Err(Error::path(name, "was begun with other settings"));
        }
        Ok(Self {
            id: Some(complete.id()),
            packing: complete.packing(),
            windows: held.windows.clone(),
            first_window: *first_window,
            name: name.into(),
        })
    }
}

/// The number of blocks in a batch that fit in memory. Memory holds two batches of samples and two of coded blocks, the
/// workers' scratch, and what choosing the next window's scheme takes.
fn batch_len(
    config: &ConvertConfig,
    blocks: BlockGrid,
    archive: &Archive,
    colour_transform: Option<&ColourTransform>,
) -> Result<usize> {
    let sample = archive.sample;
    let voxels = blocks.region(0).voxels();
    let samples = voxels * config.window;
    let raw = samples
        * colour_transform.map_or(sample.size(), |colour_transform| colour_transform.sample.size().max(sample.size()));
    let channel_bytes = colour_transform.map_or(0, |_| samples * sample.size());
    let codes = voxels * most_coefficients(config) * size_of::<i32>();
    let alone = config.coding.space == SpatialPredictor::Alone || config.tolerance == 0.0; // no pyramid is tried then
    let field = if alone { 0 } else { 2 * voxels * most_coefficients(config) * size_of::<f64>() };
    let choice = if alone { 0 } else { choose::bytes(samples, sample) };
    let scratch = samples + 2 * codes + field + raw + channel_bytes + ZSTD_SCRATCH;
    let needs =
        |batch: &usize| batch * 4 * raw + batch.min(&rayon::current_num_threads()) * scratch + choice + memory::FIXED;
    let enough = (4 * rayon::current_num_threads() - 2).min(memory::MOST_BLOCKS); // recent memory is cached
    let fits = (1..=enough).rev().find(|batch| needs(batch) + archive.memory <= config.memory);
    fits.ok_or_else(|| {
        let share = config.memory as f64 / config.memory.saturating_sub(archive.memory).max(1) as f64;
        let (least, edge) = ((needs(&1) as f64 * share / MIB).ceil(), blocks.edges[0]);
        let window = config.window;
        let what = format!("windows of {window} frames in blocks of {edge} voxels a side need {least}MiB");
        Error::setting(
            "memory",
            Note::with(format!("{what}; give that, or make either smaller"), Remedy::Adjust(&["window", "block"])),
        )
    })
}

/// The number of coefficients of a voxel in a full window.
fn most_coefficients(config: &ConvertConfig) -> usize {
    match config.coding.basis {
        Some(basis @ (Basis::Haar | Basis::Multi)) => wavelet::basis(basis, &[], config.window).coefficients(),
        // as many as frames; without a given basis, one of these two is chosen
        Some(Basis::Samples | Basis::Learned) | None => config.window,
    }
}

/// An upper bound of the memory of a zstd context at the offered levels, for inputs of a few MiB.
const ZSTD_SCRATCH: usize = 4 << 20;
const MIB: f64 = 1_048_576.0;

/// The worker stage: encodes batches, each on all workers, until the reader ends. Returns the time spent encoding.
fn encode(
    level: i32,
    plan: &Plan<'_>,
    read: &Pool<Vec<u8>>,
    batches: &Receiver<Batch>,
    out: &Sender<EncodedBatch>,
) -> Result<Duration> {
    let encoders = Encoders::default();
    let mut busy = Duration::ZERO;
    for batch in batches {
        let started = Instant::now();
        let encoded = encode_batch(level, plan, (&encoders, read), batch)?;
        busy += started.elapsed();
        if out.send(encoded).is_err() {
            break; // the writer failed and reports why
        }
    }
    Ok(busy)
}

type Encoders = Pool<Encoder>;

/// Encodes a batch on all workers.
fn encode_batch(
    level: i32,
    plan: &Plan<'_>,
    (encoders, read): (&Encoders, &Pool<Vec<u8>>),
    Batch { window, blocks, last }: Batch,
) -> Result<EncodedBatch> {
    let encode = |(id, samples): (BlockId, Vec<u8>)| {
        let mut encoder = encoders.take().map_or_else(|| Encoder::new(level), Ok).map_err(bug)?;
        let of = plan.sampled_box(&window.codec, id.block as usize);
        let samples = to_channel(plan.colour_transform, id, samples, read);
        let encoded = encoder.block(&window.codec, id, of, &samples).map_err(bug);
        encoders.put(encoder);
        read.put(samples);
        encoded
    };
    let blocks: Result<Vec<Encoded>> = blocks.into_par_iter().map(encode).collect();
    Ok(EncodedBatch { window: window.clone(), blocks: blocks?, last })
}

/// Converts the samples of a block to those of its channel.
fn to_channel(
    colour_transform: Option<&ColourTransform>,
    id: BlockId,
    samples: Vec<u8>,
    idle: &Pool<Vec<u8>>,
) -> Vec<u8> {
    let Some(colour_transform) = colour_transform else { return samples };
    let mut channel = idle.take().unwrap_or_default();
    channel.resize(samples.len() / colour_transform.sample.size() * ColourTransform::SAMPLE.size(), 0);
    colour_transform.paint(id.channel.into(), &samples, &mut channel);
    idle.put(samples);
    channel
}

/// A pool of reusable values: new memory costs about as much as the work done with it.
#[derive(Debug)]
struct Pool<T>(Mutex<Vec<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T> Pool<T> {
    fn take(&self) -> Option<T> {
        self.0.lock().ok().and_then(|mut idle| idle.pop())
    }

    fn put(&self, value: T) {
        if let Ok(mut idle) = self.0.lock() {
            idle.push(value);
        }
    }
}

/// An error for compression failures, which happen only if a size exceeds our own limits.
fn bug(error: wavesplat_format::Error) -> Error {
    Error::CoefficientFile { path: "encoding".into(), source: error }
}

/// Coded blocks for the writer, in order.
#[derive(Debug)]
struct EncodedBatch {
    window: Arc<WindowJob>,
    blocks: Vec<Encoded>,
    last: bool,
}

/// A window, as the reader prepared it.
#[derive(Debug)]
struct WindowJob {
    index: u32,
    first_frame: u64,
    id: FileId,
    /// How the file's codes are packed.
    packing: Packing,
    codec: WindowCodec,
    /// The range that the tolerance refers to: the given one, or that of all samples up to the window's end.
    range: (f64, f64),
    digest: u64,
    /// The times of its frames, if the source has any.
    times: Vec<f64>,
}
