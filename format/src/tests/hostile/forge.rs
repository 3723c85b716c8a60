//! Takes a file apart, changes a piece and reassembles the file with valid checksums, lengths and offsets. Follows
//! `FORMAT.md` alone.
//!
//! Everything that depends on the changed piece is updated, as an attacker would do.

use std::cell::RefCell;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// The pieces of a file that can be changed before the structures that cover them are rebuilt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Piece {
    Header,
    Start,
    /// The frame of any section.
    Frame,
    /// A part before compression, and after.
    Raw,
    Stored,
    Entry,
    /// The raw bytes of a leaf.
    Leaf,
    Window,
    End,
    Metadata,
    /// The raw bytes of the root.
    Root,
    Footer,
}

/// Changes a piece, given its kind and its number, counted from 0 in the file.
pub(crate) type Change<'a> = &'a mut dyn FnMut(Piece, usize, &mut Vec<u8>);

/// Bytes and their compressed form.
#[derive(Clone)]
struct Packed {
    raw: Vec<u8>,
    stored: Vec<u8>,
}

#[derive(Clone)]
struct Block {
    entry: Vec<u8>,
    parts: Vec<Packed>,
}

#[derive(Clone)]
enum Section {
    Start(Vec<u8>),
    Block(Block),
    Leaf(Packed),
    Window(Vec<u8>),
    End(Vec<u8>),
    Metadata(Vec<u8>),
    Root(Packed),
}

/// A file taken apart.
pub(crate) struct Pieces {
    header: Vec<u8>,
    sections: Vec<Section>,
    footer: Vec<u8>,
    compressor: RefCell<zstd::bulk::Compressor<'static>>,
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).map_or(0, |four| u32::from_le_bytes(four.try_into().expect("four")))
}

pub(crate) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..at + 8).map_or(0, |eight| u64::from_le_bytes(eight.try_into().expect("eight")))
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_bits(u64_at(bytes, at))
}

pub(crate) fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}

fn packed(stored: &[u8], raw_len: u32) -> Packed {
    let raw = zstd::bulk::decompress(stored, raw_len as usize).expect("whole");
    Packed { raw, stored: stored.to_vec() }
}

/// The checksum of stored bytes of a block. `block` is the first ten bytes of its entry.
pub(crate) fn checksum(file: &[u8], block: &[u8], kind: [u8; 2], stored: &[u8]) -> u64 {
    let seed = [file, &block[..10], &kind].concat();
    xxh3_64_with_seed(stored, xxh3_64(&seed))
}

impl Pieces {
    pub(crate) fn new(file: &[u8]) -> Self {
        let (body, footer) = file.split_at(file.len() - 128);
        let (mut sections, mut at) = (Vec::new(), 128);
        while at < body.len() {
            at += section(&body[at..], &mut sections);
            at = at.next_multiple_of(64);
        }
        let mut compressor = zstd::bulk::Compressor::new(3).expect("level 3");
        compressor.include_checksum(true).expect("known");
        let compressor = RefCell::new(compressor);
        Self { header: body[..128].to_vec(), sections, footer: footer.to_vec(), compressor }
    }

    /// The kind, number and length of every piece.
    pub(crate) fn sizes(&self) -> Vec<(Piece, usize, usize)> {
        let mut sizes = Vec::new();
        self.forge(&mut |piece, number, bytes| sizes.push((piece, number, bytes.len())));
        sizes
    }

    /// The file with the changes.
    pub(crate) fn forge(&self, change: Change<'_>) -> Vec<u8> {
        let mut forger = Forger { pieces: self, change, counts: [0; 12], out: Vec::new(), leaves: Vec::new() };
        let mut header = self.header.clone();
        forger.change(Piece::Header, &mut header);
        let sum = xxh3_64(&header[..header.len().min(120)]);
        put(&mut header, 120, &sum.to_le_bytes());
        forger.out.extend(header);
        let (mut blocks, mut footer) = (Vec::new(), self.footer.clone());
        for section in &self.sections {
            forger.section(section, &mut blocks, &mut footer);
        }
        forger.footer(footer);
        forger.out
    }
}

