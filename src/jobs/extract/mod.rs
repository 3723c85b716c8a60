//! Extracts samples from a coefficient file: any frames and any region, without reading the rest. Writes them in the
//! formats of other programs.

mod ahead;
mod contents;
mod read;
mod sink;
mod strides;

pub use contents::contents;
pub use read::read_region;
pub use sink::{Files, Sink};
pub use wavesplat_formats::{Contents, Direction, OutputAxis, SampleFormat, SampleOrder};

use ahead::fetch_ahead;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use std::sync::{Mutex, PoisonError};
use strides::{Strides, length};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::memory;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::zeroed::Zeroed;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::WantedFrames;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_format::BlockEntry;

/// What to extract. [`ExtractConfig::new`] asks for everything; narrow it by struct update.
#[derive(Debug, Clone)]
pub struct ExtractConfig {
    /// Which frames, ascending. Default: all.
    pub frames: Vec<usize>,
    /// Which voxels. Default: all.
    pub region: Region,
    /// Which channel, from 0. Default: the first.
    pub channel: usize,
    /// The order of the samples. Default: frame by frame, x fastest.
    pub order: SampleOrder,
    /// Bytes that may be allocated. Default: 512 MiB.
    pub memory: usize,
}

impl ExtractConfig {
    /// All frames and voxels of the first channel of `file`.
    pub fn new(file: &CoefficientFile) -> Self {
        let (frames, order) = ((0..file.frames()).collect(), SampleOrder::default());
        Self { frames, region: file.grid.whole(), channel: 0, order, memory: memory::DEFAULT }
    }

    /// An error unless the file has these frames and voxels and this channel.
    fn check(&self, file: &CoefficientFile) -> Result<()> {
        let (frames, [x, y, z], channels) = (file.frames(), file.grid.dims, file.channels());
        if !self.frames.is_sorted() || self.frames.last().is_some_and(|last| *last >= frames) {
            return Err(Error::setting("frames", format!("takes numbers below {frames}, ascending")));
        }
        if !file.grid.whole().contains(&self.region) || self.region.is_empty() {
            return Err(Error::setting("region", format!("takes voxels of {x} x {y} x {z}, at least one")));
        }
        if self.channel >= channels {
            return Err(Error::setting("channel", format!("takes a number below {channels}")));
        }
        Ok(())
    }
}

/// The report of an extraction.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct ExtractReport {
    /// Frames written.
    pub frames: usize,
    /// Decoded blocks; a block decoded twice counts twice.
    pub blocks_read: u64,
    /// Stored bytes of blocks that were read, without those of the tiers above them.
    pub bytes_read: u64,
    /// Bytes that were read of the file, including its directory.
    pub file_bytes_read: u64,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of the extracted samples, in the file's sample type.
    pub bytes: u64,
}

/// An error if the memory is too small, before anything is written.
pub fn check_memory(file: &CoefficientFile, config: &ExtractConfig) -> Result<()> {
    Pieces::new(file, config).map(|_| ())
}

/// Writes the samples in the file's sample type, little-endian, in the order of `config`. Messages call `out` `name`.
pub fn extract(
    file: &CoefficientFile,
    config: &ExtractConfig,
    name: &std::path::Path,
    out: &mut dyn Write,
    progress: &dyn Progress,
) -> Result<ExtractReport> {
    let mut write = |samples: &[u8]| out.write_all(samples).map_err(|e| Error::io(name, "writing", e));
    extract_to(file, config, &mut write, progress)
}

/// As [`extract`]; `write` gets the samples in pieces, one after another.
pub fn extract_to(
    file: &CoefficientFile,
    config: &ExtractConfig,
    write: &mut dyn FnMut(&[u8]) -> Result<()>,
    progress: &dyn Progress,
) -> Result<ExtractReport> {
    progress.start(Some(config.frames.len() as u64));
    file.begin_run();
    let mut report = ExtractReport::default();
    let pieces = Pieces::new(file, config)?;
    let all = config.frames.len() * config.region.voxels() * file.sample().size();
    let mut buffers = Vec::new();
    let list = pieces.list(file, config);
    let (mut begun, mut fetched) = (0, 0);
    for together in list.chunks(pieces.together(file, config)) {
        progress.check()?;
        if fetched < begun + together.len() {
            fetched = begun + fetch_ahead(file, config.channel, &list[begun..])?;
        }
        begun += together.len();
        buffers.resize_with(together.len(), Zeroed::default);
        let read = together.par_iter().zip(&mut buffers);
        let read = read.map(|(piece, bytes)| read_piece(file, config, piece, pieces.blocks, bytes));
        for (read, bytes) in read.collect::<Result<Vec<_>>>()? {
            write(bytes)?;
            report.blocks_read += read.blocks_read;
            report.bytes_read += read.bytes_read;
            report.bytes += bytes.len() as u64;
            let done = (report.bytes as u128 * config.frames.len() as u128 / all as u128) as usize;
            progress.advance((done - report.frames) as u64);
            report.frames = done;
        }
    }
    file.check_unchanged()?;
    (report.file_bytes_read, report.file_bytes) = (file.bytes_read(), file.bytes());
    progress.finish();
    Ok(report)
}

