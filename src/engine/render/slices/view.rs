//! The geometry of a view: slices across the principal axis, and their cells on the sheared lattice.
//!
//! The principal axis a is the one closest to the view direction; b and c are the others. A slice lies at a position s
//! along a, in voxels. Its cells are `1 / cells` voxels apart along b and c. Cells of two slices with the same number
//! (u, v) lie on one ray:
//!
//! ```text
//! voxel position of a cell (b, c) = (u - alpha s, v - beta s)
//! ```
//!
//! alpha and beta are the slopes of eq 35, so a ray crosses all slices at one (u, v), which is a point of the picture.

use super::table::change;
use super::taps::{CUT, Taps, along, reach};
use super::{GROUP, LEAST};
use crate::render::config::{Mode, RenderConfig};
use crate::render::splat::lattice::Shear;
use std::ops::Range;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_core::view::footprint::{Footprint, Method};

/// A view cut into slices.
#[derive(Debug, Clone)]
pub(in crate::render) struct SlicedView {
    pub(in crate::render) camera: Camera,
    pub(super) shear: Shear,
    pub(super) clip: Region,
    /// The voxels of the region along b, c and a.
    pub(super) count: [usize; 3],
    /// The first of them.
    start: [usize; 3],
    /// Whether the ray meets the last voxels along a first.
    reversed: bool,
    /// World units between voxels along b, c and a.
    spacing: [f64; 3],
    /// Standard deviation of the kernel along b, c and a, in voxels.
    pub(super) sigma: [f64; 3],
    /// Voxels that the kernel reaches to either side, along b, c and a.
    pub(super) reach: [usize; 3],
    /// Cells per voxel along b and c.
    pub(in crate::render) cells: usize,
    /// Slabs per voxel along a, and slices per slab.
    slabs: usize,
    parts: usize,
    /// Voxels beyond the kernel, along b, c and a, that decide whether a cell is visible: what is between two slices of a surface
    /// shows in both, and what a slab's slices meet counts for all of it.
    pub(super) margin: [usize; 3],
    /// The lattice's first cell, in whole voxels.
    corner: [i64; 2],
    /// Width and height of the lattice in voxels; the width is a multiple of [`GROUP`].
    pub(super) extent: [usize; 2],
    /// Length of a ray between two slices, in world units.
    pub(in crate::render) step: f64,
}

/// One slice: the weights of voxels along each axis.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    pub(super) number: u32,
    /// The number of slices in whose place it stands.
    pub(super) thickness: u32,
    /// The mean density of these slices as a share of its own.
    pub(super) filling: f64,
    /// Weights along a; voxels are counted from the first that a ray meets.
    pub(super) along: Taps,
    /// Weights of each phase along b and c: those of cell `phase`. `cells` further on, they move by a voxel.
    pub(super) across: [Vec<Taps>; 2],
}

/// A part of all rays at most a voxel thick: a few slices, or one in place of them where light hardly changes.
#[derive(Debug, Clone)]
pub(super) struct Slab {
    /// The slice in its middle. If `is_met`, it is as thick as the slab.
    pub(super) middle: Slice,
    /// Its slices; none if the slab is one.
    pub(super) slices: Vec<Slice>,
    /// Whether rays in the middle are long enough to stand in place of the slices.
    pub(super) is_met: bool,
}

impl Slab {
    /// Bytes of the weights of a view's slabs, each.
    pub(super) fn bytes(view: &SlicedView) -> usize {
        let slices = if view.parts > 1 { 1 + view.parts } else { 1 };
        size_of::<Self>() + slices * Slice::bytes(view)
    }
}

impl Slice {
    /// Bytes of its weights.
    pub(super) fn bytes(view: &SlicedView) -> usize {
        let across = 2 * view.cells * (view.reach[0].max(view.reach[1]));
        size_of::<Self>() + (across + view.reach[2]) * 4 * size_of::<f32>() + 2 * view.cells * size_of::<Taps>()
    }
}

