//! The views of a run.

use super::annotations::picture_margins;
use super::camera_path::{Stand, is_moving, stands};
use super::modes::mode_name;
use crate::axes::Axes;
use crate::picture::request::PictureRequest;
use crate::picture::values::{Convention, ModeName};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_engine::render::annotate::Margins;

/// Azimuth and elevation of the view if none is given.
const USUAL: [f64; 2] = [30.0, 30.0];

/// All views, including those of orbits and of key frames, which have one for each of the frames.
pub(in crate::picture) fn views(request: &PictureRequest, grid: &Grid, frames: &[usize]) -> Result<Vec<View>> {
    if let Some(path) = &request.key_frames {
        return in_one_scale(request, &stands(path, frames)?, grid);
    }
    let given: Vec<[f64; 2]> = request.view.iter().map(|view| view.0).collect();
    let first = if given.is_empty() { vec![USUAL] } else { given };
    let orbits = first.into_iter().map(|first| in_one_scale(request, &orbit(first, request.orbit), grid));
    Ok(orbits.collect::<Result<Vec<_>>>()?.concat())
}

/// Where the camera stands in an orbit of `count` views.
fn orbit([azimuth, elevation]: [f64; 2], count: u32) -> Vec<Stand> {
    let turned = |n| (azimuth + f64::from(n) * 360.0 / f64::from(count)).rem_euclid(360.0);
    let turned = |n| if count == 1 { azimuth } else { turned(n) };
    (0..count).map(|n| Stand { azimuth: turned(n), elevation, zoom: 1.0 }).collect()
}

/// Views with a common scale. Unless a scale or a centre is given, the volume fits beside the annotations.
fn in_one_scale(request: &PictureRequest, stands: &[Stand], grid: &Grid) -> Result<Vec<View>> {
    let view = |stand: &Stand| view_from(request, stand.azimuth, stand.elevation);
    let fits = request.scale.is_none() && request.center.is_none();
    let around = if fits { picture_margins(request) } else { Margins::default() };
    if let [only @ Stand { zoom: 1.0, .. }] = stands
        && around == Margins::default()
    {
        return Ok(vec![view(only)]);
    }
    let zooms: Vec<f64> = stands.iter().map(|stand| stand.zoom).collect();
    beside(stands.iter().map(view).collect(), &zooms, grid, around)
}

fn view_from(request: &PictureRequest, azimuth: f64, elevation: f64) -> View {
    let (size, center) = (request.size.0, request.center.map(|c| c.0));
    View { azimuth, elevation, roll: request.roll, size, scale: request.scale, center }
}

/// Views in one scale, in which the volume fits beside the margins, but for the zoom of each.
fn beside(views: Vec<View>, zooms: &[f64], grid: &Grid, around: Margins) -> Result<Vec<View>> {
    let Margins { left, right, top, bottom } = around;
    let camera = |view: &View| {
        let size = [view.size[0] - left - right, view.size[1] - top - bottom];
        Camera::new(&View { size, ..*view }, grid)
    };
    let cameras = views.iter().map(camera).collect::<Result<Vec<_>>>()?;
    let scale = cameras.iter().map(|camera| camera.scale).fold(f64::INFINITY, f64::min);
    let moved = |((view, camera), zoom): ((View, &Camera), &f64)| {
        let scale = scale * zoom;
        let [across, up] = [[right, left], [top, bottom]].map(|[a, b]| (a as f64 - b as f64) / 2.0 / scale);
        View { scale: Some(scale), center: Some(camera.moved(across, up)), ..view }
    };
    Ok(views.into_iter().zip(&cameras).zip(zooms).map(moved).collect())
}

/// The views with the scale and the centre that they have for a grid.
pub(in crate::picture) fn fixed(views: &[View], grid: &Grid) -> Result<Vec<View>> {
    let fixed = |view: &View| {
        let camera = Camera::new(view, grid)?;
        Ok(View { scale: Some(camera.scale), center: Some(camera.beside(0.0)), ..*view })
    };
    views.iter().map(fixed).collect()
}

