//! The formats of extracted samples.

use super::contents::Contents;
use super::encoding::Encoding;
use crate::base::sample::SampleType;
use std::path::Path;

/// A format of extracted samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleFormat {
    /// One NumPy array (frames, z, y, x).
    Npy,
    /// Only the samples, little-endian.
    Raw,
    /// One NRRD with its header: x y z t, or x y z for one frame.
    Nrrd,
    /// A NRRD header, with the samples in a file beside it.
    Nhdr,
    /// VTK image data, one file for each frame.
    Vti,
    /// A ParaView list of `.vti` files, one for each frame, with their times.
    Pvd,
    /// Classic NetCDF (time, z, y, x) with coordinates.
    Netcdf,
}

impl SampleFormat {
    /// The formats by name, which is also their file extension.
    pub const NAMES: [(&'static str, Self); 7] = [
        ("npy", Self::Npy),
        ("raw", Self::Raw),
        ("nrrd", Self::Nrrd),
        ("nhdr", Self::Nhdr),
        ("vti", Self::Vti),
        ("pvd", Self::Pvd),
        ("nc", Self::Netcdf),
    ];

    /// The format for a path's extension.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension().and_then(|e| e.to_str()).map(|e| if e == "bin" { "raw" } else { e })?;
        Self::NAMES.into_iter().find(|(name, _)| *name == ending).map(|(_, format)| format)
    }

    /// How samples of a type are written in this format.
    pub(super) fn encoding(self, from: SampleType) -> Encoding {
        let has_halves = matches!(self, Self::Npy | Self::Raw);
        let to = if from == SampleType::F16 && !has_halves { SampleType::F32 } else { from };
        Encoding { from, to, big_endian: self == Self::Netcdf }
    }

    /// Notes for the user on what the format cannot store exactly as it was.
    pub fn notes(self, contents: &Contents) -> Vec<String> {
        let name = match self {
            Self::Npy | Self::Raw => return Vec::new(),
            Self::Nrrd | Self::Nhdr => "NRRD",
            Self::Vti | Self::Pvd => "VTK",
            Self::Netcdf => "NetCDF",
        };
        let Encoding { from, to, .. } = self.encoding(contents.sample);
        let retyped = (from != to).then(|| format!("{name} has no {from}: the samples are written as {to}, exactly"));
        let untimed = name == "NRRD" && contents.times.len() > 1 && contents.regular_times().is_none();
        let untimed = untimed
            .then(|| "NRRD can store only times at regular steps: the times of these frames are left out".into());
        retyped.into_iter().chain(untimed).collect()
    }
}
