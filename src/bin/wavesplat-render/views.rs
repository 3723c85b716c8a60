//! The views of a run.

use crate::annotations::AnnotationArgs;
use crate::args::Cli;
use wavesplat::base::error::Result;
use wavesplat::base::grid::Grid;
use wavesplat::render::annotate::Margins;
use wavesplat::view::camera::View;

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
    /// annotations.
    fn orbit(&self, [azimuth, elevation]: [f64; 2], grid: &Grid) -> Result<Vec<View>> {
        let (roll, size, center) = (self.roll, self.size.0, self.center.map(|c| c.0));
        let first = View { azimuth, elevation, roll, size, scale: self.scale, center };
        let fits = self.scale.is_none() && center.is_none();
        let around = if fits { self.around.margins(size) } else { Margins::default() };
        if self.orbit == 1 && around == Margins::default() {
            return Ok(vec![first]);
        }
        let turned = |n| (azimuth + f64::from(n) * 360.0 / f64::from(self.orbit)).rem_euclid(360.0);
        let turned = |n| if self.orbit == 1 { azimuth } else { turned(n) };
        let views = (0..self.orbit).map(|n| View { azimuth: turned(n), ..first }).collect();
        AnnotationArgs::beside(views, grid, around)
    }
}
