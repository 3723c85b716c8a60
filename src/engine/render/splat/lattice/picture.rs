//! The lattice of one view as a splat backend. A view uses it if its stated error is small enough and it is less work
//! than footprints.

use super::axis::Cut;
use super::cells::{Cells, LINE, Rectangle};
use super::error::{SliceError, Weighting};
use super::filtered::{Along, FilteredCells, Filters, Window, places, side_by_side};
use super::fit::MOST_WIDTH;
use super::kernel::Kernel;
use super::prefilter::HALF;
use super::shear::Shear;
use super::upright::{Move, Upright};
use super::{Choice, Placed, Spreading, Sums};
use crate::render::splat::tile_rect::{TILE, TileRect, WIDEST, pixels_around};
use std::ops::Range;
use std::sync::Arc;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::view::camera::Camera;
use wavesplat_core::view::footprint::{Footprint, Kernel as Gaussian, Method};

/// The lattice of a view.
#[derive(Debug, Clone)]
pub(in crate::render) struct Lattice {
    spreading: Arc<Spreading>,
    kernel: Kernel,
    pub(super) upright: Upright,
    /// f at its centre.
    pub(super) peak: f64,
    /// The largest number of additions for a cell of a plane.
    additions: usize,
    /// The cells that any voxel reaches, prefilter included, before and after rows move.
    bounds: Window,
    upright_bounds: Window,
}

/// A bound for a kernel and the spreading of voxels.
type Bound = fn(&Weighting<'_>, &Spreading) -> SliceError;

/// A view that may be splatted on a lattice.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct SplattedView<'a> {
    pub(in crate::render) kernel: Gaussian,
    pub(in crate::render) grid: &'a Grid,
    /// The voxels that count.
    pub(in crate::render) clip: &'a Region,
    pub(in crate::render) blocks: BlockGrid,
    pub(in crate::render) camera: &'a Camera,
    /// The exact contribution of a voxel to pixels, without a lattice.
    pub(in crate::render) footprint: &'a Footprint,
}

impl SplattedView<'_> {
    /// Standard deviation of the kernel in pixels.
    fn sigma(&self) -> f64 {
        self.kernel.sigma * self.camera.scale
    }

    /// Products for a plane with a footprint for each voxel.
    fn footprint_work(&self) -> f64 {
        let side = |pixels: usize| (2.0 * self.footprint.reach + 1.0).min(pixels as f64);
        self.clip.voxels() as f64 * (FOOTPRINT + side(self.camera.size[0]) * side(self.camera.size[1]))
    }
}

/// The choices, from the cheapest on.
const CHOICES: [Choice; 10] = [
    Choice::new(1, 4, Sums::Single),
    Choice::new(1, 5, Sums::Single),
    Choice::new(2, 4, Sums::Single),
    Choice::new(2, 5, Sums::Single),
    Choice::new(3, 5, Sums::Single),
    Choice::new(1, 5, Sums::Double),
    Choice::new(2, 5, Sums::Double),
    Choice::new(3, 5, Sums::Double),
    Choice::new(3, 6, Sums::Double),
    Choice::new(4, 6, Sums::Double),
];
/// The largest exponent by which weights change from one voxel to the next: rounding grows with its cube.
const STEEPEST: f64 = 0.5;
/// The largest slope of slices, in voxels.
const STEEPEST_SLOPE: f64 = 32.0;
/// The largest number of cells that a square tile reaches.
const TILE_CELLS: usize = 4096;
/// The largest number of cells that a wide tile reaches.
const WIDEST_CELLS: usize = 16 * TILE_CELLS;
/// Width of a tile in units of its height: the pixels of a row share the sums of columns.
const WIDE: usize = 4;
/// Heights of tiles. Bands begin at multiples of the largest sizes, so that tiles do not depend on bands.
const SIDES: [usize; 5] = [32, 16, 8, 4, 2];
const _: () = assert!(TILE.is_multiple_of(SIDES[0]) && WIDEST.is_multiple_of(WIDE * SIDES[0]));

