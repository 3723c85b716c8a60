//! Extracts to a file block by block: each block is decoded once and its rows are written at their places, so that no more samples
//! are in memory than those of some blocks.

use super::sink::Sink;
use super::{ExtractConfig, ExtractReport, Extraction, Piece, Pieces, extract_to, length, rooms};
use std::ops::Range;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::output::Placed;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::zeroed::Zeroed;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_formats::{Direction, OutputAxis};

/// Preferred bytes of a piece. Smaller ones have shorter runs of samples, and writing many short ones takes longer than decoding.
const PREFERRED: usize = 64 << 20;

/// As [`super::extract`], to a sink. If that is a plain file, samples are written at their places.
pub(super) fn extract_to_sink(
    file: &CoefficientFile,
    config: &ExtractConfig,
    sink: &mut Sink<'_>,
    progress: &dyn Progress,
) -> Result<ExtractReport> {
    let pieces = Pieces::new(file, config)?;
    if let Some(list) = pieces.of_blocks(file, config)
        && let Some(placed) = sink.placed()?
    {
        let report = extract_placed(&Extraction { file, config, pieces, list }, &placed, progress)?;
        sink.skip_placed()?;
        return Ok(report);
    }
    extract_to(file, config, &mut |samples| sink.write(samples), progress)
}

/// Reads pieces, and writes each while the next is read.
fn extract_placed(of: &Extraction<'_>, placed: &Placed<'_>, progress: &dyn Progress) -> Result<ExtractReport> {
    let size = of.file.sample().size();
    let write = |pieces: &[Piece], buffers: &[Zeroed<u8>]| {
        pieces.iter().zip(buffers).try_for_each(|(piece, buffer)| {
            Runs::new(of.config, piece).list().try_for_each(|run| {
                placed.write((run.to * size) as u64, &buffer[run.from.start * size..run.from.end * size])
            })
        })
    };
    let (mut buffers, mut full): (Vec<Zeroed<u8>>, Vec<Zeroed<u8>>) = Default::default();
    let mut read: Vec<Piece> = Vec::new();
    let report = of.for_each_group(progress, |group, lengths| {
        let rooms = rooms(&mut buffers, lengths);
        let (written, report) = rayon::join(|| write(&read, &full), || group.read(rooms));
        written?;
        std::mem::swap(&mut buffers, &mut full);
        read = group.pieces.to_vec();
        report
    })?;
    write(&read, &full)?;
    progress.finish();
    Ok(report)
}

impl Pieces {
    /// Pieces of whole blocks, with all frames of a window. None if two do not fit in memory.
    fn of_blocks(&self, file: &CoefficientFile, config: &ExtractConfig) -> Option<Vec<Piece>> {
        let windows = file.by_window(&config.frames);
        let mut list: Vec<Piece> =
            windows.map(|frames| Piece { frames: frames.to_vec(), region: config.region }).collect();
        let [others @ .., fastest] = config.order.axes();
        let preferred = PREFERRED.min(self.room / 2);
        // Runs are long where the fastest axis is whole.
        let limits = others.map(|axis| (axis, preferred)).into_iter().chain([(fastest, self.room / 2)]);
        for (axis, most) in limits.filter_map(|(axis, most)| Some((axis.voxels()?, most))) {
            list = list.iter().flat_map(|piece| piece.by_blocks(file, axis, most)).collect();
        }
        let largest = list.iter().map(|piece| piece.bytes(file)).max().unwrap_or(0);
        (2 * largest <= self.room).then_some(list)
    }
}

impl Piece {
    /// Cuts the piece along an axis between blocks, into pieces of `most` bytes, or of one block if that has more.
    fn by_blocks(&self, file: &CoefficientFile, axis: usize, most: usize) -> Vec<Self> {
        let (whole, edge) = (self.region, file.blocks.edges[axis]);
        let of_edge = self.bytes(file) / whole.dims()[axis] * edge;
        let step = if self.bytes(file) <= most { whole.end[axis] } else { edge * (most / of_edge).max(1) };
        let piece = |first: usize| {
            let mut region = whole;
            region.start[axis] = whole.start[axis].max(first);
            region.end[axis] = whole.end[axis].min(first + step);
            Self { frames: self.frames.clone(), region }
        };
        (whole.start[axis] / edge * edge..whole.end[axis]).step_by(step).map(piece).collect()
    }
}

/// Where the samples of a piece lie in those of all.
struct Runs {
    /// The axes from the slowest to the fastest.
    axes: [Axis; 4],
}

/// An axis of the output.
#[derive(Debug, Clone, Copy)]
struct Axis {
    /// Its items.
    all: usize,
    /// Those of the piece.
    part: usize,
    /// The first of these.
    first: usize,
}

/// Samples side by side: numbers in the piece, and the number of the first among all samples.
#[derive(Debug, PartialEq, Eq)]
struct Run {
    from: Range<usize>,
    to: usize,
}

