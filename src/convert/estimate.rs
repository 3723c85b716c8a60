//! Estimates the size of a coefficient file by coding some blocks of some windows.

use super::{ConvertConfig, Plan, Task, convert};
use crate::base::error::{Error, Result};
use crate::base::grid::{BlockGrid, Grid, Region};
use crate::base::output::STANDARD;
use crate::base::progress::{Progress, Silent};
use crate::base::sample::join_ranges;
use crate::source::scan::{Scan, scan_frame};
use crate::source::{Archive, FrameSource, FrameWindow, OpenOptions, open_stream};
use serde::Serialize;
use std::collections::BTreeSet;
use std::io::{self, Cursor};
use std::path::Path;

/// The largest number of blocks coded in a window, and of windows.
const BLOCKS: usize = 24;
const WINDOWS: usize = 3;
/// The samples of these blocks take at most one part in this many of the allowed memory.
const SHARE: usize = 4;

/// The estimated size of an archive's coefficient file.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Bytes of the coefficient file.
    pub bytes: u64,
    /// The compression ratio: bytes of the samples divided by `bytes`.
    pub ratio: f64,
    /// The tolerance.
    pub tolerance: f64,
    /// The value range that it refers to, from a few frames of each coded window and the last frame.
    pub range: (f64, f64),
    /// Blocks that were coded in each window.
    pub blocks: usize,
    /// Windows with coded blocks.
    pub windows: usize,
}

/// Converts some blocks, spread over the volume and over time, and scales their size to the whole archive. For a bound
/// that refers to a range.
///
/// # Errors
/// Those of a conversion; also an error if the source is a stream.
pub fn estimate(source: &mut dyn FrameSource, config: &ConvertConfig, progress: &dyn Progress) -> Result<Estimate> {
    let archive = source.archive().clone();
    let Some(frames) = archive.frames.filter(|frames| *frames > 0) else {
        return Err(Error::path(
            STANDARD,
            "an estimate needs frames that can be read more than once, not standard input",
        ));
    };
    let task = Task::new(config, &archive);
    let plan = Plan::new(&task.config, &task.archive, None)?;
    let block = plan.blocks.region(0).voxels() * archive.sample.size() * config.window;
    let most = (config.memory / SHARE / block).clamp(1, BLOCKS);
    let regions = spread(plan.blocks.len(), most).map(|block| whole_block(&plan, block)).collect::<Vec<_>>();
    let firsts = windows(frames, config.window);
    progress.start(Some(firsts.len() as u64));
    let frames_read = FramesRead { archive: &archive, missing_value: task.config.missing_value, regions: &regions };
    let range = config.range.map_or_else(|| frames_read.range(source, config.window, &firsts), Ok)?;
    let config = ConvertConfig { range: Some(range), block: Some(plan.blocks.edges[0]), ..task.config };
    let (mut coded, mut samples) = (0, 0);
    for first in &firsts {
        let window = source.window(*first, config.window.min(frames - first))?;
        let mut stack = stacked(window.as_ref(), &archive, &regions)?;
        samples += stack.archive().grid.whole().voxels() * window.frames();
        coded += convert(stack.as_mut(), &config, Path::new("estimate"), io::sink(), &Silent)?.output_bytes;
        progress.advance(1);
    }
    progress.finish();
    let all = archive.grid.whole().voxels() as f64 * frames as f64;
    let bytes = coded as f64 * all / samples as f64;
    let ratio = all * archive.sample.size() as f64 / bytes.max(1.0);
    let (blocks, windows) = (regions.len(), firsts.len());
    Ok(Estimate { bytes: bytes as u64, ratio, tolerance: config.tolerance, range, blocks, windows })
}

/// Up to `most` indices below `all`, evenly spaced.
fn spread(all: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = all.min(most);
    (0..count).map(move |i| (2 * i + 1) * all / (2 * count))
}

/// The first frames of some windows: of all windows if they are few, else only of full ones.
fn windows(frames: usize, window: usize) -> Vec<usize> {
    let all = frames.div_ceil(window);
    spread(if all <= WINDOWS { all } else { frames / window }, WINDOWS).map(|index| index * window).collect()
}

/// The frames that are read to find a value range.
struct FramesRead<'a> {
    archive: &'a Archive,
    missing_value: Option<f64>,
    /// The coded blocks.
    regions: &'a [Region],
}