impl Lattice {
    /// The lattice that splats within `error`, and its method for reports; `None` if footprints are better. `stated`
    /// gives the error of the picture for the error of a slice.
    pub(in crate::render) fn within(
        error: f64,
        view: &SplattedView<'_>,
        stated: impl Fn(SliceError) -> f64,
    ) -> Option<(Self, Method)> {
        let error = error.min(LARGEST);
        let radius = (2.0 * libm::log(1.0 / (CUT * error))).sqrt();
        if error < LEAST {
            return None;
        }
        for choice in CHOICES {
            let Some(lattice) = Self::new(choice, radius, view) else { continue };
            if stated(lattice.slice_error(SliceError::at_least)) > error {
                continue;
            }
            let stated_error = stated(lattice.slice_error(SliceError::new));
            if stated_error <= error {
                return Some((lattice, Method { name: "lattice", radius, stated_error }));
            }
        }
        None
    }

    /// The fastest lattice, whose error is only estimated: one cell a voxel. `estimated` gives the estimate for the
    /// picture from the error of a slice.
    pub(in crate::render) fn fast(
        view: &SplattedView<'_>,
        estimated: impl Fn(SliceError) -> f64,
    ) -> Option<(Self, Method)> {
        let (lattice, radius) = (Self::new(QUICK, QUICK_RADIUS, view)?, QUICK_RADIUS);
        let stated_error = estimated(lattice.slice_error(SliceError::new));
        Some((lattice, Method { name: "lattice-fast", radius, stated_error }))
    }

    /// The lattice of a choice, with a kernel that is cut at `radius` standard deviations; `None` if footprints are less
    /// work, or it does not suit.
    fn new(choice: Choice, radius: f64, view: &SplattedView<'_>) -> Option<Self> {
        let sigma = view.sigma();
        let SplattedView { grid, clip, blocks, camera, footprint, .. } = *view;
        let shear = Shear::new(camera, grid, choice.fineness).widened();
        let cut = Cut { radius, phases: choice.sums.phases() };
        let (kernel, upright) = (Kernel::new(&shear, sigma), Upright::new(&shear, sigma, cut)?);
        let slices = grid.dims[shear.axes[2]];
        let spreading = Spreading::new(shear, choice, kernel.conditional_sigmas(), view.kernel.tau, slices);
        let (peak, bounds) = (footprint.at_depth(0.0), Window::default());
        let additions = additions(clip, blocks, shear.axes[2]);
        let spreading = Arc::new(spreading);
        let mut lattice = Self { spreading, kernel, upright, peak, additions, bounds, upright_bounds: bounds };
        if !lattice.suits() || lattice.work(camera, clip) > view.footprint_work() {
            return None;
        }
        lattice.bounds = lattice.filtered_rectangle(clip);
        lattice.upright_bounds = lattice.upright.window(&lattice.bounds);
        Some(lattice)
    }

    /// The error of a slice, by one of the bounds.
    fn slice_error(&self, bound: Bound) -> SliceError {
        let roundings = match self.spreading.sums {
            Sums::Single => self.additions + OTHERS + OF_A_WEIGHT,
            Sums::Double => OF_A_WEIGHT,
        };
        bound(&Weighting { kernel: &self.kernel, cut: self.upright.cut(), roundings }, &self.spreading)
    }

    fn suits(&self) -> bool {
        if !self.is_tame() {
            return false;
        }
        let depths = self.spreading.shear.depths.map(|z| (self.spreading.tau * z).abs());
        let pixel = self.cells_reached(&(0..1), &(0..1)).size;
        let steep = depths.into_iter().fold(0.0, f64::max) > STEEPEST;
        !steep && area(pixel) <= TILE_CELLS
    }

    /// Whether cell indices are small enough for exact arithmetic.
    fn is_tame(&self) -> bool {
        let shear = &self.spreading.shear;
        let per_pixel = [[1.0, 0.0], [0.0, 1.0]].map(|pixel| shear.cells(pixel));
        let positions = [shear.cell_at([0.0; 2]), self.upright.position([0.0; 2]), self.upright.half()];
        let within = |numbers: &[f64; 2], most: f64| numbers.iter().all(|n| n.abs() <= most);
        within(&shear.slopes, STEEPEST_SLOPE)
            && per_pixel.iter().all(|n| within(n, 1e6))
            && positions.iter().all(|n| within(n, 1e9))
    }

