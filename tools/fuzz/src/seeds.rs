//! Small valid files to change and damage, one for each way of coding blocks.

use super::forge::Seed;
use std::sync::OnceLock;

/// Their names and bytes, as `tools/tests/fuzz.rs` makes them.
pub const SEEDS: [(&str, &[u8]); 11] = [
    ("haar", include_bytes!("../seeds/haar.wspl")),
    ("multi", include_bytes!("../seeds/multi.wspl")),
    ("learned", include_bytes!("../seeds/learned.wspl")),
    ("pyramid", include_bytes!("../seeds/pyramid.wspl")),
    ("exact", include_bytes!("../seeds/exact.wspl")),
    ("channels", include_bytes!("../seeds/channels.wspl")),
    ("leaves", include_bytes!("../seeds/leaves.wspl")),
    ("nested", include_bytes!("../seeds/nested.wspl")),
    ("ghosts", include_bytes!("../seeds/ghosts.wspl")),
    ("tiers", include_bytes!("../seeds/tiers.wspl")),
    ("listed", include_bytes!("../seeds/listed.wspl")),
];

/// A file by its number, modulo how many there are.
pub fn seed(number: u8) -> (&'static [u8], &'static Seed) {
    static TAKEN_APART: [OnceLock<Seed>; SEEDS.len()] = [const { OnceLock::new() }; SEEDS.len()];
    let number = usize::from(number) % SEEDS.len();
    let file = SEEDS[number].1;
    (file, TAKEN_APART[number].get_or_init(|| Seed::new(file)))
}