/// The largest number of slices per voxel.
const MOST: usize = 64;
/// The largest number of voxels that the kernel reaches, and of the lattice along an axis: products of three are numbers.
const MOST_REACH: f64 = 4096.0;
const MOST_EXTENT: usize = 1 << 20;
/// Pixels per voxel from which on several cells per voxel show.
const FEW_PIXELS: f64 = 0.8;
/// The default distance of cells, and of slices for largest values, in standard deviations of the kernel.
const FINE: f64 = 2.0 / 3.0;
/// The default distance of slices for smooth opacities.
const COARSE: f64 = 4.0 / 3.0;
/// Opacities of a voxel are smooth if they change by no more than this within an eighth of the range of values.
const SMOOTH: f64 = 0.1;
/// Cells around the picture that interpolation needs.
const RIM: f64 = 2.0;

impl SlicedView {
    /// Cuts a view of `grid`.
    ///
    /// # Errors
    /// A region outside the volume, a camera without a picture, or a number of slices out of range.
    pub(in crate::render) fn new(grid: &Grid, config: &RenderConfig, view: &View) -> Result<Self> {
        let clip = config.clip(grid)?;
        let camera = Camera::new(view, grid)?;
        let shear = Shear::new(&camera, grid, 1);
        let (start, count) = along(&clip, shear.axes);
        let sigma = shear.axes.map(|axis| config.kernel.sigma_in_voxels(grid, axis));
        Footprint::new(config.kernel, grid, camera.scale, Method::EXACT)?; // weights are numbers
        if sigma.iter().any(|sigma| sigma * CUT > MOST_REACH) {
            return Err(too_wide());
        }
        if let Some(wrong) = config.mode.slices().filter(|n| !(1..=MOST).contains(n)) {
            return Err(Error::setting("slices", format!("takes 1 to {MOST} per voxel, not {wrong}")));
        }
        let pixels = shear.pixels.map(|step| step[0].hypot(step[1])).into_iter().fold(0.0, f64::max);
        let cells = config.mode.slices().unwrap_or_else(|| default_cells(&config.mode, &sigma, pixels));
        let deeper = camera.step(shear.axes[2], 1.0)[2];
        let voxel = grid.spacing[shear.axes[2]] / deeper.abs();
        let [slabs, parts] = match config.mode.slices() {
            Some(slices) => [slices, 1],
            None => default_slices(&config.mode, sigma[2], voxel, grid),
        };
        let step = voxel / (slabs * parts) as f64;
        let mut cut = Self {
            camera,
            shear,
            clip,
            count,
            start,
            reversed: deeper < 0.0,
            spacing: shear.axes.map(|axis| grid.spacing[axis]),
            sigma,
            reach: sigma.map(reach),
            cells,
            slabs,
            parts,
            margin: [0; 3],
            corner: [0; 2],
            extent: [0; 2],
            step,
        };
        cut.margin = cut.margin(config.mode.is_of_surfaces());
        (cut.corner, cut.extent) = cut.lattice();
        if cut.extent.iter().any(|n| *n > MOST_EXTENT) { Err(too_wide()) } else { Ok(cut) }
    }

    /// See the field: as far as cells move from a slice to the next one, or from the middle of a slab to its slices.
    fn margin(&self, is_of_surfaces: bool) -> [usize; 3] {
        let slices = self.slices_per_voxel() as f64;
        let along_a = if is_of_surfaces { 1.0 / slices } else { (self.parts - 1) as f64 / (2.0 * slices) };
        let least = usize::from(is_of_surfaces);
        let moved = |slope: f64| (slope.abs() * along_a * (1.0 + 1e-9)).ceil() as usize;
        let [b, c] = self.shear.slopes.map(|slope| moved(slope).max(least));
        [b, c, least] // all slices of a slab lie between the same two layers
    }

