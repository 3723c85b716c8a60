//! The provenance of a picture: texts stored with it that tell how it was made.

use super::SinkConfig;
use crate::render::{Rendered, ViewReport};
use serde::Serialize;
use serde_json::Value;
use std::fmt::Display;

/// How the pictures of a run were made. It contains no paths or dates, and does not depend on threads or memory. Keys
/// have the names of the options, and values have the form that the options accept.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Provenance {
    /// Name and version of the program.
    pub software: String,
    /// Whether coefficients or frames were splatted.
    pub method: &'static str,
    /// How the values along a ray are combined.
    pub mode: &'static str,
    /// The planes that are shown, at their true coordinates.
    pub slice: Option<String>,
    /// The quantity that a pixel shows; projections only.
    pub quantity: Option<&'static str>,
    /// Whether the file shows the picture or the certified error of its pixels.
    pub shows: Shows,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Attenuation per world unit of depth.
    pub tau: f64,
    /// Standard deviation of the kernel in world units.
    pub sigma: Option<f64>,
    /// The factor by which heights are drawn taller, if they are.
    pub exaggerate: Option<f64>,
    /// The level of detail, if pictures show every 2^lod-th voxel along each axis.
    pub lod: Option<u32>,
    /// The requested splat error. The stated error of each view is stored with the view.
    pub splat_error: f64,
    /// The tolerance of pictures, as a share of the range.
    pub tolerance: Option<f64>,
    /// The error that the tolerance limits.
    pub error: Option<&'static str>,
    /// Error bound of every splatted sample, if it is known before splatting.
    pub sample_error: Option<f64>,
    /// The rendered region of voxels.
    pub region: Option<String>,
    /// The value that means "missing" in frames.
    pub missing_value: Option<f64>,
    /// The coefficient file's id.
    pub file_id: Option<String>,
    /// The error bound that the file promises.
    pub file_promise: Option<String>,
    /// The largest error of any sample of the file.
    pub file_reached: Option<f64>,
    /// Name of the colour map of values.
    pub colormap: Option<String>,
    /// Name of the transfer function that turned samples into colours.
    pub transfer_function: Option<String>,
    /// Opacities of values along the ray.
    pub opacity: Option<String>,
    /// Length of the path that has these opacities, in world units.
    pub opacity_unit: Option<f64>,
    /// Isosurfaces.
    pub iso: Option<String>,
    /// Degrees by which the lamp stands to the right of the viewer and above, if colours are shaded.
    pub light: Option<[f64; 2]>,
    /// The values of the first and the last colour.
    pub range: Option<(f64, f64)>,
    /// How values are spread over the range.
    pub norm: Option<&'static str>,
    /// The colour of the background.
    pub background: Option<String>,
    /// The least and the largest value that show the background.
    pub clear: Option<[f64; 2]>,
    /// The value that short rays meet beyond the volume, if means are weighed by the lengths of rays.
    pub beyond: Option<f64>,
    /// The parts drawn around the volume.
    pub annotate: Option<String>,
    /// The title drawn above the volume.
    pub title: Option<String>,
    /// The words beside the colour bar, if they are not those of the source.
    pub bar_title: Option<String>,
    /// Numbers of the frames.
    pub frames: Vec<usize>,
    /// Times of the frames, or empty.
    pub times: Vec<f64>,
    /// Dates of the frames where a calendar is known, else empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dates: Vec<String>,
}

/// The result of a rendering that a sink shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shows {
    /// The picture in the requested quantity.
    #[default]
    Picture,
    /// The error bound of every pixel.
    CertifiedError,
}

