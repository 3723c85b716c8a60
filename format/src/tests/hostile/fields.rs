//! FieldReader of extreme values; checksums fit.

use super::fat::*;
use super::forge::*;
use crate::testing::*;
use crate::*;
use std::time::Instant;

/// Offsets and sizes of the fields of a piece, by `FORMAT.md`. In records, a field may begin at every byte.
fn fields(piece: Piece, len: usize) -> Vec<(usize, usize)> {
    let at = |sizes: &[usize]| {
        let starts = sizes.iter().scan(0, |next, size| {
            *next += size;
            Some((*next - size, *size))
        });
        starts.collect::<Vec<_>>()
    };
    let block = [4, 4, 2, 2, 4, 8, 8, 8, 8, 8, 8];
    let part = [1, 1, 2, 4, 4, 4, 8, 8, 8, 8, 8];
    match piece {
        Piece::Header => at(&[8, 2, 2, 4, 8, 8, 8, 8]),
        Piece::Footer => at(&[8, 8, 8, 8, 4, 4, 8, 8, 4, 4, 8, 8, 8, 8, 8, 8, 8, 8]),
        Piece::Frame => at(&[4, 4, 4, 4, 8]),
        Piece::Entry => at(&[&block[..], &part.repeat((len - 64) / 56)].concat()),
        Piece::Leaf => at(&block),
        Piece::Root => at(&[&[4, 4, 2, 2, 4, 4, 4][..], &[8; 13]].concat().repeat(len / 128)),
        Piece::Start | Piece::Window | Piece::End | Piece::Metadata => {
            let sized = |size: usize| (0..=len.saturating_sub(size)).map(move |at| (at, size));
            sized(8).chain(sized(4)).chain(sized(2)).collect()
        }
        Piece::Raw | Piece::Stored => Vec::new(),
    }
}

/// The values to try for a field of a size; `was` is its value.
fn values(file: &[u8], size: usize, was: u64) -> Vec<u64> {
    let (len, most) = (file.len() as u64, u64::MAX >> (64 - 8 * size));
    let mut all = vec![0, 1, most, most - 1, 1 << 31, (1 << 32) - 1, 1 << 60, 1 << 63, len - 1, len, len + 1];
    all.extend([was.wrapping_add(1), was.wrapping_sub(1), f64::NAN.to_bits(), f64::INFINITY.to_bits()]);
    all.iter_mut().for_each(|value| *value &= most);
    all.sort_unstable();
    all.dedup();
    all.retain(|value| *value != was);
    all
}

/// Every piece with its content.
fn contents(pieces: &Pieces) -> Vec<(Piece, usize, Vec<u8>)> {
    let mut found = Vec::new();
    pieces.forge(&mut |piece, number, bytes| found.push((piece, number, bytes.clone())));
    found
}

#[test]
fn extreme_fields_are_refused_or_change_nothing() {
    let (original, began) = (lean(), Instant::now());
    let pieces = Pieces::new(&original.file);
    let before = format!("{:?}", read_all(&original.file).expect("whole"));
    let (mut tries, mut slowest) = (0, 0.0f64);
    for (piece, number, content) in contents(&pieces) {
        for (at, size) in fields(piece, content.len()) {
            let was = (0..size).fold(0, |was, byte| was | u64::from(content[at + byte]) << (8 * byte));
            for value in values(&original.file, size, was) {
                let start = Instant::now();
                let file = pieces.forge(&mut |p, n, bytes| {
                    if (p, n) == (piece, number) {
                        bytes[at..at + size].copy_from_slice(&value.to_le_bytes()[..size]);
                    }
                });
                let read = read_all(&file);
                if let (Ok(read), Piece::Header | Piece::Footer | Piece::Frame | Piece::Root) = (read, piece) {
                    assert_eq!(format!("{read:?}"), before, "{piece:?} {number} {at}");
                }
                let _ = CompletePrefix::read(&file);
                if tries % 8 == 0 {
                    let _ = recover(&file);
                }
                slowest = slowest.max(start.elapsed().as_secs_f64());
                tries += 1;
            }
        }
    }
    assert!(slowest < 1.0, "{slowest} s");
    tell("fields set to extremes", tries, 50_000, began);
}
