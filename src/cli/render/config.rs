//! The settings of a run.

use super::args::{Cli, ErrorName, MethodName, QuantityName};
use crate::base::error::{Error, Result};
use crate::base::grid::{Grid, Region};
use crate::colour::TransferFunction;
use crate::convert::range_bound;
use crate::file::CoefficientFile;
use crate::file::promise::{range_of_shares, share_tolerance};
use crate::render::{Mode, Quantity, RenderConfig, Scene, default_splat_error};
use crate::view::camera::{Camera, View};
use crate::view::footprint::Kernel;
use wavesplat_format::Metadata;

/// The views with the scale and the centre that they have for a grid.
fn fixed(views: &[View], grid: &Grid) -> Result<Vec<View>> {
    let fixed = |view: &View| {
        let camera = Camera::new(view, grid)?;
        Ok(View { scale: Some(camera.scale), center: Some(camera.beside(0.0)), ..*view })
    };
    views.iter().map(fixed).collect()
}

/// The mode with opacities that apply over the largest spacing of `whole`, the lattice of all voxels, whatever the
/// level of detail.
fn of_whole(mode: Mode, whole: &Grid) -> Mode {
    match mode {
        Mode::Composite { transfer, unit: None, slices, light, planes } => {
            Mode::Composite { transfer, unit: Some(whole.largest_spacing()), slices, light, planes }
        }
        other => other,
    }
}

impl Cli {
    pub(crate) fn config(
        &self,
        scene: &dyn Scene,
        file: Option<&CoefficientFile>,
        colours: Option<&TransferFunction>,
    ) -> Result<RenderConfig> {
        self.config_of(scene, file, colours, scene.frames().unwrap_or(0))
    }

    /// The settings of pictures of some of `all` frames, which may be more than the scene has.
    pub(crate) fn config_of(
        &self,
        scene: &dyn Scene,
        file: Option<&CoefficientFile>,
        colours: Option<&TransferFunction>,
        all: usize,
    ) -> Result<RenderConfig> {
        let grid = scene.grid();
        let (whole, lod) = file.map_or((*grid, 0), |file| (file.whole_grid(), file.lod()));
        let file = file.map(CoefficientFile::metadata);
        let allowed = self.tolerance.map(|t| self.allowed(t, file)).transpose()?;
        let tolerance = self.tolerance.or(file.map(share_tolerance));
        let splat_error = self.splat_error.unwrap_or(default_splat_error(tolerance));
        let frames = self.frames_of(all)?;
        let views = self.views(&whole, &frames)?;
        Ok(RenderConfig {
            frames: self.frames_of_views(frames, views.len())?,
            paired: self.is_moving(),
            views: if lod == 0 { views } else { fixed(&views, &whole)? },
            kernel: Kernel::new(self.sigma, self.tau, grid)?,
            quantity: match self.quantity {
                QuantityName::Mean => Quantity::Mean,
                QuantityName::Emission => Quantity::Emission,
            },
            region: self.region_of(&whole, lod)?,
            splat_error,
            quick: self.fast,
            allowed,
            limited: self.error.into(),
            certify: self.error_image.is_some(),
            mode: of_whole(self.along.mode(colours)?, &whole),
            memory: self.common.memory.0,
        })
    }

    /// The frames to render, of `all`.
    pub(crate) fn frames_of(&self, all: usize) -> Result<Vec<usize>> {
        self.frames.as_ref().map_or(Ok((0..all).collect()), |frames| frames.resolve(all))
    }

    /// The voxels to render, on the lattice of a level of detail.
    fn region_of(&self, whole: &Grid, lod: u32) -> Result<Option<Region>> {
        let Some(region) = self.region.map(|r| r.resolve(whole)).transpose()? else { return Ok(None) };
        let region = region.every(1 << lod);
        if region.is_empty() {
            return Err(Error::usage(format!("--region: holds no voxel with --lod {lod}")));
        }
        Ok(Some(region))
    }

    /// The sample error that `--tolerance` allows, in the unit of the samples.
    fn allowed(&self, tolerance: f64, file: Option<&Metadata>) -> Result<f64> {
        let Some(file) = file.filter(|_| self.method == MethodName::Coefficients) else {
            return Err(Error::usage("--tolerance: leaves out coefficients, so it needs --method coefficients"));
        };
        if !(0.0..=1.0).contains(&tolerance) {
            return Err(Error::usage("--tolerance: a share of the value range, 0 to 1; 2 % is 0.02"));
        }
        let range = range_of_shares(file);
        let allowed = range_bound(tolerance, range);
        let reached = file.windows.iter().map(|w| w.reached).fold(0.0, f64::max);
        if allowed < reached && self.error == ErrorName::Certified {
            let least = reached / (range.1 - range.0);
            let what = "the samples of the file are up to";
            return Err(Error::usage(format!("--tolerance {tolerance:e}: {what} {least:.3e} of its range off")));
        }
        Ok(allowed)
    }
}