    /// Estimated work for a plane, in products of a footprint.
    fn work(&self, camera: &Camera, clip: &Region) -> f64 {
        let (width, q) = (self.spreading.width() as f64, self.spreading.shear.fineness as f64);
        let [b, c] = self.spreading.shear.pixels.map(|step| step.map(|pixels| pixels / q));
        let volume = area(self.rectangle(clip).size) as f64 * (b[0] * c[1] - b[1] * c[0]).abs();
        let (pixels, tile) = (volume.min((camera.size[0] * camera.size[1]) as f64), self.tile());
        let copied = area(self.tile_cells(tile)) as f64 * pixels / area(tile) as f64;
        let tiles = camera.size[0].div_ceil(tile[0]) * camera.size[1].div_ceil(tile[1]);
        TILING * tiles as f64
            + GATHERING * self.upright.cells() * pixels
            + COPYING * copied
            + SPREADING * clip.voxels() as f64 * width * (q + 1.0)
    }

    /// The f64 numbers that a thread holds while it splats a block or gathers a tile of `planes` planes, without those that
    /// [`Self::copied_bytes`] counts.
    pub(in crate::render) fn scratch(&self, block: &Region, planes: usize) -> usize {
        const VALUES: usize = 3; // in their own type, as f32, as f64
        const SUMS: usize = 2; // of a plane with sums in f64, and of ones
        let splatting = self.block_cells(block) + VALUES * block.voxels();
        let (tile, Upright { along, across, .. }) = (self.tile(), &self.upright);
        let of_columns = self.tile_cells(tile)[0] * (side_by_side(planes) + across.padded());
        splatting.max(of_columns + tile[0] * along.padded() + SUMS * self.most_tile_cells())
    }

