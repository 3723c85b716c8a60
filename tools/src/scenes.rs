//! Shared by demo and gallery: converts archives to files, and renders scenes to pictures.

use std::path::Path;
use wavesplat::base::error::Result;
use wavesplat::base::progress::Silent;
use wavesplat::convert::{ConvertConfig, ConvertReport, convert};
use wavesplat::render::{RenderConfig, RenderReport, Scene, render};
use wavesplat::source::FrameSource;
use wavesplat_core::base::output::Output;

/// Bytes that a conversion or a rendering may allocate.
pub(crate) const MEMORY: usize = 512 << 20;

/// Converts an archive to the file `path`, which is replaced.
pub(crate) fn converted(source: &mut dyn FrameSource, config: &ConvertConfig, path: &Path) -> Result<ConvertReport> {
    let mut out = Output::create(path, true)?;
    let report = convert(source, config, path, &mut out, &Silent)?;
    out.commit()?;
    Ok(report)
}

/// All frames, one after another.
pub(crate) fn pictures(scene: &mut dyn Scene, config: &RenderConfig) -> Result<(Vec<f32>, RenderReport)> {
    let mut all = Vec::new();
    let report = render(scene, config, &Silent, &mut |rendered| {
        all.extend_from_slice(rendered.picture);
        Ok(())
    })?;
    Ok((all, report))
}
