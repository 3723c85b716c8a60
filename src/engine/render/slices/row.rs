//! A row of cells in a slice: means and lengths, sixteen cells at a time, and the ways to combine the slices.

use super::filter::{Sixteen, weighted_rows};
use super::{GROUP, LEAST, stops};
use crate::render::batches::Units;

/// Sums along a and b of a row of cells, from the first row of voxels on that the weights along c meet.
#[derive(Clone, Copy)]
pub(super) struct RowSums<'a> {
    pub(super) values: &'a [f32],
    /// Sums of the weights of present samples; `None` if none is missing.
    pub(super) present: Option<&'a [f32]>,
}

/// One phase of a row of cells in a slice: sums of the kernel along a and b, to be summed along c.
pub(in crate::render) struct Row<'a> {
    pub(super) sums: RowSums<'a>,
    /// The derivatives of the sums along b and a; `None` unless a blend needs the gradient.
    pub(super) slopes: Option<[RowSums<'a>; 2]>,
    pub(super) stride: usize,
    /// Weights along c, and their derivatives.
    pub(super) weights: &'a [f32],
    pub(super) weight_slopes: &'a [f32],
    /// The sum of weights along a and c that meet the region, and along b for each cell.
    pub(super) share: f32,
    pub(super) shares: &'a [f32],
    /// Their derivatives: of the sum along c and a, and along b for each cell.
    pub(super) share_slopes: [f32; 2],
    pub(super) shares_slopes: &'a [f32],
    /// The kernel's density without missing samples and edges.
    pub(super) density: f32,
    /// Where the density is less, there is nothing.
    pub(super) least: f32,
    /// For each group, whether all its weights meet the region.
    pub(super) whole: &'a [bool],
    /// The number of the slice, and the number of slices in whose place it stands.
    pub(super) slice: u32,
    pub(super) thickness: u32,
    /// The place of the first cell in voxels along b, c and a. Voxels along a are counted along the ray. The cells of a
    /// row are a voxel apart along b.
    pub(super) place: [f32; 3],
    /// The stops of each group; none if no ray ends early.
    pub(super) stops: &'a [Sixteen],
}

/// Densities this close to 1 count as 1.
const WHOLE: f32 = 2e-4;

impl Row<'_> {
    /// Whether the means of a group are plain sums.
    #[inline(always)]
    pub(super) fn is_whole(&self, group: usize) -> bool {
        self.stops.is_empty()
            && self.sums.present.is_none()
            && self.whole[group]
            && self.share > 1.0 - 1e-6
            && (self.density - 1.0).abs() < WHOLE
    }

    /// The sums of a group.
    #[inline(always)]
    pub(super) fn sums(&self, group: usize) -> Sixteen {
        self.along_c(self.sums.values, self.weights, group)
    }

    /// The means of a group, and the lengths of its rays as shares of the distance of two slices. A length is 0 where
    /// almost nothing is present.
    #[inline(always)]
    pub(super) fn means(&self, group: usize) -> (Sixteen, Sixteen) {
        let (mut means, mut lengths) = (self.sums(group), [0.0; GROUP]);
        let present = self.presence(group);
        for i in 0..GROUP {
            let length = present[i] * self.density;
            let is_there = length >= self.least;
            means[i] = if is_there { means[i] / present[i] } else { 0.0 };
            lengths[i] = if is_there { length } else { 0.0 };
        }
        if let Some(stops) = self.stops.get(group) {
            let shares = stops::shares(stops, self.slice, self.thickness);
            for i in 0..GROUP {
                lengths[i] *= shares[i];
            }
        }
        (means, lengths)
    }

    /// The sums of the weights of present samples.
    #[inline(always)]
    fn presence(&self, group: usize) -> Sixteen {
        match self.sums.present {
            Some(present) => self.along_c(present, self.weights, group),
            None => {
                let mut shares = sixteen_of(self.shares, group);
                for share in &mut shares {
                    *share *= self.share;
                }
                shares
            }
        }
    }

    /// The gradient of the means of a group along b, c and a, per voxel (eq 41). `means` are `None` if the group is
    /// whole.
    #[inline(always)]
    pub(super) fn gradient(&self, group: usize, means: Option<&Sixteen>) -> [Sixteen; 3] {
        let Some([along_b, along_a]) = self.slopes else { return [[0.0; GROUP]; 3] };
        let terms = [(along_b, self.weights), (self.sums, self.weight_slopes), (along_a, self.weights)];
        let mut gradient = [[0.0; GROUP]; 3];
        // Loops instead of closures, which would not be compiled for the vector units.
        for (component, (sums, weights)) in gradient.iter_mut().zip(terms) {
            *component = self.along_c(sums.values, weights, group);
        }
        if let Some(means) = means {
            let (present, slopes) = (self.presence(group), self.presence_slopes(terms, group));
            for (component, slopes) in gradient.iter_mut().zip(&slopes) {
                for i in 0..GROUP {
                    component[i] = (component[i] - means[i] * slopes[i]) / present[i].max(f32::MIN_POSITIVE);
                }
            }
        }
        gradient
    }

    /// The derivatives of [`Self::presence`] along b, c and a.
    #[inline(always)]
    fn presence_slopes(&self, of: [(RowSums<'_>, &[f32]); 3], group: usize) -> [Sixteen; 3] {
        let mut slopes = [[0.0; GROUP]; 3];
        if self.sums.present.is_some() {
            for (slopes, (sums, weights)) in slopes.iter_mut().zip(of) {
                *slopes = self.along_c(sums.present.unwrap_or_default(), weights, group);
            }
            return slopes;
        }
        let (shares, [along_c, along_a]) = (sixteen_of(self.shares, group), self.share_slopes);
        let along_b = sixteen_of(self.shares_slopes, group);
        for i in 0..GROUP {
            slopes[0][i] = along_b[i] * self.share;
            slopes[1][i] = shares[i] * along_c;
            slopes[2][i] = shares[i] * along_a;
        }
        slopes
    }

    #[inline(always)]
    fn along_c(&self, values: &[f32], weights: &[f32], group: usize) -> Sixteen {
        weighted_rows(values, self.stride, weights, group * GROUP)
    }
}

/// The numbers of a group of cells.
#[inline(always)]
fn sixteen_of(numbers: &[f32], group: usize) -> Sixteen {
    numbers[group * GROUP..].first_chunk::<GROUP>().copied().unwrap_or([0.0; GROUP])
}

/// The field at a point.
pub(in crate::render) struct Point {
    /// Its place in voxels along b, c and a, as in [`Row::place`].
    pub(super) place: [f64; 3],
    pub(super) density: f64,
    pub(super) value: f64,
    /// The change of the value per voxel along b, c and a; zero unless the blend is shaded.
    pub(super) gradient: [f64; 3],
}

/// The groups of a row of cells.
pub(in crate::render) struct RowGroups<'a, G> {
    pub(super) states: &'a mut [G],
    pub(super) limits: &'a mut [f32],
    /// Whether each is to be computed.
    pub(super) live: &'a mut [bool],
    /// The last means; none if every slab is one slice.
    pub(super) last: &'a mut [LastMeans],
}

