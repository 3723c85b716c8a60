//! Small files that claim to be huge. Each is refused or read correctly, with little memory.

use peak_alloc::PeakAlloc;
use std::io;
use std::sync::Mutex;
use wavesplat_format::*;

#[allow(dead_code, reason = "made for other tests, too")]
#[path = "../src/tests/hostile/forge.rs"]
mod forge;

use forge::{Change, Piece, Pieces, put, u32_at};

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Held by each test while it runs, because the measured memory is that of the whole process.
static ALONE: Mutex<()> = Mutex::new(());

/// Additional memory in bytes that a file of a few KiB may take.
const MOST: usize = 64 << 20;

/// A named change of pieces.
type Bomb = (&'static str, Box<dyn Fn(Piece, usize, &mut Vec<u8>)>);

/// Blocks' entries without offsets, and their payloads.
type Content = Vec<(BlockId, BlockStats, Vec<(PartKind, Vec<u8>)>)>;

fn metadata() -> Metadata {
    let empty = WindowEnd::empty(0);
    let window = |first_frame| Window {
        first_frame,
        frames: 4,
        basis: Basis::Haar,
        coefficients: 4,
        levels: vec![1, 1, 2],
        functions: Vec::new(),
        pyramid: None,
        coarseness: 1.0,
        range: (0.0, 1.0),
        digest: 1,
        delta: 0.5,
        reached: empty.reached,
        share: 0.0,
        squared_error: 0.0,
        min: 0.0,
        max: 1.0,
        missing: 0,
        coded: 0,
        outliers: 0,
    };
    Metadata {
        dims: [32, 16, 16],
        spacing: [1.0; 3],
        origin: [0.0; 3],
        sample: SampleType::I16,
        block_edge: 16,
        channels: 1,
        frames: 8,
        times: (0..8).map(f64::from).collect(),
        variable: Some("density".into()),
        bound: Bound::Pointwise,
        tolerance: 0.01,
        missing_value: None,
        windows: vec![window(0), window(4)],
        settings: vec![("basis".into(), "haar".into())],
        program: "tests".into(),
    }
}

/// A block with level 0 and outliers, or with exact samples.
fn block(id: BlockId, compressor: &mut Compressor) -> EncodedBlock {
    let (mut codes, mut outliers, mut exact) = (Vec::new(), Vec::new(), Vec::new());
    let level: Vec<i32> = (0..4096).map(|i| i % 7 - 3).collect();
    pack_codes(&level, &mut codes);
    pack_outliers(&Outliers { positions: vec![3, 77], samples: vec![1, 2, 3, 4] }, 2, &mut outliers);
    pack_exact(&vec![0; 2 * 4 * 4096], 2, &mut exact);
    let mut part = |kind, count: usize, raw: &[u8]| {
        let (energy, largest) = if kind == PartKind::Level(0) { (9.0, 3.0) } else { (0.0, 0.0) };
        compressor.part(kind, PartStats { count: count as u64, energy, largest }, raw).expect("fits")
    };
    let count = level.iter().filter(|&&code| code != 0).count();
    let parts = match id.block {
        0 => vec![part(PartKind::Level(0), count, &codes), part(PartKind::Outliers, 2, &outliers)],
        _ => vec![part(PartKind::Exact, 4 * 4096, &exact)],
    };
    let stats = BlockStats { step: 0.5, min: 0.0, max: 1.0, reached: 0.0, squared_error: 0.0, dropped: 0.0 };
    EncodedBlock { id, stats, parts }
}

fn file() -> Vec<u8> {
    let (metadata, mut compressor) = (metadata(), Compressor::new(3).expect("known"));
    let mut writer = Writer::new(Vec::new(), FileId([0xA5; 16]), &metadata).expect("memory");
    for (number, window) in (0..).zip(&metadata.windows) {
        let times = metadata.times[4 * number as usize..][..4].to_vec();
        let begun = window.with_totals(&WindowEnd::empty(number));
        writer.begin_window(WindowRecord { number, window: begun, times }).expect("next");
        let mut end = WindowEnd::empty(number);
        for block in 0..2 {
            let block = self::block(BlockId::new(number, 0, block), &mut compressor);
            end.add(&block);
            writer.append(&block).expect("next");
        }
        writer.end_window(&end).expect("whole");
    }
    writer.finish().expect("whole").0
}

fn read(file: &[u8]) -> Result<Content> {
    let reader = Reader::open(file)?;
    let (mut wrong, mut content) = (None, Vec::new());
    reader.check_structure(&mut |error| wrong = Some(error))?;
    for leaf in (0..reader.metadata().windows.len() as u32).flat_map(|window| reader.leaves(window)) {
        let blocks = reader.leaf(leaf)?;
        reader.check_leaf(leaf, &blocks, &mut |error| wrong = Some(error))?;
        for block in blocks {
            reader.check_parts(&block)?;
            let parts = block.parts.iter().map(|part| Ok((part.kind, reader.part(&block, part)?)));
            content.push((block.id, block.stats, parts.collect::<Result<_>>()?));
        }
    }
    wrong.map_or(Ok(content), Err)
}

/// Does everything with a file and checks the memory that this took. Returns whether the file was refused.
fn set_off(name: &str, file: &[u8], expected: &Content) -> bool {
    HEAP.reset_peak_usage();
    let baseline = HEAP.current_usage();
    let content = read(file);
    assert!(content.as_ref().map_or(true, |content| content == expected), "{name}: other content");
    let _ = CompletePrefix::read(&file);
    let recovery = Recovery::search(&file, &mut |_| {});
    let _ = recovery.and_then(|recovery| recovery.write(&file, io::sink(), &mut || {}));
    let taken = HEAP.peak_usage() - baseline;
    assert!((1..MOST).contains(&taken), "{name}: {taken} bytes");
    content.is_err()
}

/// Changes the stored payload of the first part.
fn stored(name: &'static str, change: impl Fn(&mut Vec<u8>) + 'static) -> Bomb {
    let change = move |piece, number, bytes: &mut Vec<u8>| {
        if (piece, number) == (Piece::Stored, 0) {
            change(bytes);
        }
    };
    (name, Box::new(change))
}

/// Sets a field in the first piece of each of these kinds.
fn field<const N: usize>(name: &'static str, kinds: &'static [Piece], at: usize, value: [u8; N]) -> Bomb {
    let change = move |piece, number, bytes: &mut Vec<u8>| {
        if kinds.contains(&piece) && number == 0 {
            put(bytes, at, &value);
        }
    };
    (name, Box::new(change))
}

/// Replaces the content of the first piece of a kind.
fn content(name: &'static str, kind: Piece, len: usize) -> Bomb {
    let change = move |piece, number, bytes: &mut Vec<u8>| {
        if (piece, number) == (kind, 0) {
            *bytes = vec![0; len];
        }
    };
    (name, Box::new(change))
}

/// The payload in a zstd frame without checksum or content size.
fn again(bytes: &mut Vec<u8>, checksum: bool, size: bool) {
    let raw = zstd::bulk::decompress(bytes, 1 << 20).expect("whole");
    let mut compressor = zstd::bulk::Compressor::new(3).expect("known");
    compressor.include_checksum(checksum).expect("known");
    compressor.include_contentsize(size).expect("known");
    *bytes = compressor.compress(&raw).expect("memory");
}

const SKIPPABLE: [u8; 12] = [0x50, 0x2A, 0x4D, 0x18, 4, 0, 0, 0, 1, 2, 3, 4];
const HUGE: [u8; 8] = (1u64 << 60).to_le_bytes();
const ALL_DIMS: [u8; 24] = [0, 0, 0, 0x80, 0, 0, 0, 0, 0, 0, 0, 0x80, 0, 0, 0, 0, 0, 0, 0, 0x80, 0, 0, 0, 0];
const ENTRY: &[Piece] = &[Piece::Entry];
const FOOTER: &[Piece] = &[Piece::Footer];
const RECORDS: &[Piece] = &[Piece::Start, Piece::Metadata];
const WINDOWS: &[Piece] = &[Piece::Window];

/// zstd frames that are not valid for parts.
fn frames() -> Vec<Bomb> {
    vec![
        stored("empty", Vec::clear),
        stored("one byte", |bytes| bytes.truncate(1)),
        stored("cut", |bytes| bytes.truncate(bytes.len() - 1)),
        stored("trailing byte", |bytes| bytes.push(0)),
        stored("two frames", |bytes| bytes.extend(bytes.clone())),
        stored("skippable first", |bytes| drop(bytes.splice(..0, SKIPPABLE))),
        stored("skippable last", |bytes| bytes.extend(SKIPPABLE)),
        stored("skippable alone", |bytes| *bytes = SKIPPABLE.to_vec()),
        stored("no content size", |bytes| again(bytes, true, false)),
        stored("no checksum", |bytes| again(bytes, false, true)),
        stored("wrong checksum", |bytes| *bytes.last_mut().expect("some") ^= 1),
        stored("checksum flag alone", |bytes| bytes[4] ^= 4),
        stored("a dictionary", |bytes| {
            bytes[4] |= 1;
            bytes.insert(5, 7);
        }),
        stored("a size of 2^60", |bytes| {
            bytes[4] = 0xE4;
            bytes.splice(5..7, HUGE);
        }),
        stored("a window of 4 TiB", |bytes| {
            bytes[4] = 0xC4;
            bytes.splice(5..7, [&[0xFF][..], &HUGE].concat());
        }),
    ]
}

/// Payloads and directories that decompress to many times their size.
fn ratios() -> Vec<Bomb> {
    let all = 2 * 4 * 4096;
    let mut bombs = vec![
        content("a payload at its cap", Piece::Raw, 1 + 4096 / 8 + 4 * 4096),
        content("a payload above its cap", Piece::Raw, 1 + 4096 / 8 + 4 * 4096 + 1),
        content("a payload of 96 MiB", Piece::Raw, limits::MAX_PART_RAW as usize),
        content("a payload of 96 MiB and 1", Piece::Raw, limits::MAX_PART_RAW as usize + 1),
        content("a leaf at the cap of two blocks", Piece::Leaf, 2 * (64 + 56 * limits::MAX_PARTS)),
        content("a leaf above it", Piece::Leaf, 2 * (64 + 56 * limits::MAX_PARTS) + 1),
        content("a leaf of 64 MiB", Piece::Leaf, 64 << 20),
        content("a root of 64 MiB", Piece::Root, 64 << 20),
        content("metadata of 16 MiB", Piece::Metadata, limits::MAX_METADATA),
        content("metadata of 16 MiB and 1", Piece::Metadata, limits::MAX_METADATA + 1),
        content("a start of 16 MiB", Piece::Start, limits::MAX_METADATA),
        content("a window of 16 MiB", Piece::Window, limits::MAX_METADATA),
        content("an empty root", Piece::Root, 0),
        content("an empty leaf", Piece::Leaf, 0),
    ];
    let exact = move |piece, number, bytes: &mut Vec<u8>| match (piece, number) {
        (Piece::Raw, 2) => *bytes = vec![0; 64 * all],
        (Piece::Entry, 1) => put(bytes, 64 + 32, &(64 * all as u64 / 2).to_le_bytes()),
        _ => {}
    };
    bombs.push(("64 times the samples, exactly", Box::new(exact)));
    bombs
}

/// Fields with wrong lengths and counts.
fn lies() -> Vec<Bomb> {
    vec![
        field("raw length 0", ENTRY, 64 + 8, [0; 4]),
        field("raw length 1", ENTRY, 64 + 8, [1, 0, 0, 0]),
        field("raw length 96 MiB", ENTRY, 64 + 8, (limits::MAX_PART_RAW as u32).to_le_bytes()),
        field("raw length 2^32 - 1", ENTRY, 64 + 8, [0xFF; 4]),
        field("stored length 0", ENTRY, 64 + 4, [0; 4]),
        field("stored length 2^32 - 1", ENTRY, 64 + 4, [0xFF; 4]),
        field("stored and raw length 2^32 - 1", ENTRY, 64 + 4, [0xFF; 8]),
        field("count 2^60", ENTRY, 64 + 32, HUGE),
        field("count 2^64 - 1", ENTRY, 64 + 32, [0xFF; 8]),
        field("65535 parts", ENTRY, 10, [0xFF; 2]),
        field("a step that is NaN", ENTRY, 16, [0xFF; 8]),
        field("blocks 2^60", FOOTER, 72, HUGE),
        field("leaves 2^60", FOOTER, 80, HUGE),
        field("leaves 2^23", FOOTER, 80, (1u64 << 23).to_le_bytes()),
        field("root of 2^32 - 1", FOOTER, 56, [0xFF; 8]),
        field("root of 1 GiB raw", FOOTER, 60, (1u32 << 30).to_le_bytes()),
        field("metadata of 2^32 - 1", FOOTER, 32, [0xFF; 8]),
        field("sections of 2^32 - 1", &[Piece::Frame], 4, [0xFF; 8]),
        field("leaves of 2^32 - 1", &[Piece::Root], 12, [0xFF; 8]),
        field("65535 blocks in a leaf", &[Piece::Root], 10, [0xFF; 2]),
        field("dims of 2^31", RECORDS, 0, (1u64 << 31).to_le_bytes()),
        field::<24>("all dims of 2^31", RECORDS, 0, ALL_DIMS),
        field::<24>("all dims of 2^64 - 1", RECORDS, 0, [0xFF; 24]),
        field("spacing that is NaN", RECORDS, 24, [0xFF; 8]),
        field("block edges of 2^32 - 1", RECORDS, 76, [0xFF; 4]),
        field("65535 channels", RECORDS, 80, [0xFF; 2]),
        field("2^53 frames", RECORDS, 82, (1u64 << 53).to_le_bytes()),
        field("window 2^32 - 1", WINDOWS, 0, [0xFF; 4]),
        field("end of window 2^32 - 1", &[Piece::End], 0, [0xFF; 4]),
        field("a window of 2^32 - 1 frames", WINDOWS, 12, [0xFF; 4]),
        field("a window from frame 2^60", WINDOWS, 4, HUGE),
        field("2^60 levels", WINDOWS, 24, HUGE),
    ]
}

#[test]
fn bombs_are_refused_or_read_correctly_in_little_memory() {
    let (_alone, file) = (ALONE.lock(), file());
    let (pieces, expected) = (Pieces::new(&file), read(&file).expect("whole"));
    assert!(!set_off("nothing", &file, &expected));
    let bombs: Vec<Bomb> = [frames(), ratios(), lies()].into_iter().flatten().collect();
    assert!(bombs.len() >= 60, "{}", bombs.len());
    for (name, change) in &bombs {
        let bomb = pieces.forge(&mut |piece, number, bytes| change(piece, number, bytes));
        assert!(bomb != file, "{name}: nothing changed");
        assert!(set_off(name, &bomb, &expected), "{name}: not refused");
    }
}

/// Tries every offset at which a record may hold a list, a string, a number or a float.
#[test]
fn records_with_extremes_anywhere_take_little_memory() {
    let (_alone, file) = (ALONE.lock(), file());
    let (pieces, expected) = (Pieces::new(&file), read(&file).expect("whole"));
    let values = [HUGE, (1u64 << 31).to_le_bytes(), (1u64 << 20).to_le_bytes(), f64::NAN.to_le_bytes(), [0xFF; 8]];
    let kinds = [Piece::Start, Piece::Window, Piece::End, Piece::Metadata];
    let mut tries = 0;
    for (kind, number, len) in pieces.sizes().into_iter().filter(|(kind, ..)| kinds.contains(kind)) {
        for (at, value) in (0..len).flat_map(|at| values.map(|value| (at, value))) {
            let change: Change<'_> = &mut |p, n, bytes| {
                let end = (at + 8).min(bytes.len());
                if (p, n) == (kind, number) {
                    put(bytes, at, &value[..end - at]);
                }
            };
            set_off_all(&pieces.forge(change), &expected);
            tries += 1;
        }
    }
    assert!(tries > 5000, "{tries}");
}

/// Like [`set_off`], for changes that may read as other content.
fn set_off_all(file: &[u8], expected: &Content) {
    let content = read(file).unwrap_or_default();
    set_off("a record", file, if content.is_empty() { expected } else { &content });
}

#[test]
fn text_that_is_not_utf_8_is_refused() {
    let (_alone, file) = (ALONE.lock(), file());
    let (pieces, expected) = (Pieces::new(&file), read(&file).expect("whole"));
    for text in ["density", "basis", "haar", "tests"] {
        let bomb = pieces.forge(&mut |piece, _, bytes| {
            let found = bytes.windows(text.len()).position(|window| window == text.as_bytes());
            if let Some(at) = found.filter(|_| piece == Piece::Metadata) {
                bytes[at] = 0xFF;
            }
        });
        assert!(bomb != file && set_off(text, &bomb, &expected), "{text}");
    }
    assert_eq!(u32_at(&file, 128), u32::from_le_bytes(*b"STRT"));
}