    /// The part of the lattice that both the picture and the kernels of the region reach.
    fn lattice(&self) -> ([i64; 2], [usize; 2]) {
        let [seen, reached] = [self.cells_seen(), self.cells_reached(&self.clip)];
        let ends: [[f64; 2]; 2] =
            [0, 1].map(|i| [seen[i][0].max(reached[i][0]).floor(), seen[i][1].min(reached[i][1]).ceil()]);
        let extent =
            ends.map(|[from, to]| if to >= from { (to - from).min(2.0 * MOST_EXTENT as f64) as usize + 1 } else { 0 });
        let empty = extent.contains(&0);
        let corner = ends.map(|[from, _]| from as i64);
        (corner, if empty { [0; 2] } else { [extent[0].next_multiple_of(GROUP), extent[1]] })
    }

    /// The range of cells along b and c, in voxels, that the picture shows.
    fn cells_seen(&self) -> [[f64; 2]; 2] {
        let [width, height] = self.camera.size.map(|n| n as f64);
        let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]].map(|pixel| self.cell_at(pixel));
        let rim = RIM / self.cells as f64;
        [0, 1].map(|i| ends(corners.iter().map(|corner| corner[i]), rim))
    }

    /// The range of cells along b and c, in voxels, that the kernels of a region reach.
    fn cells_reached(&self, region: &Region) -> [[f64; 2]; 2] {
        let (start, count) = along(region, self.shear.axes);
        let depths = [start[2] as f64, (start[2] + count[2]) as f64 - 1.0];
        let depths = [depths[0] - self.reach[2] as f64, depths[1] + self.reach[2] as f64];
        [0, 1].map(|i| {
            let sides = [start[i] as f64, (start[i] + count[i]) as f64 - 1.0];
            let at = |side: f64| depths.map(|depth| side + self.shear.slopes[i] * depth);
            ends(sides.into_iter().flat_map(at), self.reach[i] as f64)
        })
    }

    /// The position of a picture's point on the lattice, in voxels.
    pub(super) fn cell_at(&self, point: [f64; 2]) -> [f64; 2] {
        self.shear.cell_at(point)
    }

    /// The position of a point of the picture in cells of the lattice, counted from its first cell.
    pub(super) fn cell_of(&self, pixel: [f64; 2]) -> [f64; 2] {
        let at = self.cell_at(pixel);
        [0, 1].map(|i| (at[i] - self.corner[i] as f64) * self.cells as f64)
    }

    /// The point of the picture that the ray of a cell goes through. Cells are counted from the first one.
    pub(super) fn pixel_of(&self, cell: [usize; 2]) -> [f64; 2] {
        let at = [0, 1].map(|i| self.corner[i] as f64 + cell[i] as f64 / self.cells as f64);
        self.shear.pixel(at)
    }

    /// The position along a of a place in voxels along x, y, z.
    pub(in crate::render) fn along(&self, place: [f64; 3]) -> f64 {
        place[self.shear.axes[2]]
    }

    /// The number of slices that a ray crosses before it comes to voxel `at` along a.
    pub(super) fn slices_before(&self, at: f64) -> f64 {
        let last = (self.start[2] + self.count[2] - 1) as f64;
        let met = if self.reversed { last - at } else { at - self.start[2] as f64 };
        (met + self.reach[2] as f64) * self.slices_per_voxel() as f64
    }

    /// Number of slices.
    pub(in crate::render) fn slices(&self) -> usize {
        self.slab_count() * self.parts
    }

    fn slices_per_voxel(&self) -> usize {
        self.slabs * self.parts
    }

    /// Number of slabs.
    pub(super) fn slab_count(&self) -> usize {
        (self.count[2] - 1 + 2 * self.reach[2]) * self.slabs
    }

    /// Whether slabs have several slices.
    pub(super) fn has_parts(&self) -> bool {
        self.parts > 1
    }

    /// The number of slices of a slab.
    pub(super) fn parts(&self) -> usize {
        self.parts
    }

    /// The position along a of one of `per_voxel` slices or slabs per voxel, in voxels from the first that a ray meets.
    fn position(&self, number: usize, per_voxel: usize) -> f64 {
        (number as f64 + 0.5) / per_voxel as f64 - self.reach[2] as f64
    }

    /// The slabs that need no voxel from `met` on, of all from `first` on: a range of numbers.
    pub(super) fn ready(&self, first: usize, met: usize) -> Range<usize> {
        let beyond = (self.reach[2] + self.margin[2]) as i64;
        let needs = |number: &usize| self.position(*number, self.slabs).floor() as i64 + beyond;
        let all = self.slab_count();
        if met >= self.count[2] {
            return first..all;
        }
        first..(first..all).find(|number| needs(number) >= met as i64).unwrap_or(all)
    }

    /// The first voxel along a, counted along the ray, that slabs from `number` on need.
    pub(super) fn first_needed(&self, number: usize) -> usize {
        let beyond = (self.reach[2] + self.margin[2]) as i64;
        (self.position(number, self.slabs).floor() as i64 + 1 - beyond).clamp(0, self.count[2] as i64) as usize
    }

    /// A slab; `None` if the ray is too short in all of it.
    pub(super) fn slab(&self, number: usize) -> Option<Slab> {
        let density = |slice: &Slice| f64::from(slice.along.presence(0, self.count[2])) * slice.along.density;
        let is_met = |slice: &Slice| density(slice) as f32 >= LEAST;
        let first = number * self.parts;
        let mut middle = self.slice(self.position(number, self.slabs), first);
        let part = |n: usize| self.slice(self.position(first + n, self.slices_per_voxel()), first + n);
        let parts = if self.has_parts() { 0..self.parts } else { 0..0 };
        let slices: Vec<Slice> = parts.map(part).filter(is_met).collect();
        let is_met = is_met(&middle);
        if is_met && self.has_parts() {
            middle.thickness = self.parts as u32;
            middle.filling = slices.iter().map(density).sum::<f64>() / (self.parts as f64 * density(&middle));
        }
        (is_met || !slices.is_empty()).then_some(Slab { middle, slices, is_met })
    }

    /// The slice at a position along a.
    fn slice(&self, position: f64, number: usize) -> Slice {
        let cell = |i: usize, phase: usize| self.corner[i] as f64 + phase as f64 / self.cells as f64;
        let across = [0, 1].map(|i| (0..self.cells).map(|phase| self.taps(position, i, cell(i, phase))).collect());
        Slice { number: number as u32, thickness: 1, filling: 1.0, along: Taps::new(position, self.sigma[2]), across }
    }

    /// The weights along b or c of a cell's position in a slice at a position along a.
    fn taps(&self, position: f64, i: usize, cell: f64) -> Taps {
        let voxel = if self.reversed {
            (self.start[2] + self.count[2] - 1) as f64 - position
        } else {
            self.start[2] as f64 + position
        };
        Taps::new(cell - self.shear.slopes[i] * voxel - self.start[i] as f64, self.sigma[i])
    }

    /// The weights along b, c and a where the ray of a cell crosses a slice.
    pub(super) fn taps_at(&self, number: usize, cell: [f64; 2]) -> [Taps; 3] {
        let position = self.position(number, self.slices_per_voxel());
        let [b, c] = [0, 1].map(|i| self.taps(position, i, cell[i]));
        [b, c, Taps::new(position, self.sigma[2])]
    }

    /// The change per world unit of a value that changes by 1 per voxel along b, c and a. Voxels along a are counted
    /// along the ray.
    pub(super) fn per_world_unit(&self) -> [f64; 3] {
        let [b, c, a] = self.spacing.map(|spacing| 1.0 / spacing);
        [b, c, if self.reversed { -a } else { a }]
    }

    /// The voxels along b, c and a that a ray passes from one voxel along a to the next.
    pub(super) fn direction(&self) -> [f64; 3] {
        let back = if self.reversed { 1.0 } else { -1.0 };
        [back * self.shear.slopes[0], back * self.shear.slopes[1], 1.0]
    }

    /// Voxels of the lattice that a cell or a pixel takes, whichever is larger.
    pub(super) fn grain(&self) -> f64 {
        let pixels = self.shear.pixels.map(|step| step[0].hypot(step[1])).into_iter().fold(0.0, f64::max);
        (1.0 / self.cells as f64).max(1.0 / pixels)
    }

    /// The distance of two slices, in voxels along a.
    pub(super) fn between(&self) -> f64 {
        1.0 / self.slices_per_voxel() as f64
    }

    /// The same view with every slice a slab.
    pub(super) fn slice_by_slice(&self) -> Self {
        self.with_slices(self.slices_per_voxel()).0
    }

    /// The same view with `slices` slices per voxel, each a slab, and the number of slices of this view per slice of that one.
    pub(super) fn with_slices(&self, slices: usize) -> (Self, f64) {
        (Self { slabs: slices, parts: 1, ..self.clone() }, self.slices_per_voxel() as f64 / slices as f64)
    }

    /// The place of voxel layer `at` (an index along the grid's axis a), counted along the ray.
    pub(super) fn met_at(&self, at: usize) -> usize {
        if self.reversed { self.start[2] + self.count[2] - 1 - at } else { at - self.start[2] }
    }

    /// Whether rays meet the last voxels along a first.
    pub(super) fn is_reversed(&self) -> bool {
        self.reversed
    }

    /// The groups of cells that the kernels of a region reach: columns of groups, and rows in voxels.
    pub(super) fn reached(&self, region: &Region) -> [Range<usize>; 2] {
        let reached = self.cells_reached(region);
        let within = |i: usize, most: usize| {
            let ends = reached[i].map(|cell| cell - self.corner[i] as f64);
            let from = (ends[0].floor() - 1.0).clamp(0.0, most as f64) as usize;
            from..(ends[1].ceil() + 2.0).clamp(from as f64, most as f64) as usize
        };
        let [columns, rows] = [within(0, self.extent[0]), within(1, self.extent[1])];
        [columns.start / GROUP..columns.end.div_ceil(GROUP), rows]
    }
}

