//! Shared by demo and gallery: converts archives to files, and renders scenes to pictures.

use std::path::Path;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::output::Output;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::source::FrameSource;
use wavesplat_engine::convert::{ConvertConfig, ConvertReport, convert};
use wavesplat_engine::render::{RenderConfig, RenderReport, Scene, render};

/// Bytes that a conversion or a rendering may allocate.
pub const MEMORY: usize = 512 << 20;

/// Converts an archive to the file `path`, which is replaced.
pub fn converted(source: &mut dyn FrameSource, config: &ConvertConfig, path: &Path) -> Result<ConvertReport> {
    let mut out = Output::create(path, true)?;
    let report = convert(source, config, path, &mut out, &Silent)?;
    out.commit()?;
    Ok(report)
}

/// All frames, one after another.
pub fn pictures(scene: &mut dyn Scene, config: &RenderConfig) -> Result<(Vec<f32>, RenderReport)> {
    let mut all = Vec::new();
    let report = render(scene, config, &Silent, &mut |rendered| {
        all.extend_from_slice(rendered.picture);
        Ok(())
    })?;
    Ok((all, report))
}
