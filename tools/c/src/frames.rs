//! What frames are.
#![allow(unsafe_code)]

use crate::text;
use std::ffi::c_char;
use wavesplat::base::description::{ArrayAxis, AxisRole, Description, Dimension, with_coordinates, with_frames};
use wavesplat::base::sample::SampleType;
use wavesplat::source::{Archive, RegularTimes};
use wavesplat::{Error, Grid, Result};

/// Unsigned integers of 8 bits.
pub const WAVESPLAT_U8: u32 = 0;
/// Signed integers of 8 bits.
pub const WAVESPLAT_I8: u32 = 1;
/// Unsigned integers of 16 bits.
pub const WAVESPLAT_U16: u32 = 2;
/// Signed integers of 16 bits.
pub const WAVESPLAT_I16: u32 = 3;
/// Unsigned integers of 32 bits.
pub const WAVESPLAT_U32: u32 = 4;
/// Signed integers of 32 bits.
pub const WAVESPLAT_I32: u32 = 5;
/// Floats of 16 bits.
pub const WAVESPLAT_F16: u32 = 6;
/// Floats of 32 bits.
pub const WAVESPLAT_F32: u32 = 7;
/// Floats of 64 bits.
pub const WAVESPLAT_F64: u32 = 8;

/// The frames of a run. Set all fields that are not needed to 0. A plane has 1 voxel along z.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct WavesplatFrames {
    /// Voxels along x, y and z.
    pub dims: [usize; 3],
    /// The type of the samples: `WAVESPLAT_F32` or another.
    pub sample: u32,
    /// The distance of voxels along x, y and z; 0 for 1.
    pub spacing: [f64; 3],
    /// The place of the first voxel.
    pub origin: [f64; 3],
    /// The places of all voxels along x, y and z where their distances differ: ascending, as many as there are voxels; or null. They
    /// take the place of spacing and origin, and are stored when a file is finished: recovered ones lack them.
    pub coordinates: [*const f64; 3],
    /// The time of the first frame, if there is a `time_step`.
    pub first_time: f64,
    /// The time from each frame to the next; 0 if frames have no times, or each is pushed with its own.
    pub time_step: f64,
    /// The unit of times, such as "s" or "hours since 2000-01-01"; or null.
    pub time_unit: *const c_char,
    /// The name of what the samples are, such as "pressure"; or null.
    pub variable: *const c_char,
    /// Their unit, such as "Pa"; or null.
    pub unit: *const c_char,
}

/// The same, checked.
#[derive(Debug, Clone)]
pub(crate) struct Frames {
    pub(crate) grid: Grid,
    pub(crate) sample: SampleType,
    pub(crate) times: Option<RegularTimes>,
    pub(crate) time_unit: Option<String>,
    pub(crate) variable: Option<String>,
    pub(crate) unit: Option<String>,
    /// The places of voxels where their distances differ.
    coordinates: Option<Description>,
}

impl Frames {
    /// # Safety
    /// The texts of `given` are null or end with a 0, and coordinates are null or of all voxels along their axis.
    pub(crate) unsafe fn new(given: &WavesplatFrames) -> Result<Self> {
        let sample = SampleType::ALL.get(given.sample as usize).copied();
        let sample = sample.ok_or_else(|| Error::value("sample", given.sample, "is no type of samples"))?;
        let bytes = given.dims.into_iter().try_fold(sample.size(), usize::checked_mul);
        if !bytes.is_some_and(|bytes| (1..=MOST_BYTES).contains(&bytes)) {
            return Err(Error::setting("dims", format!("{:?} voxels are none, or too many", given.dims)));
        }
        // SAFETY: the caller's.
        let text = |name, text| unsafe { text::optional(name, text) }.map(|text| text.map(String::from));
        let is_timed = given.time_step != 0.0;
        let times = is_timed.then(|| RegularTimes::new(given.first_time, given.time_step)).transpose();
        let times = times.map_err(|_| {
            let what = format!(
                "takes steps above 0 after a finite `first_time`, not {} after {}",
                given.time_step, given.first_time
            );
            Error::setting("time_step", what)
        })?;
        // SAFETY: the caller's.
        let listed = |axis: usize| unsafe { text::listed("coordinates", given.coordinates[axis], given.dims[axis]) };
        let listed = [listed(0)?, listed(1)?, listed(2)?];
        let grid = grid_of(given, &listed)?;
        Ok(Self {
            grid,
            sample,
            times,
            time_unit: text("time_unit", given.time_unit)?,
            variable: text("variable", given.variable)?,
            unit: text("unit", given.unit)?,
            coordinates: irregular(&grid, listed)?,
        })
    }

