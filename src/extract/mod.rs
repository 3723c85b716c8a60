//! Extracts samples from a coefficient file: any frames and any region, without reading the rest. Writes them in the
//! formats of other programs.

mod contents;
mod encoding;
mod format;
mod netcdf;
mod nrrd;
mod read;
mod sink;
mod vti;

pub use contents::Contents;
pub use format::SampleFormat;
pub use read::read_region;
pub use sink::{Files, Sink};

use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::base::memory;
use crate::base::progress::Progress;
use crate::codec::WindowCodec;
use crate::file::CoefficientFile;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
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
    /// Bytes that may be allocated. Default: 512 MiB.
    pub memory: usize,
}

impl ExtractConfig {
    /// All frames and voxels of the first channel of `file`.
    pub fn new(file: &CoefficientFile) -> Self {
        Self { frames: (0..file.frames()).collect(), region: file.grid.whole(), channel: 0, memory: memory::DEFAULT }
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

/// What an extraction did.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct ExtractReport {
    /// Frames written.
    pub frames: usize,
    /// Decoded blocks; a block decoded twice counts twice.
    pub blocks_read: u64,
    /// Stored bytes of blocks that were read.
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

/// Writes the samples in the file's sample type, little-endian, frame by frame, x fastest. Messages call `out` `name`.
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

/// As [`extract`]; `write` gets the samples in pieces: whole frames, or part of one frame.
pub fn extract_to(
    file: &CoefficientFile,
    config: &ExtractConfig,
    write: &mut dyn FnMut(&[u8]) -> Result<()>,
    progress: &dyn Progress,
) -> Result<ExtractReport> {
    progress.start(Some(config.frames.len() as u64));
    let mut report = ExtractReport::default();
    let pieces = Pieces::new(file, config)?;
    let mut bytes = Vec::new();
    for piece in pieces.list(file, config) {
        read_piece(file, config.channel, &piece, pieces.blocks, &mut bytes, &mut report)?;
        write(&bytes)?;
        report.bytes += bytes.len() as u64;
        if piece.region.end[2] == config.region.end[2] {
            report.frames += piece.frames.len();
            progress.advance(piece.frames.len() as u64);
        }
    }
    file.check_unchanged()?;
    (report.file_bytes_read, report.file_bytes) = (file.bytes_read(), file.bytes());
    progress.finish();
    Ok(report)
}

/// The amount decoded at a time: whole frames of a window, or slabs of z of one frame.
struct Pieces {
    frames: usize,
    slab: usize,
    /// Blocks decoded at a time.
    blocks: usize,
}

/// Frames of one window and voxels that are decoded together, in the order of the output.
struct Piece {
    window: u32,
    frames: Vec<usize>,
    region: Region,
}

impl Pieces {
    fn new(file: &CoefficientFile, config: &ExtractConfig) -> Result<Self> {
        config.check(file)?;
        let plane = config.region.dims()[0] * config.region.dims()[1] * file.sample().size();
        let frame = plane * config.region.dims()[2];
        let available = config.memory.saturating_sub(memory::FIXED + block_bytes(file)) / 2;
        if available < plane {
            let least = (2 * plane + memory::FIXED + block_bytes(file)).div_ceil(1 << 20);
            return Err(Error::setting("memory", format!("extracting from this file needs at least {least}MiB")));
        }
        let blocks = (available / block_bytes(file)).clamp(1, rayon::current_num_threads());
        Ok(Self { blocks, frames: (available / frame).max(1), slab: (available / plane).min(config.region.dims()[2]) })
    }

    fn list(&self, file: &CoefficientFile, config: &ExtractConfig) -> Vec<Piece> {
        let same_window = |a: &usize, b: &usize| file.window_of(*a) == file.window_of(*b);
        let groups = config.frames.chunk_by(same_window).flat_map(|g| g.chunks(self.frames));
        let [z0, z1] = [config.region.start[2], config.region.end[2]];
        groups
            .flat_map(|frames| {
                let window = file.window_of(frames[0]);
                (z0..z1).step_by(self.slab).map(move |z| {
                    let mut region = config.region;
                    (region.start[2], region.end[2]) = (z, (z + self.slab).min(z1));
                    Piece { window, frames: frames.to_vec(), region }
                })
            })
            .collect()
    }
}

/// Bytes of memory to decode one block: its codes, its coefficients and its samples.
fn block_bytes(file: &CoefficientFile) -> usize {
    file.block_bytes() + file.largest_block() * file.sample().size()
}

/// Fills `out` with the samples of a piece.
fn read_piece(
    file: &CoefficientFile,
    channel: usize,
    piece: &Piece,
    at_once: usize,
    out: &mut Vec<u8>,
    report: &mut ExtractReport,
) -> Result<()> {
    let codec = file.codec(piece.window)?;
    let first = file.window_range(piece.window).start;
    let frames: Vec<usize> = piece.frames.iter().map(|f| f - first).collect();
    let wanted = crate::wavelet::needed(&codec.synthesis, &frames);
    let size = file.sample().size();
    out.resize(frames.len() * piece.region.voxels() * size, 0); // blocks overwrite all of it
    for entries in file.entries(piece.window, channel, &piece.region) {
        for entries in entries?.chunks(at_once) {
            let batch = file.batch(&codec, entries, &wanted)?;
            let decode =
                |entry: &BlockEntry| batch.block(&codec, entry, &wanted).map(|b| (b.samples(&codec), b.bytes_read));
            let decoded = entries.par_iter().map(decode).collect::<Result<Vec<_>>>()?;
            for (entry, (samples, bytes_read)) in entries.iter().zip(decoded) {
                let region = file.blocks.region(entry.id.block as usize);
                copy_block(&codec, &frames, &region, &samples, &piece.region, out);
                report.blocks_read += 1;
                report.bytes_read += bytes_read;
            }
        }
    }
    Ok(())
}

/// Copies the rows shared by a block and the piece.
fn copy_block(codec: &WindowCodec, frames: &[usize], block: &Region, samples: &[u8], piece: &Region, out: &mut [u8]) {
    let size = codec.sample.size();
    let shared = block.intersect(piece);
    let row = shared.dims()[0] * size;
    for (to_frame, from_frame) in frames.iter().enumerate() {
        for (y, z) in shared.rows() {
            let voxel = [shared.start[0], y, z];
            let from = (from_frame * block.voxels() + block.index(voxel)) * size;
            let to = (to_frame * piece.voxels() + piece.index(voxel)) * size;
            out[to..to + row].copy_from_slice(&samples[from..from + row]);
        }
    }
}
