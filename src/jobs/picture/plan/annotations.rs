//! Annotations around the volume.

use super::format::is_page;
use crate::axes::Axes;
use crate::picture::reporter::Reporter;
use crate::picture::request::PictureRequest;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_core::view::camera::View;
use wavesplat_core::view::footprint::Kernel;
use wavesplat_engine::render::annotate::{Annotation, AxisLabels, Margins, Panel, Parts, VolumeAxes, margins};
use wavesplat_engine::render::{Mode, Plane, RenderConfig, Surface};

/// The parts that are drawn into pictures. A web page itself has a title, a colour bar and the time.
fn drawn_parts(request: &PictureRequest) -> Parts {
    let parts = request.annotate.unwrap_or(Parts::NONE);
    if is_page(request) { Parts { bar: false, time: false, ..parts } } else { parts }
}

/// The margins of the pictures.
pub(in crate::picture) fn picture_margins(request: &PictureRequest) -> Margins {
    let has_title = request.title.is_some() && !is_page(request);
    margins(request.size.0, drawn_parts(request), has_title)
}

/// The annotations of pictures of these values and times, but for the axes.
pub(in crate::picture) fn annotation(request: &PictureRequest, values: String, times: TimeLabels) -> Annotation {
    Annotation {
        parts: drawn_parts(request),
        title: request.title.clone().unwrap_or_default(),
        values: request.bar_title.clone().unwrap_or(values),
        times,
        axes: None,
        surfaces: Vec::new(),
        panels: Vec::new(),
    }
}

/// The isosurfaces of a mode, which pictures list.
pub(in crate::picture) fn surfaces_of(mode: &Mode) -> Vec<Surface> {
    match mode {
        Mode::Iso { surfaces, .. } => surfaces.clone(),
        _ => Vec::new(),
    }
}

/// The slices that share each picture of a mode. Planes are in voxels of a level of detail.
pub(in crate::picture) fn panels_of(mode: &Mode, lod: u32) -> Vec<Panel> {
    let Mode::Planes { planes, panels } = mode else { return Vec::new() };
    let panel = |(plane, view): (&Plane, &View)| Panel {
        view: *view,
        axis: plane.axis,
        at: plane.at * f64::from(1_u32 << lod),
    };
    planes.iter().zip(panels).map(panel).collect()
}

/// Says how much of a long title pictures show.
pub(in crate::picture) fn note_title(
    request: &PictureRequest,
    annotation: &Annotation,
    config: &RenderConfig,
    reporter: &dyn Reporter,
) {
    let frame = config.frames.first().copied().unwrap_or(0);
    if let Some(shown) = annotation.cut_title(request.size.0, frame).filter(|_| !is_page(request)) {
        reporter.note(format_args!("`title`: the picture is too narrow for all of it; it shows '{shown}'"));
    }
}

/// The axes of the volume as it is drawn, with their true coordinates.
pub(in crate::picture) fn volume_axes(
    request: &PictureRequest,
    axes: &Axes,
    whole: &Grid,
    config: &RenderConfig,
    exaggeration: f64,
) -> Result<VolumeAxes> {
    let region = request.region.as_ref().map_or(Ok(whole.whole()), |region| axes.region("region", region))?;
    Ok(axes_of_region(axes.labels(), whole, region, config, exaggeration))
}

/// The axes of the voxels that are drawn.
pub(in crate::picture) fn axes_of_region(
    labels: [AxisLabels; 3],
    whole: &Grid,
    region: Region,
    config: &RenderConfig,
    exaggeration: f64,
) -> VolumeAxes {
    let has_kernel = !matches!(config.mode, Mode::Planes { .. } | Mode::Iso { .. } | Mode::Mip { .. });
    let rim = if has_kernel { rim(&config.kernel, whole) } else { 0.0 };
    let compares = labels[..2].iter().any(|across| across.compares_with(&labels[2]));
    VolumeAxes { grid: *whole, region, rim, exaggeration: if compares { exaggeration } else { 1.0 }, labels }
}

/// How far beyond the box of a grid its kernels are seen, in world units.
pub(in crate::picture) fn rim(kernel: &Kernel, grid: &Grid) -> f64 {
    (SEEN * kernel.sigma - grid.largest_spacing() / 2.0).max(0.0)
}

/// Says if a scale that is asked for cannot be drawn.
pub(in crate::picture) fn note_scale(annotation: &Annotation, reporter: &dyn Reporter) {
    let lacks_unit = annotation.axes.as_ref().is_some_and(|volume| volume.length_unit().is_none());
    if annotation.parts.scale && lacks_unit {
        reporter.note(format_args!("no scale is drawn, since lengths differ from axis to axis"));
    }
}

/// Standard deviations of the kernel up to which the outermost voxels are seen.
const SEEN: f64 = 2.4;
