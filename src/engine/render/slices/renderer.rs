//! Composites, isosurfaces and maximum intensity projections: every frame batch slice by slice, one view after another.

use super::batch::{SlicePass, Swept, bytes};
use super::blend::Composite;
use super::certificate::{Certificate, pixel_errors, second_bytes};
use super::iso::Isosurfaces;
use super::iso_certificate::{IsoCertificate, iso_errors, seen_with_errors};
use super::row::Blend;
use super::stops::Stops;
use super::view::SlicedView;
use crate::render::Rendered;
use crate::render::batches::{SampleReader, SampledView, Scene};
use crate::render::config::{Pixel, Plane, RenderConfig, ViewTask};
use crate::render::planes::{PlanesPass, PlanesView};
use crate::render::renderer::{Output, Renderer};
use crate::render::report::{RenderReport, ViewReport};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid};
use wavesplat_core::colour::TransferFunction;

/// Renders views slice by slice, combined by `B`. Progress counts slices of frames.
pub(in crate::render) struct Sliced<'a, B: Blend> {
    views: Vec<SlicedView>,
    /// How the slices of a view combine.
    blend: Box<dyn Fn(&SlicedView) -> B + 'a>,
    planes: Option<ColouredPlanes<'a>>,
    certifier: Option<Certifier<B>>,
}

/// Bounds of the errors of pixels, frame by frame.
type FrameErrors = Vec<Vec<f32>>;

/// What bounds the errors of pixels.
struct Certifier<B: Blend> {
    /// The blend of a batch, made from that of a view.
    blend: fn(B, &SlicedView, &SampleReader<'_>) -> B,
    /// The bounds of each frame of a batch after its slices.
    errors: fn(&SlicePass<'_, B>, &Swept<B>, &mut RenderReport) -> Result<FrameErrors>,
    /// Bytes that this takes for a number of frames, without decoded blocks. The last argument is whether light falls on the field.
    bytes: fn(&SlicedView, usize, BlockGrid, bool) -> usize,
}

impl Sliced<'_, Composite> {
    /// The same with bounds of the errors of all pixels. Every slice is drawn, no slab in place of several, and every ray by its length.
    pub(in crate::render) fn certified(self) -> Self {
        let views = self.views.iter().map(SlicedView::slice_by_slice).collect();
        let blend = |composite: Composite, _: &SlicedView, _: &SampleReader<'_>| composite.by_lengths();
        let certifier = Some(Certifier { blend, errors: pixel_errors, bytes: second_bytes::<Certificate<'_>> });
        Self { views, certifier, ..self }
    }
}

impl Sliced<'_, Isosurfaces> {
    /// The same with bounds of the errors of all pixels.
    pub(in crate::render) fn certified(self) -> Self {
        Self {
            certifier: Some(Certifier {
                blend: seen_with_errors,
                errors: iso_errors,
                bytes: second_bytes::<IsoCertificate<'_>>,
            }),
            ..self
        }
    }
}

/// Planes in the volume, and their colours.
#[derive(Clone, Copy)]
struct ColouredPlanes<'a> {
    planes: &'a [Plane],
    colours: &'a TransferFunction,
}

/// A batch of frames after all slices, and the values of the planes behind them.
struct Drawn<B: Blend> {
    swept: Swept<B>,
    planes: Option<Vec<f32>>,
    /// The bounds of the errors of each frame's pixels, if pictures are certified.
    errors: Option<FrameErrors>,
}

impl<'a, B: Blend> Sliced<'a, B> {
    pub(in crate::render) fn new(
        grid: &Grid,
        config: &RenderConfig,
        blend: impl Fn(&SlicedView) -> B + 'a,
    ) -> Result<Self> {
        let views = config.views.iter().map(|view| SlicedView::new(grid, config, view));
        Ok(Self { views: views.collect::<Result<_>>()?, blend: Box::new(blend), planes: None, certifier: None })
    }

    /// The same with opaque planes in the volume, if there are any.
    pub(in crate::render) fn with_planes(self, planes: &'a [Plane], colours: &'a TransferFunction) -> Self {
        Self { planes: (!planes.is_empty()).then_some(ColouredPlanes { planes, colours }), ..self }
    }

    /// Bytes to render `frames` frames together, without blocks.
    fn bytes(&self, config: &RenderConfig, view: &SlicedView, blocks: BlockGrid, frames: usize) -> usize {
        let planes = if self.planes.is_some() { Behind::bytes(view, frames) } else { 0 };
        let shaded = config.mode.is_shaded();
        let errors = self.certifier.as_ref().map_or(0, |certifier| (certifier.bytes)(view, frames, blocks, shaded));
        bytes::<B>(view, frames, blocks, shaded) + planes + errors
    }

