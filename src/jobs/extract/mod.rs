//! Extracts samples from a coefficient file: any frames and any region, without reading the rest. Writes them in the
//! formats of other programs.

mod ahead;
mod contents;
mod read;
mod sink;
mod strides;
mod placed;
mod to_files;

pub use contents::contents;
pub use read::read_region;
pub use to_files::{OutputOfExtraction, format_of};
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
use wavesplat_engine::file::{CoefficientFile, SamplesOfBlock};
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
    /// Bytes that may be allocated, beside the memory of [`extract_into`]. Default: 512 MiB.
    pub memory: usize,
}

impl ExtractConfig {
    /// All frames and voxels of the first channel of `file`.
    pub fn new(file: &CoefficientFile) -> Self {
        let (frames, order) = ((0..file.frames()).collect(), SampleOrder::default());
        Self { frames, region: file.grid.whole(), channel: 0, order, memory: memory::DEFAULT }
    }

    /// Bytes of the samples.
    fn bytes(&self, file: &CoefficientFile) -> usize {
        self.frames.len() * self.region.voxels() * file.sample().size()
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
fn check_memory(file: &CoefficientFile, config: &ExtractConfig) -> Result<()> {
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
    let mut buffers: Vec<Zeroed<u8>> = Vec::new();
    Extraction::in_order(file, config, Pieces::new(file, config)?)
        .for_each_group(progress, |group, lengths| {
            let read = group.read(rooms(&mut buffers, lengths))?;
            buffers.iter().zip(lengths).try_for_each(|(buffer, len)| write(&buffer[..*len]))?;
            Ok(read)
        })
        .inspect(|_| progress.finish())
}

/// As [`extract`], to memory, which has room for all samples and no more.
///
/// # Errors
/// As [`extract`], and [`Error::Setting`] for memory of another size.
pub fn extract_into(
    file: &CoefficientFile,
    config: &ExtractConfig,
    out: &mut [u8],
    progress: &dyn Progress,
) -> Result<ExtractReport> {
    config.check(file)?;
    if out.len() != config.bytes(file) {
        return Err(Error::setting("out", format!("takes {} bytes, not {}", config.bytes(file), out.len())));
    }
    let mut left = out;
    let windows = Pieces { items: [usize::MAX; 2], ..Pieces::new(file, config)? }; // so each block is decoded once
    Extraction::in_order(file, config, windows)
        .for_each_group(progress, |group, lengths| {
            let (mut parts, after) = std::mem::take(&mut left).split_at_mut(lengths.iter().sum());
            left = after;
            let rooms = lengths.iter().map(|len| parts.split_off_mut(..*len).unwrap_or_default()).collect();
            group.read(rooms)
        })
        .inspect(|_| progress.finish())
}

/// The first bytes of some buffers, as many buffers as there are lengths.
fn rooms<'a>(buffers: &'a mut Vec<Zeroed<u8>>, lengths: &[usize]) -> Vec<&'a mut [u8]> {
    buffers.resize_with(lengths.len(), Zeroed::default);
    buffers.iter_mut().zip(lengths).map(|(buffer, len)| room(buffer, *len)).collect()
}

/// The first `len` bytes of a buffer, which is replaced by a longer one if it is too short.
fn room(buffer: &mut Zeroed<u8>, len: usize) -> &mut [u8] {
    if buffer.len() < len {
        *buffer = Zeroed::default();
        *buffer = Zeroed::new(len);
    }
    &mut buffer[..len]
}

/// An extraction, divided into pieces.
struct Extraction<'a> {
    file: &'a CoefficientFile,
    config: &'a ExtractConfig,
    pieces: Pieces,
    list: Vec<Piece>,
}

impl<'a> Extraction<'a> {
    /// One whose pieces are in the order of the output.
    fn in_order(file: &'a CoefficientFile, config: &'a ExtractConfig, pieces: Pieces) -> Self {
        let list = pieces.list(file, config);
        Self { file, config, pieces, list }
    }

