//! Codes and decodes one block within an error bound. Pure functions over slices; no I/O, no threads.
//!
//! [`encode`] transforms, truncates and quantises samples, decodes the result, and stores the samples that miss the
//! bound exactly. [`decode`] is the only decoder: `extract`, `verify` and the renderer use it, and the encoder checks itself with
//! it, except for series that cannot change a block's statistics (`screen`). Nothing here depends on the kind of transform along time, except that samples without one
//! (`Basis::Samples`) may also be predicted along time.

mod as_read;
mod balance;
pub mod bound;
mod box_samples;
pub mod buffer;
mod check;
pub mod coarse;
pub(crate) mod codes;
pub mod decode;
pub mod derived;
pub mod encode;
mod error_weights;
pub mod field;
mod forward;
mod gain;
mod group;
mod limits;
mod listed;
mod load;
mod measured;
mod mend;
mod moved;
mod order;
pub mod part;
pub(crate) mod pyramid;
pub mod real;
mod refine;
mod repack;
mod rows;
pub mod block_with_ghosts;
pub mod scheme;
mod screen;
pub mod shifts;
mod sides;
pub mod trial;
mod truncate;

use crate::base::grid::Region;
use crate::base::sample::{self, SampleType};
use crate::codec::bound::{ErrorBound, SampleLimits, difference_up};
use crate::wavelet::{self, LANES, TimeBasis};
use buffer::Buffer;
pub use load::load_lanes;
use pyramid::PredictionPasses;
use real::Real;
use scheme::Scheme;
use std::ops::Range;
use std::sync::Arc;
use wavesplat_format::{Axis, BlockEntry, Metadata, Packing, PartKind, Pyramid, Window};

/// Returns the memory of all unused buffers and codes to the system.
pub fn release_spare() {
    buffer::release_spare::<f32>(usize::MAX);
    release_spare_below::<f64>(usize::MAX);
}

/// Returns unused buffers with fewer than `len` entries, and all unused codes, to the system. Of the floats, only those of type `R`.
pub fn release_spare_below<R: Real>(len: usize) {
    buffer::release_spare::<R>(len);
    buffer::release_spare::<i32>(len);
    buffer::release_spare::<u8>(len);
    codes::PooledCodes::release_spare();
}

/// Makes spare buffers for coding a block of `samples` samples with its ghosts in floats of type `R`. Gives back those of the other type.
/// Pages take memory only when they are written.
pub fn make_spare<R: Real>(samples: usize, ty: SampleType) {
    if size_of::<R>() == size_of::<f32>() {
        buffer::release_spare::<f64>(usize::MAX);
    } else {
        buffer::release_spare::<f32>(usize::MAX);
    }
    drop([(); 3].map(|()| Buffer::<R>::with_len(samples))); // the nodes of the field, the same sorted by passes, and those above
    drop((Buffer::<i32>::with_len(samples), Buffer::<u8>::with_len(samples * ty.size())));
}

/// What coding and decoding share for all blocks of one window.
#[derive(Debug, Clone)]
pub struct WindowCodec {
    /// How blocks are coded.
    pub scheme: Arc<Scheme>,
    /// The temporal basis.
    pub basis: Arc<dyn TimeBasis>,
    /// The basis functions: `synthesis[k][t]` is u_k(t).
    pub synthesis: Arc<Vec<Vec<f64>>>,
    /// The largest sum over k of |u_k(t)| (eq 25).
    pub gain: f64,
    /// The type of the samples.
    pub sample: SampleType,
    /// The guaranteed error bound.
    pub bound: ErrorBound,
    /// The sample value that means "missing", besides NaN and infinities.
    pub missing_value: Option<f64>,
    /// If set, extracted samples are clamped to this range, the range of the source's samples in the window.
    pub clip: Option<(f64, f64)>,
    /// The kept values, ascending: samples stay below, at or above each.
    pub sides: Arc<[f64]>,
    /// Whether the sums of each block's frames are kept.
    pub sums: bool,
    /// Without a pyramid: the range of coefficients in each level part of a block, coarse to fine.
    pub levels: Vec<Range<usize>>,
    /// Whether blocks may list their values.
    pub lists: bool,
    /// The level of detail: blocks are decoded on the lattice of every 2^lod-th voxel along each axis.
    pub lod: u32,
    /// The tier of the blocks that are coded or decoded.
    pub tier: u8,
}

