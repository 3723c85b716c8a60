//! Decisions made from the configuration and the archive before any frame is read.

use super::coded_input::CodedInput;
use super::{ConvertConfig, SchemeConstraint, SpatialPredictor, settings, trial_boxes};
use crate::file::above::{OF_ONE_BLOCK, most_within, nodes_above};
use crate::file::promise::UNIT_RANGE;
use wavesplat_core::base::description::{coordinates, is_regular};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::{BlockGrid, Region};
use wavesplat_core::base::memory;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::block_with_ghosts::BlockWithGhosts;
use wavesplat_core::codec::bound::Bound;
use wavesplat_core::source::{CHANNELS, ColourTransform};
use wavesplat_core::wavelet;
use wavesplat_format::limits::MAX_TIERS;
use wavesplat_format::{Basis, BlockId, Derivative, Keep, Metadata};

/// Decisions made from the configuration and the archive before any frame is read.
#[derive(Debug)]
pub(super) struct Plan<'a> {
    /// Converts samples to channels, if there are several.
    pub(super) colour_transform: Option<&'a ColourTransform>,
    /// The metadata before the first frame.
    pub(super) start: Metadata,
    pub(super) blocks: BlockGrid,
    /// The zstd level.
    pub(super) level: i32,
    /// For windows whose coefficients are coded in 32-bit floats.
    of_singles: Room,
    /// For windows whose coefficients are coded in 64-bit floats.
    of_doubles: Room,
    /// The tiers above the blocks: the fewest for which the last tier has one block, at most [`MAX_TIERS`]. 0 without pyramids, or if
    /// blocks cannot be halved.
    pub(super) tiers: u8,
}

/// The numbers of blocks that memory has room for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    /// Blocks that wait for a worker or are encoded.
    pub(super) flight: usize,
    /// Blocks above others that stay decoded.
    pub(super) kept_above: usize,
}

/// The default block edge in voxels: the largest that keeps blocks near 4 MiB without a pyramid and near 14 MiB with one,
/// because larger blocks compress better, even beside small ones at the far faces. A multiple of 16 allows coarse
/// lattices. Blocks of thin volumes are wider, up to [`WIDEST`]; those of long windows have fewer voxels.
fn block_edge(coding: SchemeConstraint, dims: [usize; 3], window: usize) -> usize {
    let alone = coding.space == SpatialPredictor::Alone;
    let usual = if alone { 32 } else { 48 };
    let fits = |edge: &usize| clipped(*edge, dims).saturating_mul(window.max(32)) <= 33 * usual * usual * usual;
    let wide = (2..=WIDEST / 16).rev().map(|edge| 16 * edge);
    let edge = wide.chain([usual / 2, usual / 4, 4, 2]).find(fits).unwrap_or(1);
    let longest = dims.into_iter().max().unwrap_or(1);
    if alone { edge } else { longest.min(edge) }
}

/// The widest blocks of thin volumes.
const WIDEST: usize = 256;

/// The voxels of the largest block. Saturates, because the edge may be any.
fn clipped(edge: usize, dims: [usize; 3]) -> usize {
    dims.into_iter().map(|n| n.min(edge)).fold(1, usize::saturating_mul)
}

impl<'a> Plan<'a> {
    /// Whether blocks may have `edge` voxels a side.
    fn takes(config: &ConvertConfig, edge: usize, dims: [usize; 3]) -> bool {
        let samples = clipped(edge, dims).saturating_mul(most_coefficients(config)) as u64;
        edge > 0 && samples <= wavesplat_format::limits::MAX_BLOCK_SAMPLES
    }

    /// A block, with the voxels around it that help to code it.
    pub(super) fn block_with_ghosts(&self, codec: &WindowCodec, block: usize) -> BlockWithGhosts {
        let region = self.blocks.region(block);
        let (start, size) = (region.start, region.dims());
        let outer = codec.outer_size(size);
        BlockWithGhosts {
            size,
            known: std::array::from_fn(|a| (start[a] + outer[a]).min(self.blocks.dims[a]) - start[a]),
        }
    }

