//! The limits of the format, with their reasons. A reader refuses files that exceed them; a writer never exceeds them.

/// Every block and section starts at a multiple of this many bytes, the size of a cache line.
pub const ALIGN: u64 = 64;

/// Blocks in one leaf of the directory: a leaf stays near 200 KiB uncompressed, and a million blocks have 2 000 leaves.
pub const BLOCKS_PER_LEAF: u32 = 512;

/// Samples of one block, and coefficients of one block (64^3 voxels by 32 frames). Bounds the memory of a decoder.
pub const MAX_BLOCK_SAMPLES: u64 = 1 << 23;

/// Bytes of one part before compression: the largest block with every sample an outlier of 4 + 8 bytes.
pub const MAX_PART_RAW: u64 = 12 * MAX_BLOCK_SAMPLES;

/// Groups of temporal levels in a window: with more, parts would be smaller than their directory entries.
pub const MAX_LEVELS: usize = 32;

/// Values of a block that lists them: a place in the list takes 16 bits.
pub const MAX_LISTED: usize = 1 << 16;

/// Kept values of a file: samples stay below, at or above each.
pub const MAX_SIDES: usize = 16;

/// Parts of one block: every level, outliers, missing samples, exact samples, sides, sums.
pub const MAX_PARTS: usize = MAX_LEVELS + 4;

/// Frames in one window: 1024, plus one for bases that need an odd number. A basis as a matrix stays near 8 MiB.
pub const MAX_WINDOW_FRAMES: u32 = 1025;

/// Coefficients of one voxel in one window: a redundant basis has at most a few per frame.
pub const MAX_COEFFICIENTS: u32 = 4 * MAX_WINDOW_FRAMES;

/// Voxels along one axis: positions fit 32 bits with room to add.
pub const MAX_DIM: u64 = 1 << 31;

/// Frames of an archive: a frame number is exact as a 64-bit float.
pub const MAX_FRAMES: u64 = 1 << 53;

/// Bytes of the metadata record: room for two million time values, small enough to hold several times.
pub const MAX_METADATA: usize = 16 << 20;

/// Bytes of the description record before compression: coordinates of large grids fit, fields do not.
pub const MAX_DESCRIPTION: usize = MAX_METADATA;

/// Dimensions, axes, variables and attributes of a description together.
pub const MAX_DESCRIPTION_ITEMS: usize = 1 << 16;

/// Bytes of the root of the directory before compression: 8 million leaves.
pub const MAX_ROOT_RAW: u64 = 1 << 30;

/// Bytes of the head of a bare stream before compression: metadata, and thousands of blocks. Larger archives are files.
pub const MAX_BARE_HEAD: usize = 32 << 20;

/// Channels of an archive.
pub const MAX_CHANNELS: u16 = 256;

/// Tiers above the blocks of a window.
pub const MAX_TIERS: u8 = 24;

/// Rounds up to a multiple of [`ALIGN`], or to `u64::MAX` on overflow.
pub(crate) fn align(position: u64) -> u64 {
    position.checked_next_multiple_of(ALIGN).unwrap_or(u64::MAX)
}
