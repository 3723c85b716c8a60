//! The possible sizes of a block's parts, as the metadata determines them.

use crate::block::PartKind;
use crate::bytes::{ParseResult, ensure};
use crate::codes::sparse::CodeBox;
use crate::codes::{max_packed, volumes};
use crate::directory::PartEntry;
use crate::limits::MAX_SIDES;
use crate::listed::max_listed;
use crate::planes::bitmap_len;
use crate::pyramid::{PassBox, Pyramid};
use crate::sides::max_sides;
use crate::sums::max_sums;
use crate::window::Window;

/// The sizes of one block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockGeometry<'a> {
    /// Voxels of its box along x, y, z, clipped at the volume's far faces.
    pub size: [usize; 3],
    /// Its tier.
    pub tier: u8,
    /// Its window.
    pub window: &'a Window,
    /// Bytes of one sample.
    pub sample_size: usize,
}

impl BlockGeometry<'_> {
    /// Voxels of its box.
    pub fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// Frames x voxels.
    pub fn samples(&self) -> usize {
        (self.window.frames as usize).saturating_mul(self.voxels())
    }

    /// Voxels along x, y, z, and frames.
    pub(crate) fn extents(&self) -> [usize; 4] {
        let [x, y, z] = self.size;
        [x, y, z, self.window.frames as usize]
    }

    /// Number of codes in a level part; `None` if the window has no such level.
    pub fn codes(&self, level: u8) -> Option<usize> {
        match &self.window.pyramid {
            Some(_) => (level < Pyramid::PARTS).then(|| volumes(&self.boxes(level))),
            None => self.window.levels.get(usize::from(level)).map(|&k| (k as usize).saturating_mul(self.voxels())),
        }
    }

    /// The boxes of codes in a level part, each contiguous; empty without a pyramid.
    pub(crate) fn boxes(&self, level: u8) -> Vec<CodeBox> {
        let Some(pyramid) = &self.window.pyramid else { return Vec::new() };
        let passes = pyramid.passes(self.size, self.window.coefficients as usize, self.tier);
        let contiguous = |of: &PassBox| {
            let extents = of.extents(passes[of.pass].extent());
            CodeBox { allowed: of.allowed, ..CodeBox::contiguous(extents) }
        };
        pyramid.boxes(&passes).iter().filter(|of| of.part == level).map(contiguous).collect()
    }

    /// The largest `count` of a part.
    fn max_count(&self, kind: PartKind) -> u64 {
        match kind {
            PartKind::Level(level) => self.codes(level).unwrap_or(0) as u64,
            PartKind::Sides => (self.samples() * MAX_SIDES) as u64,
            PartKind::Sums => self.window.frames.into(),
            _ => self.samples() as u64,
        }
    }

    /// Bytes before compression of a part with `count` items. `width` is the bytes per code; only level parts use it.
    fn raw_len(&self, kind: PartKind, count: u64, width: u64) -> u64 {
        let size = self.sample_size as u64;
        match kind {
            PartKind::Level(level) => {
                1 + bitmap_len(self.codes(level).unwrap_or(0)) as u64 + count.saturating_mul(width)
            }
            PartKind::Outliers => count.saturating_mul(4 + size),
            PartKind::Missing => (bitmap_len(self.samples()) as u64).saturating_add(count.saturating_mul(size)),
            PartKind::Exact | PartKind::Listed => count.saturating_mul(size),
            PartKind::Sides => max_sides(self.samples()) as u64,
            PartKind::Sums => max_sums(self.window.frames as usize, self.samples()) as u64,
        }
    }

    /// Upper bound on the payload of a part before compression, in bytes.
    pub fn max_raw_len(&self, kind: PartKind) -> u64 {
        match kind {
            PartKind::Level(level) if self.window.pyramid.is_some() => max_packed(&self.boxes(level)) as u64,
            PartKind::Listed => max_listed(self.sample_size, self.extents()) as u64,
            PartKind::Sides => max_sides(self.samples()) as u64,
            PartKind::Sums => max_sums(self.window.frames as usize, self.samples()) as u64,
            _ => self.raw_len(kind, self.max_count(kind), 4),
        }
    }

    /// Checks that a part's count and length are possible for this block.
    pub(crate) fn check(&self, part: &PartEntry) -> ParseResult {
        let (kind, count, raw_len) = (part.kind, part.stats.count, u64::from(part.raw_len));
        if let PartKind::Level(level) = kind {
            ensure(self.codes(level).is_some(), || format!("{kind} of {} levels", self.window.parts()))?;
        }
        let has_samples = self.tier == 0 || matches!(kind, PartKind::Level(_));
        ensure(has_samples, || format!("{kind} in tier {}", self.tier))?;
        let most = self.max_count(kind);
        let least = if kind.is_exact() { most } else { 1 };
        ensure((least..=most).contains(&count), || {
            format!("{kind}: a count of {count} where at most {most} is possible")
        })?;
        let possible = match kind {
            PartKind::Level(_) if self.window.pyramid.is_some() => raw_len <= self.max_raw_len(kind),
            PartKind::Listed | PartKind::Sides | PartKind::Sums => raw_len <= self.max_raw_len(kind),
            PartKind::Level(_) => (1..=4).any(|width| self.raw_len(kind, count, width) == raw_len),
            _ => self.raw_len(kind, count, 1) == raw_len,
        };
        ensure(possible, || format!("{kind}: {raw_len} bytes do not fit a count of {count}"))
    }
}