    /// The voxels that a block covers along x, y, z.
    pub(super) fn size(&self, id: BlockId) -> [usize; 3] {
        self.boxed(id).dims()
    }

    /// The voxels that a block covers.
    fn boxed(&self, id: BlockId) -> Region {
        self.blocks_of_tier(id.tier).region(id.block as usize)
    }

    /// The blocks of a tier.
    pub(super) fn blocks_of_tier(&self, tier: u8) -> BlockGrid {
        blocks_of_tier(self.blocks, tier)
    }

    /// The nodes of a block of a tier above 0, and how many samples along x, y, z they are made from.
    pub(super) fn coarse_nodes(&self, codec: &WindowCodec, id: BlockId) -> BlockWithGhosts {
        let size = codec.decoded_size(self.size(id));
        BlockWithGhosts { size, known: self.coarse_voxels(codec, id).map(|voxels| voxels.len()) }
    }

    /// The places along x, y, z of the samples that the nodes of a block of a tier above 0 are made from: those at its nodes, or
    /// instead of a node behind the volume the last two.
    pub(super) fn coarse_voxels(&self, codec: &WindowCodec, id: BlockId) -> [Vec<usize>; 3] {
        let (region, dims) = (self.boxed(id), self.blocks.dims);
        let size = codec.decoded_size(region.dims());
        std::array::from_fn(|a| {
            let nodes = (0..size[a]).map(|node| region.start[a] + (node << id.tier));
            nodes.flat_map(|at| if at < dims[a] { at..at + 1 } else { dims[a] - 2..dims[a] }).collect()
        })
    }

    pub(super) fn new(input: &'a CodedInput) -> Result<Self> {
        let CodedInput { config, archive, colour_transform } = input;
        wavelet::check_window(config.coding.basis.unwrap_or(Basis::Samples), config.window)?;
        check_bound(input)?;
        if config.chain == 0 {
            return Err(Error::setting("chain", "takes 1 or more windows"));
        }
        let edge = config.block.unwrap_or(block_edge(config.coding, archive.grid.dims, config.window));
        let most = wavesplat_format::limits::MAX_BLOCK_SAMPLES;
        if !Self::takes(config, edge, archive.grid.dims) {
            return Err(Error::setting(
                "block",
                format!("holds 1 to {most} samples over a window, not {edge} voxels a side"),
            ));
        }
        let blocks = BlockGrid::cubes(archive.grid.dims, edge);
        if u32::try_from(blocks.len()).is_err() {
            return Err(Error::setting(
                "block",
                format!("{edge} voxels a side give more than 2^32 blocks; take larger ones"),
            ));
        }
        let tiers = if config.has_pyramids() { tiers(blocks) } else { 0 };
        let of_doubles = room(input, blocks, tiers, size_of::<f64>())?;
        let of_singles = room(input, blocks, tiers, size_of::<f32>())?;
        let start = start(input, edge);
        let level = config.level;
        Ok(Self { start, colour_transform: colour_transform.as_ref(), blocks, level, of_singles, of_doubles, tiers })
    }

    /// The numbers of blocks that memory has room for in a window.
    pub(super) fn room(&self, codec: &WindowCodec) -> Room {
        let is_single = codec.scheme.pyramid.as_ref().is_some_and(|pyramid| pyramid.single);
        if is_single { self.of_singles } else { self.of_doubles }
    }

    pub(super) fn channels(&self) -> usize {
        self.start.channels.into()
    }

    /// The blocks of a window with so many tiers, as the file stores them: tier after tier, channel after channel.
    pub(super) fn ids(&self, window: u32, tiers: u8) -> impl Iterator<Item = BlockId> + use<> {
        let blocks: Vec<u32> = (0..=tiers).map(|tier| self.blocks_of_tier(tier).len() as u32).collect();
        let channels = self.start.channels;
        (0..=tiers).rev().flat_map(move |tier| {
            let of_tier = blocks[usize::from(tier)];
            let id = move |channel, block| BlockId { tier, ..BlockId::new(window, channel, block) };
            (0..channels).flat_map(move |channel| (0..of_tier).map(move |block| id(channel, block)))
        })
    }

