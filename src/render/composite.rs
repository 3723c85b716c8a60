//! Composites, isosurfaces and maximum intensity projections: every frame batch slice by slice, one view after another.

use super::config::{Mode, Pixel, Plane, RenderConfig};
use super::driver::{Job, for_each_batch};
use super::planes::{Cut, PlanesView};
use super::report::{RenderReport, Rendered};
use super::scene::{FrameBatch, Scene};
use super::slices::SlicedView;
use super::slices::batch::{Batch, bytes};
use super::slices::blend::Composite;
use super::slices::iso::Isosurfaces;
use super::slices::mip::Largest;
use super::slices::row::Blend;
use super::slices::shade::Shader;
use super::slices::stops::Stops;
use super::slices::table::Table;
use crate::base::error::Result;
use crate::base::grid::Grid;
use crate::base::memory;
use crate::base::progress::Progress;
use crate::colour::TransferFunction;
use std::ops::Range;

/// Renders all frames from some of the views. Progress counts slices of frames.
pub(super) fn composite(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (views, which): (&[SlicedView], Range<usize>),
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    for number in which {
        let view = &views[number];
        let mut sink =
            |frame, picture: &[f32]| sink(Rendered { views: &[], view: number, frame, picture, error: None });
        match &config.mode {
            Mode::Composite { transfer, unit, light, planes, .. } => {
                let spacing = scene.grid().largest_spacing();
                let table = Table::new(transfer, view.step / unit.unwrap_or(spacing));
                let shader = light.map(|light| Shader::new(light, view, table.faint(spacing)));
                let blend = Composite { table, shader };
                report.views[number].table_error = Some(blend.table.error());
                let behind = (!planes.is_empty()).then(|| Behind::new(scene.grid(), (config, view), number, planes));
                let behind = behind.transpose()?.map(|behind| (behind, transfer));
                Sliced { number, view, blend, behind, config, progress }.render(scene, report, &mut sink)?;
            }
            Mode::Iso { surfaces, light, .. } => {
                let blend = Isosurfaces::new(surfaces, view, Shader::new(*light, view, 0.0));
                Sliced { number, view, blend, behind: None, config, progress }.render(scene, report, &mut sink)?;
            }
            Mode::Mip { .. } => {
                Sliced { number, view, blend: Largest, behind: None, config, progress }
                    .render(scene, report, &mut sink)?;
            }
            Mode::Projection | Mode::Planes { .. } => {}
        }
    }
    Ok(())
}

/// The least memory in bytes with which any of the views can be rendered.
pub(super) fn least(scene: &dyn Scene, config: &RenderConfig, views: &[SlicedView]) -> usize {
    views.iter().map(|view| needed(scene, config, view, (1, 1))).max().unwrap_or(0)
}

/// Bytes to render `frames` frames together, with `blocks` blocks decoded at a time.
fn needed(scene: &dyn Scene, config: &RenderConfig, view: &SlicedView, (frames, blocks): (usize, usize)) -> usize {
    let grid = scene.blocks();
    let is_shaded = config.mode.is_shaded();
    let frames_bytes = match config.mode {
        Mode::Composite { .. } => bytes::<Composite>(view, frames, grid, is_shaded),
        Mode::Iso { .. } => bytes::<Isosurfaces>(view, frames, grid, is_shaded),
        _ => bytes::<Largest>(view, frames, grid, is_shaded),
    };
    let frames_bytes = frames_bytes + if config.mode.has_planes() { Behind::bytes(view, frames) } else { 0 };
    memory::FIXED + frames_bytes + blocks * block_bytes(scene, config, frames)
}

