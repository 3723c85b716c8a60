//! Reading part of a file reads little more than that part's bytes.

use crate::common::memory::Memory;
use crate::common::series::{Kind, Mask, volume};
use crate::common::{MEMORY, report, settings, stored};
use std::path::Path;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig};
use wavesplat::extract::{ExtractConfig, ExtractReport, SampleOrder, extract};
use wavesplat_format::{
    BlockId, BlockStats, Compressor, EncodedBlock, FileId, PartKind, PartStats, Reader, Storage, WindowEnd,
    WindowRecord, Writer,
};

const DIMS: [usize; 3] = [96, 80, 64];
const FRAMES: usize = 64;

/// Four windows of 8 x 7 x 6 blocks, plus clipped ones.
fn file() -> crate::common::Stored {
    let data = volume(Kind::Wave, SampleType::F32, Mask::None, DIMS.iter().product(), FRAMES, 5);
    let config = ConvertConfig { block: Some(12), ..settings(Basis::Haar, 16, 1e-3) };
    stored(&mut Memory::new(Grid::unit(DIMS), SampleType::F32, data), &config)
}

/// The bytes that are read from the file for some frames of a region, including opening it.
fn reading(of: &crate::common::Stored, frames: Vec<usize>, region: Region) -> ExtractReport {
    let file = of.open();
    let config = ExtractConfig { frames, region, channel: 0, order: SampleOrder::default(), memory: MEMORY };
    extract(&file, &config, Path::new("out"), &mut Vec::new(), &Silent).unwrap()
}

#[test]
fn little_more_is_read_than_is_needed() {
    let (stored, whole) = (file(), Grid::unit(DIMS).whole());
    let all = || (0..FRAMES).collect::<Vec<_>>();
    let held = stored.bytes().len() as u64;
    let file = stored.open();
    let directory =
        file.bytes_read() + (0..4).flat_map(|w| file.leaves(w)).map(|l| u64::from(l.stored_len) + 24).sum::<u64>();
    let in_part = Region { start: [30, 30, 30], end: [54, 54, 54] };
    let voxel = Region { start: [50, 40, 30], end: [51, 41, 31] };
    let cases = [
        ("everything", all(), whole, 1.0),
        ("one frame", vec![21], whole, 0.25),
        ("every 16th frame", vec![0, 16, 32, 48], whole, 1.0),
        ("a region of 3 %", all(), in_part, 27.0 / 336.0),
        ("one voxel's series", all(), voxel, 1.0 / 336.0),
    ];
    for (what, frames, region, share) in cases {
        let read = reading(&stored, frames, region);
        report(&format!(
            "{what}: {} of {held} bytes read, {} of them parts of blocks",
            read.file_bytes_read, read.bytes_read
        ));
        assert!(
            read.file_bytes_read <= read.bytes_read + directory,
            "{what}: no more than the blocks' parts and the directory"
        );
        assert!(read.bytes_read as f64 <= 1.6 * share * held as f64, "{what}: parts of the blocks that hold it alone");
    }
}

#[test]
fn one_level_is_read_without_the_others() {
    let stored = file();
    let reader = Reader::open(stored.bytes()).unwrap();
    let mut codes = Vec::new();
    for entry in reader.leaf(&reader.leaves(1)[0]).unwrap().iter().take(5) {
        let levels = entry.parts.iter().filter(|part| matches!(part.kind, PartKind::Level(_)));
        for part in levels {
            let PartKind::Level(level) = part.kind else { continue };
            let counted = Counted::of(stored.bytes());
            let reader = Reader::open(&counted).unwrap();
            let opened = counted.read();
            codes.resize(reader.geometry(entry.id).unwrap().codes(level).unwrap(), 0);
            reader.codes(entry, level, &mut codes).unwrap();
            assert_eq!(counted.read() - opened, u64::from(part.stored_len), "{} of {}", part.kind, entry.id);
        }
    }
}

/// Bytes that count how many of them were read.
struct Counted {
    bytes: Vec<u8>,
    read: std::sync::atomic::AtomicU64,
}

impl Counted {
    fn of(bytes: Vec<u8>) -> Self {
        Self { bytes, read: 0.into() }
    }

    fn read(&self) -> u64 {
        self.read.load(std::sync::atomic::Ordering::Relaxed)
    }
}

impl Storage for Counted {
    fn len(&self) -> u64 {
        Storage::len(&self.bytes)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> std::io::Result<()> {
        self.read.fetch_add(out.len() as u64, std::sync::atomic::Ordering::Relaxed);
        self.bytes.read_at(offset, out)
    }
}

#[test]
fn a_file_of_a_million_blocks_is_opened_by_reading_a_thousandth() {
    let small = file().open().metadata().clone();
    let mut metadata = small.start();
    (metadata.dims, metadata.block_edge) = ([2000, 1000, 1000], 10);
    let (mut window, number) = (small.windows[0].with_totals(&WindowEnd::empty(0)), 0);
    (window.frames, window.coefficients, window.levels) = (2, 2, vec![2]);
    let mut writer = Writer::new(Vec::new(), FileId([6; 16]), &metadata).unwrap();
    writer.begin_window(WindowRecord { number, window, times: Vec::new() }).unwrap();
    let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
    let part = Compressor::new(1).unwrap().part(PartKind::Missing, stats, &[0; 254]).unwrap();
    let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
    let stats = BlockStats { step: 0.0, min, max, reached: 0.0, squared_error: 0.0, dropped: 0.0 };
    for block in 0..2_000_000 {
        let parts = vec![part.clone()];
        writer.append(&EncodedBlock { id: BlockId::new(0, 0, block), stats, parts }).unwrap();
    }
    writer.end_window(&WindowEnd { missing: 2_000_000, ..WindowEnd::empty(0) }).unwrap();
    let (file, summary) = writer.finish().unwrap();
    let counted = Counted::of(file);
    let reader = Reader::open(&counted).unwrap();
    let (opened, held) = (counted.read(), summary.bytes);
    report(&format!("2 million blocks: {opened} of {held} bytes read to open the file"));
    assert!(opened < held / 1000);
    let last = BlockId::new(0, 0, 1_999_999);
    assert_eq!(reader.entry(last).unwrap().id, last);
    report(&format!("and {} more to find a block", counted.read() - opened));
    assert!(counted.read() < held / 1000, "one leaf more");
}