    /// The cells that the voxels of a region reach.
    fn rectangle(&self, region: &Region) -> Window {
        let (mut low, mut high) = ([isize::MAX; 2], [isize::MIN; 2]);
        for corner in 0..8 {
            let at = |axis: usize| if corner >> axis & 1 == 0 { region.start[axis] } else { region.end[axis] - 1 };
            let first = self.spreading.first(std::array::from_fn(at));
            (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(first[i]), high[i].max(first[i])));
        }
        // One more cell covers rounding, and cells beyond the cut that count as well.
        let pad = 1;
        let size = |i: usize| (high[i] - low[i]) as usize + 2 * pad + self.spreading.width();
        Window { first: low.map(|first| first - pad as isize), size: [size(0), size(1)] }
    }

    /// The same, with the cells that the prefilter reaches.
    fn filtered_rectangle(&self, region: &Region) -> Window {
        self.rectangle(region).grown([HALF + 1, HALF])
    }

    /// The upright cells of the centres of a rectangle of pixels.
    pub(super) fn cells_reached(&self, x: &Range<usize>, y: &Range<usize>) -> Window {
        let [x, y] = [x, y].map(|pixels| [pixels.start as f64 + 0.5, pixels.end as f64 - 0.5]);
        let corners = x.into_iter().flat_map(|x| y.map(move |y| [x, y]));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for position in corners.map(|pixel| self.upright.position(pixel)) {
            (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(position[i]), high[i].max(position[i])));
        }
        let half = self.upright.half();
        let first = [0, 1].map(|i| (low[i] - half[i]).floor() as isize - 1);
        Window { first, size: [0, 1].map(|i| ((high[i] + half[i]).ceil() as isize + 2 - first[i]) as usize) }
    }

    /// The cells, before rows move, that the filtered cells of a band's tiles are sums of. Tiles at the corners reach
    /// farthest.
    fn cells_before(&self, x: &Range<usize>, y: &Range<usize>) -> Window {
        let [width, height] = self.tile();
        let ends = |pixels: &Range<usize>, side: usize| {
            let last = pixels.start + (pixels.len().saturating_sub(1)) / side * side;
            [pixels.start, last].map(|start| start..start + side)
        };
        let rows = ends(y, height);
        let corners = ends(x, width).into_iter().flat_map(|x| rows.each_ref().map(|y| self.cells_reached(&x, y)));
        let before = corners.map(|tile| self.upright.before(&tile));
        before.reduce(|all, tile| all.joined(&tile)).unwrap_or_default().grown([HALF + 1, HALF])
    }

    /// The columns and rows of the picture that a block can reach. Both are empty if either is.
    pub(in crate::render) fn pixels_reached(&self, region: &Region, size: [usize; 2]) -> [Range<usize>; 2] {
        let Window { first, size: cells } = self.filtered_rectangle(region);
        let corner = |n: isize| [0, 1].map(|i| (first[i] + (n >> i & 1) * cells[i] as isize) as f64);
        pixels_around((0..4).map(|n| self.spreading.shear.pixel(corner(n))), self.upright.reach(), size)
    }

    /// Whether a block adds to any cell that the tiles of these pixels read. Tiles take the mean of all cells that they read, also
    /// of those that no pixel uses ([`super::bundle`]), so bands must not leave such a block out.
    pub(in crate::render) fn tiles_read(&self, region: &Region, pixels: &TileRect) -> bool {
        let block = self.upright.window(&self.filtered_rectangle(region));
        pixels.cover(self.tile()).iter().any(|tile| {
            let tile = self.cells_reached(&tile.x, &tile.y);
            block.part_in(&tile).iter().all(|(cells, _)| !cells.is_empty())
        })
    }

    /// The location in cells of a block's voxels, limited to a region. `extent` gives the cells of the planes.
    pub(in crate::render) fn placed(&self, region: &Region, clip: &Region, extent: &Rectangle) -> Placed {
        Placed::new(&self.spreading, region, clip, extent)
    }

    /// The cells of a band of a picture, with all planes at zero.
    pub(in crate::render) fn cells_of(&self, band: &TileRect, planes: usize) -> Cells {
        let Window { first, size } = self.cells_before(&band.x, &band.y).within(&self.bounds);
        Cells::new(Rectangle::holding(first, size, self.spreading.shear.fineness), planes, self.spreading.sums)
    }

    /// The filtered cells of a band.
    pub(in crate::render) fn filter(&self, cells: Cells, band: &TileRect) -> FilteredCells {
        let (rectangle, [along, across]) = (cells.rectangle(), &self.spreading.fits);
        let Window { first: [u, _], size: [width, _] } =
            self.cells_reached(&band.x, &band.y).within(&self.upright_bounds);
        let of_row = |v: isize| {
            let Move { cells, rest } = self.upright.moved(v);
            Along { start: u + cells - rectangle.first[0], taps: along.moved(rest) }
        };
        let rows = rectangle.first[1]..rectangle.first[1] + rectangle.size[1] as isize;
        let window = Window { first: [u, rows.start], size: [width, rectangle.size[1]] };
        FilteredCells::new(cells, &Filters { across: across.taps, along: rows.map(of_row).collect(), window })
    }

    /// Width and height of a tile in pixels. A square of the height reaches at most [`TILE_CELLS`] cells. The pixels of a row
    /// share the sums of columns, so tiles are wide.
    pub(in crate::render) fn tile(&self) -> [usize; 2] {
        let fits = |side: &usize| area(self.tile_cells([*side; 2])) <= TILE_CELLS;
        let side = SIDES.into_iter().find(fits).unwrap_or(1);
        let wide = |width: &usize| area(self.tile_cells([*width, side])) <= WIDEST_CELLS;
        [[WIDE * side, side].into_iter().find(wide).unwrap_or(side), side]
    }

    /// Cells along u and v that a tile reaches.
    fn tile_cells(&self, [width, height]: [usize; 2]) -> [usize; 2] {
        self.cells_reached(&(0..width), &(0..height)).size
    }

    /// An upper bound of the cells that any tile reaches.
    fn most_tile_cells(&self) -> usize {
        area(self.tile_cells(self.tile()).map(|n| n + 2)) // covers rounding and any tile position
    }

    /// An upper bound of the bytes for the planes of a band: their sums, and a group of them side by side.
    pub(in crate::render) fn band_bytes(&self, size: [usize; 2], planes: usize) -> usize {
        let number = match self.spreading.sums {
            Sums::Single => size_of::<f32>(),
            Sums::Double => size_of::<f64>(),
        };
        (planes + places(planes)) * self.band_cells(size) * number
    }

    /// An upper bound of the bytes for a plane of a band in f64, if it has sums in f32, too.
    pub(in crate::render) fn double_bytes(&self, size: [usize; 2]) -> usize {
        if self.spreading.sums == Sums::Double { 0 } else { self.plane_bytes(size) }
    }

    /// An upper bound of the bytes that a thread that gathers a tile copies of such a plane.
    pub(in crate::render) fn copied_bytes(&self) -> usize {
        const COPIES: usize = 3; // the sum, and its place in a bundle that may be half empty
        if self.spreading.sums == Sums::Double { 0 } else { COPIES * self.most_tile_cells() * size_of::<f32>() }
    }

    /// An upper bound of the bytes for a plane of a band in f64.
    pub(in crate::render) fn plane_bytes(&self, size: [usize; 2]) -> usize {
        self.band_cells(size) * size_of::<f64>()
    }

    /// An upper bound of the cells of a plane of a band, before and after rows move.
    fn band_cells(&self, [width, height]: [usize; 2]) -> usize {
        let (x, y) = (0..width, 0..height);
        // Four more cells cover rounding and any position of the band.
        let most = |reached: Window, bounds: &Window| [0, 1].map(|i| (reached.size[i] + 4).min(bounds.size[i]));
        let before = most(self.cells_before(&x, &y), &self.bounds);
        let [columns, _] = most(self.cells_reached(&x, &y), &self.upright_bounds);
        self.held(before).max((columns + 1) * before[1])
    }

    /// An upper bound of the cells of a plane of a block.
    pub(in crate::render) fn block_cells(&self, region: &Region) -> usize {
        let size = self.rectangle(region).size;
        self.held(size.map(|n| n + MOST_WIDTH - 1 + self.spreading.shear.fineness))
    }

    /// An upper bound of the stored cells for a rectangle of `size` cells: rows are whole cache lines for each phase.
    fn held(&self, size: [usize; 2]) -> usize {
        (size[0] + 3 * self.spreading.shear.fineness * LINE) * size[1]
    }
}

