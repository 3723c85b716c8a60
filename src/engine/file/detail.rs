//! The lattice of a file, and coarser ones of it.

use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{BlockGrid, Grid};
use wavesplat_format::{Axis, Metadata, Window};

/// All voxels of a file, and its blocks.
pub(super) fn whole(m: &Metadata) -> (Grid, BlockGrid) {
    let dims = m.dims.map(|n| n as usize);
    (Grid { dims, spacing: m.spacing, origin: m.origin }, BlockGrid::cubes(dims, m.block_edge as usize))
}

/// Every 2^lod-th voxel along each axis, and the blocks that hold them.
pub(super) fn coarse(m: &Metadata, lod: u32) -> Result<(Grid, BlockGrid)> {
    let (Grid { dims, spacing, origin }, blocks) = whole(m);
    let (longest, edge) = (dims.into_iter().max().unwrap_or(1), blocks.edges[0]);
    // Several blocks must begin on the lattice.
    let of_blocks = if longest <= edge { u32::MAX } else { edge.trailing_zeros() };
    let coarsest = longest.ilog2().min(of_blocks);
    if lod > coarsest {
        let why = if coarsest == of_blocks { ("blocks of", edge) } else { ("a longest axis of", longest) };
        let what = format!("takes at most {coarsest} for {} {} voxels", why.0, why.1);
        return Err(Error::setting("lod", what));
    }
    let every = 1 << lod;
    if lod > 0 && !m.windows.iter().all(refines_space) {
        return Err(Error::setting("lod", "takes a file whose pyramids refine x, y and z"));
    }
    let grid = Grid { dims: dims.map(|n| n.div_ceil(every)), spacing: spacing.map(|s| s * every as f64), origin };
    Ok((grid, BlockGrid::cubes(grid.dims, edge.div_ceil(every))))
}

pub(super) fn refines_space(window: &Window) -> bool {
    let refines = |order: &[Axis]| [Axis::X, Axis::Y, Axis::Z].iter().all(|axis| order.contains(axis));
    window.pyramid.as_ref().is_none_or(|pyramid| refines(&pyramid.order))
}
