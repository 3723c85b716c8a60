//! Measures one archive with one scheme at one tolerance, in this process.

use super::clock::{least, stay_on_one_core};
use super::schemes;
use crate::bench::process::ProcessTask;
use memmap2::MmapMut;
use serde::{Deserialize, Serialize};
use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Region;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample;
use wavesplat::convert::{ConvertReport, convert};
use wavesplat::file::CoefficientFile;
use wavesplat::formats;
use wavesplat::source::{OpenOptions, read_frames};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::bound::difference_up;
use wavesplat_core::codec::decode::Block;
use wavesplat_demo::scenes::MEMORY;

/// The settings of a measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::bench) struct Task {
    /// The archive.
    pub(super) source: PathBuf,
    /// A name of [`schemes::SCHEMES`].
    pub(super) scheme: String,
    pub(super) tolerance: f64,
    /// Lowest and highest sample of the archive.
    pub(super) range: (f64, f64),
    /// Number of repetitions of every time.
    pub(super) repeats: usize,
    /// Path of the coefficient file.
    pub(super) output: PathBuf,
}

/// The result of a measurement.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::bench) struct Measured {
    /// Bytes of the file.
    pub(super) bytes: u64,
    /// Number of nonzero codes.
    pub(super) codes_per_sample: f64,
    /// Samples stored exactly because their codes exceed the bound.
    pub(super) outliers: u64,
    /// Samples of blocks that are stored exactly and so have no codes.
    pub(super) exact_samples: u64,
    /// The largest error that a sample may have, in the units of the samples.
    pub(super) bound: f64,
    /// The largest error of any decoded sample; infinite if a value is lost.
    pub(super) largest_error: f64,
    /// Seconds from opening the archive to the last byte, in memory.
    pub(super) encode_seconds: f64,
    /// Seconds from opening the file to all samples in one array, like the peers.
    pub(super) decode_seconds: f64,
    /// Seconds from opening the file to the codes of all blocks, one after another, like the renderer.
    pub(super) codes_seconds: f64,
}

impl ProcessTask for Task {
    const NAME: &'static str = "size";
    type Measured = Measured;

    fn measure(&self) -> Result<Measured> {
        measure(self)
    }
}

/// Measures all times, and compares every sample.
fn measure(task: &Task) -> Result<Measured> {
    stay_on_one_core();
    let ((report, bytes), encode_seconds) = least(task.repeats, || encode(task))?;
    fs::write(&task.output, &bytes).map_err(|e| Error::io(&task.output, "writing", e))?;
    let (exact_samples, codes_seconds) = least(task.repeats, || codes(&task.output))?;
    let (samples, decode_seconds) = least(task.repeats, || decode(&task.output))?;
    Ok(Measured {
        bytes: bytes.len() as u64,
        codes_per_sample: report.coefficients_per_sample,
        outliers: report.outliers,
        exact_samples,
        bound: report.delta,
        largest_error: largest_error(&task.source, &samples)?,
        encode_seconds,
        decode_seconds,
        codes_seconds,
    })
}

fn encode(task: &Task) -> Result<(ConvertReport, Vec<u8>)> {
    let mut frames = formats::open(std::slice::from_ref(&task.source), &OpenOptions::default())?;
    let config = schemes::config(&task.scheme, frames.archive(), task.tolerance, task.range, MEMORY)?;
    let mut bytes = Vec::new();
    let report = convert(frames.as_mut(), &config, &task.output, &mut bytes, &Silent)?;
    Ok((report, bytes))
}

/// Reads and unpacks all codes; returns how many samples have none because their blocks are stored exactly.
fn codes(path: &Path) -> Result<u64> {
    let file = CoefficientFile::open(path)?;
    let mut exact = 0;
    for_each_block(&file, |place, block| {
        let samples = place.region.voxels() * place.codec.frames();
        exact += if block.exact.is_some() { samples as u64 } else { 0 };
        black_box(&block);
    })?;
    Ok(exact)
}

/// All samples in their own type, little-endian, as (t, z, y, x).
fn decode(path: &Path) -> Result<MmapMut> {
    let file = CoefficientFile::open(path)?;
    let whole = file.grid.whole();
    let (size, frame_bytes) = (file.sample().size(), whole.voxels() * file.sample().size());
    let mut out = array(file.frames() * frame_bytes).map_err(|e| Error::io(path, "allocating its samples", e))?;
    for_each_block(&file, |place, block| {
        let samples = block.samples(place.codec);
        let frames = out[place.first_frame * frame_bytes..].chunks_exact_mut(frame_bytes);
        for (from, to) in samples.chunks_exact(place.region.voxels() * size).zip(frames) {
            put(from, &place.region, to, &whole, size);
        }
    })?;
    Ok(out)
}

/// Memory like that of the peers' arrays: NumPy requests large pages, which take a fraction of the time.
fn array(len: usize) -> std::io::Result<MmapMut> {
    let array = MmapMut::map_anon(len)?;
    #[cfg(target_os = "linux")]
    let _ = array.advise(memmap2::Advice::HugePage); // where that is refused, it takes longer
    Ok(array)
}

/// The position of a block in the archive.
struct BlockPosition<'a> {
    codec: &'a WindowCodec,
    first_frame: usize,
    region: Region,
}

/// Reads every block with all its codes, one after another.
fn for_each_block(file: &CoefficientFile, mut visit: impl FnMut(&BlockPosition<'_>, &Block)) -> Result<()> {
    let whole = file.grid.whole();
    for window in 0..file.metadata().windows.len() as u32 {
        let codec = &file.codec(window)?;
        let wanted = vec![true; codec.basis.coefficients()];
        let first_frame = file.window_range(window).start;
        for entries in file.entries(window, 0, &whole) {
            for entry in entries? {
                let region = file.blocks.region(entry.id.block as usize);
                visit(&BlockPosition { codec, first_frame, region }, &file.block(codec, &entry, &wanted)?);
            }
        }
    }
    Ok(())
}

/// Copies the rows of a block of one frame to their places in the frame.
fn put(block: &[u8], region: &Region, frame: &mut [u8], whole: &Region, size: usize) {
    let row = region.dims()[0] * size;
    for (from, (y, z)) in block.chunks_exact(row).zip(region.rows()) {
        let to = whole.index([region.start[0], y, z]) * size;
        frame[to..to + row].copy_from_slice(from);
    }
}

/// The largest error of any sample compared with the archive, rounded up; infinite if a value is lost.
fn largest_error(source: &Path, samples: &[u8]) -> Result<f64> {
    let mut archive = formats::open(&[source.into()], &OpenOptions::default())?;
    let (whole, ty) = (archive.archive().grid.whole(), archive.archive().sample);
    let frame_bytes = whole.voxels() * ty.size();
    let count = samples.len() / frame_bytes;
    let window = archive.window(0, count)?;
    if Some(count) != archive.archive().frames {
        return Ok(f64::INFINITY);
    }
    let mut largest = 0.0_f64;
    let (mut a, mut b) = (vec![0.0; whole.voxels()], vec![0.0; whole.voxels()]);
    for (frame, decoded) in samples.chunks_exact(frame_bytes).enumerate() {
        sample::load(ty, &read_frames(window.as_ref(), std::iter::once(frame), &whole, ty)?, &mut a);
        sample::load(ty, decoded, &mut b);
        let errors = a.iter().zip(&b).map(|(a, b)| difference_up(*a, *b));
        largest = errors.map(|e| if e.is_nan() { f64::INFINITY } else { e }).fold(largest, f64::max);
    }
    Ok(largest)
}
