//! Any bytes give an error or the right content, without panics and without reads beyond the file.

mod bits;
mod cuts;
mod errors;
mod fat;
mod fields;
mod flips;
mod forge;
mod mutated;
mod overlaps;
mod splices;

use crate::footer::{FOOTER, Footer};
use crate::header::HEADER;
use crate::section::{FRAME, SectionExtent, SectionId, compress_directory, decompress, frame};
use crate::testing::*;
use crate::*;

fn small() -> (Metadata, Vec<u8>) {
    let mut metadata = tiny();
    metadata.dims = [3, 1, 1];
    let blocks = blocks(&mut metadata, 21);
    let file = file(&metadata, &blocks);
    (metadata, file)
}

#[test]
fn every_truncation_is_found() {
    let (_, file) = small();
    for len in 0..file.len() {
        assert!(Reader::open(&file[..len]).is_err(), "cut to {len} bytes");
    }
}

#[test]
fn wrong_lengths_are_named() {
    let (_, file) = small();
    let message = |bytes: &[u8]| Reader::open(bytes).expect_err("wrong length").to_string();
    assert!(message(&file[..60]).contains("68 bytes of it and everything after it are missing"));
    assert!(message(&[&file[..], &[7; 100]].concat()).contains("100 bytes too long"));
    assert!(message(&[&file[..HEADER], &file[HEADER + 64..]].concat()).contains("64 bytes too short"));
    assert!(message(&file[..file.len() - 200]).contains("end magic"));
    assert!(message(b"").contains("empty"));
}

#[test]
fn every_flipped_bit_is_found() {
    let (_, mut file) = small();
    for bit in 0..8 * file.len() {
        file[bit / 8] ^= 1 << (bit % 8);
        assert!(verify(&file).is_err(), "bit {} of byte {}", bit % 8, bit / 8);
        file[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(verify(&file).is_ok());
}

#[test]
fn swapped_and_foreign_parts_are_found() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 7);
    let file = file(&metadata, &blocks);
    let reader = Reader::open(&file).expect("whole");
    let entries = reader.leaf(&reader.leaves(0)[0]).expect("whole");
    let parts = || entries.iter().flat_map(|block| block.parts.iter().map(move |part| (block, part)));
    let twin = |part: &PartEntry, other: &PartEntry| {
        other.offset != part.offset && (other.stored_len, other.raw_len) == (part.stored_len, part.raw_len)
    };
    let pair = parts().find_map(|(block, part)| Some((block, part, parts().find(|(_, other)| twin(part, other))?.1)));
    let (block, part, other) = pair.expect("two parts of one size");
    let forged = PartEntry { offset: other.offset, checksum: other.checksum, ..*part };
    assert!(matches!(reader.part(block, &forged), Err(Error::Corrupt { what, .. }) if what.contains("checksum")));
    assert_ne!(SectionId::Root.checksum(ID, b"x"), SectionId::Root.checksum(FileId([1; 16]), b"x"));
    assert_ne!(SectionId::Root.checksum(ID, b"x"), SectionId::Metadata.checksum(ID, b"x"));
}

/// The pieces of a file, to be changed and reassembled with valid checksums.
struct Pieces {
    file: Vec<u8>,
    footer: Footer,
}

impl Pieces {
    fn new(file: &[u8]) -> Self {
        let footer = file.last_chunk::<FOOTER>().map(Footer::decode).expect("a footer").expect("whole");
        Self { file: file.to_vec(), footer }
    }

    fn stored(&self, extent: SectionExtent) -> &[u8] {
        &self.file[extent.offset as usize + FRAME..extent.end() as usize]
    }

    fn root(&self) -> Vec<u8> {
        decompress(self.stored(self.footer.root), self.footer.root.raw_len).expect("whole")
    }

    /// The file with changed metadata and root and valid checksums.
    fn forge(&self, record: &[u8], root: &[u8]) -> Vec<u8> {
        let mut out = self.file[..self.footer.metadata.offset as usize].to_vec();
        let mut section = |owner: SectionId, stored: &[u8], raw_len: usize| {
            let (stored_len, raw_len) = (stored.len() as u32, raw_len as u32);
            let checksum = owner.checksum(ID, stored);
            let extent = SectionExtent { offset: out.len() as u64, stored_len, raw_len, checksum };
            out.extend(frame(owner, &extent));
            out.extend(stored);
            out.resize(out.len().next_multiple_of(64), 0);
            extent
        };
        let metadata = section(SectionId::Metadata, record, record.len());
        let root = section(SectionId::Root, &compress_directory(root).expect("memory"), root.len());
        let total = (out.len() + FOOTER) as u64;
        out.extend(Footer { total, metadata, root, ..self.footer }.encode());
        out
    }
}

