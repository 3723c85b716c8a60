//! Structures that are swapped, duplicated, moved or taken from another file. All checksums are valid.

use super::fat::*;
use super::forge::*;
use crate::testing::*;
use crate::*;
use std::time::Instant;

/// The byte ranges of the sections with a tag, with padding. The range of a block includes its parts.
fn sections(file: &[u8], tag: &[u8; 4]) -> Vec<std::ops::Range<usize>> {
    let mut starts: Vec<usize> = (128..file.len() - 128).step_by(64).filter(|&at| is_section(&file[at..])).collect();
    starts.push(file.len() - 128);
    let ranges = starts.windows(2).map(|pair| pair[0]..pair[1]);
    ranges.filter(|range| file[range.start..].starts_with(tag)).collect()
}

fn is_section(bytes: &[u8]) -> bool {
    [b"STRT", b"BLCK", b"LEAF", b"WNDW", b"WEND", b"META", b"ROOT"].iter().any(|tag| bytes.starts_with(&tag[..]))
}

/// The file with its actual length in the footer.
fn resized(mut file: Vec<u8>) -> Vec<u8> {
    let (len, footer) = (file.len(), file.len() - 128);
    file[footer + 16..footer + 24].copy_from_slice(&(len as u64).to_le_bytes());
    let sum = xxhash_rust::xxh3::xxh3_64(&file[footer..footer + 112]);
    file[footer + 112..footer + 120].copy_from_slice(&sum.to_le_bytes());
    file
}

#[test]
fn swapped_duplicated_dropped_and_foreign_sections_are_refused_and_recovered() {
    let (original, other, began) = (fat(), strange(FileId([3; 16])), Instant::now());
    let mut tries = 0;
    let mut check = |file: Vec<u8>| {
        if file != original.file {
            let file = resized(file);
            assert!(read_all(&file).is_err());
            original.check_prefix(&file);
            assert!(original.check_recovery(&file));
            tries += 1;
        }
    };
    let file = &original.file;
    for tag in [b"BLCK", b"LEAF", b"WNDW", b"WEND"] {
        let all = sections(file, tag);
        for (number, a) in all.iter().enumerate() {
            let (before, own, after) = (&file[..a.start], &file[a.clone()], &file[a.end..]);
            check([before, own, own, after].concat());
            check([before, after].concat());
            for b in &all[number + 1..] {
                let between = &file[a.end..b.start];
                check([before, &file[b.clone()], between, own, &file[b.end..]].concat());
                check([before, between, own, &file[b.start..]].concat());
                check([before, &file[b.clone()], after].concat());
            }
            for foreign in sections(&other, tag) {
                check([before, &other[foreign], after].concat());
            }
        }
    }
    tell("sections swapped, doubled, dropped, moved, spliced", tries, 800, began);
}

/// Only the references to them distinguish such sections from the file's own, so resuming and recovery cannot notice.
#[test]
fn sections_of_another_file_that_claims_the_same_identity_are_refused() {
    let (Original { file, .. }, other, began) = (fat(), strange(ID), Instant::now());
    let mut tries = 0;
    for tag in [b"STRT", b"BLCK", b"LEAF", b"WNDW", b"WEND", b"META", b"ROOT"] {
        for (own, foreign) in sections(&file, tag).into_iter().zip(sections(&other, tag)) {
            if file[own.clone()] != other[foreign.clone()] {
                let spliced = resized([&file[..own.start], &other[foreign], &file[own.end..]].concat());
                assert!(read_all(&spliced).is_err());
                tries += 1;
            }
        }
    }
    tell("sections of another file of the same identity", tries, 25, began);
}

/// A file like [`fat`] with other content.
fn strange(id: FileId) -> Vec<u8> {
    let mut metadata = fat().metadata;
    let blocks = blocks(&mut metadata, 99);
    write_but(&metadata, blocks.iter().map(|(block, _)| block), id, None).expect("complete").0
}

/// Reorders the entries of a leaf or of the root. The leaf's blocks stay in place.
#[test]
fn swapped_and_duplicated_entries_are_refused() {
    let (original, began) = (fat(), Instant::now());
    let (pieces, mut tries) = (Pieces::new(&original.file), 0);
    for (piece, number, len) in pieces.sizes() {
        let size = match piece {
            Piece::Root => 128,
            Piece::Entry if len > 64 => 56,
            _ => continue,
        };
        let start = len % size;
        for (a, b) in (start..len).step_by(size).flat_map(|a| (start..len).step_by(size).map(move |b| (a, b))) {
            for double in [true, false] {
                let mut changed = false;
                let file = pieces.forge(&mut |p, n, bytes| {
                    if (p, n) == (piece, number) {
                        let (own, other) = (bytes[a..a + size].to_vec(), bytes[b..b + size].to_vec());
                        changed = own != other;
                        bytes[a..a + size].copy_from_slice(&other);
                        if !double {
                            bytes[b..b + size].copy_from_slice(&own);
                        }
                    }
                });
                assert!(!changed || read_all(&file).is_err(), "{piece:?} {number} {a} {b}");
                tries += u64::from(changed);
            }
        }
    }
    tell("directory entries swapped and doubled", tries, 200, began);
}

/// Exchanges parts of one kind and size between two files, whose ids are different or equal.
#[test]
fn parts_of_another_file_are_refused_unless_it_has_the_same_identity_and_block() {
    let (original, began) = (fat(), Instant::now());
    let (file, mut tries) = (&original.file, 0);
    let reader = Reader::open(file).expect("whole");
    let entries: Vec<&BlockEntry> = original.blocks.values().map(|(entry, _)| entry).collect();
    let parts = || entries.iter().flat_map(|block| block.parts.iter().map(move |part| (*block, part)));
    for (block, part) in parts() {
        for (_, other) in parts().filter(|(_, other)| *other != part) {
            let PartEntry { offset, stored_len, checksum, raw_len, .. } = *other;
            let forged = PartEntry { offset, stored_len, checksum, raw_len, ..*part };
            assert!(reader.part(block, &forged).is_err(), "{} {}", block.id, part.kind);
            tries += 1;
        }
    }
    tell("parts of other blocks", tries, 1000, began);
}
