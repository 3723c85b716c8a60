//! What another program uses: arrays in, files in any storage, regions out.

use crate::common::memory::Memory;
use crate::common::{Stored, extracted, pictures, settings, stored};
use std::io;
use std::ops::Range;
use std::sync::{Arc, Mutex};
use wavesplat::colour::Scale;
use wavesplat::convert::{Basis, ConvertConfig, MissingPolicy, SchemeConstraint, convert_to_file};
use wavesplat::extract::read_region;
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Mode, RenderConfig, check, render_png};
use wavesplat::source::ArraySource;
use wavesplat::view::camera::View;
use wavesplat::{Error, Grid, Region, SampleType};
use wavesplat_format::Storage;

const DIMS: [usize; 3] = [20, 14, 9];
const FRAMES: usize = 12;
const MISSING: f64 = -1e30;

/// Every voxel another value; one of them missing in every frame.
fn samples() -> Vec<f32> {
    let voxels = DIMS.iter().product::<usize>();
    let value = |i: usize| if i % voxels == 77 { MISSING as f32 } else { (i as f32 * 0.01).sin() };
    (0..FRAMES * voxels).map(value).collect()
}

fn config() -> ConvertConfig {
    let (coding, missing) = (SchemeConstraint::from(Basis::Haar), MissingPolicy::Mask);
    ConvertConfig {
        coding,
        window: 8,
        block: Some(5),
        missing,
        missing_value: Some(MISSING),
        ..ConvertConfig::new(0.0)
    }
}

/// A storage far away: remembers the ranges of each request.
#[derive(Clone, Default)]
struct Remote {
    bytes: Vec<u8>,
    asked: Arc<Mutex<Vec<Vec<Range<u64>>>>>,
}

impl Remote {
    fn of(bytes: Vec<u8>) -> Self {
        Self { bytes, ..Self::default() }
    }

    /// The ranges that were asked for since this was asked last, those of one time together.
    fn asked(&self) -> Vec<Vec<Range<u64>>> {
        std::mem::take(&mut self.asked.lock().unwrap())
    }
}

impl Storage for Remote {
    fn len(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.asked.lock().unwrap().push(vec![offset..offset + out.len() as u64; 1]);
        self.bytes.read_at(offset, out)
    }

    fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
        if !ranges.is_empty() {
            self.asked.lock().unwrap().push(ranges.to_vec());
        }
        self.bytes.read_many(ranges)
    }

    fn is_remote(&self) -> bool {
        true
    }
}

#[test]
fn an_array_becomes_a_file_and_any_region_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.wspl");
    std::fs::write(&path, "what was there before").unwrap();
    let samples = samples();
    let mut source = ArraySource::from_f32(DIMS, &samples).unwrap();
    let report = convert_to_file(&mut source, &config(), &path).unwrap();
    assert_eq!((report.frames, report.missing), (FRAMES as u64, FRAMES as u64));
    let file = CoefficientFile::open(&path).unwrap();
    let whole = file.grid.whole();
    for (frames, region) in [
        (0..FRAMES, whole),
        (7..9, Region { start: [3, 0, 1], end: [20, 7, 9] }),
        (11..12, Region { start: [17, 3, 0], end: [18, 4, 1] }),
        (4..4, whole),
    ] {
        let found = read_region(&file, frames.clone(), &region).unwrap();
        let at = |frame: usize| region.iter().map(move |voxel| frame * whole.voxels() + whole.index(voxel));
        let expected: Vec<f32> = frames.flat_map(at).map(|i| samples[i]).collect();
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!(*found == expected || found.is_nan() && f64::from(expected) == f64::from(MISSING as f32));
        }
    }
}

#[test]
fn a_region_that_is_not_there_is_an_error() {
    let mut memory = Memory::new(Grid::unit([4, 3, 2]), SampleType::U8, vec![7; 10 * 24]);
    let stored = stored(&mut memory, &settings(Basis::Haar, 8, 0.0));
    let file = stored.open();
    assert_eq!(read_region(&file, 8..10, &file.grid.whole()).unwrap(), [7.0; 48]);
    for (frames, end) in [(8..11, [4, 3, 2]), (0..1, [5, 3, 2]), (0..1, [4, 0, 2]), (0..1, [usize::MAX; 3])] {
        assert!(read_region(&file, frames, &Region { start: [0; 3], end }).is_err(), "{end:?}");
    }
}

#[test]
fn settings_that_a_scene_cannot_meet_are_errors() {
    let mut source = ArraySource::from_f32(DIMS, &samples()).unwrap();
    let scene = CoefficientScene::from(stored(&mut source, &config()).open());
    let plain = RenderConfig::new(&scene, View { size: [20, 20], ..View::new(30.0, 20.0) });
    let of_frames = |frames| RenderConfig { frames, ..plain.clone() };
    let of_error = |splat_error| RenderConfig { splat_error, ..plain.clone() };
    assert!(check(&scene, &plain).is_ok());
    for (config, named) in [
        (of_frames(vec![5, 2]), "frames"),
        (of_frames(vec![0, FRAMES]), "frames"),
        (of_error(-1.0), "splat_error"),
        (of_error(f64::NAN), "splat_error"),
    ] {
        let refused = check(&scene, &config).unwrap_err();
        assert!(matches!(refused, Error::Setting { setting, .. } if setting == named), "{refused}");
    }
}

