//! A file of a few KiB that uses every feature, and the checks for whatever is read from changed copies of it.

use crate::testing::*;
use crate::*;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashSet};
use std::time::Instant;
use xxhash_rust::xxh3::xxh3_128;

/// A complete file and its content.
pub(super) struct Original {
    pub(super) file: Vec<u8>,
    pub(super) metadata: Metadata,
    pub(super) blocks: BTreeMap<BlockId, (BlockEntry, Option<Content>)>,
    /// Digests of recovered files that were checked; many are equal.
    checked: RefCell<HashSet<u128>>,
}

/// Has windows of all bases, with and without a pyramid and tiers, two channels, times, outliers, missing and exact samples, and a lost
/// block.
pub(super) fn fat() -> Original {
    original([5, 3, 2], 2, 13, Packing::Nested)
}

/// Like [`fat`], with fewer voxels and one channel.
pub(super) fn lean() -> Original {
    original([2, 1, 1], 1, 3, Packing::Flat)
}

fn original(dims: [u64; 3], channels: u16, seed: u64, packing: Packing) -> Original {
    let mut metadata = Metadata { dims, channels, block_edge: 4, frames: 13, windows: windows(packing), ..metadata() };
    metadata.times = (0..13).map(|t| f64::from(t) / 2.0).collect();
    let mut blocks = blocks(&mut metadata, seed);
    let lost = blocks[1].0.id;
    blocks[1].0.parts.clear();
    count(&mut metadata, &blocks);
    let (file, _) = write_but(&metadata, blocks.iter().map(|(block, _)| block), ID, Some(lost)).expect("complete");
    let read = read_all(&file).expect("whole");
    let blocks = read.into_iter().map(|block| (block.0.id, block)).collect();
    Original { blocks, file, metadata, checked: RefCell::default() }
}

fn windows(packing: Packing) -> Vec<Window> {
    let window = |first_frame, frames, basis, levels: &[u32]| Window {
        first_frame,
        frames,
        basis,
        coefficients: levels.iter().sum(),
        levels: levels.to_vec(),
        ..metadata().windows[0].clone()
    };
    let pyramid = |order: &[Axis], stencil, single| {
        Some(Pyramid {
            order: order.to_vec(),
            stencil,
            growth: 1.5,
            most: 3.0,
            single,
            packing,
            ghosts: packing == Packing::Nested,
            tiers: 0,
        })
    };
    let functions = vec![32767, 0, -5, 9, 100, 200, -300, 0];
    let mut all = vec![window(0, 4, Basis::Haar, &[1, 1, 2]), window(4, 2, Basis::Multi, &[2, 1])];
    all.push(Window { functions, ..window(6, 4, Basis::Learned, &[4]) });
    all[2].levels.clear();
    all[2].pyramid = pyramid(&[Axis::Z, Axis::Y, Axis::X], Stencil::Linear, true);
    all.push(Window { levels: Vec::new(), ..window(10, 3, Basis::Samples, &[3]) });
    all[3].pyramid = pyramid(&[Axis::X, Axis::Y, Axis::Z, Axis::T], Stencil::Cubic, false);
    let tiers = u8::from(packing == Packing::Nested);
    all[3].pyramid.iter_mut().for_each(|pyramid| pyramid.tiers = tiers);
    all
}

impl Original {
    /// Checks that a recovered file is valid and that every block in it equals the original.
    fn check_recovered(&self, file: &[u8], recovered: &Recovered) {
        let (reader, mut lost) = (Reader::open(file).expect("whole"), Vec::new());
        assert_eq!(reader.metadata().start(), self.metadata.start());
        for (entry, content) in read_all(file).expect("whole") {
            let Some(content) = content else {
                lost.push(entry.id);
                continue;
            };
            let (original, expected) = &self.blocks[&entry.id];
            assert_eq!((Some(&content), entry.stats), (expected.as_ref(), original.stats), "{}", entry.id);
            assert!(same_coding(reader.metadata(), &self.metadata, entry.id.window));
        }
        assert_eq!(lost, recovered.lost);
    }