/// The prefix of all nonstandard names.
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

    /// Names and values for a file with all pictures: ASCII, in a fixed order.
    pub(super) fn texts_of_all(&self, rendered: &Rendered<'_>) -> Vec<(String, String)> {
        self.texts(&self.shown, rendered.views)
    }

    /// Names and values of all pictures of a run, before any is rendered.
    pub(super) fn texts_of_run(&self) -> Vec<(String, String)> {
        self.texts(&self.shown, &[])
    }

    fn texts(&self, shown: &[(usize, usize)], views: &[ViewReport]) -> Vec<(String, String)> {
        let Ok(Value::Object(all)) = serde_json::to_value(self.provenance.as_ref()) else { return Vec::new() };
        let shared = all.iter().filter(|(key, _)| !["software", "frames", "times", "dates"].contains(&key.as_str()));
        let mut texts: Vec<(&str, String)> = shared.map(|(key, value)| (key.as_str(), text(value))).collect();
        texts.extend(view_texts(views, shown));
        texts.extend(self.frame_texts(shown));
        texts.retain(|(_, text)| !text.is_empty());
        let named = texts.into_iter().map(|(key, text)| (format!("{PREFIX}{key}"), text));
        std::iter::once(("Software".into(), self.provenance.software.clone())).chain(named).collect()
    }

    /// The frame numbers, and the time and date of a single frame.
    fn frame_texts(&self, shown: &[(usize, usize)]) -> Vec<(&'static str, String)> {
        let mut frames: Vec<usize> = shown.iter().map(|(_, frame)| *frame).collect();
        frames.dedup();
        let at = self.provenance.frames.iter().position(|frame| [*frame] == frames[..]);
        let time = at.and_then(|at| self.provenance.times.get(at)).map(f64::to_string);
        let date = at.and_then(|at| self.provenance.dates.get(at)).cloned();
        vec![("frames", spans(&frames)), ("time", time.unwrap_or_default()), ("date", date.unwrap_or_default())]
    }
}

/// The settings of the views that are shown. If views differ in a setting, their values follow one another.
fn view_texts(views: &[ViewReport], shown: &[(usize, usize)]) -> Vec<(&'static str, String)> {
    let mut numbers: Vec<usize> = shown.iter().map(|(view, _)| *view).collect();
    numbers.dedup();
    let views: Vec<&ViewReport> = numbers.iter().filter_map(|n| views.get(*n)).collect();
    let setting = |say: &dyn Fn(&ViewReport) -> String| {
        let said: Vec<String> = views.iter().map(|view| say(view)).collect();
        let alike = said.windows(2).all(|pair| pair[0] == pair[1]);
        if alike { said.first().cloned().unwrap_or_default() } else { said.join(" ") }
    };
    vec![
        ("view", setting(&|view| joined(&[view.azimuth, view.elevation]))),
        ("roll", setting(&|view| view.roll.to_string())),
        ("scale", setting(&|view| view.scale.to_string())),
        ("center", setting(&|view| joined(&view.center))),
        ("slices", setting(&|view| view.slices.map_or_else(String::new, |slices| slices.to_string()))),
        ("cells", setting(&|view| view.cells.map_or_else(String::new, |cells| cells.to_string()))),
        ("splat_method", setting(&|view| view.method.into())),
        (
            "stated_splat_error",
            setting(&|view| {
                Some(view.stated_splat_error).filter(|e| !e.is_nan()).map_or_else(String::new, |e| e.to_string())
            }),
        ),
    ]
}

/// A value in the form that options accept; empty for null.
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

/// Ascending numbers, as a:b:step if they are evenly spaced, else one by one.
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
    fn frames_have_the_form_of_the_option() {
        let texts = [&[7][..], &[2, 3], &[0, 1, 2, 3], &[1, 9, 17], &[1, 2, 4]].map(spans);
        assert_eq!(texts, ["7", "2,3", "0:4", "1:18:8", "1,2,4"]);
    }

    #[test]
    fn values_have_the_form_of_options() {
        let value = serde_json::json!({"a": [48, 40], "b": [0.1, -2.0], "c": null, "d": "x", "e": 1e-9});
        let texts = ["a", "b", "c", "d", "e"].map(|key| text(&value[key]));
        assert_eq!(texts, ["48,40", "0.1,-2.0", "", "x", "1e-9"]);
    }
}
