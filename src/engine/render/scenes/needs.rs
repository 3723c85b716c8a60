//! The memory that the blocks of a file need, found once for all batches.

use super::batch_plan::{SplatSource, are_few, error_planes};
use crate::file::CoefficientFile;
use crate::render::config::RenderConfig;
use wavesplat_format::{Axis, LeafEntry, Window};

/// Upper bounds for all windows of a file.
pub(super) struct FileNeeds {
    /// Each kind of window once.
    windows: Vec<WindowKind>,
    what: SplatSource,
    block: BlockNeeds,
}

/// Bytes of the largest block, by what is done with it.
struct BlockNeeds {
    /// What is read: codes, what is stored exactly, and the nodes that the block begins with.
    read: usize,
    /// The block above while it is decoded, before the block is read.
    above: usize,
    /// All coefficients decoded at once, and scratch.
    whole: usize,
    /// Those of one k.
    one: usize,
    /// Whether some blocks need all coefficients at once however they are splatted.
    always_whole: bool,
    /// Samples of all frames of a window in their own type.
    samples: usize,
    /// Values of a frame.
    values: usize,
    /// The largest number of coefficients of a voxel.
    coefficients: usize,
}

/// What decides the number of planes of a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct WindowKind {
    /// Coefficient planes; 0 if samples are splatted.
    coefficients: usize,
    /// Level parts.
    parts: usize,
    /// Whether single frames have values besides coefficients.
    values: bool,
    missing: bool,
}

/// Bytes of a stored code: its place and value, and what it is unpacked from.
const CODE_BYTES: usize = 14;
/// Bytes of an outlier or a missing sample: its place and value, and the corrections that it becomes, in vectors that grow.
const OUTLIER_BYTES: usize = 144;

impl FileNeeds {
    pub(super) fn new(file: &CoefficientFile, what: SplatSource) -> Self {
        let count = file.metadata().windows.len() as u32;
        let mut windows: Vec<WindowKind> = (0..count).map(|window| WindowKind::new(file, what, window)).collect();
        windows.sort_unstable();
        windows.dedup();
        let block = BlockNeeds::new(file, windows.iter().any(|window| window.missing));
        Self { windows, what, block }
    }

    /// Bytes of a decoded block for a batch of `frames` frames. `asked` has the number of requested frames of each window.
    pub(super) fn block_bytes(&self, frames: usize, asked: impl Iterator<Item = usize>, is_projection: bool) -> usize {
        let BlockNeeds { read, above, whole, one, always_whole, samples, values, coefficients } = self.block;
        if self.what == SplatSource::Samples {
            return above.max(read + whole + samples);
        }
        let coded = if always_whole || !is_projection { whole } else { one };
        let few = |asked: &usize| are_few(*asked, coefficients);
        let frames = if is_projection { asked.filter(few).max().unwrap_or(0) } else { frames };
        above.max(read + coded + values * frames)
    }

    /// The largest number of planes of a projection of `frames` frames.
    pub(super) fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize {
        let planes = |window: &WindowKind| {
            let values = if window.values { frames } else { 0 };
            let absent = if window.missing { frames + 1 } else { 0 };
            window.coefficients.max(frames) + values + absent + error_planes(config, window.parts)
        };
        self.windows.iter().map(planes).max().unwrap_or(0)
    }
}

impl WindowKind {
    fn new(file: &CoefficientFile, what: SplatSource, window: u32) -> Self {
        let record = &file.metadata().windows[window as usize];
        let (missing, is_coded) = (file.has_missing(window), what == SplatSource::Coefficients);
        let exact = file.leaves(window).iter().any(|leaf| leaf.exact > 0);
        Self {
            coefficients: if is_coded { record.coefficients as usize } else { 0 },
            parts: record.parts(),
            values: !is_coded || exact || missing || record.outliers > 0,
            missing,
        }
    }
}

impl BlockNeeds {
    fn new(file: &CoefficientFile, is_missing: bool) -> Self {
        let windows = &file.metadata().windows;
        let leaves = || (0..windows.len() as u32).flat_map(|window| file.leaves(window));
        let (largest, stored, coefficient) = (file.largest_block(), file.most_codes(), file.coefficient_size());
        let most = |count: fn(&LeafEntry) -> u64| leaves().map(count).max().unwrap_or(0).min(stored as u64) as usize;
        let codes = match windows.iter().all(|window| window.pyramid.is_some()) {
            true => most(|leaf| leaf.coded) * CODE_BYTES,
            false => stored * (CODE_BYTES + size_of::<i32>()),
        };
        let exact = if leaves().any(|leaf| leaf.exact > 0) { 2 * stored * file.sample().size() } else { 0 };
        let outliers = match file.skips_damage() {
            true => stored,
            false => most(|leaf| leaf.outliers.saturating_add(leaf.missing)),
        };
        let mask = if is_missing { stored } else { 0 };
        let refines_time = |window: &Window| window.pyramid.as_ref().is_some_and(|p| p.order.contains(&Axis::T));
        // Scratch are the lattices before the last passes: of one k at a time, unless time is refined.
        let plane = file.blocks.region(0).voxels();
        let refined = |coefficients: usize| (coefficients + plane).max(coefficients * 3 / 2) * coefficient;
        Self {
            read: codes + exact + outliers * OUTLIER_BYTES + mask + file.known_bytes(),
            above: file.largest_block_above() * CODE_BYTES + refined(file.largest_block_above()) + file.known_bytes(),
            whole: refined(largest),
            one: refined(plane),
            always_whole: outliers > 0 || windows.iter().any(refines_time),
            samples: largest * file.sample().size(),
            values: plane * size_of::<f64>(),
            coefficients: file.most_coefficients(),
        }
    }
}
