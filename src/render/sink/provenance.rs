//! What made a picture, in words that travel with it.

use super::SinkConfig;
use crate::render::{Rendered, ViewReport};
use serde::Serialize;
use serde_json::Value;
use std::fmt::Display;

/// What the pictures of a run were made with: no path, no date, nothing that threads or memory change. Keys are named
/// as the options are where there is one, and text is as these take it.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Provenance {
    /// Name and version of the program.
    pub software: String,
    /// Whether coefficients or frames were splatted.
    pub method: &'static str,
    /// What became of what lies along a ray.
    pub mode: &'static str,
    /// What a pixel means, of projections.
    pub quantity: Option<&'static str>,
    /// What of it is shown: the picture, or the certified error of its pixels.
    pub shows: Shows,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Attenuation per world unit of depth.
    pub tau: f64,
    /// Standard deviation of the kernel in world units.
    pub sigma: f64,
    /// The splat error that was asked for; what each view states is that view's.
    pub splat_error: f64,
    /// The share of the range that pictures may be off.
    pub tolerance: Option<f64>,
    /// Which error that limits.
    pub error: Option<&'static str>,
    /// No sample that was splatted is further from the source's, as far as that is known before one is.
    pub sample_error: Option<f64>,
    /// Only these voxels.
    pub region: Option<String>,
    /// The value that means "missing" in frames.
    pub missing_value: Option<f64>,
    /// The coefficient file's id.
    pub file_id: Option<String>,
    /// What it promises.
    pub file_promise: Option<String>,
    /// The largest error of any of its samples.
    pub file_reached: Option<f64>,
    /// Name of the map that values have the colours of.
    pub colormap: Option<String>,
    /// Name of what turned samples into colours.
    pub transfer_function: Option<String>,
    /// Opacities of values along the ray.
    pub opacity: Option<String>,
    /// World units of a path that has such an opacity.
    pub opacity_unit: Option<f64>,
    /// The values of the first and the last colour.
    pub range: Option<(f64, f64)>,
    /// How values are spread over the range.
    pub norm: Option<&'static str>,
    /// The colour of the background.
    pub background: Option<String>,
    /// Numbers of the frames.
    pub frames: Vec<usize>,
    /// The times of these, or empty.
    pub times: Vec<f64>,
}

/// What of a rendering a sink shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shows {
    /// The quantity asked for.
    #[default]
    Picture,
    /// The bound on the error of every pixel.
    CertifiedError,
}

/// What is before the names of all but standard ones.
const PREFIX: &str = "wavesplat:";

impl SinkConfig {
    /// Names and values for a file with one picture.
    pub(super) fn texts_of(&self, rendered: &Rendered<'_>) -> Vec<(String, String)> {
        let mut texts = self.texts(&[(rendered.view, rendered.frame)], rendered.views);
        if let Some(error) = rendered.error {
            let largest = error.iter().copied().fold(0.0, f32::max);
            texts.push((format!("{PREFIX}certified_error"), f64::from(largest).to_string()));
        }
        texts
    }

    /// Names and values for a file with all pictures: ASCII, in an order that never changes.
    pub(super) fn texts_of_all(&self, rendered: &Rendered<'_>) -> Vec<(String, String)> {
        self.texts(&self.shown, rendered.views)
    }

    fn texts(&self, shown: &[(usize, usize)], views: &[ViewReport]) -> Vec<(String, String)> {
        let Ok(Value::Object(all)) = serde_json::to_value(self.provenance.as_ref()) else { return Vec::new() };
        let of_run = all.iter().filter(|(key, _)| !["software", "frames", "times"].contains(&key.as_str()));
        let mut texts: Vec<(&str, String)> = of_run.map(|(key, value)| (key.as_str(), text(value))).collect();
        texts.extend(of_views(views, shown));
        texts.extend(self.of_frames(shown));
        texts.retain(|(_, text)| !text.is_empty());
        let named = texts.into_iter().map(|(key, text)| (format!("{PREFIX}{key}"), text));
        std::iter::once(("Software".into(), self.provenance.software.clone())).chain(named).collect()
    }

    /// Which frames, and of a single one its time.
    fn of_frames(&self, shown: &[(usize, usize)]) -> Vec<(&'static str, String)> {
        let mut frames: Vec<usize> = shown.iter().map(|(_, frame)| *frame).collect();
        frames.dedup();
        let at = self.provenance.frames.iter().position(|frame| [*frame] == frames[..]);
        let time = at.and_then(|at| self.provenance.times.get(at)).map(f64::to_string);
        vec![("frames", spans(&frames)), ("time", time.unwrap_or_default())]
    }
}

/// What is to be said of the views that are shown; where they differ, one after another.
fn of_views(views: &[ViewReport], shown: &[(usize, usize)]) -> Vec<(&'static str, String)> {
    let mut numbers: Vec<usize> = shown.iter().map(|(view, _)| *view).collect();
    numbers.dedup();
    let views: Vec<&ViewReport> = numbers.iter().filter_map(|n| views.get(*n)).collect();
    let of = |say: &dyn Fn(&ViewReport) -> String| {
        let said: Vec<String> = views.iter().map(|view| say(view)).collect();
        let alike = said.windows(2).all(|pair| pair[0] == pair[1]);
        if alike { said.first().cloned().unwrap_or_default() } else { said.join(" ") }
    };
    vec![
        ("view", of(&|view| joined(&[view.azimuth, view.elevation]))),
        ("roll", of(&|view| view.roll.to_string())),
        ("scale", of(&|view| view.scale.to_string())),
        ("center", of(&|view| joined(&view.center))),
        ("slabs", of(&|view| view.slabs.map_or_else(String::new, |slabs| slabs.to_string()))),
        ("splat_method", of(&|view| view.method.into())),
        ("stated_splat_error", of(&|view| view.stated_splat_error.to_string())),
    ]
}

/// A value as options take it; of none nothing.
fn text(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Array(values) => joined(values),
        other => other.to_string(),
    }
}

fn joined(values: &[impl Display]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(",")
}

/// Ascending numbers as a:b:step where they are evenly spaced, or one by one.
fn spans(frames: &[usize]) -> String {
    match *frames {
        [first, second, .., last] if frames.windows(2).all(|pair| pair[1] - pair[0] == second - first) => {
            let step = second - first;
            if step == 1 { format!("{first}:{}", last + 1) } else { format!("{first}:{}:{step}", last + 1) }
        }
        _ => joined(frames),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_said_as_they_are_asked_for() {
        let said = [&[7][..], &[2, 3], &[0, 1, 2, 3], &[1, 9, 17], &[1, 2, 4]].map(spans);
        assert_eq!(said, ["7", "2,3", "0:4", "1:18:8", "1,2,4"]);
    }

    #[test]
    fn values_are_said_as_options_take_them() {
        let value = serde_json::json!({"a": [48, 40], "b": [0.1, -2.0], "c": null, "d": "x", "e": 1e-9});
        let said = ["a", "b", "c", "d", "e"].map(|key| text(&value[key]));
        assert_eq!(said, ["48,40", "0.1,-2.0", "", "x", "1e-9"]);
    }
}
