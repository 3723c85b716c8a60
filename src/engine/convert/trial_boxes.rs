//! Boxes of a window's samples in which schemes are tried.

use super::spread::evenly;
use std::cmp::Reverse;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::codec::block_with_ghosts::BlockWithGhosts;
use wavesplat_core::codec::bound::ErrorBound;
use wavesplat_core::codec::scheme::Pyramid;
use wavesplat_core::source::{Archive, FrameWindow, read_frames};

/// The largest number of samples in all boxes, for blocks of `block` samples.
pub(super) fn most_samples(block: usize) -> usize {
    (5 * block / 4).max(FEW_SAMPLES)
}

/// Bytes that a choice takes: the samples, the nodes and the missing masks of two transforms, and the scratch of a
/// trial. A node takes `each` bytes. Large boxes have one transform beside that of small ones.
pub(super) fn bytes(block: usize, sample: SampleType, each: usize) -> usize {
    most_samples(block) * (sample.size() + 2 * (each + 1) + each + size_of::<i32>())
}

/// A box of samples, frame by frame.
pub(super) struct Sampled {
    pub(super) size: BlockWithGhosts,
    /// The voxels that pyramids may use.
    pub(super) outer: [usize; 3],
    pub(super) samples: Vec<u8>,
}

/// Boxes, and how much they stand for.
pub(super) struct Boxes {
    pub(super) sampled: Vec<Sampled>,
    /// The voxels that they stand for: those of all channels, less a share in which samples do not change.
    pub(super) voxels: f64,
}

/// The boxes in which samples change, and others if these are few.
pub(super) struct Active {
    pub(super) places: Vec<BoxPlace>,
    /// The number of boxes divided by that of the places looked at; 1 if samples change in none.
    share: f64,
}

/// How large boxes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BoxSize {
    /// About a third of the samples: enough to compare transforms and steps.
    Small,
    /// Nearly as large as blocks.
    Large,
}

impl BoxSize {
    /// Edges in voxels, the best one first: multiples of eight have coarse lattices like those of blocks.
    fn edges(self) -> &'static [usize] {
        let all = &[40, 32, 24, 16, 8, 4, 2, 1];
        if self == Self::Small { &all[2..] } else { all }
    }
}

/// Where boxes are taken from.
pub(super) struct TrialBoxes<'a> {
    pub(super) archive: &'a Archive,
    /// The window's samples, channel by channel.
    pub(super) channels: &'a [&'a dyn FrameWindow],
    /// The value of a missing sample.
    pub(super) missing_value: Option<f64>,
    /// The promised bound.
    pub(super) bound: ErrorBound,
    /// The most samples of all boxes.
    pub(super) most: usize,
    /// Whether the scheme need not be the best: then no large boxes follow small ones.
    pub(super) is_rough: bool,
    /// A pyramid with all ghost nodes that the tried ones may have.
    pub(super) pyramid: Pyramid,
}

