//! Formats that samples are written in.

use super::contents::Contents;
use super::encoding::Encoding;
use crate::base::sample::SampleType;
use std::path::Path;

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleFormat {
    /// One NumPy array, (frames, z, y, x).
    Npy,
    /// The samples alone, little-endian.
    Raw,
    /// One NRRD with its header, of x y z t; of one frame x y z.
    Nrrd,
    /// A NRRD's header, and its samples in a file beside it.
    Nhdr,
    /// VTK's image data, one file for each frame.
    Vti,
    /// ParaView's list of one `.vti` for each frame, and their times.
    Pvd,
    /// NetCDF in one of its classic forms, (time, z, y, x) with coordinates.
    Netcdf,
}

impl SampleFormat {
    /// The formats by their names, which are also the endings of files.
    pub const NAMES: [(&'static str, Self); 7] = [
        ("npy", Self::Npy),
        ("raw", Self::Raw),
        ("nrrd", Self::Nrrd),
        ("nhdr", Self::Nhdr),
        ("vti", Self::Vti),
        ("pvd", Self::Pvd),
        ("nc", Self::Netcdf),
    ];

    /// The format that a file's ending says.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension().and_then(|e| e.to_str()).map(|e| if e == "bin" { "raw" } else { e })?;
        Self::NAMES.into_iter().find(|(name, _)| *name == ending).map(|(_, format)| format)
    }

    /// What samples become in it.
    pub(super) fn encoding(self, from: SampleType) -> Encoding {
        let has_halves = matches!(self, Self::Npy | Self::Raw);
        let to = if from == SampleType::F16 && !has_halves { SampleType::F32 } else { from };
        Encoding { from, to, big_endian: self == Self::Netcdf }
    }

    /// What a user should know of what it does not hold as it was.
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
        let untimed =
            untimed.then(|| "NRRD holds times at regular steps alone: those of these frames are left out".into());
        retyped.into_iter().chain(untimed).collect()
    }
}
