//! Files with flipped bits, with original or forged checksums.

use super::fat::*;
use super::forge::*;
use crate::*;
use std::time::Instant;

/// Opens a file and checks every byte without decompressing parts: the checksums must suffice.
fn check_bytes(file: &[u8]) -> Result<()> {
    let reader = Reader::open(file)?;
    let mut wrong = None;
    reader.check_structure(&mut |error| wrong = Some(error))?;
    wrong.take().map_or(Ok(()), Err)?;
    for window in 0..reader.metadata().windows.len() as u32 {
        for leaf in reader.leaves(window) {
            let blocks = reader.leaf(leaf)?;
            reader.check_leaf(leaf, &blocks, &mut |error| wrong = Some(error))?;
            wrong.take().map_or(Ok(()), Err)?;
            blocks.iter().filter(|block| !block.lost).try_for_each(|block| reader.check_stored(block))?;
        }
    }
    Ok(())
}

fn flip(bytes: &mut [u8], bit: usize) {
    bytes[bit / 8] ^= 1 << (bit % 8);
}

#[test]
fn every_flipped_bit_of_a_fat_file_is_found_by_checksums() {
    let (Original { mut file, .. }, began) = (fat(), Instant::now());
    assert!(check_bytes(&file).is_ok());
    for bit in 0..8 * file.len() {
        flip(&mut file, bit);
        assert!(check_bytes(&file).is_err(), "bit {} of byte {}", bit % 8, bit / 8);
        flip(&mut file, bit);
    }
    tell("every bit flipped", 8 * file.len() as u64, 8 * file.len() as u64, began);
}

#[test]
fn a_flipped_bit_loses_only_its_block_and_files_resume_before_it() {
    let (original, began) = (fat(), Instant::now());
    let (mut file, mut tries) = (original.file.clone(), 0);
    for bit in (0..8 * file.len()).step_by(37) {
        flip(&mut file, bit);
        assert!(original.check_recovery(&file), "bit {bit}");
        original.check_prefix(&file);
        flip(&mut file, bit);
        tries += 1;
    }
    tell("bits flipped, recovered and resumed", tries, 8 * file.len() as u64 / 37, began);
}

#[test]
fn flipped_bits_with_forged_checksums_are_safe() {
    for (original, step, name) in [(lean(), 3, "lean"), (fat(), 37, "fat")] {
        let (pieces, began) = (Pieces::new(&original.file), Instant::now());
        assert_eq!(pieces.forge(&mut |_, _, _| {}), original.file);
        let (mut tries, mut slowest) = (0, 0.0f64);
        for (piece, number, len) in pieces.sizes() {
            for bit in (0..8 * len).step_by(step) {
                let start = Instant::now();
                let change = &mut |p, n, bytes: &mut Vec<u8>| {
                    if (p, n) == (piece, number) {
                        flip(bytes, bit);
                    }
                };
                let file = pieces.forge(change);
                use_all(&file);
                if bit % 16 == 0 {
                    let _ = recover(&file);
                }
                slowest = slowest.max(start.elapsed().as_secs_f64());
                tries += 1;
            }
        }
        assert!(slowest < 1.0, "{slowest} s");
        tell(&format!("bits flipped, checksums forged, {name}"), tries, original.file.len() as u64 / 4, began);
    }
}

#[test]
fn two_flipped_bits_in_header_or_footer_are_found() {
    let (Original { mut file, .. }, began) = (lean(), Instant::now());
    let (bits, last) = (8 * 256, 8 * (file.len() - 256));
    let bit = |n: usize| if n < 1024 { n } else { n + last };
    let mut check = |(a, b): (usize, usize)| {
        flip(&mut file, bit(a));
        flip(&mut file, bit(b));
        assert!(Reader::open(&file[..]).is_err(), "bits {a} and {b}");
        flip(&mut file, bit(a));
        flip(&mut file, bit(b));
    };
    (0..bits).flat_map(|a| (a + 1..bits).map(move |b| (a, b))).for_each(&mut check);
    tell("two bits flipped in header and footer", (bits * (bits - 1) / 2) as u64, 2_096_128, began);
}
