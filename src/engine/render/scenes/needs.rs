//! The memory that the blocks of a file need, found once for all batches.

use super::batch_plan::{SplatSource, error_planes};
use crate::file::CoefficientFile;
use crate::render::config::RenderConfig;

/// Upper bounds for all windows of a file.
pub(super) struct FileNeeds {
    /// Each kind of window once.
    windows: Vec<WindowKind>,
    /// The largest block as it is read and decoded.
    pub(super) block_bytes: usize,
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

/// Bytes of a stored code or outlier: packed, and unpacked in vectors that grow.
const STORED_BYTES: usize = 20;

impl FileNeeds {
    pub(super) fn new(file: &CoefficientFile, what: SplatSource) -> Self {
        let count = file.metadata().windows.len() as u32;
        let mut windows: Vec<WindowKind> = (0..count).map(|window| WindowKind::new(file, what, window)).collect();
        windows.sort_unstable();
        windows.dedup();
        let block_bytes = block_bytes(file, windows.iter().any(|window| window.missing));
        Self { windows, block_bytes }
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

fn block_bytes(file: &CoefficientFile, is_missing: bool) -> usize {
    let windows = &file.metadata().windows;
    let leaves = || (0..windows.len() as u32).flat_map(|window| file.leaves(window));
    let is_double = windows.iter().filter_map(|w| w.pyramid.as_ref()).any(|pyramid| !pyramid.single);
    // Codes or nodes, and the values of all frames; what is stored exactly; a mask and corrections.
    let refined = if is_double { size_of::<f64>() } else { size_of::<f32>() } + size_of::<f64>();
    let exact = if leaves().any(|leaf| leaf.exact > 0) { 2 * file.sample().size() } else { 0 };
    let missing = if is_missing { 1 + 32 + 24 } else { 0 };
    let stored = leaves().map(|leaf| leaf.coded.saturating_add(leaf.outliers) as usize).max().unwrap_or(0);
    let largest = file.largest_block();
    largest * (refined + exact + missing)
        + stored.min(2 * largest) * STORED_BYTES
        + file.bytes_to_begin(refined + STORED_BYTES / 2)
}
