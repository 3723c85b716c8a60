//! Checks `FORMAT.md` against the code: its tables of fields, its limits and its dump of a file.

use crate::footer::{FOOTER, Footer};
use crate::header::{HEADER, Header};
use crate::leaf::LEAF_ENTRY;
use crate::section::{FRAME, SectionExtent, SectionId, frame};
use crate::testing::*;
use crate::*;
use std::fmt::Write;
use xxhash_rust::xxh3::xxh3_64;

const TEXT: &str = include_str!("../../FORMAT.md");

/// The rows of the first table after a heading, without the table's head.
fn table(heading: &str) -> Vec<Vec<&'static str>> {
    let after = TEXT.split_once(&format!("# {heading}\n")).expect("the heading").1;
    let lines = after.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    lines.skip(2).map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// Checks that the table describes the record: fields are contiguous, fill the record and hold the expected values.
fn check(heading: &str, record: &[u8], values: &[(&str, &[u8])]) {
    let mut at = 0;
    let mut values = values.iter();
    for row in table(heading) {
        let (offset, size): (usize, usize) = (row[0].parse().expect("number"), row[1].parse().expect("number"));
        assert_eq!(offset, at, "{heading}: {}", row[2]);
        let held = &record[offset..offset + size];
        match row[2] {
            "reserved" => assert!(held.iter().all(|&byte| byte == 0), "{heading}: reserved at {offset}"),
            name => assert_eq!(values.next(), Some(&(name, held)), "{heading}: {name} at {offset}"),
        }
        at += size;
    }
    assert_eq!((at, values.next()), (record.len(), None), "{heading}");
}

#[test]
fn the_header_is_as_specified() {
    let needs = "words".to_string();
    let record = Header { version: (1, 2), required: 3, optional: 4, id: ID, needs }.encode();
    assert_eq!(record.len(), HEADER);
    let magic = [0x89, 0x57, 0x53, 0x50, 0x0D, 0x0A, 0x1A, 0x0A];
    let sum = xxh3_64(&record[..120]).to_le_bytes();
    let mut words = [0; 72];
    words[..5].copy_from_slice(b"words");
    let (required, optional) = (3u64.to_le_bytes(), 4u64.to_le_bytes());
    #[rustfmt::skip]
    check("Header", &record, &[
        ("magic", &magic), ("major", &[1, 0]), ("minor", &[2, 0]), ("required", &required), ("optional", &optional),
        ("file id", &ID.0), ("needs", &words), ("checksum", &sum),
    ]);
}

#[test]
fn the_footer_is_as_specified() {
    let extent =
        |n: u32| SectionExtent { offset: n.into(), stored_len: n + 1, raw_len: n + 2, checksum: u64::from(n) + 3 };
    let description = Some(extent(30));
    let footer = Footer { id: ID, total: 7, metadata: extent(10), root: extent(20), blocks: 8, leaves: 9, description };
    let record = footer.encode();
    assert_eq!(record.len(), FOOTER);
    let (n8, n4) = (|n: u64| n.to_le_bytes(), |n: u32| n.to_le_bytes());
    #[rustfmt::skip]
    check("Footer", &record, &[
        ("file id", &ID.0), ("total", &n8(7)),
        ("metadata offset", &n8(10)), ("metadata stored", &n4(11)), ("metadata raw", &n4(12)), ("metadata checksum", &n8(13)),
        ("root offset", &n8(20)), ("root stored", &n4(21)), ("root raw", &n4(22)), ("root checksum", &n8(23)),
        ("blocks", &n8(8)), ("leaves", &n8(9)),
        ("description offset", &n8(30)), ("description stored", &n4(31)), ("description raw", &n4(32)),
        ("description checksum", &n8(33)), ("checksum", &n8(xxh3_64(&record[..112]))), ("end magic", &[0x89, 0x57, 0x53, 0x50, 0x45, 0x4E, 0x44, 0x0A]),
    ]);
}

#[test]
fn frames_and_entries_are_as_specified() {
    let (n8, n4, f8) = (|n: u64| n.to_le_bytes(), |n: u32| n.to_le_bytes(), |n: f64| n.to_le_bytes());
    let record = frame(SectionId::Metadata, &SectionExtent { offset: 9, stored_len: 1, raw_len: 2, checksum: 3 });
    assert_eq!(record.len(), FRAME);
    #[rustfmt::skip]
    check("Section frame", &record, &[("tag", b"META"), ("stored", &n4(1)), ("raw", &n4(2)), ("checksum", &n8(3))]);
    let stats = BlockStats { step: 4.0, min: 5.0, max: 6.0, reached: 7.0, squared_error: 8.0, dropped: 9.0 };
    let part_stats = PartStats { count: 14, energy: 15.0, largest: 16.0 };
    let (offset, stored_len, raw_len, checksum) = (12, 10, 11, 13);
    let part = PartEntry { kind: PartKind::Level(2), stats: part_stats, offset, stored_len, raw_len, checksum };
    let mut record = Vec::new();
    BlockEntry { id: BlockId { tier: 21, ..BlockId::new(1, 3, 2) }, stats, parts: vec![part], lost: true }
        .encode(&mut record);
    #[rustfmt::skip]
    check("Block entry", &record[..64], &[
        ("window", &n4(1)), ("block", &n4(2)), ("channel", &[3]), ("tier", &[21]), ("parts", &[1, 0]), ("lost", &n4(1)), ("step", &f8(4.0)),
        ("min", &f8(5.0)), ("max", &f8(6.0)), ("reached", &f8(7.0)), ("squared error", &f8(8.0)), ("dropped", &f8(9.0)),
    ]);
    #[rustfmt::skip]
    check("Part entry", &record[64..], &[
        ("kind", &[0]), ("level", &[2]), ("stored", &n4(10)), ("raw", &n4(11)), ("offset", &n8(12)),
        ("checksum", &n8(13)), ("count", &n8(14)), ("energy", &f8(15.0)), ("largest", &f8(16.0)),
    ]);
}

