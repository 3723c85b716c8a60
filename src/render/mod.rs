//! A scene to pictures (method.md section 6): splat the planes of a group of frames, then invert every pixel.
//!
//! ```text
//! for each group of frames of a window         plan: as many as fit in memory
//!   for each band of rows
//!     for each batch of blocks                 scene: read, decode, terms     (workers)
//!       every tile splats the batch            splat: terms x footprint       (one owner per tile)
//!     every tile inverts its pixels            finish: planes -> frames, then / weights; certificate
//!   give the finished frames to the sink
//! ```
//!
//! Where that is less work, the codes of a file and the samples of frames go to cells of the view's sheared lattice instead,
//! and from there to pixels (`lattice`); all planes then do, weights and what is missing included, so that means stay means.

mod certificate;
mod coefficients;
pub mod colour;
mod expectation;
mod finish;
mod frames;
mod lattice;
mod plan;
mod reading;
mod scene;
pub mod sink;
mod splat;
mod terms;
mod weights;

pub use coefficients::{CoefficientScene, What};
pub use expectation::Expectation;
pub use frames::FrameScene;
pub use scene::{LeftOut, Scene};

use crate::camera::{Camera, View};
use crate::error::{Error, Result};
use crate::footprint::{Footprint, Kernel, Method};
use crate::progress::Progress;
use crate::volume::{BlockGrid, Grid, Region};
use certificate::Certificate;
use finish::Finish;
use lattice::{Cells, Lattice, Sums};
use plan::Budget;
use rayon::prelude::*;
use scene::{Contents, Group};
use serde::Serialize;
use splat::{Order, Splats, Tile, overlap, rows_reached};
use std::ops::Range;
use std::time::{Duration, Instant};
use terms::{Layout, Terms};
use weights::Weights;

/// What a pixel means (method.md section 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// g, the weighted mean along the ray; NaN is background (eq 12).
    Mean,
    /// I, the emission: value times length (eq 4).
    Emission,
}

/// How to render.
#[derive(Debug, Clone)]
pub struct RenderConfig {
    /// From where.
    pub view: View,
    /// The kernel.
    pub kernel: Kernel,
    /// What a pixel means.
    pub quantity: Quantity,
    /// Which frames, ascending.
    pub frames: Vec<usize>,
    /// Which voxels; by default all.
    pub region: Option<Region>,
    /// What splatting may add to the error: of an emission relative to the image of the largest |v| at the brightest
    /// place of the plane of the picture, of a mean relative to the value range, if that place is in the picture. 0 asks
    /// for the exact method.
    pub splat_error: f64,
    /// How far off the picture may be, in the unit of samples, so that less is read and splatted; none: as near as the
    /// file is. Of an emission: as far as where all samples are off by so much.
    pub allowed: Option<f64>,
    /// Which error that limits.
    pub limited: Limit,
    /// Whether each picture comes with a bound on the error of every pixel.
    pub certify: bool,
    /// Bytes that may be allocated.
    pub memory: usize,
}

/// An error that can be limited.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Limit {
    /// The largest of any sample, and so of any pixel of a mean.
    #[default]
    Certified,
    /// The root mean square over the pixels of a window's pictures, as it is estimated.
    Expected,
}

/// What a rendering did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RenderReport {
    /// Frames rendered.
    pub frames: usize,
    /// The splat method.
    pub method: &'static str,
    /// Its stated error, in the terms of the splat error that was asked for.
    pub stated_splat_error: f64,
    /// Pixels per world unit.
    pub scale: f64,
    /// Blocks that the scene holds, over all windows touched.
    pub blocks: u64,
    /// Blocks that were decoded, each time counted.
    pub blocks_read: u64,
    /// Blocks left out because they hold nothing in the region.
    pub blocks_empty: u64,
    /// Blocks left out because no pixel sees them.
    pub blocks_outside: u64,
    /// What a looser tolerance left out of the blocks in the region, over all windows touched.
    pub left_out: LeftOut,
    /// No sample that was splatted is further from the source's.
    pub certified_sample_error: f64,
    /// An estimate of the root mean square, over the pixels that are not background, of their errors, but for those of
    /// splatting; in the pictures' unit.
    pub expected_error: f64,
    /// The largest error that a pixel may have, if pictures are certified.
    pub certified_error: Option<f64>,
    /// Stored bytes that were read of blocks.
    pub bytes_read: u64,
    /// Nonzero coefficients splatted, each time counted.
    pub coefficients: u64,
    /// Seconds spent on the sums of weights.
    pub weight_seconds: f64,
    /// Seconds spent reading and decoding.
    pub decode_seconds: f64,
    /// Seconds spent splatting.
    pub splat_seconds: f64,
    /// Seconds spent on the inverse transform and the division by weights.
    pub inverse_seconds: f64,
    /// Seconds from beginning to end, without the sink.
    pub seconds: f64,
}

