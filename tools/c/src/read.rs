//! Samples of coefficient files.
#![allow(unsafe_code)]

use crate::frames::number_of;
use crate::status::answer;
use crate::text::{give, pointed, required};
use std::ffi::{c_char, c_void};
use std::ptr::null_mut;
use wavesplat::base::description::coordinates;
use wavesplat::base::mapped::Access;
use wavesplat::base::progress::Silent;
use wavesplat::extract::{ExtractConfig, extract_into};
use wavesplat::file::CoefficientFile;
use wavesplat::{Error, Grid, Region, Result};

/// An open file.
pub struct WavesplatFile(CoefficientFile);

/// The description of a file.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct WavesplatInfo {
    /// Voxels along x, y and z, at the level of detail.
    pub dims: [usize; 3],
    /// Number of frames.
    pub frames: usize,
    /// Channels: 1, or 3 for colours.
    pub channels: usize,
    /// The type of the samples: `WAVESPLAT_F32` or another.
    pub sample: u32,
    /// Bytes of a sample.
    pub sample_bytes: usize,
    /// The distance of voxels along x, y and z; the mean if distances differ, which `wavesplat_coordinates` tells.
    pub spacing: [f64; 3],
    /// The place of the first voxel.
    pub origin: [f64; 3],
    /// The largest error of any sample.
    pub reached: f64,
    /// Whether frames have times.
    pub has_times: bool,
}

/// Opens a file. `lod` is the level of detail: every 2^lod-th voxel along each axis is there, 0 for all.
///
/// # Safety
/// `path` is null-terminated UTF-8. `file` receives the file, or null after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_open(path: *const c_char, lod: u32, file: *mut *mut WavesplatFile) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        unsafe { give("file", file, null_mut()) }?;
        // SAFETY: the caller's.
        let path = unsafe { required("path", path)? };
        // A page of a map that is lost would end the host.
        let open = CoefficientFile::open_with(path, Access::Read)?.with_detail(lod)?;
        // SAFETY: the caller's.
        unsafe { give("file", file, Box::into_raw(Box::new(WavesplatFile(open)))) }
    })
}

/// Describes a file.
///
/// # Safety
/// `file` is open. `info` receives the description.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_info(file: *const WavesplatFile, info: *mut WavesplatInfo) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let WavesplatFile(file) = unsafe { pointed("file", file)? };
        let metadata = file.metadata();
        let found = WavesplatInfo {
            dims: file.grid.dims,
            frames: file.frames(),
            channels: file.channels(),
            sample: number_of(file.sample()),
            sample_bytes: file.sample().size(),
            spacing: file.grid.spacing,
            origin: file.grid.origin,
            reached: metadata.windows.iter().map(|window| window.reached).fold(0.0, f64::max),
            has_times: !metadata.times.is_empty(),
        };
        // SAFETY: the caller's.
        unsafe { give("info", info, found) }
    })
}

/// Gives the times of `count` frames from `first` on.
///
/// # Safety
/// `file` is open. `times` has room for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_times(
    file: *const WavesplatFile,
    first: usize,
    count: usize,
    times: *mut f64,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let WavesplatFile(file) = unsafe { pointed("file", file)? };
        let found = first.checked_add(count).and_then(|end| file.metadata().times.get(first..end));
        let found = found.ok_or_else(|| {
            Error::value(
                "first",
                first,
                format!("{count} frames from there on have no times; the file has {}", file.metadata().times.len()),
            )
        })?;
        // SAFETY: the caller's.
        unsafe { room("times", times, count)? }.copy_from_slice(found);
        Ok(())
    })
}

/// Gives the places of the voxels along x, y or z, that is axis 0, 1 or 2, at the level of detail.
///
/// # Safety
/// `file` is open. `coordinates` has room for as many numbers as there are voxels along the axis.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_coordinates(file: *const WavesplatFile, axis: usize, coordinates: *mut f64) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let WavesplatFile(file) = unsafe { pointed("file", file)? };
        let count = file.grid.dims.get(axis).ok_or_else(|| Error::value("axis", axis, "is not 0, 1 or 2"))?;
        let found = along(file, axis)?;
        // SAFETY: the caller's.
        unsafe { room("coordinates", coordinates, *count)? }.copy_from_slice(&found);
        Ok(())
    })
}

/// The places of the voxels along an axis: those of the source, or in equal steps.
fn along(file: &CoefficientFile, axis: usize) -> Result<Vec<f64>> {
    let Grid { dims, spacing, origin } = file.grid;
    let listed = file.description()?.and_then(|description| coordinates(&description, axis));
    let listed = listed.map(|at| at.into_iter().step_by(1 << file.lod()).collect::<Vec<_>>());
    let regular = || (0..dims[axis]).map(|n| origin[axis] + spacing[axis] * n as f64).collect();
    Ok(listed.filter(|at| at.len() == dims[axis]).unwrap_or_else(regular))
}

/// Gives the samples of `count` frames from `first` on, of the voxels from `start` up to but without `end` along x, y and z, or of
/// all with null: frame after frame, x fastest, little-endian. `channel` is 0, or one of the three of colours.
///
/// # Safety
/// `file` is open. `start` and `end` are null or three numbers. `samples` has room for `bytes` bytes, which must be those of the
/// samples: frames times voxels times the bytes of a sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_read(
    file: *const WavesplatFile,
    first: usize,
    count: usize,
    start: *const usize,
    end: *const usize,
    channel: usize,
    samples: *mut c_void,
    bytes: usize,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let (WavesplatFile(file), out) = unsafe { (pointed("file", file)?, room("samples", samples.cast(), bytes)?) };
        let place = |at: *const usize, all: [usize; 3]| {
            let given = (!at.is_null()).then_some(at.cast::<[usize; 3]>());
            // SAFETY: the caller's.
            given.map_or(all, |at| unsafe { at.read_unaligned() })
        };
        let region = Region { start: place(start, [0; 3]), end: place(end, file.grid.dims) };
        let last = first.checked_add(count).filter(|end| *end <= file.frames());
        let last = last.ok_or_else(|| {
            Error::value(
                "first",
                first,
                format!("{count} frames from there on are not in the file, which has {}", file.frames()),
            )
        })?;
        let config = ExtractConfig { frames: (first..last).collect(), region, channel, ..ExtractConfig::new(file) };
        extract_into(file, &config, out, &Silent).map(drop)
    })
}

/// Closes a file. Null is fine.
///
/// # Safety
/// Do not use `file` afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_close(file: *mut WavesplatFile) {
    if !file.is_null() {
        answer(|| {
            // SAFETY: `wavesplat_open` made it by a box.
            drop(unsafe { Box::from_raw(file) });
            Ok(())
        });
    }
}

/// Memory of the caller.
///
/// # Safety
/// `at` is null or points to `count` of `T` that nobody else uses for `'a`.
unsafe fn room<'a, T>(name: &'static str, at: *mut T, count: usize) -> Result<&'a mut [T]> {
    let bytes = count.checked_mul(size_of::<T>()).filter(|bytes| *bytes <= isize::MAX as usize);
    if count > 0 && (at.is_null() || !at.is_aligned() || bytes.is_none()) {
        return Err(Error::setting(name, format!("is no room for {count}")));
    }
    // SAFETY: the caller's.
    Ok(if count == 0 { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(at, count) } })
}