    /// Their description, before the first of them is there.
    pub(crate) fn archive(&self) -> Archive {
        let mut archive = Archive { regular_times: self.times, ..Archive::new(self.grid, self.sample, None) };
        (archive.variable, archive.units.samples) = (self.variable.clone(), self.unit.clone());
        (archive.units.times, archive.description) = (self.time_unit.clone(), self.described(0));
        archive
    }

    /// What is known of the first `frames` frames beside samples, times and a regular grid.
    pub(crate) fn described(&self, frames: usize) -> Option<Description> {
        self.coordinates.clone().map(|coordinates| with_frames(coordinates, frames))
    }

    /// Bytes of a frame.
    pub(crate) fn bytes(&self) -> usize {
        self.grid.whole().voxels() * self.sample.size()
    }
}

/// Of a frame: so many can have addresses.
const MOST_BYTES: usize = isize::MAX as usize;

/// The grid of frames. Along axes with coordinates it has the mean distance.
fn grid_of(given: &WavesplatFrames, listed: &[Option<Vec<f64>>; 3]) -> Result<Grid> {
    let spacing = given.spacing.map(|step| if step == 0.0 { 1.0 } else { step });
    let mut grid = Grid { dims: given.dims, spacing, origin: given.origin };
    for (axis, at) in listed.iter().enumerate() {
        let Some(at) = at else { continue };
        check_coordinates(NAMES[axis], at)?;
        grid.origin[axis] = at[0];
        if at.len() > 1 {
            grid.spacing[axis] = (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64;
        }
    }
    if !grid.spacing.iter().all(|step| step.is_finite() && *step > 0.0) {
        return Err(Error::setting("spacing", format!("takes numbers above 0, not {:?}", grid.spacing)));
    }
    if !grid.origin.iter().all(|at| at.is_finite()) {
        return Err(Error::setting("origin", format!("takes finite numbers, not {:?}", grid.origin)));
    }
    Ok(grid)
}

/// The coordinates of all axes, if those of one are irregular.
fn irregular(grid: &Grid, listed: [Option<Vec<f64>>; 3]) -> Result<Option<Description>> {
    let is_irregular = |axis: usize| listed[axis].as_ref().is_some_and(|at| *at != regular(grid, axis));
    if !(0..3).any(is_irregular) {
        return Ok(None);
    }
    let coordinates = described(grid, listed);
    let size = with_frames(coordinates.clone(), usize::MAX).check_size();
    size.map_err(|e| Error::setting("coordinates", format!("take too much room in a file: {e}")))?;
    Ok(Some(coordinates))
}

const NAMES: [&str; 3] = ["x", "y", "z"];

fn check_coordinates(axis: &str, at: &[f64]) -> Result<()> {
    let length = at[at.len() - 1] - at[0];
    if !length.is_finite() || !at.windows(2).all(|pair| pair[0] < pair[1]) {
        return Err(Error::setting("coordinates", format!("those along {axis} are not finite numbers that ascend")));
    }
    Ok(())
}

/// Coordinates in equal steps.
fn regular(grid: &Grid, axis: usize) -> Vec<f64> {
    (0..grid.dims[axis]).map(|n| grid.origin[axis] + grid.spacing[axis] * n as f64).collect()
}

/// The coordinates along z, y and x.
fn described(grid: &Grid, listed: [Option<Vec<f64>>; 3]) -> Description {
    let mut all = Description { source: "frames of a program".into(), ..Description::default() };
    for (dimension, role) in (0..).zip([AxisRole::Z, AxisRole::Y, AxisRole::X]) {
        let length = role.voxels().map_or(1, |along| grid.dims[along] as u64);
        all.dimensions.push(Dimension { name: String::new(), length, unlimited: false });
        all.axes.push(ArrayAxis { dimension, role, reversed: false });
    }
    let [x, y, z] = listed;
    let along = |axis: usize, at: Option<Vec<f64>>| at.unwrap_or_else(|| regular(grid, axis));
    with_coordinates(all, &[along(0, x), along(1, y), along(2, z)])
}

/// The number of a type of samples.
pub(crate) fn number_of(sample: SampleType) -> u32 {
    SampleType::ALL.iter().position(|known| *known == sample).unwrap_or_default() as u32
}
