//! How steep a table is near each of its entries: bounds of how far its numbers move when a value does.

use super::table::{ENTRIES, Entries};

/// Bounds near an entry: the largest changes of the four numbers per step of the table, and the sum of the jumps of the last.
/// Only the last number jumps, where opacities begin between two entries.
pub(super) type Steepness = [f32; 5];

/// The bounds near each entry, within 1, 2, 4 and more entries.
pub(super) struct Steepest {
    within: Vec<Vec<Steepness>>,
}

impl Steepest {
    pub(super) fn new(entries: &Entries) -> Self {
        let own: Vec<Steepness> = (0..ENTRIES).map(|n| steep(entries, n)).collect();
        let joined = |reach: usize| -> Vec<Steepness> {
            let near = |n: usize| &own[n.saturating_sub(reach)..(n + reach + 1).min(ENTRIES)];
            (0..ENTRIES).map(|n| near(n).iter().fold([0.0; 5], join)).collect()
        };
        Self { within: (0..=ENTRIES.ilog2()).map(|power| joined(1 << power)).collect() }
    }

    /// The bounds near each entry for values that move by at most `steps` steps.
    pub(super) fn within(&self, steps: f32) -> &[Steepness] {
        // A value that moves by a step reaches the next entry, by two steps the one after it, and so on.
        let entries = steps.ceil().clamp(1.0, ENTRIES as f32) as usize;
        &self.within[entries.next_power_of_two().ilog2() as usize]
    }
}

/// The bounds between an entry and the next, and of the jump behind them.
fn steep(entries: &Entries, n: usize) -> Steepness {
    let [_, _, _, last, changes @ ..] = entries[n];
    let jump = entries.get(n + 1).map_or(0.0, |next| (next[3] - (last + changes[3])).abs());
    let [r, g, b, power] = changes.map(f32::abs);
    [r, g, b, power, jump]
}

fn join(a: Steepness, b: &Steepness) -> Steepness {
    std::array::from_fn(|i| if i < 4 { a[i].max(b[i]) } else { a[i] + b[i] })
}

#[cfg(test)]
mod tests {
    use super::super::table::Table;
    use super::*;
    use wavesplat_core::colour::TransferFunction;

    /// The numbers between two entries.
    fn at(entries: &Entries, place: f32) -> [f32; 4] {
        let place = place.clamp(0.0, (ENTRIES - 1) as f32);
        let (n, rest) = (place as usize, place.fract());
        std::array::from_fn(|i| entries[n][i] + rest * entries[n][4 + i])
    }

    #[test]
    fn numbers_move_by_no_more_than_their_steepness() {
        for points in [vec![(0.123, 0.0), (0.2345, 0.9), (0.3217, 0.0), (0.7, 1.0)], vec![(0.0, 0.0), (1.0, 1.0)]] {
            let map = TransferFunction::open("viridis").expect("a map").with_opacity(&points).expect("points");
            let entries = Table::new(&map, 0.7).colours;
            let (steepest, mut used) = (Steepest::new(&entries), 0.0_f32);
            for n in 0..40_000_u32 {
                let random = |salt: u32| (n.wrapping_mul(2_654_435_761).wrapping_add(salt) >> 8) as f32 / 16_777_216.0;
                let (place, error) = (random(0) * 560.0 - 20.0, 0.01 * 60_000.0_f32.powf(random(123_456_789)));
                let moved = place + error * if n % 3 == 0 { 1.0 } else { random(987_654_321) * 2.0 - 1.0 };
                let steep = steepest.within(error)[place.clamp(0.0, (ENTRIES - 1) as f32) as usize];
                let [from, to] = [place, moved].map(|place| at(&entries, place));
                for i in 0..4 {
                    let allowed = error * steep[i] + if i == 3 { steep[4] } else { 0.0 };
                    let off = (from[i] - to[i]).abs();
                    assert!(off <= allowed * (1.0 + 1e-5) + 1e-6, "{points:?}: {place} to {moved}, number {i}");
                    used = used.max(off / allowed.max(1e-3));
                }
            }
            assert!(used > 0.9, "{points:?}: {used}");
        }
    }
}
