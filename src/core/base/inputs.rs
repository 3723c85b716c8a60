//! Inputs that no output may replace.

use super::error::{Error, Result};
use super::output::part_of;
use std::path::{Path, PathBuf};

/// An error if writing `output`, which may be a numbered name, would replace an input or a frame beside it,
/// which no setting allows.
pub fn spare_inputs(inputs: &[PathBuf], output: &Path) -> Result<()> {
    let real = |path: &Path| path.canonicalize().ok();
    let folder = |path: &Path| real(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")));
    let numbered = output.to_string_lossy().contains('%');
    let may_be_frame = !matches!(output.extension().and_then(|e| e.to_str()), Some("wspl" | "png" | "y4m"));
    let beside = |input: &Path| {
        let inputs = if input.is_dir() { real(input) } else { folder(input) };
        let several = input.is_dir() || !input.exists();
        may_be_frame && several && inputs.is_some() && inputs == folder(output)
    };
    let replaces = |input: &PathBuf| {
        let is = |name: &Path| name.is_file() && real(input) == real(name);
        is(output) || is(&part_of(output)) || (numbered || output.is_file()) && beside(input)
    };
    match inputs.iter().find(|input| replaces(input)) {
        Some(input) => {
            Err(Error::path(output, format!("would replace the input {}; name another output", input.display())))
        }
        None => Ok(()),
    }
}
