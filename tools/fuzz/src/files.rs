//! Targets for whole files: unchanged, with forged checksums, truncated, damaged.

use super::forge::edits;
use super::input::Input;
use super::seeds::seed;
use std::collections::HashMap;
use std::io::Write;
use std::path::Path;
use wavesplat::base::description::{joined, narrowed, with_frames};
use wavesplat::base::grid::Region;
use wavesplat::base::mapped::Access;
use wavesplat::base::progress::Silent;
use wavesplat::extract::{ExtractConfig, SampleOrder, extract};
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Mode, RenderConfig};
use wavesplat::view::camera::View;
use wavesplat_format::*;

/// Limits for reading a file: decompressed bytes, and blocks.
const MOST_RAW: u64 = 16 << 20;
const MOST_BLOCKS: u64 = 4096;

/// An unchanged file.
pub fn file(data: &[u8]) {
    let _ = read_all(data);
}

/// A metadata record: a record that parses must encode to the same bytes.
pub fn metadata(data: &[u8]) {
    let Ok(metadata) = Metadata::decode(data) else { return };
    assert_eq!(metadata.encode().expect("it was read"), data);
    let start = metadata.start();
    assert!(start.validate().is_ok() && start.frames == 0);
    let window = metadata.windows.len() as u32 - 1;
    let all = |tier| metadata.blocks_per_channel(tier);
    assert!((0..=metadata.tiers(window)).all(|tier| metadata.block_box(tier, all(tier)).is_none()));
    let some = |tier| [0, all(tier) / 2, all(tier) - 1].map(|block| (tier, block));
    for (tier, block) in (0..=metadata.tiers(window)).flat_map(some) {
        let id = BlockId { tier, ..BlockId::new(window, metadata.channels - 1, block) };
        let geometry = metadata.geometry(id).expect("a block of the archive");
        let (first, size) = metadata.block_box(tier, block).expect("a block of the archive");
        assert!((0..3).all(|axis| size[axis] > 0 && first[axis] + size[axis] <= metadata.dims[axis]));
        assert!(tier > 0 || geometry.samples() as u64 <= limits::MAX_BLOCK_SAMPLES);
        for level in 0..geometry.window.parts() as u8 {
            assert!(geometry.codes(level).is_some_and(|codes| codes as u64 <= limits::MAX_BLOCK_SAMPLES));
            geometry.max_raw_len(PartKind::Level(level));
        }
    }
}

/// A description: a record that parses must encode to the same bytes, and its part for some frames and voxels is sound.
pub fn description(data: &[u8]) {
    let reader = Reader::open(seed(0).0).expect("a sound file");
    let metadata = reader.metadata();
    let Ok(description) = Description::decode(data, metadata) else { return };
    assert_eq!(description.encode(metadata).expect("it was read"), data);
    let frames: Vec<usize> = (0..metadata.frames as usize).step_by(2).collect();
    let region = Region { start: [1, 0, 1], end: metadata.dims.map(|n| n as usize) };
    let narrow = narrowed(&description, &frames, &region, 1);
    let dims = std::array::from_fn(|axis| region.dims()[axis] as u64);
    let part = Metadata { dims, frames: frames.len() as u64, ..metadata.clone() };
    // a variable may be along one dimension twice, or along that of frames without being an axis: both stay as they are
    let is_alike = |other: &Description| other.variables.len() == description.variables.len();
    assert!(is_alike(&narrow) && narrow.check_size().is_ok() && part.dims.iter().all(|n| *n > 0));
    let (both, lost) = joined(with_frames(description.clone(), 1), &[with_frames(description.clone(), 1)]);
    assert_eq!(both.variables.len() + lost.len(), description.variables.len());
}

/// A valid file with changes and updated checksums, read by the format package.
pub fn forged(data: &[u8]) {
    let mut input = Input::new(data);
    let (sound, seed) = seed(input.byte());
    let edits = edits(&mut input);
    let forged = seed.forge(&edits);
    let read = read_all(&forged);
    if edits.is_empty() {
        assert!(forged == sound && read.is_ok(), "nothing was changed: {read:?}");
    }
}

/// Opens a file as the library does; none if it is refused or would take too long.
fn small(path: &Path) -> Option<CoefficientFile> {
    let file = CoefficientFile::open_with(path, Access::Read).ok()?;
    let long = |window: &Window| window.frames.max(window.coefficients) > 64;
    let voxels = file.grid.dims.iter().try_fold(1_usize, |all, n| all.checked_mul(*n)).unwrap_or(usize::MAX);
    let large = file.largest_block() > 1 << 16 || voxels > 1 << 16 || file.metadata().windows.iter().any(long);
    (!large).then_some(file)
}

