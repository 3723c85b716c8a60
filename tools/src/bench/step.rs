//! One measured stage in a process of its own: its times are undisturbed by what went before, and its peak of memory
//! is its own.

use super::layers;
use super::look::Look;
use super::size::own;
use super::speed::work;
use super::stages;
use super::truth::ImageError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use wavesplat::base::error::{Error, Result};

/// What a process is to do.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) enum Step {
    Convert(Convert),
    Render(Render),
    Size(own::Task),
    Layers(layers::Task),
    Speed(work::Task),
}

/// Frames to a coefficient file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Convert {
    /// The archive.
    pub(super) frames: PathBuf,
    /// How many of its frames.
    pub(super) count: usize,
    /// A name of [`super::plan::BASES`].
    pub(super) basis: String,
    /// A name of [`super::plan::BOUNDS`].
    pub(super) bound: String,
    pub(super) tolerance: f64,
    pub(super) output: PathBuf,
}

/// What a conversion did.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Converted {
    pub(super) seconds: f64,
    pub(super) input_bytes: u64,
    pub(super) file_bytes: u64,
    pub(super) coefficients_per_sample: f64,
    pub(super) outliers: u64,
    /// Highest less lowest value.
    pub(super) range: f64,
    /// The voxel bound.
    pub(super) delta: f64,
}

/// Two views of all frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Render {
    /// The coefficient file, or the archive for the conventional method.
    pub(super) input: PathBuf,
    pub(super) way: Way,
    /// How many frames.
    pub(super) frames: usize,
    pub(super) look: Look,
    pub(super) splat_error: f64,
    /// The file of the truth for the first view.
    pub(super) truth: PathBuf,
    /// Whether to render the first view once more for its certificate, not timed.
    pub(super) certify: bool,
}

/// How pictures are made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Way {
    Coefficients,
    /// Footprints shared by 32 frames.
    Shared,
    /// A table of footprints, cut at so many standard deviations.
    Textbook(f64),
}

/// What a rendering did.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Rendered {
    /// From opening the input to the last picture of the first view.
    pub(super) first_seconds: f64,
    /// All pictures of another view.
    pub(super) further_seconds: f64,
    /// The splat method.
    pub(super) splat: String,
    /// What splatting may have added, as a share of the value range; unknown for the textbook form.
    pub(super) stated_splat_error: Option<f64>,
    /// Of the first view.
    pub(super) error: ImageError,
    /// The largest error that the renderer certifies for any compared pixel, as a share of the value range.
    pub(super) certified_error: Option<f64>,
    /// That in units of the largest true error of the same pictures.
    pub(super) certificate_tightness: Option<f64>,
    /// Compared pixels that are further off than certified.
    pub(super) beyond_certificate: usize,
}

/// What a process answers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Outcome<T> {
    pub(super) did: T,
    /// The most memory it ever had, pages of mapped files included.
    pub(super) peak_bytes: Option<u64>,
}

/// Does what a JSON text asks, in this process, and returns the answer as JSON.
pub fn run_step(text: &str) -> Result<String> {
    let wrong = |e: serde_json::Error| Error::usage(format!("bench-step: {e}"));
    match serde_json::from_str(text).map_err(wrong)? {
        Step::Convert(step) => answer(stages::convert(&step)?),
        Step::Render(step) => answer(stages::render(&step)?),
        Step::Size(task) => answer(own::measure(&task)?),
        Step::Layers(task) => answer(layers::measure(&task)?),
        Step::Speed(task) => answer(work::measure(&task)?),
    }
    .map_err(wrong)
}

fn answer(did: impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string(&Outcome { did, peak_bytes: peak_bytes() })
}

/// The peak of this process so far, where the system tells.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kib| kib << 10)
}

/// Runs a step in a process of its own.
pub(super) fn in_process<T: DeserializeOwned>(program: &Path, step: &Step) -> Result<Outcome<T>> {
    let failed = |e| Error::io(program, "running", e);
    let text = serde_json::to_string(step).map_err(|e| super::bad_json(program, &e))?;
    let child = Command::new(program).arg("bench-step").arg(text).stderr(Stdio::inherit()).output().map_err(failed)?;
    if !child.status.success() {
        return Err(Error::input(program, format!("a stage failed ({})", child.status)));
    }
    serde_json::from_slice(&child.stdout).map_err(|e| super::bad_json(program, &e))
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_is_known_and_never_falls() {
        let before = super::peak_bytes().expect("Linux tells");
        let large = std::hint::black_box(vec![1_u8; 64 << 20]);
        drop(large);
        let after = super::peak_bytes().expect("Linux tells");
        assert!(before > 1 << 16 && after >= before.max(64 << 20));
    }
}