/// The view of the only slice, if it is to be seen face-on.
pub(in crate::picture) fn face_on(request: &PictureRequest, axes: &Axes, grid: &Grid) -> Result<Option<View>> {
    match request.slice.as_slice() {
        [only] if !has_own_view(request) => filling(request, axes, axes.find("slice", &only.axis)?, grid).map(Some),
        _ => Ok(None),
    }
}

/// Whether the view of slices is given, or they are drawn within something.
fn has_own_view(request: &PictureRequest) -> bool {
    let is_usual = request.view.is_empty() && request.orbit == 1 && !is_moving(request);
    !is_usual || mode_name(request) != ModeName::Slice
}

/// Whether a part of the view is given, so that slices do not fill the picture.
pub(in crate::picture) fn is_placed(request: &PictureRequest) -> bool {
    request.scale.is_some() || request.center.is_some() || request.roll != 0.0
}

/// Whether slices stand side by side: three across all axes, without a view of their own.
pub(in crate::picture) fn are_panels(request: &PictureRequest, axes: &Axes) -> Result<bool> {
    let cuts = request.slice.iter().map(|slice| axes.find("slice", &slice.axis)).collect::<Result<Vec<usize>>>()?;
    let are_orthogonal = cuts.len() == 3 && (0..3).all(|axis| cuts.contains(&axis));
    Ok(are_orthogonal && !has_own_view(request) && !is_placed(request))
}

/// The axes to the right and up in a slice across an axis: x to the right if possible, else y; z up if possible, else y.
pub(in crate::picture) fn across_and_up(cut: usize) -> [usize; 2] {
    [[1, 2], [0, 2], [0, 1]][cut]
}

/// The view that sees a slice across an axis face-on. A patient's anterior and superior sides are at the right or top, and the side that the
/// convention asks for is at the right.
pub(in crate::picture) fn view_across(request: &PictureRequest, axes: &Axes, cut: usize) -> View {
    let right = match request.convention {
        Convention::Neurological => 'R',
        Convention::Radiological => 'L',
    };
    let is_turned = |axis: usize| axes.sides(axis).is_some_and(|[first, _]| [right, 'A', 'S'].contains(&first));
    let [turns_across, turns_up] = across_and_up(cut).map(is_turned);
    let [azimuth, elevation] = [[270.0, 0.0], [180.0, 0.0], [180.0, 90.0]][cut];
    // Seen from behind, a slice is turned upside down or left to right.
    let is_behind = turns_across != turns_up;
    let (azimuth, elevation, is_upside_down) = match (cut, is_behind) {
        (2, true) => (azimuth, -elevation, turns_across),
        (_, true) => ((azimuth + 180.0) % 360.0, elevation, turns_up),
        (_, false) => (azimuth, elevation, turns_up),
    };
    let roll = if is_upside_down { 180.0 } else { 0.0 };
    let view = view_from(request, azimuth, elevation);
    View { roll: view.roll + roll, ..view }
}

/// A slice across an axis, face-on. It fills the picture, beside the annotation.
fn filling(request: &PictureRequest, axes: &Axes, cut: usize, grid: &Grid) -> Result<View> {
    let (size, view) = (request.size.0, view_across(request, axes, cut));
    if is_placed(request) {
        return Ok(view);
    }
    let around @ Margins { left, right, top, bottom } = picture_margins(request);
    let [across, up] = across_and_up(cut);
    let fit = |pixels: usize, along: usize| pixels as f64 / (grid.dims[along] as f64 * grid.spacing[along]);
    let scale = fit(size[0] - left - right, across).min(fit(size[1] - top - bottom, up));
    let views = beside(vec![View { scale: Some(scale), ..view }], &[1.0], grid, around)?;
    Ok(views.into_iter().next().unwrap_or(view))
}