    /// Reads all pieces, in groups that are decoded side by side. `read` gets each group and the bytes of each of its pieces. The
    /// caller finishes the progress.
    fn for_each_group(
        &self,
        progress: &dyn Progress,
        mut read: impl FnMut(&Group<'_>, &[usize]) -> Result<ExtractReport>,
    ) -> Result<ExtractReport> {
        let Self { file, config, pieces, list } = self;
        progress.start(Some(config.frames.len() as u64));
        file.begin_run();
        let mut report = ExtractReport::default();
        let all = config.bytes(file);
        let (mut begun, mut fetched) = (0, 0);
        for together in list.chunks(pieces.together(file, list)) {
            progress.check()?;
            if fetched < begun + together.len() {
                fetched = begun + fetch_ahead(file, config, &list[begun..])?;
            }
            begun += together.len();
            let lengths: Vec<usize> = together.iter().map(|piece| piece.bytes(file)).collect();
            let group = Group { file, config, pieces: together, blocks: pieces.blocks, progress };
            let ExtractReport { blocks_read, bytes_read, .. } = read(&group, &lengths)?;
            report.blocks_read += blocks_read;
            report.bytes_read += bytes_read;
            report.bytes += lengths.iter().sum::<usize>() as u64;
            let done = (report.bytes as u128 * config.frames.len() as u128 / all as u128) as usize;
            progress.advance((done - report.frames) as u64);
            report.frames = done;
        }
        file.check_unchanged()?;
        (report.file_bytes_read, report.file_bytes) = (file.bytes_read(), file.bytes());
        Ok(report)
    }
}

/// Pieces that are decoded side by side.
struct Group<'a> {
    file: &'a CoefficientFile,
    config: &'a ExtractConfig,
    pieces: &'a [Piece],
    /// Blocks that each decodes at a time.
    blocks: usize,
    /// Tells whether the samples are still wanted.
    progress: &'a dyn Progress,
}

