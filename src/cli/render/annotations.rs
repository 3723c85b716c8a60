//! Options for what is drawn around the volume.

use super::args::Cli;
use super::places::{self, Axes};
use crate::base::error::Result;
use crate::base::grid::{Grid, Region};
use crate::base::time_labels::TimeLabels;
use crate::colour::Rgb;
use crate::file::CoefficientFile;
use crate::file::setting;
use crate::render::annotate::{Annotation, AxisLabels, Margins, Parts, VolumeAxes, margins};
use crate::render::{Mode, RenderConfig};
use crate::view::camera::{Camera, View};
use clap::{Args, ValueEnum};
use std::str::FromStr;

/// Options for what is drawn around the volume.
#[derive(Debug, Args)]
pub(crate) struct AnnotationArgs {
    /// Draw the box of the volume, values along its axes, a colour bar and the time of each frame; or only the given
    /// parts: all, none, box, axes, triad (arrows along x, y and z), scale (a line of a round length), bar and time
    #[arg(
        long,
        value_name = "PARTS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "box,axes,bar,time",
        help_heading = "Colour"
    )]
    annotate: Option<PartList>,
    /// Draw a title above the volume
    #[arg(long, value_name = "TEXT", help_heading = "Colour")]
    title: Option<String>,
    /// Label of the colour bar, instead of the name and the unit of the values
    #[arg(long, value_name = "TEXT", help_heading = "Colour")]
    bar_title: Option<String>,
    /// Colours of background and letters
    #[arg(long, value_enum, default_value = "dark", help_heading = "Colour")]
    theme: Theme,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Theme {
    /// White on black
    Dark,
    /// Black on white
    Light,
}

#[derive(Debug, Clone, Copy)]
struct PartList(Parts);

impl FromStr for PartList {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let mut parts = Parts::NONE;
        for name in text.split(',') {
            match name.trim() {
                "all" => parts = Parts::ALL,
                "none" => parts = Parts::NONE,
                "box" => parts.bounds = true,
                "axes" => parts.axes = true,
                "triad" => parts.triad = true,
                "scale" => parts.scale = true,
                "bar" => parts.bar = true,
                "time" => parts.time = true,
                other => return Err(format!("'{other}' is none of all, none, box, axes, triad, scale, bar and time")),
            }
        }
        Ok(Self(parts))
    }
}

impl AnnotationArgs {
    /// Whether anything is drawn.
    pub(crate) fn is_asked(&self) -> bool {
        self.annotate.is_some() || self.title.is_some() || self.bar_title.is_some()
    }

    /// The parts that are asked for.
    fn parts(&self) -> Parts {
        self.annotate.map_or(Parts::NONE, |list| list.0)
    }

    /// The names of the parts that are drawn, as the option takes them.
    pub(crate) fn words(&self) -> Option<String> {
        let Parts { bounds, axes, triad, scale, bar, time } = self.annotate?.0;
        let named = [(bounds, "box"), (axes, "axes"), (triad, "triad"), (scale, "scale"), (bar, "bar"), (time, "time")];
        let names: Vec<&str> = named.into_iter().filter(|(is_drawn, _)| *is_drawn).map(|(_, name)| name).collect();
        Some(if names.is_empty() { "none".into() } else { names.join(",") })
    }

    pub(crate) fn bar_title(&self) -> Option<String> {
        self.bar_title.clone().filter(|title| !title.is_empty())
    }

    pub(crate) fn title(&self) -> String {
        self.title.clone().unwrap_or_default()
    }

    /// The background if none is given.
    pub(crate) fn background(&self) -> Rgb {
        match self.theme {
            Theme::Dark => [0; 3],
            Theme::Light => [255; 3],
        }
    }

    /// Views in one scale, in which the volume fits beside the margins, but for the zoom of each.
    pub(crate) fn beside((views, zooms): (Vec<View>, &[f64]), grid: &Grid, around: Margins) -> Result<Vec<View>> {
        let Margins { left, right, top, bottom } = around;
        let camera = |view: &View| {
            let size = [view.size[0] - left - right, view.size[1] - top - bottom];
            Camera::new(&View { size, ..*view }, grid)
        };
        let cameras = views.iter().map(camera).collect::<Result<Vec<_>>>()?;
        let scale = cameras.iter().map(|camera| camera.scale).fold(f64::INFINITY, f64::min);
        let moved = |((view, camera), zoom): ((View, &Camera), &f64)| {
            let scale = scale * zoom;
            let [across, up] = [[right, left], [top, bottom]].map(|[a, b]| (a as f64 - b as f64) / 2.0 / scale);
            View { scale: Some(scale), center: Some(camera.moved(across, up)), ..view }
        };
        Ok(views.into_iter().zip(&cameras).zip(zooms).map(moved).collect())
    }
}

