//! The errors of what is computed from a file's samples, in words.

use crate::{CommonArgs, FrameRange, InputArgs, narrow, remembered};
use std::path::PathBuf;
use wavesplat_core::base::error::Result;
use wavesplat_core::source::FrameSource;
use wavesplat_engine::convert::estimate::EstimatedErrors;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::shard::frames_of_shard;

/// The frames that a file was converted from.
pub(super) fn source_of(
    file: &CoefficientFile,
    input: &InputArgs,
    inputs: &[PathBuf],
    frames: Option<FrameRange>,
    common: &CommonArgs,
) -> Result<Box<dyn FrameSource>> {
    let source = input.open_again(file, inputs, frames, common)?;
    // Appended frames may come from the same archive: then all its frames count, not those converted first.
    if frames.is_some() || source.archive().frames == Some(file.frames()) {
        return Ok(source);
    }
    let source = narrow(source, remembered(file, "frames")?, None)?;
    let shard =
        frames_of_shard(file).filter(|(_, all)| source.archive().frames.map(|frames| frames as u64) == Some(*all));
    narrow(source, shard.map(|(frames, _)| frames.into()), None)
}

/// The errors in a line.
pub(super) fn results_text(errors: &EstimatedErrors, sides: &[f64], unit: Option<&str>) -> String {
    let percent = |share: Option<f64>| share.map_or("none".into(), |share| format!("{:.2} %", 100.0 * share));
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    let sides = sides.iter().zip(&errors.sides).map(|(value, share)| format!(", edges at {value} {}", percent(*share)));
    format!(
        "of what is computed: differences off by {}, gradients {}, Laplacians {} (rms, as a share of their own){}; means of blocks up to \
         {:.2e}{unit}, extremes {:.2e}{unit} (estimated from some blocks)",
        percent(errors.difference),
        percent(errors.gradient),
        percent(errors.laplacian),
        sides.collect::<String>(),
        errors.mean,
        errors.overshoot,
    )
}
