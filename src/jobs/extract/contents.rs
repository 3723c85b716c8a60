//! The description of extracted samples, for the headers of files.

use super::ExtractConfig;
use wavesplat_core::base::description::narrowed;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::sample::{missing_value, round_to};
use wavesplat_core::source::CHANNELS;
use wavesplat_engine::file::{CoefficientFile, setting};
use wavesplat_formats::{Contents, plain};

/// Describes what `config` extracts from a file.
///
/// # Errors
/// The description of the file is damaged, or cannot be read.
pub fn contents(file: &CoefficientFile, config: &ExtractConfig) -> Result<Contents> {
    let m = file.metadata();
    let text = |name| setting(m, name).map(plain).filter(|text| !text.is_empty());
    let channel = file.colour_transform().map(|_| CHANNELS[config.channel]);
    let name = channel.or(m.variable.as_deref()).map(plain).filter(|name| !name.is_empty());
    let numbered = m.times.is_empty();
    let time = |frame: &usize| if numbered { *frame as f64 } else { m.times[*frame] };
    let description = if channel.is_none() { file.description()? } else { None };
    let description = description.map(|all| narrowed(&all, &config.frames, &config.region, 1 << file.lod()));
    Ok(Contents {
        grid: file.grid.crop(&config.region),
        sample: file.sample(),
        frames: config.frames.clone(),
        times: config.frames.iter().map(time).collect(),
        numbered,
        name: name.unwrap_or_else(|| "values".into()),
        units: text("units").filter(|_| channel.is_none()),
        time_units: text("time-units").filter(|_| !numbered),
        calendar: text("calendar").filter(|_| !numbered),
        space_units: text("space-units"),
        missing: missing(file, config),
        description,
    })
}

/// The value of missing samples: the declared one, or NaN if some are missing.
fn missing(file: &CoefficientFile, config: &ExtractConfig) -> Option<f64> {
    let ty = file.sample();
    if let Some(declared) = missing_value(ty, file.metadata().missing_value) {
        return (ty.is_float() || round_to(ty, declared) == declared).then_some(declared);
    }
    let any = config.frames.iter().any(|frame| file.has_missing(file.window_of(*frame)));
    (any && ty.is_float()).then_some(f64::NAN)
}