    /// Checks that the complete windows of a changed file equal the original.
    pub(super) fn check_prefix(&self, file: &[u8]) {
        let Ok(found) = CompletePrefix::read(&file) else { return };
        let kept = found.bytes() as usize;
        assert!(file[..kept] == self.file[..kept], "{kept} bytes kept");
        let windows = found.metadata().windows.len();
        assert_eq!(found.metadata().windows[..], self.metadata.windows[..windows]);
        assert_eq!(found.metadata().times[..], self.metadata.times[..found.metadata().frames as usize]);
    }

    /// Recovers a changed file and checks the result. Returns whether anything could be recovered.
    pub(super) fn check_recovery(&self, file: &[u8]) -> bool {
        let Ok((out, recovered)) = recover(file) else { return false };
        if self.checked.borrow_mut().insert(xxh3_128(&out)) {
            self.check_recovered(&out, &recovered);
        }
        true
    }
}

/// Recovers a damaged file.
pub(super) fn recover(file: &[u8]) -> Result<(Vec<u8>, Recovered)> {
    Recovery::search(&file, &mut |_| {})?.write(&file, Vec::new(), &mut || {})
}

/// Whether both metadata decode a window in the same way.
fn same_coding(a: &Metadata, b: &Metadata, window: u32) -> bool {
    let coding = |m: &Metadata| {
        let Window { first_frame, frames, basis, coefficients, levels, functions, pyramid, .. } =
            m.windows[window as usize].clone();
        let times = m.times[first_frame as usize..][..frames as usize].to_vec();
        (first_frame, frames, basis, coefficients, levels, functions, pyramid, times)
    };
    coding(a) == coding(b)
}

/// Does everything that a program does with a file and ignores the results.
pub(super) fn use_all(file: &[u8]) {
    let _ = read_through(file);
    let _ = CompletePrefix::read(&file);
}

/// Like [`read_all`], but unpacks every part only once.
fn read_through(file: &[u8]) -> Result<()> {
    let reader = Reader::open(file)?;
    reader.check_structure(&mut drop)?;
    for leaf in (0..reader.metadata().windows.len() as u32).flat_map(|window| reader.leaves(window)) {
        let Ok(blocks) = reader.leaf(leaf) else { continue };
        reader.check_leaf(leaf, &blocks, &mut drop)?;
        blocks.iter().for_each(|block| drop(reader.check_parts(block)));
    }
    Ok(())
}

/// Prints how many cases a test tried, and fails if there were too few.
#[allow(clippy::print_stderr, reason = "a table of what was tried is made of these")]
pub(super) fn tell(suite: &str, tries: u64, intended: u64, began: Instant) {
    eprintln!("{suite} | {tries} | {:.1}", began.elapsed().as_secs_f64());
    assert!(tries >= intended, "{suite}: {tries} of {intended}");
}

#[test]
fn fat_files_have_every_feature() {
    let Original { file, blocks, metadata, .. } = fat();
    assert!((8 << 10..20 << 10).contains(&file.len()), "{} bytes", file.len());
    let kinds = [
        PartKind::Level(0),
        PartKind::Level(1),
        PartKind::Level(2),
        PartKind::Outliers,
        PartKind::Missing,
        PartKind::Exact,
    ];
    for pyramid in [false, true] {
        let of = |id: &BlockId| metadata.windows[id.window as usize].pyramid.is_some() == pyramid;
        let has = |kind| blocks.values().any(|(entry, _)| of(&entry.id) && entry.part(kind).is_some());
        assert!(kinds.iter().all(|kind| has(*kind)), "{:?}", kinds.map(has));
    }
    for kind in [PartKind::Level(3), PartKind::Listed, PartKind::Sides, PartKind::Sums] {
        assert!(blocks.values().any(|(entry, _)| entry.part(kind).is_some()), "{kind}");
    }
    assert_eq!(blocks.values().filter(|(entry, _)| entry.lost).count(), 1);
    assert_eq!(recover(&file).expect("whole").0, file);
}
