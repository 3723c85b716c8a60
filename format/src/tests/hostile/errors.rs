//! Provokes every kind of error.

use super::fat::*;
use super::forge::*;
use crate::limits::*;
use crate::testing::*;
use crate::*;
use std::io;

/// Storage that fails beyond an offset.
#[derive(Debug)]
struct Failing(Vec<u8>, u64);

impl Storage for Failing {
    fn len(&self) -> u64 {
        Storage::len(&self.0)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let whole = offset + out.len() as u64 <= self.1;
        if whole { self.0.read_at(offset, out) } else { Err(io::Error::other("a bad sector")) }
    }
}

#[test]
fn failing_storage_is_not_reported_as_damage() {
    let file = lean().file;
    for from in (0..file.len() as u64).step_by(61) {
        let failing = Failing(file.clone(), from);
        let io = |error: Error| matches!(&error, Error::Io(e) if e.to_string() == "a bad sector");
        assert!(io(Reader::open(&failing).expect_err("fails")), "{from}");
        let resumed = CompletePrefix::read(&failing);
        assert!(resumed.map_or_else(io, |found| found.bytes() <= from), "{from}");
        assert!(Recovery::search(&failing, &mut |_| {}).is_err_and(io), "{from}");
    }
}

#[test]
fn files_of_other_formats_are_foreign() {
    for bytes in [&b""[..], b"\x89PNG\r\n\x1a\n", &[0; 4096], b"\x1f\x8b"] {
        assert!(matches!(Reader::open(bytes), Err(Error::Foreign(_))), "{bytes:?}");
        assert!(matches!(CompletePrefix::read(&bytes), Err(Error::Foreign(_))));
    }
}

#[test]
fn damage_is_corrupt_and_names_the_place() {
    let mut file = lean().file;
    file[700] ^= 1;
    let reader = Reader::open(&file).expect("a block alone is damaged");
    let mut found = Vec::new();
    for leaf in (0..4).flat_map(|window| reader.leaves(window)) {
        let blocks = reader.leaf(leaf).expect("whole");
        reader.check_leaf(leaf, &blocks, &mut |error| found.push(error)).expect("memory");
    }
    assert!(matches!(&found[..], [Error::Corrupt { place, .. }] if place.contains("window 0 block 0")), "{found:?}");
}

#[test]
fn newer_files_are_unsupported() {
    let pieces = Pieces::new(&lean().file);
    for (at, value) in [(8, 2), (8, 0), (16, 64), (23, 0x80)] {
        let file = pieces.forge(&mut |piece, _, bytes| {
            if piece == Piece::Header {
                bytes[at] = value;
            }
        });
        assert!(matches!(Reader::open(&file), Err(Error::Unsupported(_))), "{at}");
        assert!(matches!(CompletePrefix::read(&file), Err(Error::Unsupported(_))), "{at}");
        assert!(matches!(Recovery::search(&file, &mut |_| {}), Err(Error::Unsupported(_))), "{at}");
    }
}

#[test]
fn required_features_must_be_announced() {
    for original in [lean(), fat()] {
        let used = original.file[16];
        for announced in (0..32).filter(|bits| bits & 0b10 == 0) {
            let file = Pieces::new(&original.file).forge(&mut |piece, _, bytes| {
                if piece == Piece::Header {
                    bytes[16] = announced;
                }
            });
            match read_all(&file) {
                Ok(_) => assert!(used & !announced == 0),
                Err(e) => assert!(used & !announced != 0 && e.to_string().contains("does not announce"), "{e}"),
            }
        }
    }
}

#[test]
fn sizes_beyond_the_limits_are_too_large() {
    let metadata = Metadata { program: "x".repeat(MAX_METADATA), ..metadata() };
    let fits = |error: Error| matches!(error, Error::TooLarge { size, limit, .. } if size > limit);
    assert!(metadata.encode().is_err_and(fits));
    let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
    let raw = vec![0; MAX_PART_RAW as usize + 1];
    assert!(Compressor::new(1).expect("known").part(PartKind::Exact, stats, &raw).is_err_and(fits));
}

#[test]
fn lost_blocks_and_nonexistent_blocks_are_different_errors() {
    let original = fat();
    let reader = Reader::open(&original.file).expect("whole");
    let lost = &original.blocks.values().find(|(entry, _)| entry.lost).expect("one").0;
    assert!(matches!(reader.check_parts(lost), Err(Error::Lost(id)) if id == lost.id));
    assert!(matches!(reader.check_stored(lost), Err(Error::Lost(_))));
    assert!(matches!(reader.outliers(lost), Err(Error::Lost(_))));
    let last = BlockId::new(u32::MAX, u16::MAX, u32::MAX);
    let first = BlockId::new(0, 0, 0);
    for id in [last, BlockId { window: 4, ..first }, BlockId { block: 4, ..first }, BlockId { channel: 2, ..first }] {
        assert!(matches!(reader.entry(id), Err(Error::Invalid(_))), "{id}");
    }
    let entry = reader.entry(first).expect("there");
    assert!(matches!(reader.codes(&entry, 77, &mut []), Err(Error::Invalid(_))));
}
