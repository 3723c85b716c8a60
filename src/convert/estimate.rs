//! How large a conversion would come out, by coding some blocks of some windows.

use super::{ConvertConfig, Plan, Task, convert};
use crate::error::{Error, Result};
use crate::progress::{Progress, Silent};
use crate::scan::{Scan, join_ranges, scan_frame};
use crate::source::{Archive, FrameSource, FrameWindow, OpenOptions, open_stream};
use crate::volume::{Grid, Region};
use serde::Serialize;
use std::io::{self, Cursor};
use std::path::Path;

/// Blocks that are coded of a window, and windows.
const BLOCKS: usize = 12;
const WINDOWS: usize = 3;

/// What an archive would come to.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Bytes of the coefficient file.
    pub bytes: u64,
    /// How many times smaller than the samples that is.
    pub ratio: f64,
    /// The tolerance.
    pub tolerance: f64,
    /// The value range that it refers to: of the first frame of each window that was looked at, and of the last frame.
    pub range: (f64, f64),
    /// Blocks that were coded in each window.
    pub blocks: usize,
    /// Windows of which blocks were coded.
    pub windows: usize,
}

/// Converts some blocks, spread over the volume and over time, and goes from them to all. For a bound that refers to a range.
///
/// # Errors
/// Those of a conversion, and a source that is a stream.
pub fn estimate(source: &mut dyn FrameSource, config: &ConvertConfig, progress: &dyn Progress) -> Result<Estimate> {
    let archive = source.archive().clone();
    let Some(frames) = archive.frames.filter(|frames| *frames > 0) else {
        return Err(Error::usage("--estimate: needs frames that can be read more than once, not standard input"));
    };
    let task = Task::new(config, &archive);
    let plan = Plan::new(&task.config, &task.archive, None)?;
    let regions = spread(plan.blocks.len(), BLOCKS).map(|block| plan.blocks.region(block)).collect::<Vec<_>>();
    let firsts = windows(frames, config.window);
    progress.start(Some(firsts.len() as u64));
    let range = config.range.map_or_else(|| range(source, &archive, task.config.missing_value, &firsts), Ok)?;
    let config = ConvertConfig { range: Some(range), block: Some(plan.blocks.edge), ..task.config };
    let (mut coded, mut samples) = (0, 0);
    for first in &firsts {
        let window = source.window(*first, config.window.min(frames - first))?;
        for together in regions.chunk_by(|a, b| can_be_stacked(a, b, plan.blocks.edge)) {
            let mut stack = stacked(window.as_ref(), &archive, together)?;
            samples += stack.archive().grid.whole().voxels() * window.frames();
            coded += convert(stack.as_mut(), &config, Path::new("estimate"), io::sink(), &Silent)?.output_bytes;
        }
        progress.advance(1);
    }
    progress.finish();
    let all = archive.grid.whole().voxels() as f64 * frames as f64;
    let bytes = coded as f64 * all / samples as f64;
    let ratio = all * archive.sample.size() as f64 / bytes.max(1.0);
    let (blocks, windows) = (regions.len(), firsts.len());
    Ok(Estimate { bytes: bytes as u64, ratio, tolerance: config.tolerance, range, blocks, windows })
}

/// Up to `most` of so many, at even distances.
fn spread(all: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = all.min(most);
    (0..count).map(move |i| (2 * i + 1) * all / (2 * count))
}

/// The first frames of some windows: of whole ones, unless there is none.
fn windows(frames: usize, window: usize) -> Vec<usize> {
    spread((frames / window).max(1), WINDOWS).map(|index| index * window).collect()
}

/// The range of some whole frames: the first one of each window, and the very last one.
fn range(
    source: &mut dyn FrameSource,
    archive: &Archive,
    missing_value: Option<f64>,
    firsts: &[usize],
) -> Result<(f64, f64)> {
    let last = archive.frames.map(|frames| frames - 1);
    let mut seen = Scan::NOTHING.range;
    for frame in firsts.iter().copied().chain(last) {
        let window = source.window(frame, 1)?;
        let scan = scan_frame(Scan::NOTHING, window.as_ref(), 0, &archive.grid, archive.sample, missing_value)?;
        seen = join_ranges(seen, scan.range);
    }
    Ok(if seen.0 <= seen.1 { seen } else { (0.0, 0.0) })
}

/// Whether two blocks of `edge` voxels a side are still blocks where one lies upon the other.
fn can_be_stacked(a: &Region, b: &Region, edge: usize) -> bool {
    a.dims() == b.dims() && a.dims()[2] == edge
}

/// Blocks of a window, one upon the other, as an archive of their own.
fn stacked(window: &dyn FrameWindow, archive: &Archive, blocks: &[Region]) -> Result<Box<dyn FrameSource>> {
    let [x, y, z] = blocks[0].dims();
    let grid = Grid::unit([x, y, z * blocks.len()]);
    let block = x * y * z * archive.sample.size();
    let mut samples = vec![0; block * blocks.len() * window.frames()];
    for (frame, samples) in samples.chunks_exact_mut(block * blocks.len()).enumerate() {
        for (region, samples) in blocks.iter().zip(samples.chunks_exact_mut(block)) {
            window.read_box(frame, region, samples)?;
        }
    }
    let dims = grid.dims.into_iter().chain([window.frames()]).collect();
    let (memory, sample) = (samples.len(), Some(archive.sample));
    let options = OpenOptions { dims: Some(dims), sample, memory, ..OpenOptions::default() };
    open_stream(Cursor::new(samples), &options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_spread_evenly() {
        assert_eq!(spread(3, 12).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(spread(100, 4).collect::<Vec<_>>(), [12, 37, 62, 87]);
        assert_eq!(
            [windows(5, 32), windows(100, 32), windows(640, 32)],
            [vec![0], vec![0, 32, 64], vec![96, 320, 512]]
        );
    }
}