/// Bytes of a decoded block, with its samples in all frames, and its coefficients if these are inverted.
pub(super) fn block_bytes(scene: &dyn Scene, config: &RenderConfig, frames: usize) -> usize {
    let voxels = scene.blocks().region(0).voxels();
    let coefficients = scene.most_planes(frames, config).saturating_sub(2 * frames + 1);
    let inverted = if coefficients > 0 { (coefficients + 2 * frames) * size_of::<f64>() } else { 0 };
    scene.block_bytes() + voxels * (frames * size_of::<f32>() + 2 * size_of::<f64>() + inverted)
}

/// A view, and the way its slices combine.
struct Sliced<'a, B> {
    number: usize,
    view: &'a SlicedView,
    blend: B,
    /// Planes in the volume, and their colours.
    behind: Option<(Behind, &'a TransferFunction)>,
    config: &'a RenderConfig,
    progress: &'a dyn Progress,
}

impl<B: Blend> Sliced<'_, B> {
    fn render(
        &self,
        scene: &mut dyn Scene,
        report: &mut RenderReport,
        sink: &mut dyn FnMut(usize, &[f32]) -> Result<()>,
    ) -> Result<()> {
        let fits = |scene: &dyn Scene, frames, blocks| {
            needed(scene, self.config, self.view, (frames, blocks)) <= self.config.memory
        };
        let threads = rayon::current_num_threads();
        let at_a_time = (1..=threads).rev().find(|blocks| fits(scene, 1, *blocks)).unwrap_or(1);
        let together =
            |scene: &dyn Scene, most: usize| (1..=most).rev().find(|n| fits(scene, *n, at_a_time)).unwrap_or(1);
        let blocks = scene.blocks();
        let job = Job { config: self.config, together: &together, views: &[], progress: self.progress };
        let advance = |slices: usize| self.progress.advance(slices as u64);
        let (number, view, blend) = (self.number, self.view, &self.blend);
        let render = |batch: &dyn FrameBatch, report: &mut RenderReport| {
            let stops = self.behind.as_ref().map(|(behind, _)| &behind.stops);
            let job = Batch { number, view, blend, stops, blocks, batch, together: at_a_time, advance: &advance };
            let mut pictures = job.render(report)?;
            if let Some((behind, colours)) = &self.behind {
                let values = Cut { view: &behind.planes, blocks, batch, at_a_time }.pictures(report)?;
                put_behind(&mut pictures, &values, colours);
            }
            Ok(pictures)
        };
        for_each_batch(scene, job, report, render, |frames, channels, _| {
            let pictures = &channels[0].pictures;
            let numbers = pictures.len() / frames.len();
            frames.iter().zip(pictures.chunks_exact(numbers)).try_for_each(|(frame, picture)| sink(*frame, picture))
        })
    }
}

/// Opaque planes behind the light in front of them.
struct Behind {
    planes: PlanesView,
    stops: Stops,
}

impl Behind {
    fn new(grid: &Grid, (config, view): (&RenderConfig, &SlicedView), number: usize, planes: &[Plane]) -> Result<Self> {
        let planes = PlanesView::new(grid, config.clip(grid)?, planes, &config.views[number])?;
        let stops = Stops::new(view, |pixel| planes.nearest(pixel).map(|hit| view.along(hit.place)));
        Ok(Self { planes, stops })
    }

    /// Bytes for `frames` frames.
    fn bytes(view: &SlicedView, frames: usize) -> usize {
        Stops::bytes(view) + frames * view.camera.size.iter().product::<usize>() * (size_of::<f64>() + size_of::<f32>())
    }
}

/// Puts the colours of values behind the light of pixels. NaN has none.
fn put_behind(light: &mut [f32], values: &[f32], colours: &TransferFunction) {
    for (pixel, value) in light.chunks_exact_mut(Pixel::Light.numbers()).zip(values) {
        let Some(colour) = colours.colour(f64::from(*value)).filter(|_| !value.is_nan()) else { continue };
        let through = 1.0 - pixel[3];
        pixel.iter_mut().zip(colour).for_each(|(light, c)| *light += through * c as f32);
        pixel[3] = 1.0;
    }
}
