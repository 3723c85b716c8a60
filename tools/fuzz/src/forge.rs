//! Takes a valid file apart, changes it, and reassembles it with updated lengths, offsets, sums and checksums, so that
//! changes reach the code behind the checks. Written from `format/FORMAT.md`, independent of the format's own code.

use super::input::Input;
use std::cell::RefCell;
use wavesplat_format::{Compressor, PartKind, PartStats, Reader};
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

const HEADER: usize = 128;
const FRAME: usize = 24;
const ENTRY: usize = 64;
const PART: usize = 56;
/// The totals of a window's blocks.
const SUMS: usize = 64;

/// A change to a file. All but the first change fields of the file, before sums and checksums are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EditTarget {
    /// Parts of a block: omitted or duplicated.
    Parts,
    Header,
    /// The fields with which both start and metadata begin: grid, type, blocks, channels.
    Grid,
    Start,
    /// A block's entry, before and after its offsets, lengths and checksums are filled in.
    Entry,
    Placed,
    /// The payload of a part.
    Payload,
    Leaf,
    /// A window's record, in its section and in the metadata; and its totals, in both.
    Window,
    End,
    Metadata,
    /// A leaf's entry in the root.
    Root,
    Footer,
    Frame,
    /// The stored bytes of a part.
    Stored,
}

const PLACES: [EditTarget; 15] = [
    EditTarget::Parts,
    EditTarget::Header,
    EditTarget::Grid,
    EditTarget::Start,
    EditTarget::Entry,
    EditTarget::Placed,
    EditTarget::Payload,
    EditTarget::Leaf,
    EditTarget::Window,
    EditTarget::End,
    EditTarget::Metadata,
    EditTarget::Root,
    EditTarget::Footer,
    EditTarget::Frame,
    EditTarget::Stored,
];

/// One change: of the bytes at `at` of the target with this number (counted as the file is written, modulo 256).
#[derive(Debug, Clone)]
pub struct Edit<'a> {
    place: EditTarget,
    number: usize,
    at: usize,
    how: u8,
    value: u8,
    bytes: &'a [u8],
}

/// The changes that an input describes: at most 32, of at least 6 bytes each.
pub fn edits<'a>(input: &mut Input<'a>) -> Vec<Edit<'a>> {
    let mut edits = Vec::new();
    while !input.is_empty() && edits.len() < 32 {
        let (place, number) = (input.pick(&PLACES), input.byte().into());
        let (at, how, value) = (input.short(), input.byte() % 10, input.byte());
        let bytes = if how >= 8 { input.bytes(value.into()) } else { &[] };
        edits.push(Edit { place, number, at, how, value, bytes });
    }
    edits
}

const FLOATS: [f64; 10] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 1.0, -1.0, f64::MAX, f64::MIN_POSITIVE, 1e300, 0.5];
const NUMBERS: [u64; 10] = [0, 1, 2, 1025, 0xFFFF, 0x10000, 0x7FFF_FFFF, 0xFFFF_FFFF, 1 << 53, u64::MAX];

impl Edit<'_> {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let at = self.at % (bytes.len() + 1);
        let number = NUMBERS[usize::from(self.value) % NUMBERS.len()];
        match self.how {
            0 => put(bytes, at, &[self.value]),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= self.value),
            2 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = byte.wrapping_add(self.value)),
            3 => put(bytes, at, &(number as u32).to_le_bytes()),
            4 => put(bytes, at, &number.to_le_bytes()),
            5 => put(bytes, at, &FLOATS[usize::from(self.value) % FLOATS.len()].to_le_bytes()),
            6 => bytes.truncate(at),
            7 => drop(bytes.splice(at..at, std::iter::repeat_n(0, self.value.into()))),
            8 => put(bytes, at, self.bytes),
            _ => {
                bytes.truncate(at);
                bytes.extend(self.bytes);
            }
        }
    }
}

fn put(bytes: &mut [u8], at: usize, value: &[u8]) {
    bytes.iter_mut().skip(at).zip(value).for_each(|(to, from)| *to = *from);
}

/// A piece of a file, without values that are computed from other pieces.
#[derive(Debug, Clone)]
enum Piece {
    Start(Vec<u8>),
    Block { entry: Vec<u8>, parts: Vec<Vec<u8>> },
    Leaf,
    Window(Vec<u8>),
    End(Vec<u8>),
    Metadata(Vec<u8>),
}

/// A valid file in pieces.
#[derive(Debug, Clone)]
pub struct Seed {
    header: Vec<u8>,
    pieces: Vec<Piece>,
}