    /// The number of the pair of layers along z that a block lies in, counted through all channels. Blocks of a pair share those above.
    pub(super) fn pair_of_layers(&self, id: BlockId) -> usize {
        let [nx, ny, nz] = self.blocks_of_tier(id.tier).counts();
        usize::from(id.channel) * nz.div_ceil(2) + id.block as usize / (2 * nx * ny)
    }

    /// The block that ends a window.
    pub(super) fn last_block(&self, window: u32) -> BlockId {
        BlockId::new(window, self.start.channels - 1, (self.blocks.len() - 1) as u32)
    }

    pub(super) fn blocks_of_window(&self) -> usize {
        self.blocks.len() * self.channels()
    }
}

/// The blocks of a tier above these.
fn blocks_of_tier(blocks: BlockGrid, tier: u8) -> BlockGrid {
    BlockGrid::cubes(blocks.dims, blocks.edges[0] << tier)
}

/// As [`Plan::tiers`], with pyramids.
fn tiers(blocks: BlockGrid) -> u8 {
    let is_one = |tier: &u8| blocks_of_tier(blocks, *tier).len() == 1;
    let is_even = blocks.edges[0].is_multiple_of(2);
    let tiers = (0..MAX_TIERS).find(is_one).unwrap_or(MAX_TIERS);
    if is_even { tiers } else { 0 }
}

/// Checks that the tolerance or error is valid for this bound and these samples.
fn check_bound(input: &CodedInput) -> Result<()> {
    let config = &input.config;
    check_keep(input)?;
    let Some(error) = config.max_error else {
        let is_share = (0.0..=1.0).contains(&config.tolerance);
        return is_share
            .then_some(())
            .ok_or_else(|| Error::setting("tolerance", "takes a share, 0 to 1, like 0.02 or 2%"));
    };
    if !(0.0..=f64::MAX).contains(&error) {
        return Err(Error::setting("max_error", "takes a finite number of 0 or more, in the samples' unit"));
    }
    check_max_error(config.bound, config.range != Some(UNIT_RANGE), input.colour_transform.is_some())
}

/// Checks that what is kept means something for these samples.
pub(super) fn check_keep(input: &CodedInput) -> Result<()> {
    let keep = &input.config.keep;
    let wrong = |what: &str| Err(Error::setting("keep", what));
    if Keep::parse(&keep.to_string()).as_ref() != Ok(keep) {
        return wrong("takes up to 16 finite values that ascend, and errors and shares of 0 or more");
    }
    if input.colour_transform.is_some() && *keep != (Keep { range: keep.range, ..Keep::default() }) {
        return wrong("takes only range, since `transfer_function` codes colours, and the others are about samples");
    }
    let in_space = keep.derivatives.iter().find(|of| of.derivative != Derivative::Difference);
    let coordinates = |axis| coordinates(input.archive.description.as_ref()?, axis);
    let is_uneven = |axis: &usize| coordinates(*axis).is_some_and(|at| !is_regular(&at));
    match in_space.zip((0..3).find(is_uneven)) {
        Some((of, axis)) => wrong(&format!(
            "{} needs voxels at regular places, and those along {} are not; difference and relative do not need them",
            of.derivative.name(),
            ["x", "y", "z"][axis]
        )),
        None => Ok(()),
    }
}