/// Takes a section apart; returns its length.
fn section(bytes: &[u8], sections: &mut Vec<Section>) -> usize {
    let (stored_len, raw_len) = (u32_at(bytes, 4) as usize, u32_at(bytes, 8));
    let stored = &bytes[24..24 + stored_len];
    let mut len = 24 + stored_len;
    sections.push(match &bytes[..4] {
        b"STRT" => Section::Start(stored.to_vec()),
        b"BLCK" => {
            let mut part = |entry: &[u8]| {
                let stored = &bytes[len..len + u32_at(entry, 4) as usize];
                len += stored.len();
                packed(stored, u32_at(entry, 8))
            };
            Section::Block(Block { parts: stored[64..].chunks(56).map(&mut part).collect(), entry: stored.to_vec() })
        }
        b"LEAF" => Section::Leaf(packed(stored, raw_len)),
        b"WNDW" => Section::Window(stored.to_vec()),
        b"WEND" => Section::End(stored.to_vec()),
        b"META" => Section::Metadata(stored.to_vec()),
        _ => Section::Root(packed(stored, raw_len)),
    });
    len
}

/// The file as far as it is reassembled.
struct Forger<'a, 'b> {
    pieces: &'a Pieces,
    change: Change<'b>,
    counts: [usize; 12],
    out: Vec<u8>,
    /// The root's entries.
    leaves: Vec<u8>,
}

/// The entries of a leaf before and after the change, and the offset of its first block.
type Blocks = Vec<(Vec<u8>, Vec<u8>, usize)>;

impl Forger<'_, '_> {
    fn change(&mut self, piece: Piece, bytes: &mut Vec<u8>) {
        let count = &mut self.counts[piece as usize];
        (self.change)(piece, *count, bytes);
        *count += 1;
    }

    fn section(&mut self, section: &Section, blocks: &mut Blocks, footer: &mut [u8]) {
        match section {
            Section::Start(record) => drop(self.record(Piece::Start, record, 20)),
            Section::Block(block) => self.block(block, blocks),
            Section::Leaf(leaf) => self.leaf(leaf, blocks),
            Section::Window(record) => drop(self.record(Piece::Window, record, 21)),
            Section::End(record) => drop(self.record(Piece::End, record, 22)),
            Section::Metadata(record) => put(footer, 24, &self.record(Piece::Metadata, record, 18)),
            Section::Root(root) => put(footer, 48, &self.root(root)),
        }
    }

    /// Writes the section of a record; a window's record states its own window. Returns offset, lengths and checksum as in
    /// the footer.
    fn record(&mut self, piece: Piece, record: &[u8], kind: u8) -> [u8; 24] {
        let mut record = record.to_vec();
        self.change(piece, &mut record);
        let mut owner = [0; 10];
        if kind > 20 {
            put(&mut owner, 0, &u32_at(&record, 0).to_le_bytes());
        }
        let tag = [b"META", b"ROOT", b"STRT", b"WNDW", b"WEND"][usize::from(kind - 18)];
        self.put_section(tag, &owner, kind, &record, record.len())
    }

    fn put_section(&mut self, tag: &[u8; 4], owner: &[u8], kind: u8, stored: &[u8], raw_len: usize) -> [u8; 24] {
        let (place, sum) = (self.out.len() as u64, checksum(&self.pieces.header[32..48], owner, [kind, 0], stored));
        let mut extent = [0; 24];
        put(&mut extent, 0, &place.to_le_bytes());
        put(&mut extent, 8, &(stored.len() as u32).to_le_bytes());
        put(&mut extent, 12, &(raw_len as u32).to_le_bytes());
        put(&mut extent, 16, &sum.to_le_bytes());
        let mut frame = [&tag[..], &extent[8..16], &[0; 4], &extent[16..]].concat();
        self.change(Piece::Frame, &mut frame);
        self.out.extend(frame);
        self.out.extend(stored);
        self.pad();
        extent
    }

    fn pad(&mut self) {
        self.out.resize(self.out.len().next_multiple_of(64), 0);
    }

    /// Changes a piece; returns it uncompressed and compressed.
    fn compress(&mut self, piece: Piece, packed: &Packed, mut raw: Vec<u8>) -> (Vec<u8>, Vec<u8>) {
        self.change(piece, &mut raw);
        if raw == packed.raw {
            return (raw, packed.stored.clone());
        }
        let stored = self.pieces.compressor.borrow_mut().compress(&raw).expect("memory");
        (raw, stored)
    }

