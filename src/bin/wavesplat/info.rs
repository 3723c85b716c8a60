//! `wavesplat info`

use clap::Args;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use wavesplat::bound::Bound;
use wavesplat::cli::{CommonArgs, print};
use wavesplat::error::Result;
use wavesplat::file::CoefficientFile;
use wavesplat::mapped::Access;

/// Say what a coefficient file holds, promises and reached
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  wavesplat info run.wspl
  wavesplat info run.wspl --json | jq .windows")]
pub(crate) struct InfoArgs {
    /// Coefficient file
    file: PathBuf,
    /// Read the file instead of mapping it
    #[arg(long)]
    no_mmap: bool,
    #[command(flatten)]
    common: CommonArgs,
}

/// The keys of `--json`.
#[derive(Debug, Serialize)]
struct Info {
    id: String,
    bytes: u64,
    dims: [u64; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    sample: &'static str,
    frames: u64,
    times: Vec<f64>,
    variable: Option<String>,
    bound: &'static str,
    tolerance: f64,
    range: (f64, f64),
    value_range: (f64, f64),
    missing_value: Option<f64>,
    block_edge: u32,
    blocks: u64,
    raw_bytes: u64,
    coefficients: u64,
    outliers: u64,
    missing: u64,
    windows: Vec<WindowInfo>,
    settings: Vec<(String, String)>,
    program: String,
}

#[derive(Debug, Serialize)]
struct WindowInfo {
    first_frame: u64,
    frames: u32,
    basis: String,
    coefficients_per_voxel: u32,
    promised: f64,
    reached: f64,
    rms: f64,
    min: Option<f64>,
    max: Option<f64>,
    coefficients: u64,
    outliers: u64,
    missing: u64,
}

pub(crate) fn run(args: &InfoArgs) -> Result<()> {
    let access = Access::unless(args.no_mmap);
    let info = Info::of(&CoefficientFile::open(&args.file, access)?);
    if args.common.json { args.common.report(&info, false) } else { print(&info.text(args.common.verbose)) }
}

impl Info {
    fn of(file: &CoefficientFile) -> Self {
        let m = file.metadata();
        let voxels: u64 = m.dims.iter().product();
        let windows: Vec<WindowInfo> = m.windows.iter().map(|w| WindowInfo::of(w, voxels)).collect();
        Self {
            id: file.id().to_string(),
            bytes: file.bytes(),
            dims: m.dims,
            spacing: m.spacing,
            origin: m.origin,
            sample: m.sample.name(),
            frames: m.frames,
            times: m.times.clone(),
            variable: m.variable.clone(),
            bound: match m.bound {
                Bound::Pointwise => "pointwise",
                Bound::Rms => "rms",
            },
            tolerance: m.tolerance,
            range: m.range,
            value_range: file.value_range(),
            missing_value: m.missing_value,
            block_edge: m.block_edge,
            blocks: m.blocks(),
            raw_bytes: voxels * m.frames * m.sample.size() as u64,
            coefficients: windows.iter().map(|w| w.coefficients).sum(),
            outliers: windows.iter().map(|w| w.outliers).sum(),
            missing: windows.iter().map(|w| w.missing).sum(),
            windows,
            settings: m.settings.clone(),
            program: m.program.clone(),
        }
    }

    fn text(&self, verbose: bool) -> String {
        let [x, y, z] = self.dims;
        let name = self.variable.as_deref().unwrap_or("unnamed");
        let ratio = self.raw_bytes as f64 / self.bytes as f64;
        let per_sample = self.coefficients as f64 / (x * y * z * self.frames) as f64;
        let [promised, reached] = [largest(&self.windows, |w| w.promised), largest(&self.windows, |w| w.reached)];
        let mut text = format!(
            "volume     {x} x {y} x {z} voxels, spacing {:?}, origin {:?}\n\
             samples    {} ({name}), {} frames, decoded values {:.4e} to {:.4e}\n\
             size       {} bytes, {ratio:.1}x smaller than raw; {} blocks of {} voxels a side\n\
             promise    {} error <= {:e} x ({:.4e} to {:.4e}), {promised:.4e} at most; largest sample error reached {reached:.4e}\n\
             content    {per_sample:.4} coefficients per sample, {} outliers, {} missing samples\n\
             id         {} ({})\n",
            self.spacing,
            self.origin,
            self.sample,
            self.frames,
            self.value_range.0,
            self.value_range.1,
            self.bytes,
            self.blocks,
            self.block_edge,
            self.bound,
            self.tolerance,
            self.range.0,
            self.range.1,
            self.outliers,
            self.missing,
            self.id,
            self.program
        );
        let shown = if verbose { self.windows.len() } else { self.windows.len().min(MOST_WINDOWS) };
        for w in &self.windows[..shown] {
            let end = w.first_frame + u64::from(w.frames);
            let _ = writeln!(
                text,
                "window     frames {}..{end} {}: promised {:.4e}, reached {:.4e}, rms {:.4e}",
                w.first_frame, w.basis, w.promised, w.reached, w.rms
            );
        }
        if shown < self.windows.len() {
            let _ = writeln!(text, "           and {} more windows; -v shows all", self.windows.len() - shown);
        }
        text
    }
}

/// Windows that are listed unless `--verbose` asks for all.
const MOST_WINDOWS: usize = 8;

fn largest(windows: &[WindowInfo], of: fn(&WindowInfo) -> f64) -> f64 {
    windows.iter().map(of).fold(0.0, f64::max)
}

impl WindowInfo {
    fn of(w: &wavesplat_format::Window, voxels: u64) -> Self {
        let samples = (voxels * u64::from(w.frames)).saturating_sub(w.missing).max(1);
        Self {
            first_frame: w.first_frame,
            frames: w.frames,
            basis: format!("{:?}", w.basis).to_lowercase(),
            coefficients_per_voxel: w.coefficients,
            promised: w.delta,
            reached: w.reached,
            rms: (w.squared_error / samples as f64).sqrt(),
            min: Some(w.min).filter(|v| v.is_finite()),
            max: Some(w.max).filter(|v| v.is_finite()),
            coefficients: w.coded,
            outliers: w.outliers,
            missing: w.missing,
        }
    }
}