#[test]
fn a_file_opens_from_any_storage() {
    let mut source = ArraySource::from_f32(DIMS, &samples()).unwrap();
    let stored = stored(&mut source, &config());
    let (bytes, local) = (stored.bytes(), stored.open());
    let memory = CoefficientFile::from_storage("memory", bytes.clone()).unwrap();
    assert_eq!((memory.id(), memory.bytes()), (local.id(), bytes.len() as u64));
    assert_eq!(extracted(&memory), extracted(&local));
    memory.check_stored().unwrap();
    memory.check_unchanged().unwrap();
    let cut = CoefficientFile::from_storage("memory", bytes[..bytes.len() - 64].to_vec()).unwrap_err();
    assert!(cut.to_string().starts_with("memory: "), "{cut}");
}

/// A file of noise, most of which is far from its ends.
fn large() -> Stored {
    let dims = [40, 30, 20];
    let noise = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 8) as f32;
    let samples: Vec<f32> = (0..dims.iter().product::<usize>() * FRAMES).map(noise).collect();
    let mut source = ArraySource::from_f32(dims, &samples).unwrap();
    stored(&mut source, &ConvertConfig { block: Some(10), ..config() })
}

#[test]
fn a_remote_file_needs_few_requests() {
    let stored = large();
    let remote = Remote::of(stored.bytes());
    let file = CoefficientFile::from_storage("https://example.org/a.wspl", remote.clone()).unwrap();
    assert_eq!(remote.asked().len(), 1, "both ends come together");
    assert_eq!(extracted(&file), extracted(&stored.open()));
    assert!((1..=2).contains(&remote.asked().len()), "leaves, then blocks");
    assert_eq!(extracted(&file), extracted(&stored.open()));
    assert!(remote.asked().is_empty(), "what was read is kept");
}

#[test]
fn pictures_of_a_remote_file_are_the_same() {
    let stored = large();
    let remote = Remote::of(stored.bytes());
    let file = CoefficientFile::from_storage("far", remote.clone()).unwrap();
    let (mut local, mut far) = (CoefficientScene::from(stored.open()), CoefficientScene::from(file));
    let view = View { size: [60, 50], ..View::new(30.0, 20.0) };
    let plain = RenderConfig::new(&far, view);
    remote.asked();
    for mode in [Mode::Projection, Mode::Mip { slices: None }] {
        let config = RenderConfig { mode, ..plain.clone() };
        let ((near, _), (far, _)) = (pictures(&mut local, &config), pictures(&mut far, &config));
        assert!(near.iter().zip(&far).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert!(remote.asked().len() <= 2, "leaves, then blocks");
    }
}

#[test]
fn a_batch_of_damaged_blocks_names_the_place() {
    let mut source = ArraySource::from_f32(DIMS, &samples()).unwrap();
    let mut bytes = stored(&mut source, &config()).bytes();
    let sound = CoefficientFile::from_storage("sound", bytes.clone()).unwrap();
    let entry = sound.leaf(&sound.leaves(0)[0]).unwrap()[3].clone();
    bytes[entry.parts[0].offset as usize] ^= 1;
    let file = CoefficientFile::from_storage("far", Remote::of(bytes)).unwrap();
    let error = read_region(&file, 0..1, &file.grid.whole()).unwrap_err();
    assert!(error.to_string().contains(&entry.id.to_string()), "{error}");
}

#[test]
fn pictures_of_all_views_become_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut source = ArraySource::from_f32(DIMS, &samples()).unwrap();
    let file = stored(&mut source, &config());
    let mut scene = CoefficientScene::from(file.open());
    let view = View { size: [40, 30], ..View::new(30.0, 20.0) };
    let views = vec![view, View { azimuth: 60.0, ..view }];
    let config = RenderConfig { views, frames: vec![2, 11], ..RenderConfig::new(&scene, view) };
    let colours = Scale::named("viridis", (-1.0, 1.0)).unwrap();
    for _ in 0..2 {
        render_png(&mut scene, &config, &colours, folder.path().join("v%v_%02d.png")).unwrap();
    }
    for name in ["v0_02.png", "v0_11.png", "v1_02.png", "v1_11.png"] {
        assert!(std::fs::read(folder.path().join(name)).unwrap().starts_with(b"\x89PNG"), "{name}");
    }
    assert!(render_png(&mut scene, &config, &colours, folder.path().join("%02d.png")).is_err());
}
