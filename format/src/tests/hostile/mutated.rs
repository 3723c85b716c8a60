//! A deterministic search for files that panic, hang or read as different content. `WAVESPLAT_CASES=10` tries ten times as
//! many.

use super::fat::*;
use super::forge::*;
use crate::testing::*;
use std::time::Instant;

/// Number of cases without `WAVESPLAT_CASES`.
const CASES: u64 = 100_000;

/// Prints the number of the case if a test fails.
struct Case(u64);

impl Drop for Case {
    #[allow(clippy::print_stderr, reason = "without it the case is not known")]
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("case {}", self.0);
        }
    }
}

impl Case {
    /// Makes the seeds of neighbouring cases very different.
    fn random(&self) -> Random {
        let mut random = Random((self.0 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..3 {
            random.below(2);
        }
        random
    }
}

/// A file, its pieces and their contents.
struct Seed {
    original: Original,
    pieces: Pieces,
    contents: Vec<(Piece, usize, Vec<u8>)>,
}

impl Seed {
    fn new(original: Original) -> Self {
        let (pieces, mut contents) = (Pieces::new(&original.file), Vec::new());
        pieces.forge(&mut |piece, number, bytes| contents.push((piece, number, bytes.clone())));
        Self { original, pieces, contents }
    }

    /// Mutates a random piece one to three times; everything that covers it is updated.
    fn forged(&self, random: &mut Random) -> Vec<u8> {
        let any = |random: &mut Random| &self.contents[random.below(self.contents.len() as u64) as usize];
        let (piece, number, content) = any(random);
        let (mut content, other) = (content.clone(), &any(random).2);
        (0..=random.below(3)).for_each(|_| mutate(&mut content, other, random));
        self.pieces.forge(&mut |p, n, bytes| {
            if (p, n) == (*piece, *number) {
                bytes.clone_from(&content);
            }
        })
    }

    /// Mutates the file and keeps its checksums.
    fn damaged(&self, random: &mut Random) -> Vec<u8> {
        let mut file = self.original.file.clone();
        let from = random.below(file.len() as u64) as usize;
        let other = file[from..].to_vec();
        (0..=random.below(3)).for_each(|_| mutate(&mut file, &other, random));
        file
    }
}

/// Changes some bytes; may copy bytes from `other`.
fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let below = |random: &mut Random, limit: usize| random.below(limit.max(1) as u64) as usize;
    let len = bytes.len();
    let from = below(random, len);
    let most = 1 << random.below(7);
    let to = (from + 1 + below(random, most)).min(len);
    let start = below(random, other.len());
    let copied = &other[start..(start + to - from.min(to)).min(other.len())];
    match random.below(8) {
        _ if len == 0 => bytes.extend(copied),
        0 | 1 => bytes[from] ^= 1 << random.below(8),
        2 => bytes[from] = [0, 1, 0x7F, 0x80, 0xFE, 0xFF][below(random, 6)],
        3 => bytes[from..to].fill([0, 0xFF][below(random, 2)]),
        4 => bytes[from..from + copied.len()].copy_from_slice(copied),
        5 => drop(bytes.splice(from..from, copied.iter().copied())),
        6 => drop(bytes.drain(from..to)),
        _ => {
            let at = below(random, len);
            bytes.swap(from, at);
        }
    }
}

#[test]
fn mutated_files_are_safe_and_damage_is_found() {
    let times = std::env::var("WAVESPLAT_CASES").map_or(1, |times| times.parse().expect("a number of times"));
    let (seeds, began) = ([lean(), fat()].map(Seed::new), Instant::now());
    let (mut tries, mut slowest) = (0, 0.0f64);
    for number in 0..CASES * times {
        let (case, start) = (Case(number), Instant::now());
        let mut random = case.random();
        let seed = &seeds[usize::from(random.below(16) == 0)];
        let (forged, recovered) = (random.below(2) == 0, random.below(50) == 0);
        let file = if forged { seed.forged(&mut random) } else { seed.damaged(&mut random) };
        if forged {
            use_all(&file);
        } else {
            assert!(file == seed.original.file || read_all(&file).is_err(), "read as if it were whole");
            seed.original.check_prefix(&file);
        }
        match (recovered, forged) {
            (true, true) => drop(recover(&file)),
            (true, false) => drop(seed.original.check_recovery(&file)),
            _ => {}
        }
        slowest = slowest.max(start.elapsed().as_secs_f64());
        tries += 1;
    }
    assert!(slowest < 2.0, "{slowest} s");
    tell("mutated", tries, CASES, began);
}