/// The default number of cells per voxel across the ray. Surfaces have sharp edges, so their cells are no larger than
/// pixels.
fn default_cells(mode: &Mode, sigma: &[f64; 3], pixels: f64) -> usize {
    let smooth = if pixels < FEW_PIXELS { 1 } else { per_voxel(FINE * sigma[0].min(sigma[1])) };
    if mode.is_of_surfaces() { smooth.max(per_voxel(1.0 / pixels)) } else { smooth }
}

/// The default numbers of slabs per voxel and of slices per slab for a kernel of `sigma` voxels. `voxel` is the length of a ray
/// along which it crosses a voxel.
fn default_slices(mode: &Mode, sigma: f64, voxel: f64, grid: &Grid) -> [usize; 2] {
    match mode {
        Mode::Composite { transfer, unit, .. } => {
            let length = voxel / unit.unwrap_or_else(|| grid.largest_spacing());
            let sharp = (change(transfer, length) / SMOOTH).ceil().clamp(1.0, 8.0) as usize;
            [per_voxel(COARSE * sigma), sharp]
        }
        _ => [per_voxel(FINE * sigma), 1],
    }
}

/// The number of slices or cells per voxel that are at most `distance` voxels apart; at most 8.
fn per_voxel(distance: f64) -> usize {
    (1.0 / distance - 1e-6).ceil().clamp(1.0, 8.0) as usize
}

fn too_wide() -> Error {
    let what = "covers too many voxels along an axis for slices";
    Error::setting("sigma", Note::with(what, Remedy::Adjust(&["sigma", "spacing"])))
}

fn ends(values: impl Iterator<Item = f64>, rim: f64) -> [f64; 2] {
    let [from, to] =
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[from, to], value| [from.min(value), to.max(value)]);
    [from - rim, to + rim]
}