/// A finished picture: `width * height` numbers, row by row.
pub type Picture<'a> = &'a [f32];

/// A frame as it was rendered.
#[derive(Debug, Clone, Copy)]
pub struct Rendered<'a> {
    /// Its number.
    pub frame: usize,
    /// The quantity asked for.
    pub picture: Picture<'a>,
    /// If pictures are certified, a bound on the error of every pixel, in the same unit: against the picture of the
    /// source's samples splatted without a cut and without rounding. NaN is background.
    pub error: Option<Picture<'a>>,
}

/// Renders frames in order, giving each to `sink`.
pub fn render(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    progress: &dyn Progress,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<RenderReport> {
    let started = Instant::now();
    let mut sink_time = Duration::ZERO;
    let (eye, method) = Eye::new(scene, config)?;
    let budget = Budget::new(config, scene, eye.lattice.as_ref())?;
    progress.start(Some(config.frames.len() as u64));
    let mut report = RenderReport { method: method.name, scale: eye.camera.scale, ..Default::default() };
    report.stated_splat_error = stated_splat_error(config.quantity, method);
    let mut clock = Instant::now();
    let weights = Weights::new(&eye, config, &budget)?;
    let expectation = Expectation::new(&eye, config.quantity, &weights);
    lap(&mut clock, &mut report.weight_seconds);
    let mut rest = config.frames.as_slice();
    while let Some(first) = rest.first() {
        let end = scene.group_end(*first);
        let most = rest.partition_point(|f| *f < end);
        let (now, later) = rest.split_at(budget.frames(scene, config, most));
        let group = scene.group(now, config, &expectation)?;
        let pictures = render_group(group.as_ref(), &eye, config, &weights, &budget, &mut report)?;
        for rendered in pictures.frames(now) {
            let writing = Instant::now();
            sink(rendered)?;
            sink_time += writing.elapsed();
            progress.advance(1);
        }
        report.frames += now.len();
        rest = later;
    }
    progress.finish();
    report.expected_error = (report.expected_error / report.frames.max(1) as f64).sqrt();
    report.seconds = (started.elapsed() - sink_time).as_secs_f64();
    Ok(report)
}

/// The cheapest splat method within an error.
pub fn splat_method(quantity: Quantity, error: f64) -> Method {
    Method::within(footprint_error(quantity, error))
}

/// What footprints may be off by.
fn footprint_error(quantity: Quantity, error: f64) -> f64 {
    match quantity {
        Quantity::Emission => error,
        // A pixel that is not background must keep some of its weights.
        Quantity::Mean => (error * weights::BACKGROUND).min(0.9 * weights::BACKGROUND),
    }
}

/// The error that a splat method states.
pub fn stated_splat_error(quantity: Quantity, method: Method) -> f64 {
    match quantity {
        Quantity::Emission => method.stated_error,
        Quantity::Mean => method.stated_error / weights::BACKGROUND, // weights are down to so much of the largest
    }
}

/// Adds the seconds since `clock` to a stage, and restarts it.
fn lap(clock: &mut Instant, stage: &mut f64) {
    *stage += clock.elapsed().as_secs_f64();
    *clock = Instant::now();
}

/// Means are of voxels of which some are not deeper than this over tau: exponentials lose digits at 708, and vanish.
const DEEPEST: f64 = 640.0;

/// Everything that is the same for all frames of a view.
#[derive(Debug, Clone)]
struct Eye {
    camera: Camera,
    footprint: Footprint,
    grid: Grid,
    blocks: BlockGrid,
    /// The voxels that are splatted.
    clip: Region,
    /// What splats instead of footprints.
    lattice: Option<Lattice>,
}

impl Eye {
    fn new(scene: &dyn Scene, config: &RenderConfig) -> Result<(Self, Method)> {
        let (grid, blocks) = (*scene.grid(), scene.blocks());
        let clip = config.region.unwrap_or(grid.whole());
        if !grid.whole().contains(&clip) || clip.is_empty() {
            let d = grid.dims;
            return Err(Error::usage(format!("--region: not within the volume of {}x{}x{} voxels", d[0], d[1], d[2])));
        }
        let method = splat_method(config.quantity, config.splat_error);
        let camera = Camera::new(&config.view, &grid)?;
        let footprint = Footprint::new(config.kernel, &grid, camera.scale, method)?;
        let nearest = camera.nearest_of(&grid.crop(&clip));
        if config.quantity == Quantity::Mean && config.kernel.tau * nearest > DEEPEST {
            let what = "--tau: all voxels of the region lie so deep that their weights are beyond numbers";
            return Err(Error::usage(format!("{what} (tau {:e})", config.kernel.tau)));
        }
        let lattice = (scene.on_lattice() && !config.certify)
            .then(|| {
                let error = footprint_error(config.quantity, config.splat_error);
                Lattice::within(error, config.kernel, (&grid, &blocks, &clip), &camera, &footprint)
            })
            .flatten();
        let method = lattice.as_ref().map_or(method, |(_, method)| *method);
        Ok((Self { camera, footprint, grid, blocks, clip, lattice: lattice.map(|l| l.0) }, method))
    }

    fn pixels(&self) -> usize {
        self.camera.size[0] * self.camera.size[1]
    }

    fn tiles(&self, rows: Range<usize>, layout: &Layout) -> Vec<Tile> {
        let order = if self.lattice.is_some() { Order::Pixels } else { layout.order };
        Tile::cover(self.camera.size[0], rows, layout.planes(), order)
    }

    /// Copies the first planes of a tile to their places in as many whole pictures.
    fn paste<T>(&self, tile: &Tile, planes: usize, pictures: &mut [T], convert: impl Fn(f64) -> T) {
        let width = tile.x.len();
        for (plane, pixels) in tile.planes().take(planes).enumerate() {
            for (y, line) in tile.y.clone().zip(pixels.chunks_exact(width)) {
                let at = plane * self.pixels() + y * self.camera.size[0] + tile.x.start;
                pictures[at..at + width].iter_mut().zip(line).for_each(|(to, from)| *to = convert(*from));
            }
        }
    }

    /// Whether any voxel of a block can reach these rows of the picture.
    fn sees(&self, block: usize, rows: &Range<usize>) -> bool {
        if let Some(lattice) = &self.lattice {
            return overlap(&lattice.rows_reached(&self.blocks.region(block), self.camera.size), rows);
        }
        let region = self.blocks.region(block).intersect(&self.clip);
        overlap(&rows_reached(&region, &self.grid, &self.camera, &self.footprint), rows)
    }

    /// Splats blocks in order into tiles, `batch` at a time.
    fn splat(
        &self,
        tiles: &mut [Tile],
        blocks: &[usize],
        batch: usize,
        source: &dyn Blocks,
        report: &mut RenderReport,
    ) -> Result<()> {
        if let Some(lattice) = &self.lattice {
            return self.splat_on(lattice, tiles, blocks, batch, source, report);
        }
        let project = |block: usize| {
            let terms = source.terms(block)?;
            let held = [terms.coefficients, terms.bytes_read];
            let region = self.blocks.region(block);
            Ok((Splats::new(terms, &region, &self.clip, &self.grid, &self.camera, &self.footprint), held))
        };
        in_batches(blocks, batch, report, project, |splats| {
            tiles.par_iter_mut().for_each(|tile| splats.iter().for_each(|(s, _)| tile.splat(s, &self.footprint)));
        })
    }

    /// The same by way of a lattice.
    fn splat_on(
        &self,
        lattice: &Lattice,
        tiles: &mut [Tile],
        blocks: &[usize],
        batch: usize,
        source: &dyn Blocks,
        report: &mut RenderReport,
    ) -> Result<()> {
        let planes = tiles.first().map_or(0, Tile::count);
        let mut cells: Vec<Cells> = tiles.iter().map(|tile| lattice.cells_of(tile)).collect();
        let sums_of = |block: usize| {
            let sums: Sums = match source.sums(block, &self.clip, lattice)? {
                Some(sums) => sums,
                None => lattice.of_terms(&source.terms(block)?, &self.blocks.region(block), &self.clip, planes),
            };
            let held = [sums.coefficients, sums.bytes_read];
            Ok((sums, held))
        };
        in_batches(blocks, batch, report, sums_of, |sums| {
            cells.par_iter_mut().for_each(|cells| sums.iter().for_each(|(s, _)| s.add_to(cells, planes)));
        })?;
        let mut clock = Instant::now();
        tiles.par_iter_mut().zip(&cells).for_each(|(tile, cells)| lattice.gather(cells, tile));
        lap(&mut clock, &mut report.splat_seconds);
        Ok(())
    }
}

/// Makes something of every block, in order and `batch` at a time, each with its coefficients and the bytes read for them,
/// and adds it.
fn in_batches<T: Send>(
    blocks: &[usize],
    batch: usize,
    report: &mut RenderReport,
    make: impl Fn(usize) -> Result<(T, [u64; 2])> + Sync,
    mut add: impl FnMut(&[(T, [u64; 2])]),
) -> Result<()> {
    let mut clock = Instant::now();
    for blocks in blocks.chunks(batch) {
        let made = blocks.par_iter().map(|block| make(*block)).collect::<Result<Vec<_>>>()?;
        lap(&mut clock, &mut report.decode_seconds);
        add(&made);
        for (_, [coefficients, bytes_read]) in &made {
            report.coefficients += coefficients;
            report.bytes_read += bytes_read;
        }
        lap(&mut clock, &mut report.splat_seconds);
    }
    Ok(())
}

/// Where the terms of blocks come from, and for a lattice their sums, if there is a shorter way to these.
trait Blocks: Sync {
    fn terms(&self, block: usize) -> Result<Terms>;

    fn sums(&self, _block: usize, _clip: &Region, _lattice: &Lattice) -> Result<Option<Sums>> {
        Ok(None)
    }
}

impl Blocks for &dyn Group {
    fn terms(&self, block: usize) -> Result<Terms> {
        Group::terms(*self, block)
    }

    fn sums(&self, block: usize, clip: &Region, lattice: &Lattice) -> Result<Option<Sums>> {
        Group::sums(*self, block, clip, lattice)
    }
}

/// The pictures of a group.
struct Pictures {
    pixels: usize,
    /// Those of the frames, and if they are certified, those of their errors.
    all: Vec<f32>,
}

impl Pictures {
    fn frames<'a>(&'a self, numbers: &'a [usize]) -> impl Iterator<Item = Rendered<'a>> {
        let (values, errors) = self.all.split_at(numbers.len() * self.pixels);
        let of = |all: &'a [f32], i: usize| all.get(i * self.pixels..(i + 1) * self.pixels);
        numbers.iter().enumerate().map(move |(i, frame)| Rendered {
            frame: *frame,
            picture: of(values, i).unwrap_or_default(),
            error: of(errors, i),
        })
    }
}

/// Renders all frames of a group.
fn render_group(
    group: &dyn Group,
    eye: &Eye,
    config: &RenderConfig,
    weights: &Weights,
    budget: &Budget,
    report: &mut RenderReport,
) -> Result<Pictures> {
    let layout = group.layout();
    let certificate = config.certify.then(|| Certificate::new(eye, config.quantity));
    let finish = Finish { group, layout, quantity: config.quantity, weights, certificate };
    let blocks = blocks_to_read(group, eye, report)?;
    let mut pictures = vec![f32::NAN; finish.planes() * eye.pixels()];
    for rows in budget.bands(&layout) {
        let seen: Vec<usize> = blocks.iter().copied().filter(|b| eye.sees(*b, &rows)).collect();
        report.blocks_read += seen.len() as u64;
        let mut tiles = eye.tiles(rows.clone(), &layout);
        eye.splat(&mut tiles, &seen, budget.batch(&layout, rows.len()), &group, report)?;
        let mut clock = Instant::now();
        tiles.par_iter_mut().for_each(|tile| finish.tile(tile));
        tiles.iter().for_each(|tile| eye.paste(tile, finish.planes(), &mut pictures, |pixel| pixel as f32));
        lap(&mut clock, &mut report.inverse_seconds);
    }
    group.finish()?;
    if certificate.is_some() {
        let errors = pictures[layout.frames * eye.pixels()..].iter().map(|e| f64::from(*e));
        report.certified_error = Some(errors.fold(report.certified_error.unwrap_or(0.0), f64::max));
    }
    Ok(Pictures { pixels: eye.pixels(), all: pictures })
}

/// The blocks of a group that a pixel sees, and a word in the report on the others.
fn blocks_to_read(group: &dyn Group, eye: &Eye, report: &mut RenderReport) -> Result<Vec<usize>> {
    let Contents { mut blocks, empty, left_out, certified, expected } = group.blocks(&eye.clip)?;
    let held = blocks.len();
    blocks.retain(|b| eye.sees(*b, &(0..eye.camera.size[1])));
    report.blocks += eye.blocks.len() as u64;
    report.blocks_empty += empty;
    report.blocks_outside += (held - blocks.len()) as u64;
    report.left_out += left_out;
    report.certified_sample_error = report.certified_sample_error.max(certified);
    // Frame by frame, so that it is the same however frames are grouped.
    (0..group.layout().frames).for_each(|_| report.expected_error += expected);
    Ok(blocks)
}