/// The amount decoded at a time: some items of the slowest axis, or one of its items and some items of the second axis.
struct Pieces {
    /// Items along the two slowest axes.
    items: [usize; 2],
    /// Blocks decoded at a time.
    blocks: usize,
}

/// Frames and voxels that are decoded together, in the order of the output.
#[derive(Debug, Clone)]
struct Piece {
    frames: Vec<usize>,
    region: Region,
}

impl Pieces {
    fn new(file: &CoefficientFile, config: &ExtractConfig) -> Result<Self> {
        config.check(file)?;
        let length = |axis| length(axis, config.frames.len(), &config.region);
        let [_, second, third, fastest] = config.order.axes().map(length);
        let plane = third.saturating_mul(fastest).saturating_mul(file.sample().size());
        let fixed = |memory| memory::FIXED + file.shared_bytes(memory) + block_bytes(file);
        let available = config.memory.saturating_sub(fixed(config.memory)) / 2;
        if available < plane {
            let least = memory::least(|memory| 2 * plane + fixed(memory)).div_ceil(1 << 20);
            return Err(Error::setting("memory", format!("extracting from this file needs at least {least}MiB")));
        }
        file.limit_shared(config.memory);
        let blocks = (available / block_bytes(file)).clamp(1, rayon::current_num_threads());
        let planes = available / plane.max(1);
        Ok(Self { blocks, items: [(planes / second.max(1)).max(1), planes.min(second.max(1))] })
    }

    /// Pieces that are decoded side by side: several if each touches few blocks, as the series of a voxel does.
    fn together(&self, file: &CoefficientFile, config: &ExtractConfig) -> usize {
        let touched = file.blocks.touching(&config.region).take(self.blocks).count();
        (self.blocks / touched.max(1)).max(1)
    }

    fn list(&self, file: &CoefficientFile, config: &ExtractConfig) -> Vec<Piece> {
        let whole = Piece { frames: config.frames.clone(), region: config.region };
        let [slowest, second, ..] = config.order.axes();
        let slabs = whole.divided(slowest, self.items[0], file);
        if self.items[1] >= length(second, config.frames.len(), &config.region) {
            return slabs;
        }
        slabs.into_iter().flat_map(|slab| slab.divided(second, self.items[1], file)).collect()
    }
}

impl Piece {
    /// Cuts the piece along an axis, in the axis' direction, into pieces of at most so many items, and of frames of one
    /// window.
    fn divided(self, along: OutputAxis, items: usize, file: &CoefficientFile) -> Vec<Self> {
        match along {
            OutputAxis::Frames => {
                let groups = file.by_window(&self.frames).flat_map(|group| group.chunks(items));
                groups.map(|frames| Self { frames: frames.to_vec(), region: self.region }).collect()
            }
            OutputAxis::Voxels(axis, direction) => {
                let (start, end) = (self.region.start[axis], self.region.end[axis]);
                let starts = (0..end - start).step_by(items);
                let slab = |first: usize| {
                    let (low, high) = (first, (first + items).min(end - start));
                    let mut slab = self.clone();
                    (slab.region.start[axis], slab.region.end[axis]) = match direction {
                        Direction::Ascending => (start + low, start + high),
                        Direction::Descending => (end - high, end - low),
                    };
                    slab
                };
                starts.map(slab).collect()
            }
        }
    }
}

/// Bytes of memory to decode one block: its codes, its coefficients and its samples.
fn block_bytes(file: &CoefficientFile) -> usize {
    file.block_bytes() + file.largest_block() * file.sample().size()
}