/// The choice for a quick look, and the cut of its kernel in standard deviations.
const QUICK: Choice = Choice::new(1, 4, Sums::Single);
const QUICK_RADIUS: f64 = 3.5;
/// The share of the error that is left for the cut of the kernel.
const CUT: f64 = 0.03;
/// Smaller errors are below what weights in f32 can promise. Views from 5e-6 on have a lattice.
const LEAST: f64 = 3e-6;
/// Roundings to f32 besides the additions for a cell, 32 for the filters and 64 for a pixel; and those of a weight.
const OTHERS: usize = 96;
const OF_A_WEIGHT: usize = 8;

/// The measured cost of a footprint of a single pixel, in products.
const FOOTPRINT: f64 = 20.0;
/// The cost of a tile, with or without voxels, in the same unit.
const TILING: f64 = 2000.0;
/// The measured costs of a cell around a pixel (of all cells within the cut), of copying a cell into a tile, and of a
/// product from voxels to cells, in units of a product of a footprint.
const GATHERING: f64 = 0.5;
const COPYING: f64 = 5.0;
const SPREADING: f64 = 0.15;

/// The largest error to aim for: larger errors would not be cheaper.
const LARGEST: f64 = 0.05;

/// The largest number of additions in f32 for a cell of a plane: the slices of a block and the voxels of a slice, and the
/// blocks that a ray can meet, each with its neighbours.
fn additions(clip: &Region, blocks: BlockGrid, axis: usize) -> usize {
    let dims = clip.dims();
    let met: usize = (0..3).map(|a| dims[a].div_ceil(blocks.edges[a]) + 1).sum();
    blocks.edges[axis].min(dims[axis]) + 2 * MOST_WIDTH + 4 * met
}

fn area([width, height]: [usize; 2]) -> usize {
    width * height
}
