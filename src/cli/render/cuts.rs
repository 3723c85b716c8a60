//! Slices: planes through the volume.

use super::along::ModeName;
use super::annotations::AnnotationArgs;
use super::args::Cli;
use super::places::{Axes, Place};
use crate::base::error::{Error, Result};
use crate::base::grid::Grid;
use crate::render::annotate::Margins;
use crate::render::{Mode, Plane, RenderConfig};
use crate::view::camera::View;
use clap::Args;
use std::str::FromStr;

/// Options for slices.
#[derive(Debug, Args)]
pub(crate) struct CutArgs {
    /// Show the samples on a plane across an axis, alone or within --mode composite. For more planes, repeat the option
    /// or separate them with commas. AXIS is x, y, z or the data's own name, like lat. PLACE is a share like 0.3 (with
    /// a point, 0.0 to 1.0) or 30%, a voxel like #12, or else a coordinate like 45, -500 or 120m; @0.3 is always a
    /// coordinate. A single slice is seen face-on unless --view is given
    #[arg(
        long = "slice",
        value_name = "AXIS=PLACE",
        value_delimiter = ',',
        allow_hyphen_values = true,
        conflicts_with_all = ["sigma", "splat_error"],
        help_heading = "View"
    )]
    pub(crate) planes: Vec<SliceSpec>,
}

/// The planes of a mode.
pub(crate) fn planes_of(mode: &Mode) -> Vec<Plane> {
    match mode {
        Mode::Composite { planes, .. } | Mode::Planes { planes } => planes.clone(),
        Mode::Projection | Mode::Iso { .. } | Mode::Mip { .. } => Vec::new(),
    }
}

/// A mode with other planes, if it takes some.
pub(crate) fn with_planes(mode: Mode, planes: Vec<Plane>) -> Mode {
    match mode {
        Mode::Composite { transfer, unit, slices, light, .. } => {
            Mode::Composite { transfer, unit, slices, light, planes }
        }
        Mode::Planes { .. } => Mode::Planes { planes },
        other => other,
    }
}

/// A plane across an axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SliceSpec {
    axis: String,
    place: Place,
}

impl FromStr for SliceSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (axis, place) = text.split_once('=').ok_or("takes AXIS=PLACE, like x=0.5, z=#12 or lat=45")?;
        Ok(Self { axis: axis.into(), place: place.parse()? })
    }
}

const OPTION: &str = "--slice";

impl Cli {
    /// Takes the mode of slices if there are some.
    pub(crate) fn imply_mode(&mut self) -> Result<()> {
        match (self.cuts.planes.is_empty(), self.along.given_mode()) {
            (true, Some(ModeName::Slice)) => Err(Error::usage("--mode slice: needs --slice, like --slice z=0.5")),
            (true, _) => Ok(()),
            (false, None | Some(ModeName::Slice)) => {
                self.along.take_mode(ModeName::Slice);
                Ok(())
            }
            (false, Some(ModeName::Composite)) => Ok(()),
            (false, Some(mode)) => {
                Err(Error::usage(format!("{OPTION}: needs --mode slice or composite, not {}", mode.name())))
            }
        }
    }

    /// The axis and the place in voxels of each slice.
    fn places(&self, axes: &Axes) -> Result<Vec<(usize, f64)>> {
        let place = |slice: &SliceSpec| {
            let axis = axes.find(OPTION, &slice.axis)?;
            Ok((axis, axes.voxel(OPTION, axis, &slice.place)?))
        };
        self.cuts.planes.iter().map(place).collect()
    }

    /// Sets the planes of a mode of slices, and the view of a single one. `lod` is the level of detail of `grid`.
    pub(crate) fn set_planes(
        &self,
        config: &mut RenderConfig,
        axes: &Axes,
        (grid, whole, lod): (&Grid, &Grid, u32),
    ) -> Result<()> {
        if self.cuts.planes.is_empty() {
            return Ok(());
        }
        if let Some(axis) = self.face(axes)? {
            config.views = vec![self.face_on(axis, whole)?];
        }
        let region = config.region.unwrap_or(grid.whole());
        let plane = |(axis, at): (usize, f64)| {
            let at = at / f64::from(1_u32 << lod);
            Plane { axis, at: at.min((grid.dims[axis] - 1) as f64) }
        };
        let planes: Vec<Plane> = self.places(axes)?.into_iter().map(plane).collect();
        if let Some(outside) = planes.iter().find(|plane| !plane.is_within(&region)) {
            let at = axes.text(outside.axis, outside.at * f64::from(1_u32 << lod));
            return Err(Error::usage(format!("{OPTION}: {at} is outside of --region")));
        }
        config.mode = with_planes(config.mode.clone(), planes);
        Ok(())
    }

    /// The true places of all slices, as the option takes them.
    pub(crate) fn slice_texts(&self, axes: &Axes) -> Result<Option<String>> {
        let texts: Vec<String> = self.places(axes)?.into_iter().map(|(axis, at)| axes.text(axis, at)).collect();
        Ok(Some(texts.join(",")).filter(|texts| !texts.is_empty()))
    }

    /// The axis of the only slice, if it is to be seen face-on.
    pub(crate) fn face(&self, axes: &Axes) -> Result<Option<usize>> {
        match self.cuts.planes.as_slice() {
            [only] if self.has_no_view() && self.along.mode_name() == ModeName::Slice => {
                axes.find(OPTION, &only.axis).map(Some)
            }
            _ => Ok(None),
        }
    }

    fn has_no_view(&self) -> bool {
        self.views.is_empty() && self.orbit == 1 && !self.is_moving()
    }

    /// A plane across an axis, face-on: x to the right if possible, else y; z up if possible, else y. It fills the
    /// picture, beside the annotation.
    pub(crate) fn face_on(&self, axis: usize, grid: &Grid) -> Result<View> {
        let (azimuth, elevation) = [(270.0, 0.0), (180.0, 0.0), (180.0, 90.0)][axis];
        let (size, center) = (self.size.0, self.center.map(|c| c.0));
        let view = View { azimuth, elevation, roll: self.roll, size, scale: self.scale, center };
        if self.scale.is_some() || center.is_some() || self.roll != 0.0 {
            return Ok(view);
        }
        let around @ Margins { left, right, top, bottom } = self.margins(size);
        let [across, up] = [[1, 2], [0, 2], [0, 1]][axis];
        let fit = |pixels: usize, along: usize| pixels as f64 / (grid.dims[along] as f64 * grid.spacing[along]);
        let scale = fit(size[0] - left - right, across).min(fit(size[1] - top - bottom, up));
        let views = AnnotationArgs::beside((vec![View { scale: Some(scale), ..view }], &[1.0]), grid, around)?;
        Ok(views.into_iter().next().unwrap_or(view))
    }
}