/// The samples of a piece, in `buffer`, and the blocks that it read.
fn read_piece<'a>(
    file: &CoefficientFile,
    config: &ExtractConfig,
    piece: &Piece,
    at_once: usize,
    buffer: &'a mut Zeroed<u8>,
) -> Result<(ExtractReport, &'a [u8])> {
    let mut report = ExtractReport::default();
    let strides = Strides::new(&config.order, piece.frames.len(), &piece.region);
    let bytes = piece.frames.len() * piece.region.voxels() * file.sample().size();
    if buffer.len() < bytes {
        *buffer = Zeroed::default();
        *buffer = Zeroed::new(bytes);
    }
    let out = &mut buffer[..bytes]; // blocks overwrite all of it
    let mut first = 0;
    for frames in file.by_window(&piece.frames) {
        let target = Target { strides, region: piece.region, first };
        read_window(file, config.channel, frames, &target, at_once, out, &mut report)?;
        first += frames.len();
    }
    Ok((report, out))
}

/// Where samples go in the array of a piece.
struct Target {
    strides: Strides,
    region: Region,
    /// The place of the first frame among those of the piece.
    first: usize,
}

/// Frames of one window, and what decoding them takes.
struct InWindow {
    window: u32,
    codec: WindowCodec,
    wanted: WantedFrames,
}

impl InWindow {
    fn new(file: &CoefficientFile, frames: &[usize]) -> Result<Self> {
        let window = file.window_of(frames[0]);
        let (codec, first) = (file.codec(window)?, file.window_range(window).start);
        let wanted = WantedFrames::new(&codec, frames.iter().map(|frame| frame - first).collect());
        Ok(Self { window, codec, wanted })
    }
}

/// Reads the samples of a piece in frames of one window.
fn read_window(
    file: &CoefficientFile,
    channel: usize,
    frames: &[usize],
    target: &Target,
    at_once: usize,
    out: &mut [u8],
    report: &mut ExtractReport,
) -> Result<()> {
    let InWindow { window, codec, wanted } = InWindow::new(file, frames)?;
    let is_part = frames.len() < codec.frames() || target.region != file.grid.whole();
    let out = Mutex::new(out);
    let read = |entry: &BlockEntry| {
        let (samples, bytes_read) = file.samples(&codec, entry, &wanted, is_part)?;
        let region = file.blocks.region(entry.id.block as usize);
        let mut out = out.lock().unwrap_or_else(PoisonError::into_inner);
        target.copy(&codec, &wanted.frames, &region, &samples, &mut out);
        Ok(bytes_read)
    };
    for entries in file.entries(window, channel, &target.region) {
        let entries = entries?;
        for group in file.by_shared(&entries) {
            file.fetch_blocks(&codec, group.iter().copied(), &wanted.coefficients)?;
            let decoded_now = group.iter().copied().filter(|entry| !file.keeps_samples(entry));
            file.decode_shared(&codec, decoded_now, &wanted.coefficients)?;
            let is_any = at_once >= rayon::current_num_threads(); // there are no more threads than that
            for some in group.chunks(if is_any { group.len() } else { at_once }) {
                report.bytes_read += some.par_iter().map(|entry| read(entry)).sum::<Result<u64>>()?;
            }
        }
        report.blocks_read += entries.len() as u64;
    }
    Ok(())
}

impl Target {
    /// Copies the rows shared by a block and the piece.
    fn copy(&self, codec: &WindowCodec, frames: &[usize], block: &Region, samples: &[u8], out: &mut [u8]) {
        let (size, shared) = (codec.sample.size(), block.intersect(&self.region));
        let ([nx, ny, nz], [bx, by, _]) = (shared.dims(), block.dims());
        let [along_x, along_y, along_z] = [0, 1, 2].map(|axis| self.strides.along(axis));
        for (to_frame, from_frame) in frames.iter().enumerate() {
            let from = from_frame * block.voxels() + block.index(shared.start);
            let to = self.strides.place(self.first + to_frame, shared.start) as isize;
            for (z, y) in (0..nz).flat_map(|z| (0..ny).map(move |y| (z, y))) {
                let row = &samples[(from + bx * (y + by * z)) * size..][..nx * size];
                let to = to + y as isize * along_y + z as isize * along_z;
                copy_row(row, size, to as usize, along_x, out);
            }
        }
    }
}

/// Copies samples of `size` bytes to places that begin at `to` and lie `step` apart.
fn copy_row(row: &[u8], size: usize, to: usize, step: isize, out: &mut [u8]) {
    if step == 1 {
        return out[to * size..][..row.len()].copy_from_slice(row);
    }
    let mut at = to as isize;
    for sample in row.chunks_exact(size) {
        out[at as usize * size..][..size].copy_from_slice(sample);
        at += step;
    }
}
