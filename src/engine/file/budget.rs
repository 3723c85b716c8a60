//! Memory budgets of commands that work on some blocks at a time.

use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::memory::{FIXED, MOST_BLOCKS, least};

/// The number of blocks of `block` bytes each that fit in `memory`, beside those that all of them share, and the `held`
/// bytes of a source. `shared(memory)` is how many bytes all blocks share with a budget of `memory`. A source takes a share of the memory.
///
/// # Errors
/// Not even one fits; `doing` names the work.
pub(super) fn blocks_within(
    memory: usize,
    held: usize,
    shared: impl Fn(usize) -> usize,
    block: usize,
    doing: &str,
) -> Result<usize> {
    let available = memory.saturating_sub(held.saturating_add(FIXED + shared(memory)));
    if available < block {
        let share = memory as f64 / memory.saturating_sub(held).max(1) as f64;
        let needs = |memory: usize| ((block + FIXED + shared(memory)) as f64 * share) as usize;
        let least = least(needs).div_ceil(1 << 20);
        return Err(Error::setting("memory", format!("{doing} this file needs at least {least}MiB")));
    }
    Ok((available / block.max(1)).clamp(1, MOST_BLOCKS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_without_room_for_a_block_is_refused_with_one_that_suffices() {
        const MIB: usize = 1 << 20;
        assert_eq!(blocks_within(118 * MIB, 0, |_| 10 * MIB, 25 * MIB, "verifying").expect("room"), 4);
        assert_eq!(blocks_within(usize::MAX, 0, |_| 0, 1, "verifying").expect("room"), MOST_BLOCKS);
        let shared = |memory: usize| memory / 8;
        for held in [0, 10 * MIB] {
            let refused =
                blocks_within(40 * MIB, held, shared, 60 * MIB, "verifying").expect_err("too little").to_string();
            let least = refused.split("at least ").nth(1).and_then(|rest| rest.split("MiB").next()).expect("a number");
            let least: usize = least.parse().expect("a number");
            let held = held / 40 * (least + 1); // the same share
            assert!(blocks_within((least + 1) * MIB, held, shared, 60 * MIB, "verifying").is_ok(), "{refused}");
        }
    }
}