/// The same, decoded to samples by the library: some frames of all voxels, and one voxel of all frames. The number of the
/// seed also says the level of detail.
pub fn decode(data: &[u8]) {
    let mut input = Input::new(data);
    let number = input.byte();
    let (_, seed) = seed(number);
    let file = seed.forge(&edits(&mut input));
    with_file(&file, |path| {
        let lod = u32::from(number) / 64;
        let Some(Ok(file)) = small(path).map(|file| file.with_detail(lod)) else { return };
        let whole = file.grid.whole();
        let corner = Region { start: whole.end.map(|end| end - 1), end: whole.end };
        for (frames, region) in [(file.frames().min(9), whole), (file.frames().min(999), corner)] {
            let config = ExtractConfig {
                frames: (0..frames).collect(),
                region,
                channel: 0,
                order: SampleOrder::default(),
                memory: 256 << 20,
            };
            let mut out = Vec::new();
            if extract(&file, &config, path, &mut out, &Silent).is_ok() {
                assert_eq!(out.len(), frames * region.voxels() * file.sample().size());
            }
        }
    });
}

/// The same, drawn by the library: a few frames in a small picture, by any mode and level of detail.
pub fn render(data: &[u8]) {
    let mut input = Input::new(data);
    let (_, seed) = seed(input.byte());
    let [lod, mode, how] = std::array::from_fn(|_| input.byte());
    let view = View { size: [12, 10], ..View::new(f64::from(input.byte()), f64::from(how) - 90.0) };
    let file = seed.forge(&edits(&mut input));
    with_file(&file, |path| {
        let Some(Ok(file)) = small(path).map(|file| file.with_detail(u32::from(lod % 3))) else { return };
        let frames = (0..file.frames().min(9)).collect();
        let mut scene = CoefficientScene::from(file);
        let plain = RenderConfig::new(&scene, view);
        let mode = if mode % 3 == 0 { Mode::Mip { slices: None } } else { Mode::Projection };
        let (fast, certify) = (how % 2 == 1, how % 4 == 2);
        let config = RenderConfig { mode, frames, fast, certify, memory: 256 << 20, ..plain };
        let _ = wavesplat::render::render(&mut scene, &config, &Silent, &mut |_| Ok(()));
    });
}

/// The bare stream of a valid file with changes in its head: without changes it gives the same file.
pub fn bare(data: &[u8]) {
    let mut input = Input::new(data);
    let (sound, _) = seed(input.byte());
    let Ok(stream) = to_bare(&Reader::open(sound).expect("a sound file")) else { return }; // it has a description
    let number = |at: usize| u32::from_le_bytes(stream[at..at + 4].try_into().expect("four bytes"));
    let (stored, parts) = stream[BARE_START..].split_at(number(8) as usize);
    let kind = PartKind::Missing; // of no account: a part and a head are compressed alike
    let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
    let head = EncodedPart { kind, stats, raw_len: number(12), stored: stored.to_vec() };
    let mut head = head.payload().expect("a head");
    let is_changed = !input.is_empty();
    while !input.is_empty() {
        let at = input.short() % head.len();
        head[at] = input.byte();
    }
    let head = Compressor::new(1).and_then(|mut zstd| zstd.part(kind, stats, &head)).expect("memory");
    let lengths = [head.stored.len() as u32, head.raw_len].map(u32::to_le_bytes);
    let checksum = xxhash_rust::xxh3::xxh3_64(&head.stored).to_le_bytes();
    let forged = [&stream[..8], lengths.as_flattened(), &checksum, &head.stored, parts].concat();
    let Ok((file, rest)) = from_bare(&forged) else { return assert!(is_changed, "it was sound") };
    let read = read_all(&file);
    assert!(is_changed || (file == sound && rest.is_empty() && read.is_ok()), "nothing was changed: {read:?}");
}

/// Bytes before the head of a bare stream.
const BARE_START: usize = 24;

/// A file that is truncated or has another end: its complete windows must resume to a valid file.
pub fn prefix(data: &[u8]) {
    let mut input = Input::new(data);
    let (_, seed) = seed(input.byte());
    let cut = input.short();
    let mut file = seed.forge(&edits(&mut input));
    file.truncate(cut * 64); // all sections begin at multiples of 64
    let Ok(found) = CompletePrefix::read(&file) else { return };
    let (end, frames) = (found.bytes() as usize, found.metadata().frames);
    assert!(end <= file.len());
    file.truncate(end);
    assert_eq!(
        CompletePrefix::read(&file).map(|again| again.bytes()).ok(),
        Some(end as u64),
        "the same without the rest"
    );
    let metadata = found.metadata().clone();
    let description = found.features().described.then(Description::default);
    let written = Writer::resume(file, found).finish_described(description.as_ref());
    let error = written.as_ref().err();
    assert_eq!(error.is_none(), frames > 0, "{error:?}");
    if let Ok((file, summary)) = written {
        assert_eq!(summary.bytes, file.len() as u64);
        let reader = Reader::open(&file).expect("it was just finished");
        assert!(reader.metadata() == &metadata);
    }
}

