//! Pixels of small pictures, and the rays by whose lengths means are weighed.

use super::annotations::rim;
use wavesplat_core::base::grid::Grid;
use wavesplat_engine::render::sink::{RayLengths, weighed};
use wavesplat_engine::render::{Mode, Quantity, RenderConfig, Rendered};

/// Whether pictures are means along rays.
pub(in crate::picture) fn is_of_means(config: &RenderConfig) -> bool {
    matches!(config.mode, Mode::Projection) && config.quantity == Quantity::Mean
}

/// The rays through what is rendered of a grid.
pub(in crate::picture) fn rays(config: &RenderConfig, grid: &Grid) -> RayLengths {
    RayLengths::new(grid, &config.region.unwrap_or(grid.whole()), rim(&config.kernel, grid))
}

/// The values of some pixels, and the lengths of their rays.
#[derive(Default)]
pub(super) struct Pixels {
    pub(super) values: Vec<f32>,
    /// As shares of the longest ray; none if values are not weighed by them.
    shares: Vec<f32>,
}

impl Pixels {
    /// Adds every `step`-th pixel of a picture.
    pub(super) fn add(&mut self, rendered: &Rendered<'_>, step: usize, rays: Option<&RayLengths>, size: [usize; 2]) {
        let shares = rays.zip(rendered.views.get(rendered.view)).map(|(rays, view)| rays.shares(view, size));
        let known = rendered.picture.iter().enumerate().step_by(step).filter(|(_, value)| !value.is_nan());
        for (at, value) in known {
            self.values.push(*value);
            self.shares.extend(shares.as_ref().map(|shares| shares.get(at).copied().unwrap_or(1.0)));
        }
    }

    /// The values as they are shown.
    pub(super) fn weighed(self, beyond: f64) -> Vec<f32> {
        self.values.into_iter().zip(self.shares).map(|(value, share)| weighed(value, share, beyond as f32)).collect()
    }
}
