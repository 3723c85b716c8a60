//! The memory that the blocks of a file need: bounds for all, and what the directory says of a window.

use super::batch_plan::{SplatSource, are_few, error_planes};
use crate::file::CoefficientFile;
use crate::render::config::RenderConfig;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_format::{Axis, BlockEntry, LeafEntry, PartKind, Window};

/// Upper bounds for all windows of a file.
pub(super) struct FileNeeds {
    /// Each kind of window once.
    windows: Vec<WindowKind>,
    block: BlockNeeds,
    /// The blocks of a region in one window, the last one that was asked for.
    last: Option<(u32, Region, BlockNeeds)>,
}

/// The most that a block stores.
struct Stored {
    /// Codes that are not zero.
    codes: usize,
    /// Outliers and missing samples.
    outliers: usize,
    /// Whether all samples of some block are stored exactly.
    exact: bool,
    missing: bool,
}

/// Bytes of the largest block, by what is done with it.
#[derive(Clone)]
pub(super) struct BlockNeeds {
    what: SplatSource,
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
        let block = BlockNeeds::new(file, what, &Stored::at_most(file));
        Self { windows, block, last: None }
    }

    /// Upper bounds for all blocks.
    pub(super) fn of_all(&self) -> &BlockNeeds {
        &self.block
    }

    /// Upper bounds for the blocks of a region in a window, as the directory lists them.
    pub(super) fn of_window(&mut self, file: &CoefficientFile, window: u32, region: &Region) -> Result<&BlockNeeds> {
        if !self.last.as_ref().is_some_and(|(of, within, _)| (*of, within) == (window, region)) {
            let needs = BlockNeeds::new(file, self.block.what, &Stored::in_window(file, window, region)?);
            self.last = Some((window, *region, needs));
        }
        Ok(self.last.as_ref().map_or(&self.block, |(_, _, needs)| needs))
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
            values: !is_coded || exact || missing || record.outliers > 0 || file.keeps_sides(),
            missing,
        }
    }
}

impl Stored {
    /// In any block, as far as the leaves of the directory tell.
    fn at_most(file: &CoefficientFile) -> Self {
        let windows = 0..file.metadata().windows.len() as u32;
        let leaves = || windows.clone().flat_map(|window| file.leaves(window));
        let most = |count: fn(&LeafEntry) -> u64| leaves().map(count).max().unwrap_or(0);
        Self {
            codes: most(|leaf| leaf.coded) as usize,
            outliers: most(|leaf| leaf.outliers.saturating_add(leaf.missing)) as usize,
            exact: leaves().any(|leaf| leaf.exact > 0),
            missing: windows.clone().any(|window| file.has_missing(window)),
        }
    }

    /// In a block that touches a region, or in one above those.
    fn in_window(file: &CoefficientFile, window: u32, region: &Region) -> Result<Self> {
        let mut most = Self { codes: 0, outliers: 0, exact: false, missing: file.has_missing(window) };
        for channel in 0..file.channels() {
            for entries in file.entries(window, channel, region) {
                entries?.iter().for_each(|entry| most.add(entry));
            }
            for entries in file.entries_above(window, channel, region) {
                let Ok(entries) = entries else { return Ok(Self::at_most(file)) }; // the error is reported if it matters
                entries.iter().for_each(|entry| most.add(entry));
            }
        }
        Ok(most)
    }

    fn add(&mut self, entry: &BlockEntry) {
        let count = |is_counted: fn(PartKind) -> bool| {
            let parts = entry.parts.iter().filter(|part| is_counted(part.kind));
            parts.fold(0_u64, |sum, part| sum.saturating_add(part.stats.count)) as usize
        };
        self.codes = self.codes.max(count(|kind| matches!(kind, PartKind::Level(_))));
        let overrides = |kind| matches!(kind, PartKind::Outliers | PartKind::Missing | PartKind::Sides);
        self.outliers = self.outliers.max(count(overrides));
        self.exact |= entry.is_exact();
    }
}

impl BlockNeeds {
    fn new(file: &CoefficientFile, what: SplatSource, stores: &Stored) -> Self {
        let windows = &file.metadata().windows;
        let (largest, stored, coefficient) = (file.largest_block(), file.most_codes(), file.coefficient_size());
        let codes = match windows.iter().all(|window| window.pyramid.is_some()) {
            true => stores.codes.min(stored) * CODE_BYTES,
            false => stored * (CODE_BYTES + size_of::<i32>()),
        };
        let exact = if stores.exact { 2 * stored * file.sample().size() } else { 0 };
        let outliers = if file.skips_damage() || file.keeps_sides() { stored } else { stores.outliers.min(stored) };
        let mask = if stores.missing { stored } else { 0 };
        let sides = if file.keeps_sides() { stored * file.sample().size() } else { 0 }; // samples that show who changes its side
        let refines_time = |window: &Window| window.pyramid.as_ref().is_some_and(|p| p.order.contains(&Axis::T));
        // Scratch are the lattices before the last passes: of one k at a time, unless time is refined.
        let plane = file.blocks.region(0).voxels();
        let refined = |coefficients: usize| (coefficients + plane).max(coefficients * 3 / 2) * coefficient;
        let largest_above = file.largest_block_above();
        Self {
            what,
            read: codes + exact + outliers * OUTLIER_BYTES + mask + sides + file.known_bytes(),
            above: largest_above.min(stores.codes) * CODE_BYTES + refined(largest_above) + file.known_bytes(),
            whole: refined(largest),
            one: refined(plane),
            always_whole: outliers > 0 || file.keeps_sides() || windows.iter().any(refines_time),
            samples: largest * file.sample().size(),
            values: plane * size_of::<f64>(),
            coefficients: file.most_coefficients(),
        }
    }

    /// Bytes of a decoded block for a batch of `frames` frames. `asked` has the number of requested frames of each window.
    pub(super) fn bytes(&self, frames: usize, asked: impl Iterator<Item = usize>, is_projection: bool) -> usize {
        let &Self { what, read, above, whole, one, always_whole, samples, values, coefficients } = self;
        if what == SplatSource::Samples {
            return above.max(read + whole + samples);
        }
        let coded = if always_whole || !is_projection { whole } else { one };
        let few = |asked: &usize| are_few(*asked, coefficients);
        let frames = if is_projection { asked.filter(few).max().unwrap_or(0) } else { frames };
        above.max(read + coded + values * frames)
    }
}