/// The samples along some axes.
fn all(axes: &[Axis]) -> usize {
    axes.iter().map(|axis| axis.all).product()
}

/// The samples of the piece along some axes.
fn of_part(axes: &[Axis]) -> usize {
    axes.iter().map(|axis| axis.part).product()
}

impl Runs {
    fn new(config: &ExtractConfig, piece: &Piece) -> Self {
        Self::of(config.order.axes(), &config.frames, &config.region, piece)
    }

    /// The axes of all samples, their frames and their voxels, and a piece of them.
    fn of(axes: [OutputAxis; 4], frames: &[usize], region: &Region, piece: &Piece) -> Self {
        let first = |axis| match axis {
            OutputAxis::Frames => frames.partition_point(|frame| *frame < piece.frames[0]),
            OutputAxis::Voxels(axis, Direction::Ascending) => piece.region.start[axis] - region.start[axis],
            OutputAxis::Voxels(axis, Direction::Descending) => region.end[axis] - piece.region.end[axis],
        };
        let axis = |axis| Axis {
            all: length(axis, frames.len(), region),
            part: length(axis, piece.frames.len(), &piece.region),
            first: first(axis),
        };
        Self { axes: axes.map(axis) }
    }

    /// The axis along which a run goes; all faster axes are whole.
    fn along(&self) -> usize {
        (1..4).rev().find(|axis| self.axes[*axis].all != self.axes[*axis].part).unwrap_or(0)
    }

    fn list(self) -> impl Iterator<Item = Run> {
        let along = self.along();
        let len = of_part(&self.axes[along..]);
        (0..of_part(&self.axes[..along])).map(move |run| {
            let (mut to, mut left) = (self.axes[along].first * all(&self.axes[along + 1..]), run);
            for axis in (0..along).rev() {
                let Axis { part, first, .. } = self.axes[axis];
                to += (first + left % part) * all(&self.axes[axis + 1..]);
                left /= part;
            }
            Run { from: run * len..(run + 1) * len, to }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The place of a sample, from the slowest axis to the fastest.
    fn place(order: [OutputAxis; 4], frames: &[usize], region: &Region, frame: usize, voxel: [usize; 3]) -> usize {
        order.iter().fold(0, |place, axis| match *axis {
            OutputAxis::Frames => place * frames.len() + frames.iter().position(|f| *f == frame).expect("it is one"),
            OutputAxis::Voxels(axis, direction) => {
                let (start, end) = (region.start[axis], region.end[axis]);
                let item = if direction == Direction::Ascending { voxel[axis] - start } else { end - 1 - voxel[axis] };
                place * (end - start) + item
            }
        })
    }

    #[test]
    fn runs_take_every_sample_of_a_piece_to_its_place() {
        let (x, y, z) = (0, 1, 2);
        let [up, down] = [Direction::Ascending, Direction::Descending];
        let voxels = OutputAxis::Voxels;
        for axes in [
            [OutputAxis::Frames, voxels(z, up), voxels(y, up), voxels(x, up)],
            [OutputAxis::Frames, voxels(z, down), voxels(y, up), voxels(x, down)],
            [voxels(x, up), voxels(y, down), OutputAxis::Frames, voxels(z, up)],
            [voxels(y, down), voxels(z, up), voxels(x, up), OutputAxis::Frames],
        ] {
            let all = Region { start: [2, 1, 3], end: [7, 6, 7] };
            for part in [
                all,
                Region { start: [2, 1, 4], end: [7, 6, 6] },
                Region { start: [2, 3, 3], end: [7, 5, 7] },
                Region { start: [3, 1, 3], end: [5, 6, 7] },
                Region { start: [4, 2, 5], end: [6, 4, 6] },
            ] {
                for part_frames in [vec![1, 3, 4], vec![3, 4], vec![4]] {
                    check(axes, &[1, 3, 4], &all, &Piece { frames: part_frames, region: part });
                }
            }
        }
    }

    /// Places the numbers of all samples, and compares each sample of the piece.
    fn check(axes: [OutputAxis; 4], frames: &[usize], all: &Region, piece: &Piece) {
        let runs = Runs::of(axes, frames, all, piece).list();
        let mut placed = vec![None; frames.len() * all.voxels()];
        for run in runs {
            run.from.clone().enumerate().for_each(|(n, from)| assert_eq!(placed[run.to + n].replace(from), None));
        }
        let mut count = 0;
        for (frame, number) in piece.frames.iter().flat_map(|f| (0..piece.region.voxels()).map(move |n| (*f, n))) {
            let dims = piece.region.dims();
            let item = [number % dims[0], number / dims[0] % dims[1], number / (dims[0] * dims[1])];
            let voxel = std::array::from_fn(|a| piece.region.start[a] + item[a]);
            let to = place(axes, frames, all, frame, voxel);
            assert_eq!(placed[to], Some(place(axes, &piece.frames, &piece.region, frame, voxel)));
            count += 1;
        }
        assert_eq!(placed.iter().flatten().count(), count);
    }
}
