//! The measured archives: those of the user, and those made here or by the peers' script.

use super::peers::Peers;
use crate::synth::{Kind, Synth};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::sample;
use wavesplat::formats;
use wavesplat::source::{OpenOptions, read_frames};
use wavesplat_demo::eddy::{Magnet, Plate, eddy_currents};
use wavesplat_demo::output::{Format, Target};

/// An archive that can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Subject {
    /// The demo's eddy currents in a plate
    Demo,
    /// As `synth` has it
    Smooth,
    /// As `synth` has it
    Moving,
    /// As `synth` has it
    Oscillating,
    /// As `synth` has it
    Noise,
    /// As `synth` has it
    Sparse,
    /// Eddy currents that decay, by the peers' script
    Plate,
    /// The same, rough in space, by the peers' script
    #[value(name = "plate_fe")]
    PlateFe,
    /// Gaussians in turbulence, by the peers' script
    Vortex,
    /// Turbulent blobs in nothing, by the peers' script
    Cloud,
}

impl Subject {
    /// The default archives: with peers, those of the targets; otherwise those that need no script.
    pub(super) fn usual(peers: bool) -> Vec<Self> {
        let wanted = |s: &Self| *s == Self::Demo || s.synth().is_some() != peers;
        Self::value_variants().iter().copied().filter(wanted).collect()
    }

    /// The name on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |v| v.get_name().into())
    }

    fn synth(self) -> Option<Kind> {
        Some(match self {
            Self::Smooth => Kind::Smooth,
            Self::Moving => Kind::Moving,
            Self::Oscillating => Kind::Oscillating,
            Self::Noise => Kind::Noise,
            Self::Sparse => Kind::Sparse,
            Self::Demo | Self::Plate | Self::PlateFe | Self::Vortex | Self::Cloud => return None,
        })
    }

    /// Writes the archive into a folder.
    pub(super) fn make(self, folder: &Path, small: bool, peers: Option<&Peers>) -> Result<PathBuf> {
        let path = folder.join(format!("{}.npy", self.name()));
        let dims = if small { [16, 12, 10, 8] } else { [64, 64, 64, 32] };
        match (self.synth(), peers) {
            (Some(kind), _) => drop(Synth::f32(kind, dims).write_npy(folder)?),
            (None, _) if self == Self::Demo => demo(small, &path)?,
            (None, Some(peers)) => peers.generate(&self.name(), folder, small)?,
            (None, None) => return Err(Error::usage(format!("--kinds: {} needs --peers", self.name()))),
        }
        Ok(path)
    }
}

/// |J| in A/m^2.
fn demo(small: bool, path: &Path) -> Result<()> {
    let coarse = Plate { dims: [38, 38, 11], spacing: 4e-3, ..Plate::default() };
    let (plate, frames) = if small { (coarse, 8) } else { (Plate::default(), wavesplat_demo::experiment::FRAMES) };
    let solution = eddy_currents(plate, Magnet::default(), frames);
    Target::File(path.into(), Format::Npy).write_f32(plate.dims, frames, solution)
}

/// An archive and its size.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Data {
    /// The name of its kind, or of its file without the extension.
    pub name: String,
    /// The file.
    #[serde(skip)]
    pub(in crate::bench) path: PathBuf,
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Frames.
    pub frames: usize,
    /// The type of the samples.
    pub samples: String,
    /// Bytes of all samples.
    pub bytes: u64,
    /// The lowest and the highest sample.
    pub range: (f64, f64),
}

impl Data {
    /// Its name and size in words.
    pub(super) fn in_words(&self) -> String {
        let [x, y, z] = self.dims;
        format!("*{}*: {x}x{y}x{z} voxels, {} frames, {}", self.name, self.frames, self.samples)
    }

    /// Describes a file; reads every sample.
    pub(in crate::bench) fn of(path: PathBuf) -> Result<Self> {
        let mut source = formats::open(std::slice::from_ref(&path), &OpenOptions::default())?;
        let archive = source.archive().clone();
        let (whole, ty, frames) = (archive.grid.whole(), archive.sample, archive.frames.unwrap_or(0));
        let (mut range, mut values) = ((f64::INFINITY, f64::NEG_INFINITY), vec![0.0; whole.voxels()]);
        let window = source.window(0, frames)?;
        for frame in 0..frames {
            sample::load(ty, &read_frames(window.as_ref(), std::iter::once(frame), &whole, ty)?, &mut values);
            range = values.iter().fold(range, |(low, high), v| (low.min(*v), high.max(*v)));
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let bytes = (frames * whole.voxels() * ty.size()) as u64;
        Ok(Self { name, path, dims: archive.grid.dims, frames, samples: ty.to_string(), bytes, range })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn archives_of_the_script_need_peers() {
        let names = |peers| Subject::usual(peers).into_iter().map(Subject::name).collect::<Vec<_>>();
        assert_eq!(names(true), ["demo", "plate", "plate_fe", "vortex", "cloud"]);
        assert_eq!(names(false), ["demo", "smooth", "moving", "oscillating", "noise", "sparse"]);
        assert!(Subject::Cloud.make(Path::new("nowhere"), true, None).is_err());
    }
}
