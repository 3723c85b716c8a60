//! The settings of a rendering, from a request and an open scene.

use super::camera_path::{frames_of_views, is_moving};
use super::modes;
use super::views::{fixed, views};
use crate::axes::Axes;
use crate::picture::request::PictureRequest;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::codec::bound::range_bound;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::view::footprint::Kernel;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::promise::{range_of_shares, share_tolerance};
use wavesplat_engine::render::{Limit, Mode, RenderConfig, Scene, SplatSource, default_splat_error};
use wavesplat_format::Metadata;

/// The settings of pictures of some of `all` frames, which may be more than the scene has. `memory` is in bytes.
pub(in crate::picture) fn render_config(
    request: &PictureRequest,
    scene: &dyn Scene,
    file: Option<&CoefficientFile>,
    axes: &Axes,
    colours: Option<&TransferFunction>,
    all: usize,
    memory: usize,
) -> Result<RenderConfig> {
    let grid = scene.grid();
    let (whole, lod) = file.map_or((*grid, 0), |file| (file.whole_grid(), file.lod()));
    let file = file.map(CoefficientFile::metadata);
    let allowed = request.tolerance.map(|tolerance| allowed_error(request, tolerance, file)).transpose()?;
    let tolerance = request.tolerance.or(file.map(share_tolerance));
    let frames = frames_of(request, all)?;
    let views = views(request, &whole, &frames)?;
    Ok(RenderConfig {
        frames: frames_of_views(request, frames, views.len())?,
        paired: is_moving(request),
        views: if lod == 0 { views } else { fixed(&views, &whole)? },
        kernel: Kernel::new(request.sigma, request.tau, grid)?,
        quantity: request.quantity,
        region: region_of(request, axes, lod)?,
        splat_error: request.splat_error.unwrap_or(default_splat_error(tolerance)),
        fast: request.fast,
        allowed,
        error: request.error,
        certify: request.certify || request.error_image.is_some(),
        mode: with_unit_of(&whole, modes::mode(request, colours)?),
        memory,
    })
}

/// The frames to render, of `all`.
pub(in crate::picture) fn frames_of(request: &PictureRequest, all: usize) -> Result<Vec<usize>> {
    request.frames.as_ref().map_or(Ok((0..all).collect()), |frames| frames.resolve(all))
}

/// The mode with opacities that apply over the largest spacing of `whole`, the lattice of all voxels, whatever the
/// level of detail.
fn with_unit_of(whole: &Grid, mode: Mode) -> Mode {
    match mode {
        Mode::Composite { transfer, unit: None, slices, light, planes } => {
            Mode::Composite { transfer, unit: Some(whole.largest_spacing()), slices, light, planes }
        }
        other => other,
    }
}

/// The voxels to render, on the lattice of a level of detail.
fn region_of(request: &PictureRequest, axes: &Axes, lod: u32) -> Result<Option<Region>> {
    let Some(region) = request.region.as_ref().map(|region| axes.region("region", region)).transpose()? else {
        return Ok(None);
    };
    let region = region.every(1 << lod);
    if region.is_empty() {
        return Err(Error::setting("region", format!("holds no voxel with `lod` {lod}")));
    }
    Ok(Some(region))
}

/// The sample error that `tolerance` allows, in the unit of the samples.
fn allowed_error(request: &PictureRequest, tolerance: f64, file: Option<&Metadata>) -> Result<f64> {
    let Some(file) = file.filter(|_| request.method == SplatSource::Coefficients) else {
        return Err(Error::setting("tolerance", "leaves out coefficients, so it needs `method` coefficients"));
    };
    if !(0.0..=1.0).contains(&tolerance) {
        return Err(Error::setting("tolerance", "a share of the value range, 0 to 1, like 0.02 or 2%"));
    }
    let range = range_of_shares(file);
    let allowed = range_bound(tolerance, range);
    let reached = file.windows.iter().map(|w| w.reached).fold(0.0, f64::max);
    if allowed < reached && request.error == Limit::Certified {
        let least = reached / (range.1 - range.0);
        let what = "the samples of the file are up to";
        return Err(Error::value(
            "tolerance",
            format!("{tolerance:e}"),
            format!("{what} {least:.3e} of its range off"),
        ));
    }
    Ok(allowed)
}
