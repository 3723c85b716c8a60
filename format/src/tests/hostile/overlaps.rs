//! Parts, blocks, leaves and sections whose extents overlap or point to other content. All checksums are valid.

use super::fat::*;
use super::forge::*;
use crate::testing::*;
use crate::*;
use std::time::Instant;

/// Offsets of every section and part, and the bytes next to them; the end of the file, and offsets beyond it.
fn places(original: &Original) -> Vec<u64> {
    let len = original.file.len() as u64;
    let parts = original.blocks.values().flat_map(|(entry, _)| &entry.parts).map(|part| part.offset);
    let reader = Reader::open(&original.file).expect("whole");
    let windows = 0..original.metadata.windows.len() as u32;
    let leaves = windows.flat_map(|window| reader.leaves(window)).flat_map(|leaf| [leaf.data_offset, leaf.offset]);
    let all = parts.chain(leaves).flat_map(|place| [place - 1, place, place + 1, place + 64]);
    all.chain([0, 1, 32, 128, len - 128, len - 1, len, len + 1, 1 << 32, 1 << 63, u64::MAX - 63, u64::MAX]).collect()
}

/// The bytes of the file at a place; fewer at its end.
fn at(file: &[u8], place: u64, len: u32) -> &[u8] {
    let from = usize::try_from(place).map_or(file.len(), |place| place.min(file.len()));
    &file[from..(from + len as usize).min(file.len())]
}

/// The file with one field of 8 bytes of a piece replaced and, if given, the checksum after it.
fn moved(pieces: &Pieces, which: (Piece, usize), field: usize, place: u64, sum: Option<(usize, u64)>) -> Vec<u8> {
    pieces.forge(&mut |piece, number, bytes| {
        if (piece, number) == which {
            put(bytes, field, &place.to_le_bytes());
            if let Some((at, sum)) = sum {
                put(bytes, at, &sum.to_le_bytes());
            }
        }
    })
}

#[test]
fn parts_that_overlap_or_are_elsewhere_are_refused() {
    let (original, began) = (lean(), Instant::now());
    let (pieces, places, mut tries) = (Pieces::new(&original.file), places(&original), 0);
    for (number, (entry, _)) in original.blocks.values().enumerate() {
        let block = entry.encoded();
        for (field, part) in (64..).step_by(56).zip(&entry.parts) {
            for place in places.iter().filter(|place| **place != part.offset) {
                let sum = checksum(&ID.0, &block, part.kind.code(), at(&original.file, *place, part.stored_len));
                let file = moved(&pieces, (Piece::Entry, number), field + 16, *place, Some((field + 24, sum)));
                assert!(read_all(&file).is_err(), "{} {} at {place}", entry.id, part.kind);
                let _ = (CompletePrefix::read(&file), recover(&file));
                tries += 1;
            }
        }
    }
    tell("parts elsewhere", tries, 300, began);
}

#[test]
fn leaves_and_sections_that_overlap_or_are_elsewhere_are_refused() {
    let (original, began) = (lean(), Instant::now());
    let (pieces, places, mut tries) = (Pieces::new(&original.file), places(&original), 0);
    let leaves = (0..original.metadata.windows.len()).flat_map(|leaf| [128 * leaf + 24, 128 * leaf + 32]);
    let fields = leaves.map(|field| (Piece::Root, field)).chain([(Piece::Footer, 24), (Piece::Footer, 48)]);
    for ((piece, field), place) in fields.flat_map(|field| places.iter().map(move |place| (field, *place))) {
        let file = moved(&pieces, (piece, 0), field, place, None);
        assert!(file == original.file || read_all(&file).is_err(), "{piece:?} {field} at {place}");
        tries += 1;
    }
    tell("leaves, metadata and root elsewhere", tries, 500, began);
}

/// Leaves of one size that claim each other's blocks, sections and sums under their own number.
#[test]
fn leaves_that_share_their_blocks_are_refused() {
    let original = fat();
    let (pieces, mut tries) = (Pieces::new(&original.file), 0);
    let leaves = 2 * original.metadata.windows.len();
    for (a, b) in (0..leaves).flat_map(|a| (0..leaves).map(move |b| (a, b))).filter(|(a, b)| a != b) {
        let file = pieces.forge(&mut |piece, _, bytes| {
            if piece == Piece::Root {
                bytes.copy_within(128 * b + 10..128 * (b + 1), 128 * a + 10);
            }
        });
        assert!(read_all(&file).is_err(), "leaf {a} is {b}");
        tries += 1;
    }
    assert_eq!(tries, 56);
}

/// A file within a file: everything in it is intact but not at the offsets that it states.
#[test]
fn files_before_or_after_a_file_are_refused() {
    let Original { file, .. } = lean();
    let both = [&file[..], &file[..]].concat();
    assert!(matches!(Reader::open(&both), Err(Error::Corrupt { place, .. }) if place == "footer"));
    let mut told = both.clone();
    let footer = told.len() - 128;
    let len = (told.len() as u64).to_le_bytes();
    put(&mut told, footer + 16, &len);
    let sum = xxhash_rust::xxh3::xxh3_64(&told[footer..footer + 112]);
    put(&mut told, footer + 112, &sum.to_le_bytes());
    assert!(Reader::open(&told).is_err());
    assert_eq!(recover(&both).expect("whole").0, file);
}
