//! The interface of the renderers of all modes.

use super::batches::Scene;
use super::config::{RenderConfig, ViewTask};
use super::report::{RenderReport, Rendered, ViewReport};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;

/// Renders the views of one mode.
pub(super) trait Renderer {
    /// The least memory in bytes with which any view can be rendered alone.
    fn least_memory(&self, scene: &dyn Scene, config: &RenderConfig) -> usize;

    /// The report of each view, before anything is rendered.
    fn reports(&self, config: &RenderConfig) -> Vec<ViewReport>;

    /// The steps of progress for a frame of all views: slices of pictures, or pictures.
    fn steps(&self) -> usize;

    /// Renders some of the views.
    fn render(&self, scene: &mut dyn Scene, task: &ViewTask, output: &mut Output<'_, '_>) -> Result<()>;
}

/// Takes pictures.
pub(super) type PictureSink<'a> = dyn FnMut(Rendered<'_>) -> Result<()> + 'a;

/// The sink for the pictures of a rendering, and its progress.
pub(super) struct Output<'a, 's> {
    pub(super) sink: &'a mut PictureSink<'s>,
    pub(super) report: &'a mut RenderReport,
    pub(super) progress: &'a dyn Progress,
}

/// Gives the pictures of some frames to a sink. They lie one after another.
pub(super) fn give(sink: &mut PictureSink<'_>, view: usize, frames: &[usize], pictures: &[f32]) -> Result<()> {
    let each = pictures.chunks_exact(pictures.len() / frames.len());
    frames
        .iter()
        .zip(each)
        .try_for_each(|(frame, picture)| sink(Rendered { views: &[], view, frame: *frame, picture, error: None }))
}

/// An error unless the settings allow `least` bytes.
pub(super) fn check_memory(config: &RenderConfig, least: usize) -> Result<()> {
    if least <= config.memory {
        return Ok(());
    }
    let ([width, height], mib) = (config.size(), least.div_ceil(1 << 20));
    let threads = rayon::current_num_threads();
    let pictures = format!("pictures of {width}x{height} pixels of this volume");
    Err(Error::setting(
        "memory",
        format!("{pictures} need at least {mib}MiB with {threads} thread(s), without the memory of the sink"),
    ))
}