impl TrialBoxes<'_> {
    /// Boxes spread over the volume and the channels: about one voxel in fifty, but at least a few boxes of a size that
    /// represents blocks. Of small volumes they are at most an eighth, unless they would be tiny. Boxes that every scheme codes by next
    /// to nothing are passed over, as far as others are found.
    pub(super) fn read(&self, size: BoxSize) -> Result<Boxes> {
        let (voxels, most) = (self.voxels_of(size), self.most_voxels(size));
        let volume = voxels.iter().product::<usize>();
        let count = (self.voxels() / SHARE / volume).clamp(self.least(), MOST_BOXES).min(most / volume).max(1);
        let Active { places, share } = self.active(0, count, voxels)?;
        let sampled = places.iter().map(|place| self.sampled(place)).collect::<Result<_>>()?;
        Ok(Boxes { sampled, voxels: self.voxels() as f64 * share })
    }

    /// The places of `count` boxes of a size in which samples change, or others if too few are found. Looks from place `first` on.
    /// Of those that change, takes every few in the order of their changes, from the most on.
    pub(super) fn active(&self, first: usize, count: usize, size: [usize; 3]) -> Result<Active> {
        let (mut active, mut quiet) = (Vec::new(), Vec::new());
        for number in first..first + count * MOST_CANDIDATES {
            let place = self.place(number, size);
            match self.changes(&place)? {
                0 => quiet.push(place),
                changes => active.push((changes, place)),
            }
            if number + 1 >= first + count * CANDIDATES && active.len() >= count {
                break;
            }
        }
        let (found, all) = (active.len(), active.len() + quiet.len());
        active.sort_by_key(|(changes, _)| Reverse(*changes));
        let taken = active.into_iter().enumerate().filter(|(i, _)| i * count % found < count);
        let mut places: Vec<_> = taken.map(|(_, (_, place))| place).collect();
        places.extend(quiet.into_iter().take(count - places.len()));
        let share = if found > 0 { found.max(count) as f64 / all as f64 } else { 1.0 };
        Ok(Active { places, share })
    }

    /// One more than the number of layers of a few frames in which the samples of a box change, with time or within the layer; 0 if one
    /// value is within the bound of all.
    fn changes(&self, place: &BoxPlace) -> Result<usize> {
        let (window, ty) = (self.channels[place.channel], self.archive.sample);
        let mut frames = LOOKED_AT.map(|share| ((window.frames() - 1) as f64 * share) as usize).to_vec();
        frames.dedup();
        let [x, y, z] = place.region.dims();
        let mut samples = vec![0; place.region.voxels() * ty.size()];
        let (mut of_layers, mut of_all, mut changes) = (vec![NO_RANGE; z], NO_RANGE, 0);
        for frame in frames {
            window.read_box(frame, &place.region, &mut samples)?;
            for (before, layer) in of_layers.iter_mut().zip(samples.chunks_exact(x * y * ty.size())) {
                let range = sample::range_of_present(ty, layer, self.missing_value, |_| {});
                changes += usize::from(self.is_wide(sample::join_ranges(*before, range)));
                (*before, of_all) = (range, sample::join_ranges(of_all, range));
            }
        }
        Ok(if self.is_wide(of_all) { changes + 1 } else { 0 })
    }

    /// Whether no value is within the bound of all samples of a range.
    fn is_wide(&self, range: (f64, f64)) -> bool {
        let (lo, hi) = range;
        let nearest_zero = if lo <= 0.0 && hi >= 0.0 { 0.0 } else { lo.abs().min(hi.abs()) };
        hi - lo > 2.0 * self.bound.allowed(nearest_zero)
    }

    /// Voxels of a box along x, y, z.
    pub(super) fn voxels_of(&self, size: BoxSize) -> [usize; 3] {
        let (most, least) = (self.most_voxels(size), self.least());
        let fits = |edge: &&usize| {
            let is_large = **edge > SMALL_EDGE && size == BoxSize::Small && !self.is_rough; // rough choices have no larger boxes later
            let most = if is_large { most.min(self.voxels() / LARGEST_SHARE_OF_LARGE) } else { most };
            least * self.voxels_of_edge(**edge).iter().product::<usize>() <= most
        };
        size.edges().iter().find(fits).map_or([1; 3], |edge| self.voxels_of_edge(*edge))
    }

    /// Voxels of a box with so many a side along x, y, z.
    fn voxels_of_edge(&self, edge: usize) -> [usize; 3] {
        self.archive.grid.dims.map(|n| n.min(edge))
    }

    /// Voxels of all channels.
    pub(super) fn voxels(&self) -> usize {
        self.archive.grid.whole().voxels() * self.channels.len()
    }

    /// The number of frames in the window.
    pub(super) fn frames(&self) -> usize {
        self.channels[0].frames()
    }

    /// The least number of boxes.
    fn least(&self) -> usize {
        LEAST_BOXES.max(self.channels.len())
    }

    /// The most voxels of all boxes.
    fn most_voxels(&self, size: BoxSize) -> usize {
        let most = if self.pyramid.single { self.most } else { self.most / 3 * 2 }; // double precision takes more memory
        let leaves_room = size == BoxSize::Small && !self.is_rough; // for large boxes
        let most = if leaves_room { most / 3 } else { most };
        (self.voxels() / LARGEST_SHARE).min(most / self.frames())
    }

    /// Reads a box.
    pub(super) fn sampled(&self, place: &BoxPlace) -> Result<Sampled> {
        let &BoxPlace { channel, region, outer, size } = place;
        let window = self.channels[channel];
        let samples = read_frames(window, 0..window.frames(), &region, self.archive.sample)?;
        Ok(Sampled { size, outer, samples })
    }

    /// The place with this number of an evenly spread sequence, the same for every window. Channels take turns.
    fn place(&self, number: usize, size: [usize; 3]) -> BoxPlace {
        let dims = self.archive.grid.dims;
        let ghosts = self.pyramid.ghost_nodes(size);
        let outer = std::array::from_fn(|axis| size[axis] + ghosts[axis]); // the voxels that coding a box by any pyramid takes
        let ends = if number.is_multiple_of(2) { size } else { outer }; // blocks at far faces are followed by no other voxels
        let known: [usize; 3] = std::array::from_fn(|axis| ends[axis].min(dims[axis]));
        let start = evenly(number, std::array::from_fn(|axis| dims[axis] - known[axis] + 1));
        let region = Region { start, end: std::array::from_fn(|axis| start[axis] + known[axis]) };
        BoxPlace { channel: number % self.channels.len(), region, outer, size: BlockWithGhosts { size, known } }
    }
}

/// Where a box is.
pub(super) struct BoxPlace {
    channel: usize,
    region: Region,
    /// The voxels that pyramids may use.
    outer: [usize; 3],
    size: BlockWithGhosts,
}

/// The frames that show whether samples change, as shares of the window: unevenly spaced, so that they see oscillations.
const LOOKED_AT: [f64; 7] = [0.0, 0.13, 0.31, 0.47, 0.62, 0.83, 1.0];

/// Of no samples.
const NO_RANGE: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// The number of samples that may always be read.
const FEW_SAMPLES: usize = 1 << 17;

/// One voxel in this many is used for trials.
const SHARE: usize = 50;

/// The smallest and the largest number of boxes for trials.
const LEAST_BOXES: usize = 2;
const MOST_BOXES: usize = 12;

/// For each wanted box, so many places are looked at, and more if samples change in too few.
const CANDIDATES: usize = 4;
const MOST_CANDIDATES: usize = 16;

/// At most one voxel in this many is used for trials.
const LARGEST_SHARE: usize = 8;

/// Small boxes with a longer edge than this are taken only if all together are at most one voxel in [`LARGEST_SHARE_OF_LARGE`].
const SMALL_EDGE: usize = 16;
const LARGEST_SHARE_OF_LARGE: usize = 16;
