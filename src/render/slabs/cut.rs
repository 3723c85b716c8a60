//! How a view is cut into slabs (eq 29), and how much memory they take.

use super::visible::Visible;
use crate::base::error::{Error, Result};
use crate::base::grid::{Grid, Region};
use crate::render::config::RenderConfig;
use crate::render::splat::Slab;
use crate::render::splat::ViewSetup;

/// Planes of slabs that are gathered together, about: they share the weights of a pixel.
pub(in crate::render) const TOGETHER: usize = 64;
/// More slabs than this are refused.
const MOST_SLABS: usize = 1 << 16;
/// Standard deviations of the kernel in front of the first voxels and behind the last ones that slabs are cut in, too.
const TAIL: f64 = 3.0;

/// The slabs of a view.
#[derive(Debug)]
pub(in crate::render) struct Slabs {
    /// An eye for each, from front to back.
    pub(in crate::render) setups: Vec<ViewSetup>,
    /// World units of each.
    pub(in crate::render) thickness: f64,
}

/// The depths between which a view is cut.
fn ends(setup: &ViewSetup, config: &RenderConfig) -> [f64; 2] {
    let [nearest, farthest] = setup.camera.depths_of(&setup.grid.crop(&setup.clip));
    [nearest - TAIL * config.kernel.sigma, farthest + TAIL * config.kernel.sigma]
}

/// How many slabs a view is to be cut into.
pub(in crate::render) fn count(setup: &ViewSetup, config: &RenderConfig) -> usize {
    let [from, to] = ends(setup, config);
    config.mode.slabs().unwrap_or(((to - from) / setup.grid.largest_spacing()).ceil().max(1.0) as usize)
}

/// Cuts the volume into slabs across the view direction. The first and the last one have no end.
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

/// Bytes that the slabs of a view take, and to tell which of their tiles can be seen.
pub(in crate::render) fn bytes(setup: &ViewSetup, config: &RenderConfig) -> usize {
    let tiles: usize = setup.camera.size.iter().map(|pixels| pixels.div_ceil(setup.backend.tile())).product();
    count(setup, config) * (tiles * Visible::BYTES + size_of::<ViewSetup>()) + setup.blocks.len() * Visible::BLOCK_BYTES
}

/// Slabs that a block can reach into, and bytes that each of its voxels takes in each of so many.
pub(in crate::render) fn of_block(setups: &[ViewSetup], block: &Region) -> (usize, usize) {
    let Some(ViewSetup { slab: Some(slab), camera, grid, .. }) = setups.first() else { return (1, 0) };
    let [nearest, farthest] = camera.depths_of(&Grid { dims: block.dims(), ..*grid });
    let each = slab.reached_by(0.0).min(setups.len()) * size_of::<f64>();
    (slab.reached_by(farthest - nearest), each)
}