/// Checks that an error in the samples' unit means something beside the other settings.
pub(super) fn check_max_error(bound: Bound, has_range: bool, has_colours: bool) -> Result<()> {
    let (setting, what) = match bound {
        _ if has_colours => ("max_error", "is in the samples' unit, and `transfer_function` codes colours"),
        _ if has_range => ("range", "the tolerance refers to it, and `max_error` to no range; give one"),
        Bound::Relative { .. } | Bound::Sampled { .. } => {
            ("max_error", "needs `bound` pointwise or rms; the others are shares of the samples themselves")
        }
        Bound::Pointwise | Bound::Rms => return Ok(()),
    };
    Err(Error::setting(setting, what))
}

/// The metadata before the first frame.
fn start(input: &CodedInput, edge: usize) -> Metadata {
    let CodedInput { config, archive, colour_transform } = input;
    Metadata {
        dims: archive.grid.dims.map(|n| n as u64),
        spacing: archive.grid.spacing,
        origin: archive.grid.origin,
        sample: archive.sample,
        block_edge: edge as u32,
        channels: colour_transform.as_ref().map_or(1, |_| CHANNELS.len() as u16),
        frames: 0,
        times: Vec::new(),
        variable: archive.variable.clone(),
        bound: config.bound,
        tolerance: config.tolerance,
        missing_value: config.missing_value,
        windows: Vec::new(),
        settings: settings::stored_settings(input),
        program: format!("wavesplat {}", env!("CARGO_PKG_VERSION")),
    }
}

/// The numbers of blocks that fit in memory. Memory holds samples and codes of blocks, the workers' scratch, and what choosing the next window's scheme takes. A coefficient takes `each` bytes.
fn room(input: &CodedInput, blocks: BlockGrid, tiers: u8, each: usize) -> Result<Room> {
    let CodedInput { config, archive, colour_transform } = input;
    let sample = archive.sample;
    let voxels = blocks.region(0).voxels();
    let samples = voxels * config.window;
    let largest = |transform: &ColourTransform| transform.sample.size().max(sample.size());
    let raw = samples * colour_transform.as_ref().map_or(sample.size(), largest);
    let channel_bytes = colour_transform.as_ref().map_or(0, |_| samples * sample.size());
    let codes = voxels * most_coefficients(config) * size_of::<i32>();
    let has_pyramids = config.has_pyramids();
    let field = if has_pyramids { 2 * voxels * most_coefficients(config) * each } else { 0 };
    let above = if tiers > 0 { nodes_above(blocks) * most_coefficients(config) * each } else { 0 };
    let choice = if has_pyramids { trial_boxes::bytes(samples, sample, each) } else { 0 };
    let workers = rayon::current_num_threads();
    let threads = |room: &Room| room.flight.min(workers);
    let copies = if config.keep.sum { 3 } else { 2 * usize::from(!config.keep.sides.is_empty()) };
    let mended = copies * raw + if config.keep.sum { 3 * samples + 2 * voxels * size_of::<f64>() } else { 0 };
    let begin = above / 4; // the known nodes of a block: an eighth of its nodes, and more at its faces
    let scratch = samples + 2 * codes + field + raw + channel_bytes + mended + begin + above + ZSTD_SCRATCH;
    // The blocks above and two lists of blocks that wait; vectors grow to twice their length.
    let spool = if tiers > 0 { 3 * 2 * SPOOLED } else { 0 };
    let needs = |room: &Room| {
        // The samples of blocks in flight and of one that is gathered; the codes of as many, and of those that overtook one.
        let waiting = if room.flight > 1 { room.flight } else { 0 };
        2 * (room.flight + 1) * raw
            + waiting * raw
            + threads(room) * scratch
            + room.kept_above * above
            + spool
            + choice
            + memory::FIXED
    };
    // One thread needs no block that waits: fresh memory costs more time than waiting.
    let enough = if workers == 1 { 1 } else { (2 * workers).min(memory::MOST_BLOCKS) };
    let fits = |room: &Room| needs(room) + archive.memory <= config.memory;
    let largest = |kept_above| (1..=enough).rev().map(|flight| Room { flight, kept_above }).find(fits);
    // More threads save more than blocks that stay decoded.
    let most = most_within(config.memory, above, 0);
    let rooms = (1..=most.min(OF_ONE_BLOCK)).chain([most]).filter_map(largest);
    rooms.max_by_key(threads).ok_or_else(|| {
        let share = config.memory as f64 / config.memory.saturating_sub(archive.memory).max(1) as f64;
        let least = (needs(&Room { flight: 1, kept_above: 1 }) as f64 * share / MIB).ceil();
        let (window, edge) = (config.window, blocks.edges[0]);
        let what = format!("windows of {window} frames in blocks of {edge} voxels a side need {least}MiB");
        Error::setting(
            "memory",
            Note::with(format!("{what}; give that, or make either smaller"), Remedy::Adjust(&["window", "block"])),
        )
    })
}