impl Cli {
    /// The parts that are drawn into pictures. A web page itself has a title, a colour bar and the time.
    fn parts(&self) -> Parts {
        let parts = self.around.parts();
        if self.is_page() { Parts { bar: false, time: false, ..parts } } else { parts }
    }

    /// The margins in a picture of this size.
    pub(crate) fn margins(&self, size: [usize; 2]) -> Margins {
        margins(size, self.parts(), self.around.title.is_some() && !self.is_page())
    }

    /// The annotations of a run, but for the axes.
    pub(crate) fn annotation(&self, values: String, times: TimeLabels) -> Annotation {
        let values = self.around.bar_title.clone().unwrap_or(values);
        Annotation { parts: self.parts(), title: self.around.title(), values, times, axes: None }
    }

    /// Says how much of a long title pictures show.
    pub(crate) fn note_title(&self, annotation: &Annotation, config: &RenderConfig) {
        let frame = config.frames.first().copied().unwrap_or(0);
        if let Some(shown) = annotation.cut_title(self.size.0, frame).filter(|_| !self.is_page()) {
            self.common.note(format_args!("--title: the picture is too narrow for all of it; it shows '{shown}'"));
        }
    }

    /// The axes of the volume as it is drawn, with their true coordinates.
    pub(crate) fn volume_axes(&self, axes: &Axes, whole: &Grid, config: &RenderConfig) -> Result<VolumeAxes> {
        let region = self.region.map_or(Ok(whole.whole()), |region| region.resolve(whole))?;
        Ok(self.axes_in(axes.labels(), whole, (config, region)))
    }

    /// The axes of the voxels that are drawn.
    pub(crate) fn axes_in(
        &self,
        labels: [AxisLabels; 3],
        whole: &Grid,
        (config, region): (&RenderConfig, Region),
    ) -> VolumeAxes {
        let has_kernel = !matches!(config.mode, Mode::Planes { .. } | Mode::Iso { .. });
        let rim = if has_kernel { (SEEN * config.kernel.sigma - whole.largest_spacing() / 2.0).max(0.0) } else { 0.0 };
        let volume = VolumeAxes { grid: *whole, region, rim, labels };
        if self.parts().scale && volume.length_unit().is_none() {
            self.common.note("no scale is drawn, since lengths differ from axis to axis");
        }
        volume
    }
}

/// Standard deviations of the kernel up to which the outermost voxels are seen.
const SEEN: f64 = 2.4;

/// The name and the unit of a file's values.
pub(crate) fn values_of(file: &CoefficientFile) -> Result<String> {
    let (m, description) = (file.metadata(), file.description()?);
    let text = |name: &str| description.as_ref().and_then(|all| places::text(&all.attributes, name));
    let name = text("long_name").or_else(|| text("standard_name").map(|name| name.replace('_', " ")));
    let name = name.or_else(|| m.variable.clone()).unwrap_or_default();
    let unit = setting(m, "units").map(ToString::to_string).or_else(|| text("units")).unwrap_or_default();
    let unit = in_letters(&unit);
    Ok(if unit.is_empty() || name.is_empty() { name + &unit } else { format!("{name} ({unit})") })
}

/// A unit as people write it: °C, and m s⁻¹ for "m s-1".
pub(crate) fn in_letters(unit: &str) -> String {
    match unit.trim() {
        "degC" | "deg_C" | "degree_C" | "degrees_C" | "celsius" | "Celsius" => "°C".into(),
        "degrees_north" | "degree_north" => "°N".into(),
        "degrees_east" | "degree_east" => "°E".into(),
        unit => unit.split(' ').map(raised).collect::<Vec<_>>().join(" "),
    }
}

/// A factor of a unit, with its exponent raised: letters, then perhaps a sign, then digits.
fn raised(factor: &str) -> String {
    let letters = factor.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
    let exponent = &factor[letters.len()..];
    let is_exponent =
        !letters.is_empty() && letters.chars().all(char::is_alphabetic) && exponent.parse::<i32>().is_ok();
    if !is_exponent {
        return factor.into();
    }
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    letters.chars().chain(exponent.chars().map(digit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_written_as_people_do() {
        let units = ["m s-1", "kg m-3", "degC", "m2", "mm", "1", "s-", "A/m^2", "W m-2 K-1", ""];
        let written = ["m s⁻¹", "kg m⁻³", "°C", "m²", "mm", "1", "s-", "A/m^2", "W m⁻² K⁻¹", ""];
        assert_eq!(units.map(in_letters), written.map(String::from));
    }
}
