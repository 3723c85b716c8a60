//! The views of a run.

use super::annotations::AnnotationArgs;
use super::args::Cli;
use super::motion::{Stand, stands};
use crate::base::error::Result;
use crate::base::grid::Grid;
use crate::render::annotate::Margins;
use crate::view::camera::View;

/// Azimuth and elevation of the view if none is given.
const USUAL: [f64; 2] = [30.0, 30.0];

impl Cli {
    /// All views, including those of orbits and of key frames, which have one for each of the frames.
    pub(crate) fn views(&self, grid: &Grid, frames: &[usize]) -> Result<Vec<View>> {
        if let Some(path) = &self.motion.key_frames {
            return self.in_one_scale(&stands(path, frames)?, grid);
        }
        let given: Vec<[f64; 2]> = self.views.iter().map(|view| view.0).collect();
        let first = if given.is_empty() { vec![USUAL] } else { given };
        let orbits = first.into_iter().map(|first| self.in_one_scale(&self.orbit(first), grid));
        Ok(orbits.collect::<Result<Vec<_>>>()?.concat())
    }

    /// Where the camera stands in an orbit.
    fn orbit(&self, [azimuth, elevation]: [f64; 2]) -> Vec<Stand> {
        let turned = |n| (azimuth + f64::from(n) * 360.0 / f64::from(self.orbit)).rem_euclid(360.0);
        let turned = |n| if self.orbit == 1 { azimuth } else { turned(n) };
        (0..self.orbit).map(|n| Stand { azimuth: turned(n), elevation, zoom: 1.0 }).collect()
    }

    /// Views with a common scale. Unless a scale or a centre is given, the volume fits beside the annotations.
    fn in_one_scale(&self, stands: &[Stand], grid: &Grid) -> Result<Vec<View>> {
        let (roll, size, center) = (self.roll, self.size.0, self.center.map(|c| c.0));
        let view =
            |&Stand { azimuth, elevation, .. }| View { azimuth, elevation, roll, size, scale: self.scale, center };
        let fits = self.scale.is_none() && center.is_none();
        let around = if fits { self.margins(size) } else { Margins::default() };
        if let [only @ Stand { zoom: 1.0, .. }] = stands
            && around == Margins::default()
        {
            return Ok(vec![view(only)]);
        }
        let zooms: Vec<f64> = stands.iter().map(|stand| stand.zoom).collect();
        AnnotationArgs::beside((stands.iter().map(view).collect(), &zooms), grid, around)
    }
}
