//! The frames per second of movies.

use crate::picture::request::{FASTEST, PictureRequest, SLOWEST};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_engine::render::RenderConfig;

/// The frames per second of movies: as asked for, or by the speed of the data's time.
pub(in crate::picture) fn frames_per_second(
    request: &PictureRequest,
    config: &RenderConfig,
    times: &TimeLabels,
) -> Result<f64> {
    let Some(speed) = request.speed else { return Ok(request.fps) };
    let time = |frame: Option<&usize>| frame.and_then(|frame| times.times().get(*frame)).copied();
    let (Some(first), Some(last)) = (time(config.frames.first()), time(config.frames.last())) else {
        return Err(Error::setting("speed", "the data has no times; take `fps`"));
    };
    if last <= first {
        return Err(Error::setting("speed", "no time passes in these frames; take `fps`"));
    }
    let steps = (config.frames.len() - 1) as f64;
    let fps = speed * steps / (last - first);
    if !(SLOWEST..=FASTEST).contains(&fps) {
        let sensible = 25.0 / steps * (last - first);
        let what = format!("would show {fps:.3e} frames per second, not {SLOWEST} to {FASTEST}");
        return Err(Error::value("speed", speed, format!("{what}; `speed` {sensible:.3e} shows 25")));
    }
    Ok(fps)
}
