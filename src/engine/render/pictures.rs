//! A rendering with picture files as its output.

use super::batches::Scene;
use super::config::RenderConfig;
use super::report::RenderReport;
use super::sink::{Sink, SinkConfig};
use std::path::Path;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::output::names_of_views;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::colour::Scale;

/// Renders all frames from all views into PNG files, which replace existing ones.
///
/// `path` is a pattern: `%04d` stands for the frame's number, `%v` for the view's; it may lack one that is always the
/// same. For other formats, progress, or pictures in memory see [`super::render`] and [`Sink`].
///
/// # Errors
/// A pattern that gives several pictures one name, and those of [`super::render`] and of writing files.
pub fn render_png(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    colours: &Scale,
    path: impl AsRef<Path>,
) -> Result<RenderReport> {
    super::check(scene, config)?;
    let sink = SinkConfig { force: true, ..SinkConfig::new(scene, config, colours.clone()) };
    let names = names_of_views(path.as_ref(), config.views.len(), false)?;
    let shown = |view| config.shown().into_iter().filter(|(of, _)| *of == view).collect();
    let open = |(view, name): (usize, _)| Sink::open(name, SinkConfig { shown: shown(view), ..sink.clone() });
    let mut sinks = names.iter().map(std::path::PathBuf::as_path).enumerate().map(open).collect::<Result<Vec<_>>>()?;
    let report = super::render(scene, config, &Silent, &mut |rendered| sinks[rendered.view].picture(&rendered))?;
    sinks.into_iter().try_for_each(Sink::finish)?;
    Ok(report)
}