/// A damaged file: the recovered file must be valid, and if the damaged file was valid before, unchanged.
pub fn recovery(data: &[u8]) {
    let mut input = Input::new(data);
    let (sound, seed) = seed(input.byte());
    let forge = input.below(2) == 1;
    let damage = input.below(8);
    let mut file = sound.to_vec();
    let mut damages: Vec<[usize; 4]> = (0..damage)
        .map(|_| [input.below(5), 16 * input.short() + input.below(16), input.short(), input.short()])
        .collect();
    if forge {
        file = seed.forge(&edits(&mut input));
    }
    damages.drain(..).for_each(|how| hurt(&mut file, how));
    let mut searched = 0;
    let Ok(recovery) = Recovery::search(&file, &mut |bytes| searched += bytes) else { return };
    assert_eq!(searched, file.len() as u64);
    if recovery.metadata().blocks() > MOST_BLOCKS {
        return; // all of them would be written as lost
    }
    let saved = recovery.write(&file, Vec::new(), &mut || ());
    if forge {
        saved.map(|(file, _)| Reader::open(&file).map(drop).expect("what was saved is a file")).unwrap_or_default();
        return;
    }
    let (file, saved) = saved.expect("what was sound can be saved");
    is_part_of(&file, sound, &saved);
}

/// Damages a file: flips bits, makes a hole, removes, inserts or moves bytes.
fn hurt(file: &mut Vec<u8>, [how, at, len, more]: [usize; 4]) {
    let at = at % (file.len() + 1);
    let end = (at + len).min(file.len());
    match how {
        0 => file.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << (len % 8)),
        1 => file[at..end].fill(0),
        2 => drop(file.drain(at..end)),
        3 => drop(file.splice(at..at, std::iter::repeat_n(0xAA, len % 1000))),
        _ => {
            let from = (64 * more) % (file.len() + 1);
            let piece = file[from..(from + len).min(file.len())].to_vec();
            file.splice(at..at, piece);
        }
    }
}

/// Whether every recovered block is unchanged.
fn is_part_of(file: &[u8], sound: &[u8], saved: &Recovered) {
    read_all(file).expect("what was saved is sound");
    let (new, old) = (Reader::open(file).expect("sound"), Reader::open(sound).expect("sound"));
    assert!(new.metadata().dims == old.metadata().dims && new.metadata().frames <= old.metadata().frames);
    // Where a window's end and the metadata are both damaged, its totals are computed from its blocks.
    let totals_found = new.metadata().windows == old.metadata().windows;
    assert!(!saved.lost.is_empty() || !saved.all_known || !totals_found || file == sound);
    let leaves = (0..old.metadata().windows.len() as u32).flat_map(|window| old.leaves(window));
    let others = leaves.flat_map(|leaf| old.leaf(leaf).expect("sound")).map(|block| (block.id, block));
    let others: HashMap<_, _> = others.collect();
    for leaf in (0..new.metadata().windows.len() as u32).flat_map(|window| new.leaves(window)) {
        for block in new.leaf(leaf).expect("sound").iter().filter(|block| !block.lost) {
            let other = &others[&block.id];
            assert!(block.stats == other.stats && block.parts.len() == other.parts.len(), "{}", block.id);
            for (part, other_part) in block.parts.iter().zip(&other.parts) {
                assert_eq!(new.part(block, part).expect("sound"), old.part(other, other_part).expect("sound"));
            }
        }
    }
}

/// Reads a file completely unless it is too large. Returns the first error, except those about lost blocks.
pub fn read_all(file: &[u8]) -> Result<()> {
    let reader = Reader::open(file)?;
    let (mut wrong, mut left) = (Vec::new(), MOST_RAW);
    reader.check_structure(&mut |error| wrong.push(error))?;
    for leaf in (0..reader.metadata().windows.len() as u32).flat_map(|window| reader.leaves(window)) {
        let blocks = reader.leaf(leaf)?;
        reader.check_leaf(leaf, &blocks, &mut |error| wrong.push(error))?;
        for block in blocks.iter().filter(|block| !block.lost) {
            let samples = reader.geometry(block.id)?.samples() as u64;
            let raw = block.parts.iter().map(|part| u64::from(part.raw_len) + 4 * samples).sum();
            let Some(less) = left.checked_sub(raw) else { return Ok(()) };
            left = less;
            reader.check_parts(block)?;
        }
    }
    wrong.into_iter().next().map_or(Ok(()), Err)
}

/// Calls a function with the path of a temporary file that holds some bytes.
pub fn with_file<T>(bytes: &[u8], run: impl FnOnce(&Path) -> T) -> T {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("writing a temporary file");
    run(file.path())
}
