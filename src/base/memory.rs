//! What every memory budget has in common.

/// Bytes that may be allocated where nobody says it.
pub(crate) const DEFAULT: usize = 512 << 20;

/// Bytes that a budget leaves for the program, stacks and directories.
pub(crate) const FIXED: usize = 8 << 20;

/// Blocks worked on at a time: enough to keep workers busy; more would only delay the first result.
pub(crate) const MOST_BLOCKS: usize = 64;