impl WindowCodec {
    /// Creates the codec of a window of `frames` frames. Blocks have at most `edge` voxels a side.
    pub fn new(scheme: Scheme, frames: usize, sample: SampleType, bound: ErrorBound, edge: usize) -> Self {
        let basis = scheme.time_basis(frames);
        let levels = if scheme.pyramid.is_some() { Vec::new() } else { join_levels(&basis.levels(), edge) };
        Self::with_levels(scheme, basis, sample, bound, &levels)
    }

    fn with_levels(
        scheme: Scheme,
        basis: Box<dyn TimeBasis>,
        sample: SampleType,
        bound: ErrorBound,
        levels: &[usize],
    ) -> Self {
        let synthesis = wavelet::synthesis(basis.as_ref());
        let gain = wavelet::gain(&synthesis);
        let levels = wavelet::ranges(levels);
        let (basis, synthesis) = (Arc::from(basis), Arc::new(synthesis));
        let scheme = Arc::new(scheme);
        Self {
            scheme,
            basis,
            synthesis,
            gain,
            sample,
            bound,
            missing_value: None,
            clip: None,
            sides: Arc::from([]),
            sums: false,
            levels,
            lists: false,
            lod: 0,
            tier: 0,
        }
    }

    /// Creates the codec of a window in a coefficient file; an error if the window contradicts its basis.
    pub fn from_metadata(file: &Metadata, window: &Window) -> std::result::Result<Self, wavesplat_format::Error> {
        let scheme = Scheme::from_window(window);
        let basis = scheme.time_basis(window.frames as usize);
        if basis.coefficients() != window.coefficients as usize {
            let what =
                format!("{} coefficients for {} frames of {:?}", window.coefficients, window.frames, window.basis);
            return Err(wavesplat_format::Error::Invalid(what));
        }
        let levels: Vec<usize> = window.levels.iter().map(|n| *n as usize).collect();
        let (keep, dims) = (file.keep(), file.dims.map(|n| n as usize));
        let limits = SampleLimits::new(&keep, dims, file.spacing);
        let bound = ErrorBound::new(file.bound, file.tolerance, window.delta).within(limits);
        let codec = Self::with_levels(scheme, basis, file.sample, bound, &levels);
        let clip = Some((window.min, window.max)).filter(|(lo, hi)| lo <= hi && keep.range);
        Ok(Self { missing_value: file.missing_value, clip, sides: keep.sides.into(), sums: keep.sum, ..codec })
    }

    /// The largest number of level parts of a block.
    pub fn parts(&self) -> usize {
        if self.scheme.pyramid.is_some() { usize::from(Pyramid::PARTS) } else { self.levels.len() }
    }

    /// Whether a level part affects the coefficients that `wanted` marks.
    pub fn needs_part(&self, part: usize, wanted: &[bool]) -> bool {
        match &self.scheme.pyramid {
            None => wanted[self.levels[part].clone()].contains(&true),
            Some(_) if self.is_all_above() => false,
            Some(pyramid) if part > coarsest_part(pyramid, self.lod) => false,
            // The last pass, along time, adds only the odd frames.
            Some(_) if part == ODD_FRAMES => wanted.iter().skip(1).step_by(2).any(|w| *w),
            Some(_) => true,
        }
    }

    /// The nodes of a block of `size` voxels that are decoded.
    pub fn decoded_size(&self, size: [usize; 3]) -> [usize; 3] {
        let nodes = self.scheme.pyramid.as_ref().map_or(size, |pyramid| pyramid.nodes(size, self.tier));
        nodes.map(|n| n.div_ceil(1 << self.lod))
    }

    /// The codec of the blocks above, with whose nodes blocks begin; none in the last tier.
    pub fn above(&self) -> Option<Self> {
        let (tiers, lod) = (self.tiers(), self.lod);
        let has_above = self.tier < tiers;
        has_above.then(|| match lod {
            0 => self.at(self.tier + 1, 0),
            _ => self.at(tiers.min(lod as u8), lod.saturating_sub(tiers.into())),
        })
    }

    /// The nodes along x, y, z that a block of `size` voxels begins with; `above` is [`Self::above`].
    pub fn known_size(&self, above: &Self, size: [usize; 3]) -> [usize; 3] {
        if self.is_all_above() { self.decoded_size(size) } else { above.decoded_size(size) }
    }

    /// The part of the nodes that a block of `size` voxels begins with on which the nodes of `part` depend.
    pub fn needed_above(&self, size: [usize; 3], part: &Region) -> Region {
        match &self.scheme.pyramid {
            Some(pyramid) if !self.is_all_above() => self.passes(pyramid, size).within(part).needed_above(),
            _ => *part,
        }
    }

