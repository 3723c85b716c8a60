//! Cuts a view into slabs (eq 29), and computes their memory.

use super::visible::Visible;
use crate::base::error::{Error, Result};
use crate::base::grid::{Grid, Region};
use crate::render::config::RenderConfig;
use crate::render::splat::Slab;
use crate::render::splat::ViewSetup;

/// Approximate number of planes of slabs that are gathered together, so that they share the weights of a pixel.
pub(in crate::render) const TOGETHER: usize = 64;
/// The largest number of slabs.
const MOST_SLABS: usize = 1 << 16;
/// The slabs extend this many standard deviations of the kernel in front of the first voxels and behind the last.
const TAIL: f64 = 3.0;

/// The slabs of a view.
#[derive(Debug)]
pub(in crate::render) struct Slabs {
    /// A view setup for each slab, from front to back.
    pub(in crate::render) setups: Vec<ViewSetup>,
    /// Thickness of each slab in world units.
    pub(in crate::render) thickness: f64,
}

/// The depths of the first and the last cut.
fn ends(setup: &ViewSetup, config: &RenderConfig) -> [f64; 2] {
    let [nearest, farthest] = setup.camera.depths_of(&setup.grid.crop(&setup.clip));
    [nearest - TAIL * config.kernel.sigma, farthest + TAIL * config.kernel.sigma]
}

/// The number of slabs of a view.
pub(in crate::render) fn count(setup: &ViewSetup, config: &RenderConfig) -> usize {
    let [from, to] = ends(setup, config);
    config.mode.slabs().unwrap_or(((to - from) / setup.grid.largest_spacing()).ceil().max(1.0) as usize)
}

/// Cuts the volume into slabs perpendicular to the view direction. The first and the last slab are unbounded.
pub(in crate::render) fn cut(setup: &ViewSetup, config: &RenderConfig) -> Result<Slabs> {
    let ([from, to], count) = (ends(setup, config), count(setup, config));
    if !(1..=MOST_SLABS).contains(&count) {
        return Err(Error::setting("slabs", format!("takes 1 to {MOST_SLABS}; here it would be {count}")));
    }
    let thickness = (to - from) / count as f64;
    let end = |n: usize| match n {
        0 => f64::NEG_INFINITY,
        n if n == count => f64::INFINITY,
        n => from + (to - from) * (n as f64 / count as f64),
    };
    let kernel = (config.kernel.sigma, setup.method.radius);
    let slab = |n: usize| Slab::new([end(n), end(n + 1)], kernel, thickness);
    let setups = (0..count).map(|n| ViewSetup { slab: Some(slab(n)), ..setup.clone() }).collect();
    Ok(Slabs { setups, thickness })
}

/// Bytes of the slabs of a view, and of the table of their visible tiles.
pub(in crate::render) fn bytes(setup: &ViewSetup, config: &RenderConfig) -> usize {
    let tiles: usize = setup.camera.size.iter().map(|pixels| pixels.div_ceil(setup.backend.tile())).product();
    count(setup, config) * (tiles * Visible::BYTES + size_of::<ViewSetup>()) + setup.blocks.len() * Visible::BLOCK_BYTES
}

/// The largest number of slabs that a block reaches, and the bytes of each of its voxels' shares in the slabs.
pub(in crate::render) fn of_block(setups: &[ViewSetup], block: &Region) -> (usize, usize) {
    let Some(ViewSetup { slab: Some(slab), camera, grid, .. }) = setups.first() else { return (1, 0) };
    let [nearest, farthest] = camera.depths_of(&Grid { dims: block.dims(), ..*grid });
    let each = slab.reached_by(0.0).min(setups.len()) * size_of::<f64>();
    (slab.reached_by(farthest - nearest), each)
}