impl FramesRead<'_> {
    /// The value range of the last frame and, in each window, of the first frame and of those with the least and the
    /// largest sample of the coded blocks.
    fn range(&self, source: &mut dyn FrameSource, window: usize, firsts: &[usize]) -> Result<(f64, f64)> {
        let frames = self.archive.frames.unwrap_or(0);
        let mut range = Scan::NOTHING.range;
        for first in firsts {
            let window = source.window(*first, window.min(frames - first))?;
            for frame in self.extreme_frames(window.as_ref())? {
                range = join_ranges(range, self.scan(window.as_ref(), frame, &self.archive.grid)?);
            }
        }
        let last = source.window(frames - 1, 1)?;
        range = join_ranges(range, self.scan(last.as_ref(), 0, &self.archive.grid)?);
        Ok(if range.0 <= range.1 { range } else { (0.0, 0.0) })
    }

    /// The first frame of a window, and the frames with the least and the largest sample of the coded blocks.
    fn extreme_frames(&self, window: &dyn FrameWindow) -> Result<BTreeSet<usize>> {
        let mut stack = stacked(window, self.archive, self.regions)?;
        let grid = stack.archive().grid;
        let stack = stack.window(0, window.frames())?;
        let ranges = (0..window.frames()).map(|frame| self.scan(stack.as_ref(), frame, &grid));
        let ranges: Vec<(f64, f64)> = ranges.collect::<Result<_>>()?;
        let least = (0..ranges.len()).min_by(|a, b| ranges[*a].0.total_cmp(&ranges[*b].0));
        let largest = (0..ranges.len()).max_by(|a, b| ranges[*a].1.total_cmp(&ranges[*b].1));
        Ok([0].into_iter().chain(least).chain(largest).collect())
    }

    fn scan(&self, window: &dyn FrameWindow, frame: usize, grid: &Grid) -> Result<(f64, f64)> {
        Ok(scan_frame(Scan::NOTHING, window, frame, grid, self.archive.sample, self.missing_value)?.range)
    }
}

/// A block, moved inwards if a far face cuts it, so that all blocks have the same size.
fn whole_block(plan: &Plan<'_>, block: usize) -> Region {
    let (Region { start, .. }, BlockGrid { dims, edges: [edge, ..] }) = (plan.blocks.region(block), plan.blocks);
    let start: [usize; 3] = std::array::from_fn(|axis| start[axis].min(dims[axis].saturating_sub(edge)));
    Region { start, end: std::array::from_fn(|axis| (start[axis] + edge).min(dims[axis])) }
}

/// Some blocks of a window as an archive of their own, side by side along the volume's longest axis.
fn stacked(window: &dyn FrameWindow, archive: &Archive, blocks: &[Region]) -> Result<Box<dyn FrameSource>> {
    let (dims, size) = (blocks[0].dims(), archive.sample.size());
    let axis = (0..3).max_by_key(|axis| archive.grid.dims[*axis]).unwrap_or_default();
    let mut grid = Grid::unit(dims);
    grid.dims[axis] *= blocks.len();
    let (whole, block) = (grid.whole(), Grid::unit(dims).whole());
    let frame_bytes = whole.voxels() * size;
    let mut samples = vec![0; frame_bytes * window.frames()];
    let mut of_block = vec![0; block.voxels() * size];
    for (frame, samples) in samples.chunks_exact_mut(frame_bytes).enumerate() {
        for (number, region) in blocks.iter().enumerate() {
            window.read_box(frame, region, &mut of_block)?;
            for ((y, z), row) in block.rows().zip(of_block.chunks_exact(dims[0] * size)) {
                let mut voxel = [0, y, z];
                voxel[axis] += number * dims[axis];
                samples[whole.index(voxel) * size..][..row.len()].copy_from_slice(row);
            }
        }
    }
    let dims = grid.dims.into_iter().chain([window.frames()]).collect();
    let options = OpenOptions { dims: Some(dims), sample: Some(archive.sample), memory: 0, ..OpenOptions::default() };
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
            [windows(70, 32), windows(100, 32), windows(640, 32)],
            [vec![0, 32, 64], vec![0, 32, 64], vec![96, 320, 512]]
        );
    }
}
