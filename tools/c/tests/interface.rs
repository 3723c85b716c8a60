//! The functions do what the header says, and refuse what they cannot do.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString};
use std::path::Path;
use std::ptr::{null, null_mut};
use wavesplat::Grid;
use wavesplat::base::description::{coordinates, is_of};
use wavesplat::convert::{ConvertConfig, convert_to_file};
use wavesplat::source::ArraySource;
use wavesplat_c::*;

const DIMS: [usize; 3] = [6, 5, 4];
const VOXELS: usize = 6 * 5 * 4;

fn frames() -> WavesplatFrames {
    WavesplatFrames {
        dims: DIMS,
        sample: WAVESPLAT_F32,
        spacing: [0.0; 3],
        origin: [0.0; 3],
        coordinates: [null(); 3],
        first_time: 0.0,
        time_step: 0.0,
        time_unit: null(),
        variable: null(),
        unit: null(),
    }
}

fn samples(count: usize) -> Vec<f32> {
    (0..count * VOXELS).map(|i| (i as f32 * 0.013).sin() + (i / VOXELS) as f32 * 0.1).collect()
}

fn text(text: impl AsRef<Path>) -> CString {
    CString::new(text.as_ref().to_str().expect("UTF-8")).expect("no 0")
}

fn message() -> String {
    // SAFETY: it is valid until the next call.
    unsafe { CStr::from_ptr(wavesplat_message()) }.to_str().expect("UTF-8").into()
}

fn create(path: &Path, frames: &WavesplatFrames, settings: &str, replace: bool) -> Result<*mut WavesplatWriter, i32> {
    let (path, settings, mut writer) = (text(path), text(settings), null_mut());
    // SAFETY: all pointers are valid.
    match unsafe { wavesplat_create(path.as_ptr(), frames, settings.as_ptr(), replace.into(), &raw mut writer) } {
        WAVESPLAT_OK => Ok(writer),
        status => Err(status),
    }
}

fn push(writer: *mut WavesplatWriter, frame: &[f32]) -> i32 {
    assert_eq!(frame.len(), VOXELS);
    // SAFETY: the frame is whole.
    unsafe { wavesplat_push(writer, frame.as_ptr().cast(), null()) }
}

/// Ends a file. The writer is used for the last time.
fn finish(writer: *mut WavesplatWriter) -> i32 {
    // SAFETY: `create` made it.
    unsafe { wavesplat_finish(writer) }
}

/// Pushes all frames, and ends the file.
fn push_all(writer: *mut WavesplatWriter, samples: &[f32]) {
    samples.chunks_exact(VOXELS).for_each(|frame| assert_eq!(push(writer, frame), WAVESPLAT_OK));
    assert_eq!(finish(writer), WAVESPLAT_OK);
}

fn open(path: &Path, lod: u32) -> Result<*mut WavesplatFile, i32> {
    let (path, mut file) = (text(path), null_mut());
    // SAFETY: both pointers are valid.
    match unsafe { wavesplat_open(path.as_ptr(), lod, &raw mut file) } {
        WAVESPLAT_OK => Ok(file),
        status => Err(status),
    }
}

