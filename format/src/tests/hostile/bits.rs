//! Errors in a few bits: signs of zeros, fields that readers do not use, payloads with forged checksums.

use super::fat::*;
use super::forge::*;
use crate::testing::*;
use crate::*;
use std::time::Instant;

fn put(bytes: &mut [u8], at: usize, value: f64) {
    bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

#[test]
fn lost_blocks_with_statistics_are_refused() {
    let pieces = Pieces::new(&fat().file);
    for (at, value) in [(16, 1.0), (16, -0.0), (24, 1.0), (32, 1.0), (40, 1.0), (48, 1.0), (56, 1.0), (56, -0.0)] {
        let file = pieces.forge(&mut |piece, _, bytes| {
            if piece == Piece::Entry && bytes[12] == 1 {
                put(bytes, at, value);
            }
        });
        assert!(read_all(&file).is_err(), "{value} at {at}");
    }
}

#[test]
fn amounts_of_parts_without_coefficients_are_refused() {
    let pieces = Pieces::new(&fat().file);
    for (kind, at, value) in (1..4).flat_map(|kind| [(kind, 40, 2.0), (kind, 48, 2.0), (kind, 40, -0.0)]) {
        let mut changed = false;
        let file = pieces.forge(&mut |piece, _, bytes| {
            let parts = (64..bytes.len()).step_by(56);
            let found = parts.into_iter().find(|part| piece == Piece::Entry && bytes[*part] == kind);
            if let Some(part) = found.filter(|_| !changed) {
                put(bytes, part + at, value);
                changed = true;
            }
        });
        assert!(changed && read_all(&file).is_err(), "kind {kind}: {value} at {at}");
    }
}

#[test]
fn sums_of_minus_zero_are_refused() {
    let pieces = Pieces::new(&lean().file);
    let mut tries = 0;
    for at in (0..4).flat_map(|leaf| (48..96).step_by(8).map(move |at| 128 * leaf + at)) {
        let mut was_zero = false;
        let file = pieces.forge(&mut |piece, _, bytes| {
            was_zero |= piece == Piece::Root && u64_at(bytes, at) == 0;
            if piece == Piece::Root && u64_at(bytes, at) == 0 {
                put(bytes, at, -0.0);
            }
        });
        assert!(!was_zero || read_all(&file).is_err(), "at {at}");
        tries += u32::from(was_zero);
    }
    assert!(tries > 0);
}

#[test]
fn windows_that_begin_with_minus_zero_are_not_resumed() {
    let file = Pieces::new(&fat().file).forge(&mut |piece, number, bytes| {
        if (piece, number) == (Piece::Window, 1) {
            // a list of two times, and before it eight fields
            let reached = bytes.len() - 8 * (2 + 1) - 8 * 8;
            assert_eq!(u64_at(bytes, reached), 0);
            put(bytes, reached, -0.0);
        }
    });
    assert_eq!(CompletePrefix::read(&file).expect("begun").metadata().windows.len(), 1);
}

#[test]
fn leaves_may_hold_zeros_of_both_signs() {
    let mut metadata = metadata();
    let mut blocks = blocks(&mut metadata, 5);
    for (number, (block, _)) in blocks.iter_mut().enumerate() {
        let zero = if number % 2 == 0 { 0.0 } else { -0.0 };
        (block.stats.min, block.stats.max, block.stats.reached, block.stats.dropped) = (zero, zero, zero, zero);
    }
    let file = file(&metadata, &blocks);
    assert_eq!(verify(&file).expect("whole").len(), blocks.len());
    let leaf = Reader::open(&file).expect("whole").leaves(0)[0];
    assert!(leaf.min.is_sign_negative() && leaf.max.is_sign_positive() && leaf.reached.is_sign_positive());
}

#[test]
fn files_of_sections_that_overlap_are_searched_in_linear_time() {
    let file = lean().file;
    for tag in [b"STRT", b"WNDW", b"META", b"LEAF"] {
        let began = Instant::now();
        let claim = [&tag[..], &(1u32 << 19).to_le_bytes(), &(1u32 << 19).to_le_bytes(), &[0; 12]].concat();
        let bomb = [&file[..], &claim.repeat((4 << 20) / claim.len())].concat();
        let found = Recovery::search(&bomb, &mut |_| {});
        assert!(matches!(found, Err(Error::Invalid(what)) if what.contains("overlap")), "{tag:?}");
        assert!(began.elapsed().as_secs() < 5, "{tag:?}: {:?}", began.elapsed());
    }
}

/// The checksums are valid, so only unpacking finds the damage. Blocks that begin with the nodes of a lost one are lost, too.
#[test]
fn blocks_whose_payloads_cannot_be_unpacked_are_lost() {
    let original = fat();
    let pieces = Pieces::new(&original.file);
    let (whole, mut tries) = (recover(&original.file).expect("whole").1.lost.len(), 0);
    for (_, number, _) in pieces.sizes().into_iter().filter(|(piece, ..)| *piece == Piece::Raw) {
        let file = pieces.forge(&mut |piece, n, bytes| {
            if (piece, n) == (Piece::Raw, number) {
                bytes[0] = bytes[0].wrapping_add(100);
            }
        });
        let reader = Reader::open(&file).expect("parts alone are wrong");
        let check = |id: &BlockId| reader.entry(*id).and_then(|entry| reader.check_parts(&entry));
        let is_wrong = |id: &BlockId| matches!(check(id), Err(Error::Corrupt { .. }));
        let metadata = &original.metadata;
        let is_lost = |entry: &BlockEntry| {
            let begins_above = entry.begins_above(metadata.tiers(entry.id.window));
            is_wrong(&entry.id) || begins_above && is_wrong(&metadata.above(entry.id))
        };
        let expected = original.blocks.values().filter(|(entry, _)| is_lost(entry)).count();
        let lost = recover(&file).expect("most is whole").1.lost.len() - whole;
        assert_eq!(lost, expected, "part {number}");
        tries += lost;
    }
    assert!(tries > 20, "{tries}");
}
