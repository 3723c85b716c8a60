//! Overviews of coefficient files and of frames: single samples of few frames, without decoding or reading the others.

use crate::file::{CoefficientFile, Prefetch};
use crate::render::batches::OverviewRequest;
use rayon::prelude::*;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{self, SampleType, is_missing};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::source::FrameWindow;
use wavesplat_core::wavelet;
use wavesplat_format::BlockEntry;

/// An overview of a file, decoded from the coarse parts of its blocks where it has pyramids.
pub(super) fn overview(
    file: &CoefficientFile,
    request: &OverviewRequest<'_>,
    progress: &dyn Progress,
) -> Result<Vec<f32>> {
    let windows: Vec<_> = file.by_window(request.frames).collect();
    let blocks = file.blocks.touching(&request.region).count();
    progress.start(Some((file.channels() * windows.len() * blocks) as u64));
    let mut samples = vec![f32::NAN; file.channels() * request.samples()];
    let of_frame = request.samples() / request.frames.len();
    fetch(file, request, &windows)?;
    let mut rest = samples.as_mut_slice();
    for channel in 0..file.channels() {
        for frames in &windows {
            let (of_window, later) = rest.split_at_mut(frames.len() * of_frame);
            decode_window(file, request, frames, channel, of_window, progress)?;
            rest = later;
        }
    }
    file.check_unchanged()?;
    progress.finish();
    Ok(samples)
}

/// Fetches the parts that the overview needs from a remote file, as many as should be fetched together.
fn fetch(file: &CoefficientFile, request: &OverviewRequest<'_>, windows: &[&[usize]]) -> Result<()> {
    let Some(mut prefetch) = Prefetch::new(file) else { return Ok(()) };
    for channel in 0..file.channels() {
        prefetch.leaves(windows.iter().copied(), channel, &request.region)?;
        prefetch.gather(windows, |frames, prefetch| {
            let (window, codec, frames) = coarse(file, request, frames)?;
            let wanted = wavelet::needed(&codec.synthesis, &frames);
            for entries in file.entries(window, channel, &request.region) {
                entries?.iter().try_for_each(|entry| prefetch.add(&codec, entry, &wanted))?;
            }
            Ok(())
        })?;
    }
    prefetch.finish()
}

/// The window of some frames, the codec for their overview, and their numbers in the window.
fn coarse(
    file: &CoefficientFile,
    request: &OverviewRequest<'_>,
    frames: &[usize],
) -> Result<(u32, WindowCodec, Vec<usize>)> {
    let window = file.window_of(frames[0]);
    let (codec, first) = (file.coarse_codec(window, request.thinning.stride)?, file.window_range(window).start);
    Ok((window, codec, frames.iter().map(|f| f - first).collect()))
}

/// The overview of some frames of one window, in one channel.
fn decode_window(
    file: &CoefficientFile,
    request: &OverviewRequest<'_>,
    frames: &[usize],
    channel: usize,
    samples: &mut [f32],
    progress: &dyn Progress,
) -> Result<()> {
    let (window, codec, frames) = coarse(file, request, frames)?;
    let wanted = wavelet::needed(&codec.synthesis, &frames);
    let decode = |entry: &BlockEntry| file.coarse(&codec, entry, request.thinning.stride, &frames);
    for entries in file.entries(window, channel, &request.region) {
        let mut entries = entries?;
        entries.sort_by_cached_key(|entry| file.blocks.place_in_nested(entry.id.block as usize));
        for some in entries.chunks(TOGETHER) {
            progress.check()?;
            file.decode_shared(&codec, some, &wanted)?;
            let decoded = some.par_iter().map(decode).collect::<Result<Vec<_>>>()?;
            some.iter().zip(decoded).for_each(|(entry, block)| put(request, entry.id.block as usize, &block, samples));
            progress.advance(some.len() as u64);
        }
    }
    Ok(())
}

/// Blocks that are decoded at a time.
const TOGETHER: usize = 32;

/// Puts the samples of a block in their places of all frames.
fn put(request: &OverviewRequest<'_>, block: usize, samples: &[f32], frames: &mut [f32]) {
    let dims = request.thinning.blocks().dims;
    let row = request.thinning.blocks().region(block).dims()[0];
    let starts: Vec<usize> = request.rows(block).collect();
    let of_frames = frames.chunks_exact_mut(dims.iter().product()).zip(samples.chunks_exact(row * starts.len()));
    for (frame, samples) in of_frames {
        starts
            .iter()
            .zip(samples.chunks_exact(row))
            .for_each(|(at, row)| frame[*at..][..row.len()].copy_from_slice(row));
    }
}

/// Frames to thin, of one type.
pub(super) struct Frames<'a> {
    pub(super) window: &'a dyn FrameWindow,
    pub(super) sample: SampleType,
    /// The value that means "missing", besides NaN and infinities.
    pub(super) missing_value: Option<f64>,
}

impl Frames<'_> {
    /// The overview of one frame of the window. Reads the rows along x that the overview takes voxels of.
    pub(super) fn thin(&self, frame: usize, request: &OverviewRequest<'_>, samples: &mut [f32]) -> Result<()> {
        let [nx, ny, _] = request.thinning.blocks().dims;
        let [xs, ys, zs] = [0, 1, 2].map(|axis| request.thinning.taken(axis));
        let Region { start, end } = request.region;
        let is_needed = |axis: usize, at: usize| (start[axis]..end[axis]).contains(&at);
        let planes = samples.par_chunks_exact_mut(nx * ny).zip(zs).filter(|(_, z)| is_needed(2, *z));
        planes.try_for_each(|(plane, z)| {
            let mut rows = plane.chunks_exact_mut(nx).zip(&ys).filter(|(_, y)| is_needed(1, **y));
            rows.try_for_each(|(row, y)| {
                let all = self.row(frame, [*y, z], request.thinning.blocks.dims[0])?;
                row.iter_mut().zip(&xs).for_each(|(out, x)| *out = all[*x]);
                Ok(())
            })
        })
    }

    /// A row of `voxels` voxels along x; NaN where one is missing.
    fn row(&self, frame: usize, [y, z]: [usize; 2], voxels: usize) -> Result<Vec<f32>> {
        let row = Region { start: [0, y, z], end: [voxels, y + 1, z + 1] };
        let (mut bytes, mut values) = (vec![0; voxels * self.sample.size()], vec![0.0; voxels]);
        self.window.read_box(frame, &row, &mut bytes)?;
        sample::load(self.sample, &bytes, &mut values);
        Ok(values.iter().map(|v| if is_missing(*v, self.missing_value) { f32::NAN } else { *v as f32 }).collect())
    }
}
