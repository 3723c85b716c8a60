//! The views of a run.

use crate::args::Cli;
use wavesplat::base::error::Result;
use wavesplat::base::grid::Grid;
use wavesplat::render::annotate::colour_bar_width;
use wavesplat::view::camera::{Camera, View};

/// Azimuth and elevation of the view if none is given.
const USUAL: [f64; 2] = [30.0, 30.0];

impl Cli {
    /// All views, including those of orbits.
    pub(crate) fn views(&self, grid: &Grid) -> Result<Vec<View>> {
        let given: Vec<[f64; 2]> = self.views.iter().map(|view| view.0).collect();
        let first = if given.is_empty() { vec![USUAL] } else { given };
        let orbits = first.into_iter().map(|first| self.orbit(first, grid));
        Ok(orbits.collect::<Result<Vec<_>>>()?.concat())
    }

    /// The views of an orbit, with a common scale. Unless a scale or a centre is given, the volume fits beside the
    /// annotation.
    fn orbit(&self, [azimuth, elevation]: [f64; 2], grid: &Grid) -> Result<Vec<View>> {
        let (roll, size, center) = (self.roll, self.size.0, self.center.map(|c| c.0));
        let first = View { azimuth, elevation, roll, size, scale: self.scale, center };
        let fits = self.scale.is_none() && center.is_none() && self.colour.annotate;
        let margin = if fits { colour_bar_width(size) } else { 0 };
        if self.orbit == 1 && margin == 0 {
            return Ok(vec![first]);
        }
        let turned = |n| (azimuth + f64::from(n) * 360.0 / f64::from(self.orbit)).rem_euclid(360.0);
        let turned = |n| if self.orbit == 1 { azimuth } else { turned(n) };
        let mut views: Vec<View> = (0..self.orbit).map(|n| View { azimuth: turned(n), ..first }).collect();
        let narrow = |view: &View| Camera::new(&View { size: [size[0] - margin, size[1]], ..*view }, grid);
        let cameras = views.iter().map(narrow).collect::<Result<Vec<_>>>()?;
        let scale = cameras.iter().map(|camera| camera.scale).fold(f64::INFINITY, f64::min);
        for (view, camera) in views.iter_mut().zip(&cameras) {
            view.scale = Some(scale);
            if margin > 0 {
                view.center = Some(camera.beside(margin as f64 / 2.0 / scale));
            }
        }
        Ok(views)
    }
}