    fn block(&mut self, block: &Block, blocks: &mut Blocks) {
        let (start, mut entry, mut parts) = (self.out.len(), block.entry.clone(), Vec::new());
        for (number, part) in block.parts.iter().enumerate() {
            let (raw, mut stored) = self.compress(Piece::Raw, part, part.raw.clone());
            self.change(Piece::Stored, &mut stored);
            let at = 64 + 56 * number;
            let kind = [block.entry[at], block.entry[at + 1]];
            let sum = checksum(&self.pieces.header[32..48], &block.entry, kind, &stored);
            let place = (start + 24 + entry.len() + parts.len()) as u64;
            put(&mut entry, at + 4, &(stored.len() as u32).to_le_bytes());
            put(&mut entry, at + 8, &(raw.len() as u32).to_le_bytes());
            put(&mut entry, at + 16, &place.to_le_bytes());
            put(&mut entry, at + 24, &sum.to_le_bytes());
            parts.extend(stored);
        }
        self.change(Piece::Entry, &mut entry);
        self.put_section(b"BLCK", &block.entry, 16, &entry, entry.len());
        self.out.truncate(start + 24 + entry.len());
        self.out.extend(parts);
        self.pad();
        blocks.push((block.entry.clone(), entry, start));
    }

    fn leaf(&mut self, leaf: &Packed, blocks: &mut Blocks) {
        let raw = blocks.iter().flat_map(|(_, entry, _)| entry).copied().collect();
        let (raw, stored) = self.compress(Piece::Leaf, leaf, raw);
        let (first, _, start) = blocks[0].clone();
        let extent = self.put_section(b"LEAF", &first, 17, &stored, raw.len());
        let mut entry = vec![0; 128];
        put(&mut entry, 0, &first[..10]);
        put(&mut entry, 10, &(blocks.len() as u16).to_le_bytes());
        put(&mut entry, 12, &extent[8..16]);
        put(&mut entry, 24, &(start as u64).to_le_bytes());
        put(&mut entry, 32, &extent[..8]);
        put(&mut entry, 40, &extent[16..]);
        sum_up(&raw, blocks.len(), &mut entry);
        self.leaves.extend(entry);
        blocks.clear();
    }

    fn root(&mut self, root: &Packed) -> [u8; 24] {
        let raw = std::mem::take(&mut self.leaves);
        let (raw, stored) = self.compress(Piece::Root, root, raw);
        self.put_section(b"ROOT", &[0; 10], 19, &stored, raw.len())
    }

    fn footer(&mut self, mut footer: Vec<u8>) {
        let total = (self.out.len() + 128) as u64;
        put(&mut footer, 16, &total.to_le_bytes());
        self.change(Piece::Footer, &mut footer);
        let sum = xxh3_64(&footer[..footer.len().min(112)]);
        put(&mut footer, 112, &sum.to_le_bytes());
        self.out.extend(footer);
    }
}

/// Updates the sums in a leaf's entry, as far as its blocks' entries can be parsed.
fn sum_up(raw: &[u8], blocks: usize, leaf: &mut [u8]) {
    let (mut range, mut reached, mut floats) = ((f64::INFINITY, f64::NEG_INFINITY), 0.0f64, [0.0; 3]);
    let (mut exact, mut counts, mut rest) = (0u32, [0u64; 4], raw);
    for _ in 0..blocks {
        range = (range.0.min(f64_at(rest, 24)), range.1.max(f64_at(rest, 32)));
        reached = reached.max(f64_at(rest, 40));
        floats[0] += f64_at(rest, 48);
        floats[2] += f64_at(rest, 56);
        counts[3] += u64::from(u32_at(rest, 12));
        let parts = u32_at(rest, 8) as usize >> 16;
        let (entry, after) = rest.split_at(rest.len().min(64 + 56 * parts));
        for part in entry.get(64..).unwrap_or_default().chunks(56) {
            let kind = usize::from(part[0]);
            exact += u32::from(kind == 3);
            floats[1] += if kind == 0 { f64_at(part, 40) } else { 0.0 };
            if kind < 3 {
                counts[kind] = counts[kind].saturating_add(u64_at(part, 32));
            }
        }
        rest = after;
    }
    put(leaf, 20, &exact.to_le_bytes());
    let floats = [range.0, range.1, reached, floats[0], floats[1], floats[2]].map(f64::to_le_bytes);
    put(leaf, 48, floats.as_flattened());
    put(leaf, 96, counts.map(u64::to_le_bytes).as_flattened());
}
