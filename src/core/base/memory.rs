//! Constants of memory budgets.

/// The default budget, in bytes.
pub const DEFAULT: usize = 512 << 20;

/// Bytes of a budget that are reserved for the program, stacks and directories.
pub const FIXED: usize = 8 << 20;

/// The least budget that suffices if `needs` of a budget grow with it, but by less than it does.
pub fn least(needs: impl Fn(usize) -> usize) -> usize {
    (0..32).fold(0, |budget, _| needs(budget))
}

/// About the most memory that this process has used so far, in bytes, without the files that it maps now; too low if it mapped
/// more files later. `None` except on Linux.
pub fn peak() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let bytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().nth(1)?.parse::<usize>().ok().map(|kib| kib << 10)
    };
    Some(bytes("VmHWM")?.saturating_sub(bytes("RssFile")?).max(bytes("RssAnon")?))
}

/// Largest number of blocks in work at a time: enough to keep all threads busy. More would only delay the first result.
pub const MOST_BLOCKS: usize = 64;
