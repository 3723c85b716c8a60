//! What the tests of sources and of formats share: samples with known values, and a slow read of boxes.

use super::{FrameSource, FrameWindow};
use crate::base::error::Result;
use crate::base::grid::{Grid, Region};
use crate::base::sample::{SampleType, load, store, swap_endian};

/// Voxels of the tests' frames: all different, none a power of two.
pub const DIMS: [usize; 3] = [7, 5, 3];

/// The value of a voxel of a frame: every type holds it, and no two of a frame are the same.
pub fn value(ty: SampleType, frame: usize, voxel: usize) -> f64 {
    let value = (voxel + frame) as f64;
    if ty.is_float() { value / 4.0 - 3.0 } else { value }
}

/// The bytes of frames of `DIMS` one after another.
pub fn payload(ty: SampleType, frames: std::ops::Range<usize>, big_endian: bool) -> Vec<u8> {
    let voxels = DIMS.iter().product::<usize>();
    let values: Vec<f64> = frames.flat_map(|t| (0..voxels).map(move |i| value(ty, t, i))).collect();
    let mut bytes = vec![0; values.len() * ty.size()];
    store(ty, &values, &mut bytes);
    if big_endian {
        swap_endian(ty, &mut bytes);
    }
    bytes
}

/// Boxes of every kind: whole, whole rows, whole planes, single voxels, inner ones, empty.
fn regions() -> Vec<Region> {
    let [x, y, z] = DIMS;
    let region = |start, end| Region { start, end };
    vec![
        region([0, 0, 0], DIMS),
        region([0, 0, 1], [x, y, 2]),
        region([0, 1, 0], [x, 3, z]),
        region([1, 0, 0], [2, y, z]),
        region([2, 1, 1], [6, 4, 3]),
        region([x - 1, y - 1, z - 1], DIMS),
        region([3, 3, 1], [3, 3, 1]),
    ]
}

/// Checks every box of every frame of a window that starts at frame `first`.
pub fn check_window(window: &dyn FrameWindow, ty: SampleType, first: usize) {
    let whole = Grid::unit(DIMS).whole();
    for frame in 0..window.frames() {
        for region in regions() {
            let mut bytes = vec![0; region.voxels() * ty.size()];
            window.read_box(frame, &region, &mut bytes).expect("reading a box");
            let mut found = vec![0.0; region.voxels()];
            load(ty, &bytes, &mut found);
            let expected: Vec<f64> = region.iter().map(|v| value(ty, first + frame, whole.index(v))).collect();
            assert_eq!(found, expected, "{region:?} of {}", window.name(frame));
        }
    }
    window.check_unchanged().expect("nothing changed");
}

/// Checks a source of `frames` frames, window by window.
pub fn check_source(source: &mut dyn FrameSource, ty: SampleType, frames: usize) {
    assert_eq!(source.archive().grid.dims, DIMS);
    assert_eq!(source.archive().sample, ty);
    for first in (0..frames).step_by(2) {
        let count = 2.min(frames - first);
        let window = source.window(first, count).expect("window");
        assert_eq!(window.frames(), count);
        check_window(&*window, ty, first);
    }
}

/// The message of an error that must come, and its remedy.
pub fn message<T>(result: Result<T>) -> String {
    match result {
        Ok(_) => panic!("an error was expected"),
        Err(e) => e.remedy().map_or(e.to_string(), |remedy| format!("{e}; {remedy:?}")),
    }
}