#[test]
fn pushed_frames_give_the_bytes_of_an_array() {
    let folder = tempfile::tempdir().expect("a folder");
    let (pushed, whole) = (folder.path().join("a.wspl"), folder.path().join("b.wspl"));
    let samples = samples(70);
    let writer = create(&pushed, &frames(), r#"{"max_error": 0.01, "window": 32}"#, false).expect("a writer");
    push_all(writer, &samples);
    let mut source = ArraySource::from_f32(DIMS, &samples).expect("whole frames");
    convert_to_file(&mut source, &ConvertConfig::with_max_error(0.01), &whole).expect("a file");
    assert!(std::fs::read(pushed).expect("a file") == std::fs::read(whole).expect("a file"), "other bytes");
}

#[test]
fn strides_may_leave_out_and_turn_round() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let [nx, ny, nz] = DIMS;
    let ghosts: Vec<f32> = (0..(nx + 2) * (ny + 2) * (nz + 2)).map(|i| i as f32).collect();
    let at = |i: usize, j: usize, k: usize| (i + 1) + (nx + 2) * ((j + 1) + (ny + 2) * (k + 1));
    let (row, layer) = ((nx + 2) as isize * 4, ((nx + 2) * (ny + 2)) as isize * 4);
    let writer = create(&path, &frames(), r#"{"tolerance": 0}"#, false).expect("a writer");
    for (first, strides) in [(at(0, 0, 0), [4, row, layer]), (at(nx - 1, 0, nz - 1), [-4, row, -layer])] {
        // SAFETY: the strides stay within `ghosts`.
        assert_eq!(unsafe { wavesplat_push(writer, ghosts[first..].as_ptr().cast(), strides.as_ptr()) }, WAVESPLAT_OK);
    }
    assert_eq!(finish(writer), WAVESPLAT_OK);
    let file = open(&path, 0).expect("a file");
    let mut found = vec![0_f32; 2 * VOXELS];
    // SAFETY: `found` has room.
    let read = unsafe { wavesplat_read(file, 0, 2, null(), null(), 0, found.as_mut_ptr().cast(), 8 * VOXELS) };
    assert_eq!(read, WAVESPLAT_OK);
    for (n, value) in found.iter().enumerate() {
        let (turned, i, j, k) = (n >= VOXELS, n % nx, n / nx % ny, n / (nx * ny) % nz);
        let expected = if turned { at(nx - 1 - i, j, nz - 1 - k) } else { at(i, j, k) };
        assert_eq!(value.to_bits(), (expected as f32).to_bits(), "{n}");
    }
    // SAFETY: it is used for the last time.
    unsafe { wavesplat_close(file) };
}

#[test]
fn memory_of_the_library_is_taken_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, whole) = (folder.path().join("a.wspl"), folder.path().join("b.wspl"));
    let samples = samples(40);
    let writer = create(&path, &frames(), r#"{"max_error": 0.01, "window": 32}"#, false).expect("a writer");
    for (n, frame) in samples.chunks_exact(VOXELS).enumerate() {
        let mut room = null_mut();
        // SAFETY: `room` receives memory for a frame, which is filled before it is pushed.
        unsafe {
            assert_eq!(wavesplat_room(writer, &raw mut room), WAVESPLAT_OK);
            let first = room;
            assert_eq!(
                (wavesplat_room(writer, &raw mut room), room),
                (WAVESPLAT_OK, first),
                "the same until it is pushed"
            );
            assert!(room.cast::<f64>().is_aligned());
            room.cast::<f32>().copy_from_nonoverlapping(frame.as_ptr(), VOXELS);
        }
        match n % 3 {
            0 => assert_eq!(push(writer, frame), WAVESPLAT_OK, "other memory may come between"),
            // SAFETY: the frame is whole, and still there when it is refused.
            _ => unsafe {
                assert_eq!(wavesplat_push(writer, room, null()), WAVESPLAT_OK);
                assert_eq!(wavesplat_push(writer, room, null()), WAVESPLAT_ARGUMENT, "a second time");
            },
        }
    }
    assert_eq!(finish(writer), WAVESPLAT_OK);
    let mut source = ArraySource::from_f32(DIMS, &samples).expect("whole frames");
    convert_to_file(&mut source, &ConvertConfig::with_max_error(0.01), &whole).expect("a file");
    assert!(std::fs::read(path).expect("a file") == std::fs::read(whole).expect("a file"), "other bytes");
}

/// Pushes frames with times of their own.
fn push_at(writer: *mut WavesplatWriter, time: f64, frame: &[f32]) -> i32 {
    assert_eq!(frame.len(), VOXELS);
    // SAFETY: the frame is whole.
    unsafe { wavesplat_push_at(writer, time, frame.as_ptr().cast(), null()) }
}

