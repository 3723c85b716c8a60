//! Constants of memory budgets.

/// The default budget, in bytes.
pub const DEFAULT: usize = 512 << 20;

/// Bytes of a budget that are reserved for the program, stacks and directories.
pub const FIXED: usize = 8 << 20;

/// Largest number of blocks in work at a time: enough to keep all threads busy. More would only delay the first result.
pub const MOST_BLOCKS: usize = 64;