/// Replaces 1, 2, 4 or 8 bytes at every offset with extreme values.
fn extremes(record: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    let values: [&[u8]; 7] = [&[0], &[0xFF], &[0xFF; 2], &[0xFF; 4], &[0, 0, 0, 0x80], &[0xFF; 8], &[0; 8]];
    (0..record.len()).flat_map(move |at| {
        values.into_iter().filter(move |&value| at + value.len() <= record.len()).map(move |value: &[u8]| {
            let mut changed = record.to_vec();
            changed[at..at + value.len()].copy_from_slice(value);
            changed
        })
    })
}

#[test]
fn forged_metadata_and_roots_are_safe() {
    let (_, file) = small();
    let pieces = Pieces::new(&file);
    let (record, root) = (pieces.stored(pieces.footer.metadata).to_vec(), pieces.root());
    assert_eq!(pieces.forge(&record, &root), file);
    for record in extremes(&record) {
        let _ = verify(&pieces.forge(&record, &root));
    }
    for changed in extremes(&root).filter(|changed| *changed != root) {
        assert!(verify(&pieces.forge(&record, &changed)).is_err());
    }
}

#[test]
fn forged_leaves_are_refused() {
    let (_, file) = small();
    let pieces = Pieces::new(&file);
    let (record, root) = (pieces.stored(pieces.footer.metadata).to_vec(), pieces.root());
    let leaf = Reader::open(&file).expect("whole").leaves(0)[0];
    let raw = decompress(pieces.stored(leaf.extent()), leaf.raw_len).expect("whole");
    for changed in extremes(&raw).filter(|changed| *changed != raw) {
        let stored = compress_directory(&changed).expect("memory");
        let owner = SectionId::Leaf(leaf.first());
        let (stored_len, checksum) = (stored.len() as u32, owner.checksum(ID, &stored));
        let extent = SectionExtent { offset: leaf.offset, stored_len, raw_len: changed.len() as u32, checksum };
        let mut forged = file[..leaf.offset as usize].to_vec();
        forged.extend(frame(owner, &extent));
        forged.extend(stored);
        forged.resize(forged.len().next_multiple_of(64), 0);
        let (mut entry, mut encoded) = (leaf, Vec::new());
        entry.set_extent(&extent);
        entry.encode(&mut encoded);
        let offset = forged.len() as u64;
        let footer = Footer { metadata: SectionExtent { offset, ..pieces.footer.metadata }, ..pieces.footer };
        let changed = Pieces { file: forged, footer };
        assert!(verify(&changed.forge(&record, &[&encoded[..], &root[encoded.len()..]].concat())).is_err());
    }
}

#[test]
fn forged_headers_and_footers_are_safe() {
    let (_, file) = small();
    let fix = |bytes: &mut [u8]| {
        let (fields, checksum) = bytes.split_at_mut(bytes.len() - 8);
        checksum.copy_from_slice(&xxhash_rust::xxh3::xxh3_64(fields).to_le_bytes());
    };
    for mut header in extremes(&file[..HEADER]) {
        fix(&mut header);
        let _ = verify(&[&header[..], &file[HEADER..]].concat());
    }
    let start = file.len() - FOOTER;
    for mut footer in extremes(&file[start..]).filter(|footer| footer[..112] != file[start..start + 112]) {
        fix(&mut footer[..120]);
        assert!(verify(&[&file[..start], &footer[..]].concat()).is_err());
    }
}

#[test]
fn windows_claimed_to_be_lost_take_no_memory() {
    let fat::Original { file, .. } = fat::lean();
    let bomb = forge::Pieces::new(&file).forge(&mut |piece, number, bytes| match (piece, number) {
        (forge::Piece::Metadata, _) => bytes[0] = 0xFF,
        (forge::Piece::Window, 3) => {
            bytes[..4].copy_from_slice(&[0xFF; 4]);
            bytes[4..12].copy_from_slice(&(1u64 << 40).to_le_bytes());
        }
        _ => {}
    });
    let _ = Recovery::search(&bomb, &mut |_| {});
    let many = forge::Pieces::new(&file).forge(&mut |piece, number, bytes| match (piece, number) {
        (forge::Piece::Metadata, _) => bytes[0] = 0xFF,
        (forge::Piece::Window, 3) => {
            bytes[..4].copy_from_slice(&2000u32.to_le_bytes());
            bytes[4..12].copy_from_slice(&2007u64.to_le_bytes());
        }
        (forge::Piece::End, 3) => bytes[..4].copy_from_slice(&2000u32.to_le_bytes()),
        _ => {}
    });
    assert!(matches!(Recovery::search(&many, &mut |_| {}), Err(Error::Invalid(what)) if what.contains("too short")));
    let large = forge::Pieces::new(&file).forge(&mut |piece, _, bytes| {
        if matches!(piece, forge::Piece::Metadata | forge::Piece::Start) {
            bytes[..24].copy_from_slice(&[1u64 << 31, 1, 1].map(u64::to_le_bytes).concat());
        }
    });
    assert!(matches!(Recovery::search(&large, &mut |_| {}), Err(Error::Invalid(what)) if what.contains("too short")));
}