/// The number of coefficients of a voxel in a full window.
fn most_coefficients(config: &ConvertConfig) -> usize {
    match config.coding.basis {
        Some(basis @ (Basis::Haar | Basis::Multi)) => wavelet::basis(basis, &[], config.window).coefficients(),
        // as many as frames; without a given basis, one of these two is chosen
        Some(Basis::Samples | Basis::Learned) | None => config.window,
    }
}

/// Bytes of coded blocks that wait in memory; more go to a temporary file.
pub(super) const SPOOLED: usize = 1 << 18;

/// An upper bound of the memory of a zstd context at the offered levels, for inputs of a few MiB.
const ZSTD_SCRATCH: usize = 4 << 20;
const MIB: f64 = 1_048_576.0;

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::base::sample::SampleType;
    use wavesplat_core::source::{Archive, OpenOptions};

    /// Neither pipes nor packed files need a setting of memory, whatever their samples are.
    #[test]
    fn frames_of_any_samples_fit_the_usual_memory() {
        let reading = memory::for_reading(memory::DEFAULT);
        let options = OpenOptions { memory: reading, ..OpenOptions::default() };
        for sample in SampleType::ALL {
            for dims in [[48; 3], [50, 50, 50], [300, 200, 100], [512, 512, 4], [4096, 1, 1]] {
                // Doubles that keep sides need more for files, too.
                let kept = if sample.size() > 4 { "" } else { "range sign" };
                for keep in ["", kept] {
                    let memory = options.for_window(sample);
                    let archive = Archive { memory, ..Archive::new(Grid::unit(dims), sample, None) };
                    let keep = Keep::parse(keep).expect("words");
                    let input = CodedInput::new(&ConvertConfig { keep, ..ConvertConfig::new(0.01) }, &archive);
                    let error = Plan::new(&input).err();
                    assert!(error.is_none(), "{dims:?} {sample}: {error:?}");
                }
            }
        }
    }

    #[test]
    fn blocks_are_cubes_unless_the_volume_is_thin() {
        let alone = SchemeConstraint::from(Basis::Haar);
        for (coding, dims, window, edge) in [
            (SchemeConstraint::AUTO, [1024, 1024, 1024], 32, 48),
            (SchemeConstraint::AUTO, [1024, 1024, 1024], 4, 48),
            (SchemeConstraint::AUTO, [1024, 1024, 1024], 256, 24),
            (SchemeConstraint::AUTO, [20, 18, 16], 32, 20),
            (SchemeConstraint::AUTO, [75, 75, 20], 32, 75),
            (SchemeConstraint::AUTO, [1, 512, 512], 32, 256),
            (SchemeConstraint::AUTO, [512, 8, 512], 32, 112),
            (SchemeConstraint::AUTO, [512, 512, 8], 256, 32),
            (alone, [1024, 1024, 1024], 32, 32),
            (alone, [512, 512, 2], 32, 128),
            (alone, [1024, 1024, 1024], 4096, 4),
        ] {
            assert_eq!(block_edge(coding, dims, window), edge, "{dims:?}, {window}");
            assert!(clipped(edge, dims) * window <= wavesplat_format::limits::MAX_BLOCK_SAMPLES as usize);
        }
    }
}
