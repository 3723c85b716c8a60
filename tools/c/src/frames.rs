//! What frames are.
#![allow(unsafe_code)]

use crate::text;
use std::ffi::c_char;
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

/// The frames of a run: regular in space and time. Set all fields that are not needed to 0. A plane has 1 voxel along z.
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
    /// The time of the first frame.
    pub first_time: f64,
    /// The time from each frame to the next; 0 if frames have no times.
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
    pub(crate) dims: [usize; 3],
    pub(crate) sample: SampleType,
    pub(crate) spacing: [f64; 3],
    pub(crate) origin: [f64; 3],
    pub(crate) times: Option<RegularTimes>,
    pub(crate) time_unit: Option<String>,
    pub(crate) variable: Option<String>,
    pub(crate) unit: Option<String>,
}

impl Frames {
    /// # Safety
    /// The texts of `given` are null or end with a 0.
    pub(crate) unsafe fn new(given: &WavesplatFrames) -> Result<Self> {
        let sample = SampleType::ALL.get(given.sample as usize).copied();
        let sample = sample.ok_or_else(|| Error::value("sample", given.sample, "is no type of samples"))?;
        // SAFETY: the caller's.
        let text = |name, text| unsafe { text::optional(name, text) }.map(|text| text.map(String::from));
        let is_timed = given.time_step != 0.0;
        let times = is_timed.then(|| RegularTimes::new(given.first_time, given.time_step)).transpose()?;
        let frames = Self {
            dims: given.dims,
            sample,
            spacing: given.spacing.map(|step| if step == 0.0 { 1.0 } else { step }),
            origin: given.origin,
            times,
            time_unit: text("time_unit", given.time_unit)?,
            variable: text("variable", given.variable)?,
            unit: text("unit", given.unit)?,
        };
        frames.check().map(|()| frames)
    }

    /// Their description.
    pub(crate) fn archive(&self) -> Archive {
        let grid = Grid { dims: self.dims, spacing: self.spacing, origin: self.origin };
        let mut archive = Archive { regular_times: self.times, ..Archive::new(grid, self.sample, None) };
        (archive.variable, archive.units.samples) = (self.variable.clone(), self.unit.clone());
        archive.units.times = self.times.and(self.time_unit.clone());
        archive
    }

    /// Bytes of a frame.
    pub(crate) fn bytes(&self) -> usize {
        self.dims.into_iter().product::<usize>() * self.sample.size()
    }

    fn check(&self) -> Result<()> {
        let bytes = self.dims.into_iter().try_fold(self.sample.size(), usize::checked_mul);
        let (setting, what) = match bytes {
            Some(1..=MOST_BYTES) if self.spacing.iter().any(|step| !(step.is_finite() && *step > 0.0)) => {
                ("spacing", format!("takes numbers above 0, not {:?}", self.spacing))
            }
            Some(1..=MOST_BYTES) if !self.origin.iter().all(|at| at.is_finite()) => {
                ("origin", format!("takes finite numbers, not {:?}", self.origin))
            }
            Some(1..=MOST_BYTES) => return Ok(()),
            _ => ("dims", format!("{:?} voxels are none, or too many", self.dims)),
        };
        Err(Error::setting(setting, what))
    }
}

/// Of a frame: so many can have addresses.
const MOST_BYTES: usize = isize::MAX as usize;

/// The number of a type of samples.
pub(crate) fn number_of(sample: SampleType) -> u32 {
    SampleType::ALL.iter().position(|known| *known == sample).unwrap_or_default() as u32
}
