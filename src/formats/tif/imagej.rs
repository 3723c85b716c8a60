//! The text that ImageJ writes into the first page: lines such as `slices=5`. Channels are fastest, then planes, then frames.

use super::stack::{Stack, positive};
use crate::shared::words::number;
use wavesplat_core::source::Parsed;

/// How it starts.
pub(super) const START: &str = "ImageJ=";

/// Reads it; the resolution of the page says how many pixels there are in a unit along x and y.
pub(super) fn parse(said: &str, pages: usize, pixels_per_unit: [Option<f64>; 2]) -> Parsed<Stack> {
    let get = |name: &str| said.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('=')).map(str::trim);
    let count = |name: &str| get(name).map(|text| number::<usize>(text, name)).transpose();
    let length = |name: &str| get(name).and_then(|text| text.parse().ok()).and_then(positive);
    let (channels, slices, frames) = (count("channels")?, count("slices")?, count("frames")?);
    // Beyond 4 GB ImageJ writes one page, and all images behind each other.
    let images = count("images")?.filter(|_| pages == 1).unwrap_or(pages);
    let planes = if channels.is_none() && slices.is_none() && frames.is_none() { Some(images) } else { slices };
    let lengths = [channels.unwrap_or(1), planes.unwrap_or(1), frames.unwrap_or(1)];
    let [x, y] = pixels_per_unit.map(|pixels| pixels.and_then(positive).map(f64::recip));
    let unit = get("unit").filter(|unit| !matches!(*unit, "" | "pixel" | "pixels" | "inch"));
    let space_unit = unit.map(|unit| match unit {
        "micron" | "microns" | "\\u00B5m" | "µm" | "μm" => "um".to_string(),
        other => other.into(),
    });
    let spacing = match space_unit {
        Some(_) => [x.unwrap_or(1.0), y.unwrap_or(1.0), length("spacing").unwrap_or(1.0)],
        None => [1.0, 1.0, length("spacing").unwrap_or(1.0)],
    };
    let interval = length("finterval").map(|seconds| (seconds, get("tunit").unwrap_or("s").replace("sec", "s")));
    Ok(Stack { spacing, space_unit, interval, ..Stack::new(['C', 'Z', 'T'], lengths)? })
}
