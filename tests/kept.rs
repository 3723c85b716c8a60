//! Blocks that stay decoded between reads and pictures give the same samples and pixels, with any room and any threads.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::views::{archive, field};
use crate::common::{Stored, extracted, pictures, stored};
use std::thread;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint};
use wavesplat::extract::read_region;
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Mode, RenderConfig, SplatSource};
use wavesplat::view::camera::View;

const FRAMES: usize = 19;

/// Room for nothing, for a few blocks, for about half of them, and for all.
const ROOMS: [usize; 4] = [1, 20_000, 200_000, 64 << 20];

fn files() -> Vec<Stored> {
    let grid = Grid::unit([11, 9, 8]);
    let samples = field(&grid, FRAMES, 3);
    let source: Memory = archive(grid, SampleType::F32, &samples);
    let file = |basis| {
        let usual = ConvertConfig::new(1e-3);
        let coding = SchemeConstraint { basis: Some(basis), ..usual.coding };
        let window = if basis == Basis::Multi { 9 } else { 8 };
        let config = ConvertConfig { coding, block: Some(4), window, ..usual };
        stored(&mut source.clone(), &config)
    };
    [Basis::Haar, Basis::Multi, Basis::Samples, Basis::Learned].map(file).into()
}

/// The samples of some frames of a box.
fn read(file: &CoefficientFile, random: &mut Random) -> (Vec<f32>, std::ops::Range<usize>, Region) {
    let first = random.below(FRAMES);
    let frames = first..first + 1 + random.below((FRAMES - first).min(9));
    let start = file.grid.dims.map(|n| random.below(n));
    let end = [0, 1, 2].map(|a| start[a] + 1 + random.below(file.grid.dims[a] - start[a]));
    let region = Region { start, end };
    (read_region(file, frames.clone(), &region).expect("samples"), frames, region)
}

#[test]
fn reads_of_a_file_that_keeps_blocks_are_those_of_one_that_does_not() {
    for (stored, lod) in files().iter().flat_map(|stored| [(stored, 0), (stored, 1)]) {
        let open = || stored.open().with_detail(lod).expect("blocks begin on the lattice");
        let (kept, random) = (ROOMS.map(|room| open().keeping_decoded(room)), &mut Random(9));
        let (whole, grid) = (extracted(&open()), open().grid.whole());
        let sample = |frame: usize, voxel| {
            let at = 4 * (frame * grid.voxels() + grid.index(voxel));
            f32::from_le_bytes(whole[at..][..4].try_into().expect("4 bytes"))
        };
        for _ in 0..60 {
            let (samples, frames, region) = read(&open(), random);
            let of_whole = frames.clone().flat_map(|frame| region.iter().map(move |voxel| sample(frame, voxel)));
            assert!(samples.iter().copied().eq(of_whole), "{frames:?} {region}");
            for (kept, room) in kept.iter().zip(ROOMS) {
                assert_eq!(samples, read_region(kept, frames.clone(), &region).expect("samples"), "{room}");
            }
        }
    }
}

/// Files with blocks above others, whose blocks are large enough for tiny parts to be decoded alone.
fn files_with_tiers() -> Vec<Stored> {
    let grid = Grid::unit([35, 20, 33]);
    let samples = field(&grid, 10, 5);
    let source: Memory = archive(grid, SampleType::F32, &samples);
    let file = |basis| {
        let usual = ConvertConfig::new(2e-2);
        let coding = SchemeConstraint { basis: Some(basis), ..usual.coding };
        stored(&mut source.clone(), &ConvertConfig { coding, block: Some(16), window: 8, ..usual })
    };
    [Basis::Samples, Basis::Learned].map(file).into()
}

#[test]
fn tiny_parts_are_those_of_whole_blocks() {
    for (stored, lod) in files_with_tiers().iter().flat_map(|stored| [(stored, 0), (stored, 1)]) {
        let open = || stored.open().with_detail(lod).expect("blocks begin on the lattice");
        assert!(open().metadata().windows[0].tiers() > 0);
        let (kept, random, whole) =
            (ROOMS.map(|room| open().keeping_decoded(room)), &mut Random(3), open().grid.whole());
        let all = read_region(&open(), 0..10, &whole).expect("samples");
        for _ in 0..150 {
            let start = whole.end.map(|n| random.below(n));
            let end = [0, 1, 2].map(|a| start[a] + 1 + random.below((whole.end[a] - start[a]).min(3)));
            let (region, first) = (Region { start, end }, random.below(10));
            let frames = first..first + 1 + random.below(10 - first);
            let sample = |frame: usize, voxel| all[frame * whole.voxels() + whole.index(voxel)];
            let expected: Vec<f32> =
                frames.clone().flat_map(|frame| region.iter().map(move |voxel| sample(frame, voxel))).collect();
            assert_eq!(read_region(&open(), frames.clone(), &region).expect("samples"), expected, "{region} {lod}");
            for (kept, room) in kept.iter().zip(ROOMS) {
                assert_eq!(read_region(kept, frames.clone(), &region).expect("samples"), expected, "{room} {region}");
            }
        }
    }
}