#[test]
fn leaf_entries_are_as_specified() {
    #[rustfmt::skip]
    let leaf = LeafEntry {
        window: 1, first_block: 2, channel: 3, tier: 21, count: 4, stored_len: 5, raw_len: 6, exact: 7, data_offset: 8, offset: 9,
        checksum: 10, min: 11.0, max: 12.0, reached: 13.0, squared_error: 14.0, energy: 15.0, dropped: 16.0, coded: 17,
        outliers: 18, missing: 19, lost: 20,
    };
    let mut record = Vec::new();
    leaf.encode(&mut record);
    assert_eq!(record.len(), LEAF_ENTRY);
    let (n8, n4, f8) = (|n: u64| n.to_le_bytes(), |n: u32| n.to_le_bytes(), |n: f64| n.to_le_bytes());
    #[rustfmt::skip]
    check("Leaf entry", &record, &[
        ("window", &n4(1)), ("first block", &n4(2)), ("channel", &[3]), ("tier", &[21]), ("count", &[4, 0]), ("stored", &n4(5)),
        ("raw", &n4(6)), ("exact", &n4(7)), ("data offset", &n8(8)), ("offset", &n8(9)), ("checksum", &n8(10)),
        ("min", &f8(11.0)), ("max", &f8(12.0)), ("reached", &f8(13.0)), ("squared error", &f8(14.0)),
        ("energy", &f8(15.0)), ("dropped", &f8(16.0)), ("coded", &n8(17)), ("outliers", &n8(18)), ("missing", &n8(19)), ("lost", &n8(20)),
    ]);
}

#[test]
fn the_start_of_a_bare_stream_is_as_specified() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 1);
    let stream = to_bare(&Reader::open(file(&metadata, &blocks)).expect("whole")).expect("few blocks");
    let magic = [0x89, 0x57, 0x53, 0x42, 0x0D, 0x0A, 0x1A, 0x0A];
    let stored = u32::from_le_bytes(stream[8..12].try_into().expect("four"));
    let packed = &stream[24..24 + stored as usize];
    let head = zstd::bulk::decompress(packed, 1 << 16).expect("one frame");
    let (raw, sum) = ((head.len() as u32).to_le_bytes(), xxh3_64(packed).to_le_bytes());
    #[rustfmt::skip]
    check("Start of a bare stream", &stream[..24], &[
        ("magic", &magic), ("stored", &stored.to_le_bytes()), ("raw", &raw), ("checksum", &sum),
    ]);
}

#[test]
fn limits_are_as_specified() {
    use limits::*;
    #[rustfmt::skip]
    let limits = [
        ("ALIGN", ALIGN), ("BLOCKS_PER_LEAF", BLOCKS_PER_LEAF.into()), ("MAX_BLOCK_SAMPLES", MAX_BLOCK_SAMPLES),
        ("MAX_PART_RAW", MAX_PART_RAW), ("MAX_LISTED", MAX_LISTED as u64),
        ("MAX_LEVELS", MAX_LEVELS as u64), ("MAX_SIDES", MAX_SIDES as u64), ("MAX_PARTS", MAX_PARTS as u64),
        ("MAX_WINDOW_FRAMES", MAX_WINDOW_FRAMES.into()), ("MAX_COEFFICIENTS", MAX_COEFFICIENTS.into()),
        ("MAX_DIM", MAX_DIM), ("MAX_CHANNELS", MAX_CHANNELS.into()), ("MAX_TIERS", MAX_TIERS.into()), ("MAX_FRAMES", MAX_FRAMES), ("MAX_METADATA", MAX_METADATA as u64),
        ("MAX_ROOT_RAW", MAX_ROOT_RAW), ("MAX_DESCRIPTION", MAX_DESCRIPTION as u64),
        ("MAX_DESCRIPTION_ITEMS", MAX_DESCRIPTION_ITEMS as u64), ("MAX_BARE_HEAD", MAX_BARE_HEAD as u64),
    ];
    let stated: Vec<_> = table("9. Limits").iter().map(|row| (row[0], row[1].parse().expect("number"))).collect();
    assert_eq!(stated, limits);
}

/// A hex dump with 16 bytes per line, without lines of zeros.
fn dump(file: &[u8]) -> String {
    let mut text = String::new();
    for (line, bytes) in file.chunks(16).enumerate().filter(|(_, bytes)| bytes.iter().any(|&byte| byte != 0)) {
        write!(text, "{:04x} ", 16 * line).expect("memory");
        bytes.iter().for_each(|byte| write!(text, " {byte:02x}").expect("memory"));
        text.push('\n');
    }
    text
}

#[test]
fn the_dump_is_a_file() {
    let mut metadata = tiny();
    let levels = vec![vec![3, -2], vec![0, 0], vec![0, 0, 300, 0]];
    let outliers = Outliers { positions: vec![5], samples: vec![2, 1] };
    let content = Content { levels, outliers, ..Content::default() };
    let id = BlockId::new(0, 0, 0);
    let block = encode(id, &content, &metadata.geometry(id).expect("there"), &mut Compressor::new(3).expect("level 3"));
    (metadata.windows[0].coded, metadata.windows[0].outliers) = (3, 1);
    let file = file(&metadata, &[(block, content.clone())]);
    assert_eq!(verify(&file).expect("whole"), [(id, content)]);
    let stated = TEXT.split_once("```dump\n").and_then(|(_, rest)| rest.split_once("```")).expect("a dump").0;
    assert_eq!(dump(&file), stated);
}