    /// Whether decoding a block moves samples to their sides of kept values, which takes all its coefficients.
    pub fn decodes_sides(&self, entry: &BlockEntry) -> bool {
        self.lod == 0 && entry.part(PartKind::Sides).is_some()
    }

    /// The codec of a tier's blocks at a level of detail of their lattice.
    pub fn at(&self, tier: u8, lod: u32) -> Self {
        Self { tier, lod, ..self.clone() }
    }

    /// The number of tiers above the blocks.
    pub fn tiers(&self) -> u8 {
        self.scheme.pyramid.as_ref().map_or(0, |pyramid| pyramid.tiers)
    }

    /// Whether blocks are decoded from those above them alone, because the level of detail leaves out their own nodes.
    pub(crate) fn is_all_above(&self) -> bool {
        self.tier == 0 && self.lod > 0 && self.tiers() > 0
    }

    /// The voxels along x, y, z that are needed to code a block: its own, and the ones of following blocks that predict
    /// them.
    pub fn outer_size(&self, size: [usize; 3]) -> [usize; 3] {
        let ghosts = self.scheme.pyramid.as_ref().map_or([0; 3], |pyramid| pyramid.ghost_nodes(size));
        std::array::from_fn(|a| size[a] + ghosts[a])
    }

    /// The passes that decode a block at the codec's level of detail.
    pub(crate) fn passes<'a>(&self, pyramid: &'a Pyramid, size: [usize; 3]) -> PredictionPasses<'a> {
        PredictionPasses::with_detail(pyramid, size, self.basis.coefficients(), self.tier, self.lod)
    }

    /// Without a pyramid: the range of codes in a level part of a block of `size` voxels.
    fn level_range(&self, level: u8, size: [usize; 3]) -> Range<usize> {
        let (voxels, k) = (size.iter().product::<usize>(), &self.levels[usize::from(level)]);
        k.start * voxels..k.end * voxels
    }

    /// The number of frames in the window.
    pub fn frames(&self) -> usize {
        self.basis.frames()
    }

    /// Whether a sample is missing: not finite, or equal to the declared value.
    pub fn is_missing(&self, value: f64) -> bool {
        sample::is_missing(value, self.missing_value)
    }

    /// The larger of the errors of the splatted and the extracted value, rounded up. Infinite if the extracted value
    /// would be read as missing.
    pub fn error(&self, splatted: f64, extracted: f64, source: f64) -> f64 {
        let (a, b) = (difference_up(splatted, source), difference_up(extracted, source));
        let lost = a.is_nan() || b.is_nan() || self.is_missing(extracted);
        if lost { f64::INFINITY } else { a.max(b) }
    }
}

/// The last level part that a level of detail needs.
fn coarsest_part(pyramid: &Pyramid, lod: u32) -> usize {
    // In one piece, passes along time hold codes of every lattice.
    let divided = pyramid.packing == Packing::Nested || !pyramid.order.contains(&Axis::T);
    match lod {
        1 if divided => 1,
        2.. if divided => 0,
        _ => ODD_FRAMES,
    }
}

/// The level part of a pyramid with the last pass along time.
const ODD_FRAMES: usize = Pyramid::PARTS as usize - 1;

/// Small coarse levels are joined until a part of a whole block holds at least this many coefficients.
const PART_COEFFICIENTS: usize = 1 << 17;

fn join_levels(levels: &[usize], edge: usize) -> Vec<usize> {
    let mut parts = Vec::new();
    let mut open = 0;
    for level in levels {
        open += level;
        if open * edge * edge * edge >= PART_COEFFICIENTS {
            parts.push(std::mem::take(&mut open));
        }
    }
    match parts.last_mut() {
        Some(last) if open > 0 => *last += open,
        None => parts.push(open),
        _ => {}
    }
    parts
}

/// Splits voxels into groups of [`LANES`]: (first voxel, number in the group).
pub fn lane_groups(voxels: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..voxels).step_by(LANES).map(move |first| (first, LANES.min(voxels - first)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_levels_are_joined() {
        assert_eq!(join_levels(&[1, 1, 2, 4, 8, 16], 32), [4, 4, 8, 16]);
        assert_eq!(join_levels(&[1, 1, 2, 4, 8, 16], 4), [32]);
        assert_eq!(join_levels(&[1], 64), [1]);
    }
}