/// The means of a group in the middle of a slab.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastMeans {
    pub(super) means: Sixteen,
    /// The number of the first slice after the slab.
    pub(super) next: u32,
}

impl LastMeans {
    /// No slab.
    pub(super) const NONE: Self = Self { means: [0.0; GROUP], next: u32::MAX };
}

/// Rays with less transmittance are opaque: the rest is a thirtieth of a level of an 8-bit picture.
pub(super) const CLOSED: f32 = 1.0 / 8192.0;

/// A way to combine the slices along the rays of cells.
pub(in crate::render) trait Blend: Sync {
    /// The state of sixteen cells.
    type Group: Copy + Send + Sync;
    /// The state of a finished cell.
    type Cell: Copy + Send + Sync;

    /// The state before the first slice.
    const EMPTY: Self::Group;
    const NOTHING: Self::Cell;
    /// The limit of a group before the first slice.
    const OPEN: f32;
    /// The limit of a group after all its rays have ended.
    const OVER: f32 = 0.0;
    /// Whether units depend on a value near those of the frame.
    const CENTRED: bool = false;
    /// Numbers per pixel.
    const NUMBERS: usize = 4;

    /// The units of values. `middle` is a value near those of the frame.
    fn units(&self, middle: f64) -> Units;

    /// Where the density is less, there is nothing.
    fn least(&self) -> f32 {
        LEAST
    }

    /// Whether the gradient of the field is needed.
    fn is_shaded(&self) -> bool {
        false
    }

    /// The largest error of tabulated colours in the light of a slice, if there is a table.
    fn table_error(&self) -> Option<f64> {
        None
    }

    /// Whether any value in this range is visible.
    fn shows(&self, range: (f32, f32)) -> bool;

    /// Voxels along b and c, beside those that visible cells need, whose blocks are read as well.
    fn reads_beside(&self) -> [usize; 2] {
        [0; 2]
    }

    /// Whether cells with this limit hide all values in this range.
    fn hides(limit: f32, _range: (f32, f32)) -> bool {
        Self::is_closed(limit)
    }

    /// Whether cells with this limit hide everything.
    fn is_closed(limit: f32) -> bool {
        limit < CLOSED
    }

    /// Adds the live groups of a row behind the slices before, and updates their limits. If the row stands in place of
    /// several slices, adds only groups whose light hardly changes within them: these are then no longer live.
    fn add(&self, row: &Row<'_>, groups: RowGroups<'_, Self::Group>);

    /// The cells of a group.
    fn cells(group: &Self::Group) -> [Self::Cell; GROUP];

    /// The numbers of a pixel, from the 4 x 4 cells around it and the weights of their columns and rows.
    fn pixel(units: &Units, cells: [&[Self::Cell; 4]; 4], weights: [[f32; 4]; 2], out: &mut [f32]);

    /// An exact ray.
    type Exact;

    /// An exact ray before its first step.
    fn exact(&self) -> Self::Exact;

    /// Adds a point of the field behind the earlier ones, for a share of the distance of two slices.
    fn step(&self, ray: &mut Self::Exact, point: &Point, share: f64);

    /// The difference of a pixel from an exact ray; `None` if one of them has no value.
    fn off(ray: &Self::Exact, pixel: &[f32]) -> Option<f64>;

    /// The numbers of a pixel that no ray meets.
    fn background(out: &mut [f32]) {
        out.fill(0.0);
    }
}
