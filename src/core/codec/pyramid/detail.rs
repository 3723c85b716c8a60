//! The passes over every few nodes of a block: levels of detail.

use super::stages::{Stages, Step};
use super::{PlacedBox, PredictionPasses};
use wavesplat_format::{Axis, CodeBox, Pass, PassBox, Places, Pyramid, SparseCodes};

impl<'a> PredictionPasses<'a> {
    /// The passes over every 2^lod-th node along the axes x, y and z, and over all along k, of a block.
    ///
    /// Passes in space of finer levels than `lod` add no such nodes. The finest of these are still needed, because they
    /// drop the nodes that only predict. Passes along time add such nodes in every level.
    pub(crate) fn with_detail(pyramid: &'a Pyramid, size: [usize; 3], k: usize, tier: u8, lod: u32) -> Self {
        let whole = Self::new(pyramid, size, k, tier);
        if lod == 0 {
            return whole;
        }
        let finest_level = lod + u32::from(tier);
        let every = |pass: &Pass, a: usize| if a < 3 { pass.strides[a].max(1 << lod) } else { pass.strides[a] };
        let step = |pass: &Pass| {
            let lattice: [usize; 4] = std::array::from_fn(|a| pass.limits[a].div_ceil(every(pass, a)));
            let [_, _, _, added] = pass.extent();
            match pass.axis {
                Some(Axis::T) => Step { axis: pass.axis, lattice, added: [lattice[0], lattice[1], lattice[2], added] },
                _ if has_nodes(pass, finest_level) => Step { lattice, ..Step::from(pass) },
                axis => Step { axis, lattice, added: [0; 4] },
            }
        };
        let kept: Vec<&Pass> = whole.passes.iter().filter(|pass| is_kept(pass, finest_level)).collect();
        let steps: Vec<Step> = kept.iter().map(|pass| step(pass)).collect();
        let coarse = |pass: &&Pass| Pass {
            strides: std::array::from_fn(|a| every(pass, a) >> if a < 3 { lod } else { 0 }),
            ..**pass
        };
        let passes: Vec<Pass> = kept.iter().map(coarse).collect();
        let stages = Stages::new(pyramid.stencil, &steps);
        let [x, y, z] = pyramid.nodes(size, tier).map(|n| n.div_ceil(1 << lod));
        let shape = [x, y, z, whole.shape[3]];
        let mut new = Self { pyramid, shape, pyramids: whole.pyramids, passes, steps, boxes: Vec::new(), stages };
        new.boxes =
            whole.boxes.iter().filter_map(|of| of.of).map(|of| new.thinned(&whole, &of, lod, finest_level)).collect();
        new
    }

    /// The part of a code box of the whole block that this level of detail reads.
    fn thinned(&self, whole: &Self, of: &PassBox, lod: u32, finest_level: u32) -> PlacedBox {
        let (pass, part) = (whole.passes[of.pass], of.part);
        let mut at = CodeBox { allowed: of.allowed, ..CodeBox::contiguous(of.extents(whole.extent(of.pass))) };
        let left_out = PlacedBox { of: None, part, at: CodeBox { needed: Places::NONE, ..at }, every: [1; 3] };
        if !has_nodes(&pass, finest_level) {
            return left_out;
        }
        let number = whole.passes[..of.pass].iter().filter(|pass| is_kept(pass, finest_level)).count();
        let apart: [usize; 3] = std::array::from_fn(|a| of.every[a] * pass.strides[a]);
        let every = apart.map(|apart| (1_usize << lod).div_ceil(apart));
        if every == [1; 3] {
            let every = std::array::from_fn(|a| (apart[a] >> lod) / self.passes[number].strides[a]);
            let own = PassBox { pass: number, every: every.map(|n: usize| n.max(1)), ..*of };
            at = self.placed(&own);
            return PlacedBox { of: Some(own), part, at, every: [1; 3] };
        }
        if of.allowed != 0xFF {
            return left_out; // the coarser nodes are in another box
        }
        PlacedBox { of: Some(PassBox { pass: number, every: [1; 3], ..*of }), part, at, every }
    }

    /// Leaves out codes of finer nodes, and puts the others in their places.
    pub(super) fn thin(&self, codes: &mut SparseCodes) {
        if self.boxes.iter().all(|of| of.of.is_some() && of.every == [1; 3]) {
            return;
        }
        let of_runs: Vec<&PlacedBox> =
            self.boxes.iter().flat_map(|of| std::iter::repeat_n(of, of.at.extents[3])).collect();
        codes.map_places(|run, place| {
            let PlacedBox { of, at, every, .. } = of_runs[run];
            let of = of.as_ref()?;
            if *every == [1; 3] {
                return Some(place);
            }
            let ([x, y, _, _], place) = (at.extents, place as usize);
            let node = [place % x, place / x % y, place / (x * y)];
            let (first, strides) = self.stages.places(of.pass);
            let kept = (0..3).all(|a| node[a].is_multiple_of(every[a]));
            kept.then(|| (first + (0..3).map(|a| node[a] / every[a] * strides[a]).sum::<usize>()) as u32)
        });
    }
}

/// Whether a pass adds nodes at multiples of `2^lod` along x, y and z.
fn has_nodes(pass: &Pass, lod: u32) -> bool {
    pass.level >= lod || pass.axis.is_none_or(|axis| axis == Axis::T)
}

/// Whether the level of detail needs a pass: because it adds nodes, or because it drops nodes that only predict.
fn is_kept(pass: &Pass, lod: u32) -> bool {
    has_nodes(pass, lod) || pass.level == 0
}
