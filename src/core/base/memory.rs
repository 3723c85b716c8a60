//! Constants of memory budgets.

/// The default budget, in bytes.
pub const DEFAULT: usize = 512 << 20;

/// Bytes of a budget for whoever reads frames that are not stored as they are: [`OpenOptions::memory`](crate::source::OpenOptions).
pub fn for_reading(budget: usize) -> usize {
    budget / 4
}

/// Bytes of a budget that are reserved for the program, stacks and directories.
pub const FIXED: usize = 8 << 20;

/// The least budget that suffices if `needs` of a budget grow with it, but by less than it does.
pub fn least(needs: impl Fn(usize) -> usize) -> usize {
    (0..32).fold(0, |budget, _| needs(budget))
}

/// The most memory that this process has used so far, in bytes, pages of mapped files included. `None` except on Linux.
pub fn peak_with_files() -> Option<usize> {
    status("VmHWM:")
}

/// About the most memory that this process has used so far, in bytes, without the files that it maps now; too low if it mapped
/// more files after the peak. `None` except on Linux.
pub fn peak() -> Option<usize> {
    Some(peak_with_files()?.saturating_sub(status("RssFile:")?).max(status("RssAnon:")?))
}

/// A number of bytes that the system knows of this process.
fn status(name: &str) -> Option<usize> {
    let all = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = all.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<usize>().ok().map(|kib| kib << 10)
}

/// Largest number of blocks in work at a time: enough to keep all threads busy. More would only delay the first result.
pub const MOST_BLOCKS: usize = 64;

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_is_known_and_never_falls() {
        let before = super::peak_with_files().expect("Linux tells");
        let large = std::hint::black_box(vec![1_u8; 64 << 20]);
        drop(large);
        let after = super::peak_with_files().expect("Linux tells");
        assert!(before > 1 << 16 && after >= before.max(64 << 20));
        assert!(super::peak().is_some_and(|peak| peak > 1 << 16));
    }
}
