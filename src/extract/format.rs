//! The formats of extracted samples.

use super::contents::Contents;
use super::encoding::Encoding;
use super::nifti;
use super::order::SampleOrder;
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
    /// Classic NetCDF, in the order of the source's array or (time, z, y, x), with coordinates.
    Netcdf,
    /// NIfTI in one file: x y z t, or x y z for one frame.
    Nifti,
    /// As well, in gzip.
    NiftiGz,
    /// MetaImage in one file: x y z t, or x y z for one frame.
    MetaImage,
    /// A VTK rectilinear grid, one file for each frame.
    Vtr,
    /// A Zarr store of version 2, in the order of the source's array or (time, z, y, x), with coordinates.
    Zarr,
}

impl SampleFormat {
    /// The formats by name, which is also their file extension.
    pub const NAMES: [(&'static str, Self); 12] = [
        ("npy", Self::Npy),
        ("raw", Self::Raw),
        ("nrrd", Self::Nrrd),
        ("nhdr", Self::Nhdr),
        ("vti", Self::Vti),
        ("pvd", Self::Pvd),
        ("nc", Self::Netcdf),
        ("nii", Self::Nifti),
        ("nii.gz", Self::NiftiGz),
        ("mha", Self::MetaImage),
        ("vtr", Self::Vtr),
        ("zarr", Self::Zarr),
    ];

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        Self::NAMES.into_iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }

    /// The format for a path's extension.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let has = |ending: &str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
        let known = Self::NAMES.into_iter().find(|(ending, _)| has(ending));
        known.map(|(_, format)| format).or(has("bin").then_some(Self::Raw))
    }

    /// How the samples are written in this format.
    pub(super) fn encoding(self, contents: &Contents) -> Encoding {
        let from = contents.sample;
        let has_halves = matches!(self, Self::Npy | Self::Raw);
        let to = if from == SampleType::F16 && !has_halves { SampleType::F32 } else { from };
        let big_endian = match self {
            Self::Netcdf => true,
            Self::Nifti | Self::NiftiGz => nifti::is_big_endian(contents),
            _ => false,
        };
        Encoding { from, to, big_endian }
    }

    /// The order in which this format has the samples.
    pub fn order(self, contents: &Contents) -> SampleOrder {
        match &contents.description {
            Some(description) if matches!(self, Self::Netcdf | Self::Zarr) => SampleOrder::of_source(description),
            Some(description) if self.has_lattice(contents) => SampleOrder::of_lattice(description),
            _ => SampleOrder::default(),
        }
    }

    /// Whether voxels are written in the order of the source's array, with its directions in the world.
    pub(super) fn has_lattice(self, contents: &Contents) -> bool {
        let Some(description) = contents.description.as_ref().filter(|all| all.orientation.is_some()) else {
            return false;
        };
        match self {
            Self::Nifti | Self::NiftiGz | Self::MetaImage | Self::Nrrd | Self::Nhdr => true,
            // programs that show these rarely turn them: only what cannot be said otherwise
            Self::Vti | Self::Pvd => description.source.starts_with("VTK") || !contents.is_straight(),
            Self::Npy | Self::Raw | Self::Netcdf | Self::Vtr | Self::Zarr => false,
        }
    }

    /// Notes for the user on what the format cannot store exactly as it was.
    pub fn notes(self, contents: &Contents) -> Vec<String> {
        let name = match self {
            Self::Npy | Self::Raw => return Vec::new(),
            Self::Nrrd | Self::Nhdr => "NRRD",
            Self::Vti | Self::Pvd | Self::Vtr => "VTK",
            Self::Zarr => "Zarr",
            Self::Netcdf => "NetCDF",
            Self::Nifti | Self::NiftiGz => "NIfTI",
            Self::MetaImage => "MetaImage",
        };
        let Encoding { from, to, .. } = self.encoding(contents);
        let retyped = (from != to).then(|| format!("{name} has no {from}: the samples are written as {to}, exactly"));
        let is_regular = matches!(name, "NRRD" | "NIfTI" | "MetaImage");
        let untimed = is_regular && contents.times.len() > 1 && contents.regular_times().is_none();
        let untimed = untimed
            .then(|| format!("{name} can store only times at regular steps: the times of these frames are left out"));
        let irregular = contents.irregular_axes();
        let is_lattice = !matches!(self, Self::Netcdf | Self::Vtr | Self::Zarr) && !irregular.is_empty();
        let irregular = is_lattice.then(|| {
            format!("{name} has only regular steps: .vtr, .nc and .zarr keep the places along {}", irregular.join(", "))
        });
        retyped.into_iter().chain(untimed).chain(irregular).collect()
    }
}