#[test]
fn threads_share_the_blocks_that_are_kept() {
    for stored in files() {
        let kept = &stored.open().keeping_decoded(200_000);
        thread::scope(|scope| {
            for n in 0..4 {
                let stored = &stored;
                scope.spawn(move || {
                    let random = &mut Random(n);
                    for _ in 0..40 {
                        let (samples, frames, region) = read(kept, random);
                        assert_eq!(samples, read_region(&stored.open(), frames, &region).expect("samples"));
                    }
                });
            }
        });
    }
}

/// With room for a few frames, a loop decodes as many together; with room for all, the second frame decodes them.
#[test]
fn a_loop_over_frames_reads_fewer_bytes() {
    let region = Region { start: [1, 0, 2], end: [11, 9, 8] };
    for (stored, lod) in files().iter().flat_map(|stored| [(stored, 0), (stored, 1)]) {
        let open = || stored.open().with_detail(lod).expect("blocks begin on the lattice");
        let read_all = |file: &CoefficientFile| {
            let region = region.every(1 << lod);
            let frame = |frame: usize| read_region(file, frame..frame + 1, &region).expect("a frame");
            let samples: Vec<Vec<f32>> =
                [11, 4].into_iter().chain(0..FRAMES).chain([3, 4, 2, 5, 6, 7, 8]).map(frame).collect();
            (samples, file.bytes_read())
        };
        let (plain, bytes) = read_all(&open());
        let rooms = [3, 4, 64 << 10].map(|frames| frames * 4 * open().grid.whole().voxels());
        for room in rooms {
            let (samples, kept) = read_all(&open().keeping_decoded(room));
            assert!(samples == plain, "{lod} {room}");
            // A few frames of a transform along time need more than one of them, but less than each by itself.
            assert!(lod > 0 || 5 * kept < 4 * bytes, "{room}: {kept} of {bytes}");
        }
    }
}

/// What pictures show.
#[derive(Debug, Clone, Copy)]
struct Look {
    angle: f64,
    lod: u32,
    allowed: Option<f64>,
    what: SplatSource,
    /// None for all.
    frame: Option<usize>,
    /// Whether pictures show largest values.
    peaks: bool,
}

const FRONT: Look =
    Look { angle: 10.0, lod: 0, allowed: None, what: SplatSource::Coefficients, frame: None, peaks: false };
const SIDE: Look = Look { angle: 80.0, ..FRONT };
const SIXTH: Look = Look { frame: Some(5), ..FRONT };

/// One after another.
const LOOKS: [Look; 14] = [
    SIXTH,
    Look { angle: 80.0, ..SIXTH },
    Look { frame: Some(6), ..SIXTH },
    Look { peaks: true, ..SIXTH },
    Look { peaks: true, ..FRONT },
    Look { peaks: true, ..SIXTH },
    Look { allowed: Some(0.02), ..SIXTH },
    Look { lod: 1, ..SIXTH },
    FRONT,
    SIDE,
    Look { lod: 1, ..SIDE },
    Look { allowed: Some(0.02), ..FRONT },
    Look { what: SplatSource::Samples, ..FRONT },
    FRONT,
];

/// The bits of the pictures of a file.
fn drawn(file: &CoefficientFile, look: Look) -> Vec<u32> {
    let Look { angle, lod, allowed, what, frame, peaks } = look;
    let lod = file.coarsest_detail().min(lod);
    let mut scene = CoefficientScene::new(file.clone().with_detail(lod).expect("a level"), what);
    let view = View { size: [30, 20], ..View::new(angle, 20.0) };
    let usual = RenderConfig::new(&scene, view);
    let mode = if peaks { Mode::Mip { slices: None } } else { usual.mode.clone() };
    let frames = frame.map_or(usual.frames.clone(), |frame| vec![frame]);
    let config = RenderConfig { allowed, mode, frames, ..usual };
    pictures(&mut scene, &config).0.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn pictures_of_a_file_that_keeps_blocks_are_those_of_one_that_does_not() {
    // Coefficients of learned functions are kept like those of Haar functions.
    for stored in files()[..3].iter().chain(&files_with_tiers()) {
        let kept = ROOMS.map(|room| stored.open().keeping_decoded(room));
        for look in LOOKS {
            let plain = drawn(&stored.open(), look);
            for (kept, room) in kept.iter().zip(ROOMS) {
                assert_eq!(drawn(kept, look), plain, "{room} {look:?}");
            }
        }
    }
}