#[test]
fn frames_have_times_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let samples = samples(50);
    let times: Vec<f64> = (0..50).map(|n| 0.1 * f64::from(n * n) - 3.0).collect();
    for memory in ["", r#", "memory": 30000000"#] {
        let path = folder.path().join("a.wspl");
        let settings = format!(r#"{{"max_error": 0.01, "window": 8{memory}}}"#);
        let timed = WavesplatFrames { time_unit: c"s".as_ptr(), ..frames() };
        let writer = create(&path, &timed, &settings, true).expect("a writer");
        for (frame, time) in samples.chunks_exact(VOXELS).zip(&times) {
            assert_eq!(push_at(writer, *time, frame), WAVESPLAT_OK, "{}", message());
            for wrong in [*time, time - 1.0, f64::NAN, f64::INFINITY] {
                assert_eq!(push_at(writer, wrong, frame), WAVESPLAT_ARGUMENT, "and the file goes on");
            }
            assert_eq!(push(writer, frame), WAVESPLAT_ARGUMENT);
            assert!(message().contains("needs one"), "{}", message());
        }
        assert_eq!(finish(writer), WAVESPLAT_OK);
        let file = wavesplat::file::CoefficientFile::open(&path).expect("a file");
        assert_eq!(file.metadata().times, times);
        assert_eq!(wavesplat::file::setting(file.metadata(), "time-units"), Some("s"));
    }
    let regular = WavesplatFrames { time_step: 1.0, ..frames() };
    for (frames, first, second) in [(regular, None, Some(1.0)), (frames(), None, Some(1.0))] {
        let writer = create(&folder.path().join("b.wspl"), &frames, "{}", true).expect("a writer");
        for (time, expected) in [(first, WAVESPLAT_OK), (second, WAVESPLAT_ARGUMENT)] {
            let frame = &samples[..VOXELS];
            assert_eq!(time.map_or_else(|| push(writer, frame), |time| push_at(writer, time, frame)), expected);
        }
        // SAFETY: it is used for the last time.
        unsafe { wavesplat_abandon(writer) };
    }
}

#[test]
fn coordinates_are_kept_where_distances_differ() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let (x, y) = ([0.0, 1.0, 3.0, 7.0, 8.0, 10.0], [5.0, 5.5, 6.0, 6.5, 7.0]);
    let stretched =
        WavesplatFrames { coordinates: [x.as_ptr(), y.as_ptr(), null()], spacing: [9.0, 0.0, 0.25], ..frames() };
    let writer = create(&path, &stretched, r#"{"window": 8}"#, false).expect("a writer");
    push_all(writer, &samples(20));
    let file = wavesplat::file::CoefficientFile::open(&path).expect("a file");
    assert_eq!(file.grid, Grid { dims: DIMS, spacing: [2.0, 0.5, 0.25], origin: [0.0, 5.0, 0.0] });
    let description = file.description().expect("it is read").expect("one");
    let found = [0, 1, 2].map(|axis| coordinates(&description, axis).expect("some"));
    assert_eq!(found, [x.to_vec(), y.to_vec(), vec![0.0, 0.25, 0.5, 0.75]]);
    assert!(is_of(&description, DIMS, 20));
    let (coarse, mut room) = (open(&path, 1).expect("every second voxel"), [0.0; 3]);
    // SAFETY: there is room for 3.
    unsafe {
        assert_eq!(wavesplat_coordinates(coarse, 0, room.as_mut_ptr()), WAVESPLAT_OK);
        assert_eq!(room, [0.0, 3.0, 8.0]);
        assert_eq!(wavesplat_coordinates(coarse, 2, room.as_mut_ptr()), WAVESPLAT_OK);
        assert_eq!(room[..2], [0.0, 0.5]);
        assert_eq!(wavesplat_coordinates(coarse, 3, room.as_mut_ptr()), WAVESPLAT_ARGUMENT);
        wavesplat_close(coarse);
    }
    for wrong in [[0.0, 1.0, 3.0, 2.0, 8.0, 10.0], [f64::NAN; 6], [0.0, 1.0, 2.0, 3.0, 4.0, f64::INFINITY]] {
        let frames = WavesplatFrames { coordinates: [wrong.as_ptr(), null(), null()], ..frames() };
        assert_eq!(create(&path, &frames, "{}", true).err(), Some(WAVESPLAT_ARGUMENT));
        assert!(message().starts_with("coordinates: those along x"), "{}", message());
    }
    let many: Vec<f64> = (0..(1 << 21) - 30).map(|n| f64::from(n) * f64::from(n)).collect();
    let long = WavesplatFrames { dims: [many.len(), 1, 1], coordinates: [many.as_ptr(), null(), null()], ..frames() };
    assert_eq!(create(&path, &long, "{}", true).err(), Some(WAVESPLAT_ARGUMENT), "before any frame is pushed");
    assert!(message().contains("too much room"), "{}", message());
}