    fn render_view(
        &self,
        scene: &mut dyn Scene,
        config: &RenderConfig,
        number: usize,
        output: &mut Output<'_, '_>,
    ) -> Result<()> {
        let (view, blocks, Output { sink, report, progress }) = (&self.views[number], scene.blocks(), output);
        let blend = (self.blend)(view);
        report.views[number].table_error = blend.table_error();
        let behind = self.planes.map(|planes| Behind::new(scene.grid(), config, number, view, planes)).transpose()?;
        let render = |reader: &SampleReader<'_>, report: &mut RenderReport| {
            let of_batch = |certifier: &Certifier<B>| (certifier.blend)((self.blend)(view), view, reader);
            let certified = self.certifier.as_ref().map(of_batch);
            let blend = certified.as_ref().unwrap_or(&blend);
            let stops = behind.as_ref().map(|behind| &behind.stops);
            let pass = SlicePass { number, view, blend, stops, reader };
            let swept = pass.sweep(report)?;
            let errors = self.certifier.as_ref().map(|certifier| (certifier.errors)(&pass, &swept, report));
            let planes = behind
                .as_ref()
                .map(|behind| PlanesPass { panels: std::slice::from_ref(&behind.planes), reader }.pictures(report));
            Ok(Drawn { swept, planes: planes.transpose()?, errors: errors.transpose()? })
        };
        let give = |frames: &[usize], Drawn { swept, planes, errors }: Drawn<B>, report: &mut RenderReport| {
            errors.iter().for_each(|errors| report.count_certified(errors.iter().flatten()));
            swept.pictures(view, number, report, |n, picture| {
                if let (Some(behind), Some(planes)) = (&behind, &planes) {
                    let each = planes.len() / frames.len();
                    behind.put(picture, &planes[n * each..][..each]);
                }
                progress.check()?;
                sink(Rendered {
                    views: &[],
                    view: number,
                    frame: frames[n],
                    picture,
                    error: errors.as_ref().map(|errors| errors[n].as_slice()),
                })
            })
        };
        let sampled = SampledView { config, frame_bytes: &|frames| self.bytes(config, view, blocks, frames) };
        sampled.render(scene, *progress, report, render, give)
    }
}

impl<B: Blend> Renderer for Sliced<'_, B> {
    fn least_memory(&self, scene: &dyn Scene, config: &RenderConfig) -> usize {
        let blocks = scene.blocks();
        let least = |view: &SlicedView| {
            let frame_bytes = |frames: usize| self.bytes(config, view, blocks, frames);
            SampledView { config, frame_bytes: &frame_bytes }.least_memory(scene)
        };
        self.views.iter().map(least).max().unwrap_or(0)
    }

    fn reports(&self, config: &RenderConfig) -> Vec<ViewReport> {
        let none = f64::NAN;
        let report = |(view, sliced): (_, &SlicedView)| ViewReport {
            method: "slices",
            slices: Some(sliced.slices()),
            cells: Some(sliced.cells),
            stated_splat_error: none,
            expected_error: none,
            ..ViewReport::new(view, &sliced.camera)
        };
        config.views.iter().zip(&self.views).map(report).collect()
    }

    fn steps(&self) -> usize {
        let sweeps = if self.certifier.is_some() { 2 } else { 1 };
        self.views.iter().map(|view| sweeps * view.slices()).sum()
    }

    fn render(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut Output<'_, '_>) -> Result<()> {
        task.views.clone().try_for_each(|number| self.render_view(scene, &task.config, number, output))
    }
}

/// Opaque planes behind the light in front of them.
struct Behind<'a> {
    planes: PlanesView,
    colours: &'a TransferFunction,
    stops: Stops,
}

impl<'a> Behind<'a> {
    fn new(
        grid: &Grid,
        config: &RenderConfig,
        number: usize,
        view: &SlicedView,
        coloured: ColouredPlanes<'a>,
    ) -> Result<Self> {
        let planes = PlanesView::new(grid, config.clip(grid)?, coloured.planes, &config.views[number])?;
        let stops = Stops::new(view, |pixel| planes.nearest(pixel).map(|hit| view.along(hit.place)));
        Ok(Self { planes, colours: coloured.colours, stops })
    }

    /// Bytes for `frames` frames.
    fn bytes(view: &SlicedView, frames: usize) -> usize {
        Stops::bytes(view) + frames * view.camera.size.iter().product::<usize>() * (size_of::<f64>() + size_of::<f32>())
    }

    /// Puts the colours of the planes' values behind the light of pixels. NaN has none.
    fn put(&self, light: &mut [f32], values: &[f32]) {
        for (pixel, value) in light.chunks_exact_mut(Pixel::Light.numbers()).zip(values) {
            let Some(colour) = self.colours.colour(f64::from(*value)).filter(|_| !value.is_nan()) else { continue };
            let through = 1.0 - pixel[3];
            pixel.iter_mut().zip(colour).for_each(|(light, c)| *light += through * c as f32);
            pixel[3] = 1.0;
        }
    }
}
