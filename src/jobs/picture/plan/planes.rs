//! Slices: planes through the volume.

use super::views::face_on;
use crate::axes::Axes;
use crate::picture::request::PictureRequest;
use crate::picture::values::SliceSpec;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_engine::render::{Mode, Plane, RenderConfig};

const FIELD: &str = "slice";

/// The planes of a mode.
pub(in crate::picture) fn planes_of(mode: &Mode) -> Vec<Plane> {
    match mode {
        Mode::Composite { planes, .. } | Mode::Planes { planes, .. } => planes.clone(),
        Mode::Projection | Mode::Iso { .. } | Mode::Mip { .. } => Vec::new(),
    }
}

/// A mode with other planes, if it takes some.
pub(in crate::picture) fn with_planes(mode: Mode, planes: Vec<Plane>) -> Mode {
    match mode {
        Mode::Composite { transfer, unit, slices, light, .. } => {
            Mode::Composite { transfer, unit, slices, light, planes }
        }
        Mode::Planes { panels, .. } => Mode::Planes { planes, panels },
        other => other,
    }
}

/// The number of the axis, and the position in voxels, of each slice.
fn positions(request: &PictureRequest, axes: &Axes) -> Result<Vec<(usize, f64)>> {
    let position = |slice: &SliceSpec| {
        let axis = axes.find(FIELD, &slice.axis)?;
        Ok((axis, axes.voxel(FIELD, axis, &slice.position)?))
    };
    request.slice.iter().map(position).collect()
}

/// Sets the planes of a mode of slices, and the view of a single one. `lod` is the level of detail of `grid`.
pub(in crate::picture) fn set_planes(
    config: &mut RenderConfig,
    request: &PictureRequest,
    axes: &Axes,
    grid: &Grid,
    whole: &Grid,
    lod: u32,
) -> Result<()> {
    if request.slice.is_empty() {
        return Ok(());
    }
    if let Some(view) = face_on(request, axes, whole)? {
        config.views = vec![view];
    }
    let region = config.region.unwrap_or(grid.whole());
    let plane = |(axis, at): (usize, f64)| {
        let at = at / f64::from(1_u32 << lod);
        Plane { axis, at: at.min((grid.dims[axis] - 1) as f64) }
    };
    let planes: Vec<Plane> = positions(request, axes)?.into_iter().map(plane).collect();
    if let Some(outside) = planes.iter().find(|plane| !plane.is_within(&region)) {
        let at = axes.text(outside.axis, outside.at * f64::from(1_u32 << lod));
        return Err(Error::setting(FIELD, format!("{at} is outside of `region`")));
    }
    config.mode = with_planes(config.mode.clone(), planes);
    if let Mode::Planes { planes, panels } = &mut config.mode {
        *panels = super::panels::panels(request, axes, whole, planes)?;
    }
    Ok(())
}

/// The true positions of all slices, as the option takes them.
pub(in crate::picture) fn slice_texts(request: &PictureRequest, axes: &Axes) -> Result<Option<String>> {
    let texts: Vec<String> = positions(request, axes)?.into_iter().map(|(axis, at)| axes.text(axis, at)).collect();
    Ok(Some(texts.join(",")).filter(|texts| !texts.is_empty()))
}