#[test]
fn a_region_of_some_frames_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let samples = samples(9);
    let timed = WavesplatFrames { first_time: 1.0, time_step: 0.25, ..frames() };
    let writer = create(&path, &timed, r#"{"tolerance": 0}"#, false).expect("a writer");
    push_all(writer, &samples);
    let file = open(&path, 0).expect("a file");
    let (mut info, mut times) = (WavesplatInfo::default(), [0.0; 4]);
    // SAFETY: all have room.
    unsafe {
        assert_eq!(wavesplat_info(file, &raw mut info), WAVESPLAT_OK);
        assert_eq!(wavesplat_times(file, 5, 4, times.as_mut_ptr()), WAVESPLAT_OK);
        assert_eq!(wavesplat_times(file, 6, 4, times.as_mut_ptr()), WAVESPLAT_ARGUMENT);
    }
    assert_eq!((info.dims, info.frames, info.sample, info.sample_bytes), (DIMS, 9, WAVESPLAT_F32, 4));
    assert!(info.has_times && times == [2.25, 2.5, 2.75, 3.0] && info.reached <= 0.0);
    let (start, end, mut found) = ([1, 0, 2], [5, 5, 3], vec![0_f32; 2 * 4 * 5]);
    let mut read = |first, bytes| {
        // SAFETY: `found` has room.
        unsafe { wavesplat_read(file, first, 2, start.as_ptr(), end.as_ptr(), 0, found.as_mut_ptr().cast(), bytes) }
    };
    assert_eq!((read(8, 160), read(usize::MAX, 160), read(3, 156)), (1, 1, 1));
    assert!(message().contains("156"), "{}", message());
    assert_eq!(read(3, 160), WAVESPLAT_OK);
    for (n, value) in found.iter().enumerate() {
        let (frame, j, i) = (3 + n / 20, n / 4 % 5, 1 + n % 4);
        assert_eq!(value.to_bits(), samples[frame * VOXELS + 2 * 30 + j * 6 + i].to_bits(), "{n}");
    }
    // SAFETY: it is used for the last time.
    unsafe { wavesplat_close(file) };
    assert_eq!(open(&path, 30).err(), Some(WAVESPLAT_ARGUMENT));
}