impl Seed {
    /// Takes apart a file, which must be valid and without times.
    pub fn new(file: &[u8]) -> Self {
        let reader = Reader::open(file).expect("a sound seed");
        let leaves = (0..reader.metadata().windows.len() as u32).flat_map(|window| reader.leaves(window));
        let mut blocks = leaves.flat_map(|leaf| reader.leaf(leaf).expect("a sound seed"));
        let (mut pieces, mut at) = (Vec::new(), HEADER);
        loop {
            let stored = u32_at(file, at + 4) as usize;
            let content = file[at + FRAME..at + FRAME + stored].to_vec();
            let mut end = at + FRAME + stored;
            match &file[at..at + 4] {
                b"STRT" => pieces.push(Piece::Start(content)),
                b"BLCK" => {
                    let block = blocks.next().expect("as many as there are headers");
                    let parts = block.parts.iter().map(|part| reader.part(&block, part).expect("a sound seed"));
                    pieces.push(Piece::Block { entry: content, parts: parts.collect() });
                    end += block.stored_len() as usize;
                }
                b"LEAF" => pieces.push(Piece::Leaf),
                b"WNDW" => pieces.push(Piece::Window(content)),
                b"WEND" => pieces.push(Piece::End(content)),
                b"META" => pieces.push(Piece::Metadata(content)),
                _ => break,
            }
            at = end.next_multiple_of(64);
        }
        Self { header: file[..HEADER - 8].to_vec(), pieces }
    }

    /// The file with the changes.
    pub fn forge(&self, edits: &[Edit<'_>]) -> Vec<u8> {
        let mut forge = Forge { edits, ..Forge::default() };
        let mut header = self.header.clone();
        forge.edit(EditTarget::Header, &mut header);
        header.resize(HEADER - 8, 0);
        forge.id.copy_from_slice(&header[32..48]);
        header.extend(xxh3_64(&header).to_le_bytes());
        forge.out = header;
        self.pieces.iter().for_each(|piece| forge.piece(piece));
        forge.end()
    }
}

/// A file that is being reassembled.
#[derive(Default)]
struct Forge<'a> {
    edits: &'a [Edit<'a>],
    /// How many of each target occurred.
    counts: [usize; PLACES.len()],
    id: [u8; 16],
    out: Vec<u8>,
    /// The leaf's entries so far, and the offset of its first block.
    entries: Vec<Vec<u8>>,
    data_offset: u64,
    /// The root so far, and the blocks of all leaves.
    root: Vec<u8>,
    blocks: u64,
    /// Numbers of codes and outliers in the window.
    coded: u64,
    outliers: u64,
    /// The window's number and record, before and after the changes.
    number: [u8; 4],
    begun: [Vec<u8>; 2],
    /// Each window before and after the changes.
    windows: Vec<(Vec<u8>, Vec<u8>)>,
    /// Offset, lengths and checksum, as in a footer.
    metadata: Vec<u8>,
}