impl Group<'_> {
    /// Reads each piece into its room, which has just its size.
    fn read(&self, rooms: Vec<&mut [u8]>) -> Result<ExtractReport> {
        let read = |(piece, room)| self.read_piece(piece, room);
        let read = self.pieces.par_iter().zip(rooms).map(read).collect::<Result<Vec<ExtractReport>>>()?;
        let (blocks_read, bytes_read) =
            read.iter().fold((0, 0), |sum, one| (sum.0 + one.blocks_read, sum.1 + one.bytes_read));
        Ok(ExtractReport { blocks_read, bytes_read, ..ExtractReport::default() })
    }

    /// Reads the samples of a piece into `out`, which has just their size. Blocks overwrite all of it.
    fn read_piece(&self, piece: &Piece, out: &mut [u8]) -> Result<ExtractReport> {
        let mut report = ExtractReport::default();
        let strides = Strides::new(&self.config.order, piece.frames.len(), &piece.region);
        let mut first = 0;
        for frames in self.file.by_window(&piece.frames) {
            let target = Target { strides, region: piece.region, first };
            self.read_window(frames, &target, out, &mut report)?;
            first += frames.len();
        }
        Ok(report)
    }

    /// Reads the samples of a piece in frames of one window.
    fn read_window(&self, frames: &[usize], target: &Target, out: &mut [u8], report: &mut ExtractReport) -> Result<()> {
        let (file, at_once) = (self.file, self.blocks);
        let InWindow { window, codec, wanted } = &InWindow::new(file, frames)?;
        let (is_part, numbers) = (target.region != file.grid.whole(), (0..frames.len()).collect::<Vec<usize>>());
        let ahead = file.read_ahead(*window, self.config.channel, &target.region, frames);
        let ahead = ahead.map(|frames| WantedFrames::new(codec, frames.collect()));
        let decoded = ahead.as_ref().unwrap_or(wanted);
        let out = Mutex::new(out);
        let read = |entry: &BlockEntry| {
            let region = file.blocks.region(entry.id.block as usize);
            let out = || out.lock().unwrap_or_else(PoisonError::into_inner);
            let (shared, part) = target.shared(&region);
            if let Some((samples, bytes_read)) = file.samples_of_part(codec, entry, wanted, &part)? {
                target.copy(codec, &numbers, &shared, &samples, &mut out());
                return Ok(bytes_read);
            }
            let SamplesOfBlock { samples, first, bytes_read } =
                file.samples(codec, entry, wanted, ahead.as_ref(), is_part)?;
            let frames: Vec<usize> = wanted.frames.iter().map(|frame| frame - first).collect();
            target.copy(codec, &frames, &region, &samples, &mut out());
            Ok(bytes_read)
        };
        for entries in file.entries(*window, self.config.channel, &target.region) {
            let entries = entries?;
            for group in file.by_shared(&entries) {
                self.progress.check()?;
                let decoded_now: Vec<&BlockEntry> =
                    group.iter().copied().filter(|entry| !file.keeps_samples(entry, ahead.as_ref())).collect();
                file.fetch_blocks(codec, decoded_now.iter().copied(), &decoded.coefficients)?;
                file.decode_shared(codec, self.sharing(codec, decoded_now, target)?, &decoded.coefficients)?;
                let is_any = at_once >= rayon::current_num_threads(); // there are no more threads than that
                for some in group.chunks(if is_any { group.len() } else { at_once }) {
                    report.bytes_read += some.par_iter().map(|entry| read(entry)).sum::<Result<u64>>()?;
                }
            }
            report.blocks_read += entries.len() as u64;
        }
        Ok(())
    }

    /// The blocks that need the whole block above them. A block needs only a part of it if a tiny part of the block is decoded.
    fn sharing<'e>(
        &self,
        codec: &WindowCodec,
        blocks: Vec<&'e BlockEntry>,
        target: &Target,
    ) -> Result<Vec<&'e BlockEntry>> {
        let mut sharing = Vec::new();
        for entry in blocks {
            let (_, part) = target.shared(&self.file.blocks.region(entry.id.block as usize));
            if !self.file.reads_alone(codec, entry, &part)? {
                sharing.push(entry);
            }
        }
        Ok(sharing)
    }
}

/// The amount decoded at a time: some items of the slowest axis, or one of its items and some items of the second axis.
struct Pieces {
    /// Items along the two slowest axes.
    items: [usize; 2],
    /// Blocks decoded at a time.
    blocks: usize,
    /// Bytes that pieces may take.
    room: usize,
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
        Ok(Self { blocks, room: available, items: [(planes / second.max(1)).max(1), planes.min(second.max(1))] })
    }

    /// Pieces that are decoded side by side: several if each touches few blocks, as the series of a voxel does, and two sets of
    /// them fit in memory.
    fn together(&self, file: &CoefficientFile, list: &[Piece]) -> usize {
        let touched = list.first().map_or(1, |piece| file.blocks.touching(&piece.region).take(self.blocks).count());
        let largest = list.iter().map(|piece| piece.bytes(file)).max().unwrap_or(0);
        (self.blocks / touched.max(1)).min(self.room / 2 / largest.max(1)).max(1)
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
    /// Bytes of its samples.
    fn bytes(&self, file: &CoefficientFile) -> usize {
        self.frames.len() * self.region.voxels() * file.sample().size()
    }

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

impl Target {
    /// What a block shares with the piece, and the same counted from the block's first voxel.
    fn shared(&self, block: &Region) -> (Region, Region) {
        let shared = block.intersect(&self.region);
        (shared, shared.relative_to(block))
    }

    /// Copies the rows shared by a block, or a part of it, and the piece. `frames` are the numbers of the frames in `samples`.
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