#[test]
fn what_cannot_be_done_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    for (frames, settings, words) in [
        (WavesplatFrames { sample: 9, ..frames() }, "{}", "sample 9"),
        (WavesplatFrames { dims: [0, 1, 1], ..frames() }, "{}", "dims"),
        (WavesplatFrames { dims: [usize::MAX, 2, 1], ..frames() }, "{}", "dims"),
        (WavesplatFrames { spacing: [1.0, -1.0, 1.0], ..frames() }, "{}", "spacing"),
        (WavesplatFrames { origin: [f64::NAN; 3], ..frames() }, "{}", "origin"),
        (WavesplatFrames { time_step: -1.0, ..frames() }, "{}", "time_step: takes steps above 0"),
        (frames(), "{", "settings"),
        (frames(), "[0.5]", "an object"),
        (frames(), r#"{"shard": "1/2", "range": [0, 1]}"#, "for files of frames"),
        (frames(), r#"{"tolerence": 1}"#, "tolerence"),
        (frames(), r#"{"tolerance": 1, "max_error": 1}"#, "give one"),
    ] {
        assert_eq!(create(&path, &frames, settings, true).err(), Some(WAVESPLAT_ARGUMENT));
        assert!(message().contains(words), "{words}: {}", message());
    }
    // SAFETY: null is refused.
    unsafe {
        assert_eq!(wavesplat_push(null_mut(), [0_f32; VOXELS].as_ptr().cast(), null()), WAVESPLAT_ARGUMENT);
        assert_eq!(wavesplat_finish(null_mut()), WAVESPLAT_ARGUMENT);
        wavesplat_abandon(null_mut());
        wavesplat_close(null_mut());
    }
    assert_eq!(open(Path::new("/nowhere.wspl"), 0).err(), Some(WAVESPLAT_IO));
    std::fs::write(&path, "no coefficients").expect("a file");
    assert_eq!(open(&path, 0).err(), Some(WAVESPLAT_DAMAGED));
    assert_eq!(create(&path, &frames(), "{}", false).err(), Some(WAVESPLAT_ARGUMENT));
    assert!(message().contains("exists already"), "{}", message());
    assert_eq!(create(Path::new("/nowhere/a.wspl"), &frames(), "", true).err(), Some(WAVESPLAT_ARGUMENT));
    assert!(message().contains("/nowhere: is no folder"), "{}", message());
    assert_eq!(create(folder.path(), &frames(), "", true).err(), Some(WAVESPLAT_ARGUMENT));
    assert!(message().contains("is a folder"), "{}", message());
}

#[test]
fn an_error_on_the_way_ends_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let writer = create(&path, &frames(), r#"{"max_error": 0.01, "window": 4}"#, false).expect("a writer");
    let (good, bad) = (samples(1), vec![f32::NAN; VOXELS]);
    assert_eq!(push(writer, &good), WAVESPLAT_OK);
    let failed = (0..1000).map(|_| push(writer, &bad)).find(|status| *status != WAVESPLAT_OK);
    assert_eq!(failed, Some(WAVESPLAT_INPUT), "the conversion says so once it has seen a window");
    assert!(message().contains("missing"), "{}", message());
    assert_eq!(push(writer, &good), WAVESPLAT_ARGUMENT);
    assert_eq!(finish(writer), WAVESPLAT_ARGUMENT);
    assert!(message().contains("failed before") && message().contains("missing"), "{}", message());
    assert!(!path.exists());
}

#[test]
fn an_abandoned_file_keeps_its_windows() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, part) = (folder.path().join("a.wspl"), folder.path().join("a.wspl.part"));
    let writer = create(&path, &frames(), r#"{"max_error": 0.01, "window": 4}"#, false).expect("a writer");
    samples(21).chunks_exact(VOXELS).for_each(|frame| assert_eq!(push(writer, frame), WAVESPLAT_OK));
    // SAFETY: it is used for the last time.
    unsafe { wavesplat_abandon(writer) };
    assert!(!path.exists() && part.exists());
    let bytes = std::fs::read(&part).expect("a file");
    assert_eq!(create(&path, &frames(), "{}", false).err(), Some(WAVESPLAT_ARGUMENT));
    assert!(message().contains("a.wspl.part: exists already"), "{}", message());
    let complete = wavesplat::format::CompletePrefix::read(&bytes).expect("windows").metadata().frames;
    assert!((4..=20).contains(&complete), "{complete}");
}

#[test]
fn the_grid_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let placed = WavesplatFrames { spacing: [0.5, 0.0, 2.0], origin: [1.0, 2.0, 3.0], ..frames() };
    let writer = create(&path, &placed, "{}", false).expect("a writer");
    assert_eq!(push(writer, &samples(1)), WAVESPLAT_OK);
    assert_eq!(finish(writer), WAVESPLAT_OK);
    let grid = wavesplat::file::CoefficientFile::open(path).expect("a file").grid;
    assert_eq!(grid, Grid { dims: DIMS, spacing: [0.5, 1.0, 2.0], origin: [1.0, 2.0, 3.0] });
}

/// Programs flush small numbers to zero where they are built to be fast.
#[cfg(target_arch = "x86_64")]
#[test]
fn the_arithmetic_of_the_caller_does_not_matter() {
    use std::arch::asm;
    let set = |control: u32| {
        // SAFETY: it loads a control register with a valid value.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const control) };
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.wspl");
    let tiny: Vec<f32> = (0..VOXELS).map(|i| f32::from_bits(40 + 977 * i as u32)).collect();
    set(0x1F80 | 0x8040 | 0x6000); // flushed to zero, and rounded to zero
    let writer = create(&path, &frames(), r#"{"bound": {"relative": {"floor": 0}}, "tolerance": 0.01}"#, false);
    let writer = writer.expect("a writer");
    let pushed = (0..40).map(|_| push(writer, &tiny)).max();
    // SAFETY: it is used for the last time.
    let finished = unsafe { wavesplat_finish(writer) };
    let file = open(&path, 0).expect("a file");
    let mut found = vec![0_f32; VOXELS];
    // SAFETY: `found` has room.
    let read = unsafe { wavesplat_read(file, 39, 1, null(), null(), 0, found.as_mut_ptr().cast(), 4 * VOXELS) };
    set(0x1F80);
    // SAFETY: it is used for the last time.
    unsafe { wavesplat_close(file) };
    assert_eq!((pushed, finished, read), (Some(WAVESPLAT_OK), WAVESPLAT_OK, WAVESPLAT_OK));
    for (found, given) in found.iter().zip(&tiny) {
        assert!((f64::from(*found) - f64::from(*given)).abs() <= 0.01 * f64::from(*given), "{found:e} {given:e}");
    }
}