impl<'a> Forge<'a> {
    fn changes(&mut self, place: EditTarget) -> impl Iterator<Item = &'a Edit<'a>> + use<'a> {
        let (edits, number) = (self.edits, self.counts[place as usize] % 256);
        self.counts[place as usize] += 1;
        let alone = matches!(
            place,
            EditTarget::Header | EditTarget::Grid | EditTarget::Start | EditTarget::Metadata | EditTarget::Footer
        );
        edits.iter().filter(move |edit| edit.place == place && (alone || edit.number == number))
    }

    fn edit(&mut self, place: EditTarget, bytes: &mut Vec<u8>) {
        self.changes(place).for_each(|edit| edit.apply(bytes));
    }

    fn piece(&mut self, piece: &Piece) {
        match piece.clone() {
            Piece::Start(mut start) => {
                self.grid(&mut start);
                self.edit(EditTarget::Start, &mut start);
                self.section(b"STRT", &[0; 10], [20, 0], &start, start.len());
            }
            Piece::Block { entry, parts } => self.block(entry, parts),
            Piece::Leaf => self.leaf(),
            Piece::Window(record) => self.window(record),
            Piece::End(record) => self.window_end(record),
            Piece::Metadata(record) => self.metadata(record),
        }
    }

    /// Changes to what start and metadata have alike are the same in both.
    fn grid(&mut self, record: &mut Vec<u8>) {
        let mut grid: Vec<u8> = record.drain(..82.min(record.len())).collect();
        self.edit(EditTarget::Grid, &mut grid);
        record.splice(..0, grid);
    }

    fn block(&mut self, mut entry: Vec<u8>, mut parts: Vec<Vec<u8>>) {
        for Edit { at, how, .. } in self.changes(EditTarget::Parts) {
            let part = at % parts.len().max(1);
            let place = ENTRY + PART * part;
            if parts.is_empty() {
                break;
            } else if how % 2 == 0 {
                parts.remove(part);
                entry.drain(place..place + PART);
            } else {
                parts.insert(part, parts[part].clone());
                let copy = entry[place..place + PART].to_vec();
                entry.splice(place..place, copy);
            }
            put(&mut entry, 10, &(parts.len() as u16).to_le_bytes());
        }
        self.edit(EditTarget::Entry, &mut entry);
        entry.resize(entry.len().max(ENTRY), 0);
        self.pad();
        let mut offset = (self.out.len() + FRAME + entry.len()) as u64;
        let mut all = Vec::new();
        for (number, mut payload) in parts.into_iter().enumerate() {
            self.edit(EditTarget::Payload, &mut payload);
            let mut stored = compress(&payload);
            self.edit(EditTarget::Stored, &mut stored);
            let place = ENTRY + PART * number;
            let kind = entry.get(place..place + 2).map_or([0; 2], |kind| [kind[0], kind[1]]);
            let checksum = self.checksum(&entry[..10], kind, &stored);
            put(&mut entry, place + 4, &(stored.len() as u32).to_le_bytes());
            put(&mut entry, place + 8, &(payload.len() as u32).to_le_bytes());
            put(&mut entry, place + 16, &offset.to_le_bytes());
            put(&mut entry, place + 24, &checksum.to_le_bytes());
            offset += stored.len() as u64;
            all.extend(stored);
        }
        self.edit(EditTarget::Placed, &mut entry);
        entry.resize(entry.len().max(ENTRY), 0);
        if self.entries.is_empty() {
            self.data_offset = self.out.len() as u64;
        }
        let id = entry[..10].to_vec();
        self.section(b"BLCK", &id, [16, 0], &entry, entry.len());
        self.out.extend(all);
        self.entries.push(entry);
    }

    fn leaf(&mut self) {
        let entries = std::mem::take(&mut self.entries);
        let mut raw = entries.concat();
        self.edit(EditTarget::Leaf, &mut raw);
        let stored = compress(&raw);
        let first = entries.first().map_or(vec![0; 10], |entry| entry[..10].to_vec());
        let place = self.section(b"LEAF", &first, [17, 0], &stored, raw.len());
        let mut leaf = [&first[..], &(entries.len() as u16).to_le_bytes(), &place[8..16], &[0; 4]].concat();
        leaf.extend(self.data_offset.to_le_bytes());
        leaf.extend(&place[..8]);
        leaf.extend(&place[16..]);
        self.sums(&entries, &mut leaf);
        self.edit(EditTarget::Root, &mut leaf);
        self.blocks += entries.len() as u64;
        self.root.extend(leaf);
    }

    /// What a leaf's entry ends with, and how many of its blocks are exact.
    fn sums(&mut self, entries: &[Vec<u8>], leaf: &mut Vec<u8>) {
        let (mut range, mut reached, mut squares, mut dropped) =
            ((f64::INFINITY, f64::NEG_INFINITY), 0.0_f64, 0.0, 0.0);
        let (mut energy, mut counts, mut exact, mut lost) = (0.0, [0_u64; 4], 0_u32, 0_u64);
        for entry in entries {
            range = (range.0.min(f64_at(entry, 24)), range.1.max(f64_at(entry, 32)));
            reached = reached.max(f64_at(entry, 40));
            (squares, dropped) = (squares + f64_at(entry, 48), dropped + f64_at(entry, 56));
            lost += u64::from(u32_at(entry, 12));
            let parts = entry[ENTRY..].chunks_exact(PART);
            exact += u32::from(parts.clone().any(|part| part[0] == 3));
            for part in parts.filter(|part| part[0] < 4) {
                let sum = &mut counts[usize::from(part[0])];
                *sum = sum.saturating_add(u64_at(part, 32));
                energy += if part[0] == 0 { f64_at(part, 40) } else { 0.0 };
            }
        }
        put(leaf, 20, &exact.to_le_bytes());
        let floats = [range.0, range.1, reached, squares, energy, dropped];
        leaf.extend(floats.into_iter().flat_map(f64::to_le_bytes));
        leaf.extend([counts[0], counts[1], counts[2], lost].into_iter().flat_map(u64::to_le_bytes));
        self.coded = self.coded.saturating_add(counts[0]);
        self.outliers = self.outliers.saturating_add(counts[1]);
    }

    fn window(&mut self, mut record: Vec<u8>) {
        let begins = |record: &[u8]| record[4..record.len() - SUMS - 8].to_vec(); // there are no times
        let before = begins(&record);
        self.edit(EditTarget::Window, &mut record);
        record.resize(record.len().max(4 + SUMS + 8), 0);
        self.begun = [before, begins(&record)];
        self.number.copy_from_slice(&record[..4]);
        let id = [&self.number[..], &[0; 6]].concat();
        self.section(b"WNDW", &id, [21, 0], &record, record.len());
    }

    fn window_end(&mut self, mut record: Vec<u8>) {
        let before = record[4..].to_vec();
        put(&mut record, 4 + SUMS - 16, &self.coded.to_le_bytes());
        put(&mut record, 4 + SUMS - 8, &self.outliers.to_le_bytes());
        (self.coded, self.outliers) = (0, 0);
        self.edit(EditTarget::End, &mut record);
        record.resize(record.len().max(4), 0);
        let [begun, begins] = std::mem::take(&mut self.begun);
        self.windows.push(([begun, before].concat(), [&begins[..], &record[4..]].concat()));
        let id = [&self.number[..], &[0; 6]].concat();
        self.section(b"WEND", &id, [22, 0], &record, record.len());
    }

    fn metadata(&mut self, mut record: Vec<u8>) {
        let mut from = 0;
        for (before, now) in std::mem::take(&mut self.windows) {
            let at = record[from..].windows(before.len()).position(|bytes| bytes == before);
            let at = from + at.expect("the metadata repeats windows");
            from = at + now.len();
            record.splice(at..at + before.len(), now);
        }
        self.grid(&mut record);
        self.edit(EditTarget::Metadata, &mut record);
        self.metadata = self.section(b"META", &[0; 10], [18, 0], &record, record.len());
    }

    fn end(mut self) -> Vec<u8> {
        let raw = std::mem::take(&mut self.root);
        let stored = compress(&raw);
        let root = self.section(b"ROOT", &[0; 10], [19, 0], &stored, raw.len());
        self.pad();
        let total = (self.out.len() + HEADER) as u64;
        let mut footer = [&self.id[..], &total.to_le_bytes(), &self.metadata, &root].concat();
        footer.extend(self.blocks.to_le_bytes());
        footer.extend(((raw.len() / HEADER) as u64).to_le_bytes());
        footer.resize(112, 0);
        self.edit(EditTarget::Footer, &mut footer);
        footer.resize(112, 0);
        footer.extend(xxh3_64(&footer).to_le_bytes());
        self.out.extend(footer);
        self.out.extend(b"\x89WSPEND\n");
        self.out
    }

    /// Writes a section at the next multiple of 64; its offset, lengths and checksum.
    fn section(&mut self, tag: &[u8; 4], id: &[u8], kind: [u8; 2], stored: &[u8], raw: usize) -> Vec<u8> {
        self.pad();
        let lengths = [stored.len() as u32, raw as u32].map(u32::to_le_bytes).concat();
        let checksum = self.checksum(id, kind, stored).to_le_bytes();
        let mut frame = [&tag[..], &lengths, &[0; 4], &checksum].concat();
        self.edit(EditTarget::Frame, &mut frame);
        let offset = (self.out.len() as u64).to_le_bytes();
        self.out.extend(frame);
        self.out.extend(stored);
        [&offset[..], &lengths, &checksum].concat()
    }

    fn checksum(&self, id: &[u8], kind: [u8; 2], stored: &[u8]) -> u64 {
        xxh3_64_with_seed(stored, xxh3_64(&[&self.id[..], id, &kind].concat()))
    }

    fn pad(&mut self) {
        self.out.resize(self.out.len().next_multiple_of(64), 0);
    }
}

thread_local! {
    static COMPRESSOR: RefCell<Compressor> = RefCell::new(Compressor::new(3).expect("level 3"));
}

fn compress(raw: &[u8]) -> Vec<u8> {
    let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
    let part = COMPRESSOR.with_borrow_mut(|compressor| compressor.part(PartKind::Exact, stats, raw));
    part.expect("few bytes").stored
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes[at..at + 4].try_into().map(u32::from_le_bytes).expect("four bytes")
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    bytes[at..at + 8].try_into().map(u64::from_le_bytes).expect("eight bytes")
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_bits(u64_at(bytes, at))
}
