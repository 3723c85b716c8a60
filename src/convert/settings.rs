//! The settings stored in a file: enough to verify it against its source, and to append to it.

use super::{CHAIN, ConvertConfig, MissingPolicy, SchemeConstraint, SpatialPredictor};
use crate::codec::CLIP;
use crate::codec::bound::Bound;
use crate::codec::scheme::Stencil;
use crate::colour::TransferFunction;
use crate::file::promise::{MAX_ERROR, max_error};
use crate::file::setting;
use crate::source::{Archive, ColourTransform, Units};
use crate::wavelet::Basis;
use std::str::FromStr;
use wavesplat_format::Metadata;

/// The settings of a conversion. What the metadata holds anyway is not repeated.
pub(super) fn stored_settings(
    config: &ConvertConfig,
    archive: &Archive,
    colour_transform: Option<&ColourTransform>,
) -> Vec<(String, String)> {
    let ConvertConfig { coding, window, level, missing, range, .. } = config;
    let (basis, space) = (basis_name(coding.basis), space_name(coding.space));
    let missing = if *missing == MissingPolicy::Mask { "mask" } else { "error" };
    let range = range.map(|(lo, hi)| ("range", format!("{lo:?},{hi:?}")));
    let max_error = config.max_error.map(|error| (MAX_ERROR, format!("{error:?}")));
    let given = [("basis", basis.into()), ("space", space.into()), ("window", window.to_string())];
    let more = [("level", level.to_string()), ("missing", missing.into())];
    let all = given
        .into_iter()
        .chain(more)
        .chain(range)
        .chain(max_error)
        .chain((config.chain != CHAIN).then(|| ("chain", config.chain.to_string())))
        .chain(config.clip.then(|| (CLIP.0, CLIP.1.to_string())))
        .chain(colour_transform.into_iter().flat_map(ColourTransform::settings));
    let units = archive.units.settings().map(|(name, unit)| (name, unit.to_string()));
    let ours: Vec<(String, String)> = all.chain(units).map(|(name, value)| (name.to_string(), value)).collect();
    let is_new = |(name, _): &&(String, String)| ours.iter().all(|(own, _)| own != name);
    let given: Vec<_> = config.settings.iter().filter(is_new).cloned().collect();
    [ours, given].concat()
}

/// The configuration of the conversion that wrote a file, to append to it; none if the file's settings are incomplete.
pub fn of_file(file: &Metadata, memory: usize) -> Option<ConvertConfig> {
    let named = |name: &str| setting(file, name);
    let basis = BASES.into_iter().find(|basis| named("basis") == Some(basis_name(*basis)))?;
    let space = SPACES.into_iter().find(|space| named("space") == Some(space_name(*space)))?;
    let max_error = max_error(file);
    let range = match named("range") {
        _ if max_error.is_some() => None,
        Some(range) => Some(range.split_once(',').and_then(|(lo, hi)| Some((number(lo)?, number(hi)?)))?),
        None => None,
    };
    let colours = match named("colours") {
        Some(colours) => Some(TransferFunction::parse(colours)?),
        None => None,
    };
    let missing_value = match named("missing-value") {
        Some(value) if colours.is_some() => Some(number(value)?),
        _ => file.missing_value,
    };
    Some(ConvertConfig {
        coding: SchemeConstraint { basis, space },
        chain: named("chain").map_or(Some(CHAIN), number)?,
        window: number(named("window")?)?,
        tolerance: file.tolerance,
        max_error,
        bound: file.bound,
        range,
        missing: if named("missing")? == "mask" { MissingPolicy::Mask } else { MissingPolicy::Error },
        missing_value,
        refuse_fill: true,
        clip: named(CLIP.0) == Some(CLIP.1),
        colours,
        block: Some(file.block_edge as usize),
        level: number(named("level")?)?,
        memory,
        settings: file.settings.iter().filter(|(name, _)| !is_own(file, name)).cloned().collect(),
    })
}

/// The options of `wavesplat convert` that make the same file from the same samples, with their values, including
/// defaults. Colours given as a file of points are left out, because no option value names them.
pub fn options(file: &Metadata) -> Vec<(&'static str, String)> {
    let max_error = max_error(file);
    let bound = max_error.map_or(("tolerance", file.tolerance), |error| (MAX_ERROR, error));
    let mut options = vec![(bound.0, format!("{:?}", bound.1)), ("bound", file.bound.name().into())];
    match file.bound {
        Bound::Relative { floor } => options.push(("floor", format!("{floor:?}"))),
        Bound::Sampled { samples, seed } => {
            options.extend([("samples", samples.to_string()), ("seed", seed.to_string())]);
        }
        Bound::Pointwise | Bound::Rms => {}
    }
    let colours = setting(file, "colours").and_then(TransferFunction::parse);
    if let Some((colours, name)) = colours.as_ref().and_then(|colours| Some((colours, colours.name()?))) {
        let (lo, hi) = colours.range();
        options.extend([("transfer-function", name.into()), ("range", format!("{lo:?},{hi:?}"))]);
    }
    options.extend(file.missing_value.map(|value| ("missing-value", format!("{value:?}"))));
    options.push(("block", file.block_edge.to_string()));
    let is_option = |name: &&str| match *name {
        "range" => colours.is_none() && max_error.is_none(), // that of brightness is fixed
        "dtype" => setting(file, "dims").is_some(),          // else of samples that were coloured
        "times" => setting(file, "times") != Some("list"),   // of a file that has no name here
        _ => true,
    };
    options
        .extend(STORED.into_iter().filter(is_option).filter_map(|name| Some((name, setting(file, name)?.to_string()))));
    options
}

/// Settings of a file that are options by the same names.
const STORED: [&str; 23] = [
    "chain",
    "shard",
    "clip",
    "range",
    "missing",
    "missing-value",
    "basis",
    "space",
    "window",
    "level",
    "frames",
    "region",
    "variable",
    "magnitude",
    "axes",
    "dims",
    "dtype",
    "endian",
    "offset",
    "spacing",
    "origin",
    "times",
    "time-unit",
];

/// The first difference between two conversions, in words. The program's version counts only if `same_program`.
pub(super) fn difference(before: &Metadata, now: &Metadata, same_program: bool) -> Option<String> {
    let of = |m: &Metadata| {
        let given = [
            ("size", format!("{:?}", m.dims)),
            ("spacing", format!("{:?}", m.spacing)),
            ("origin", format!("{:?}", m.origin)),
            ("type of samples", m.sample.to_string()),
            ("block", m.block_edge.to_string()),
            ("variable", m.variable.clone().unwrap_or_default()),
            ("bound", format!("{:?}", m.bound)),
            ("tolerance", format!("{:?}", m.tolerance)),
            ("missing value", format!("{:?}", m.missing_value)),
            ("version of the program", m.program.clone()),
        ];
        let given = given.into_iter().filter(|(what, _)| same_program || *what != "version of the program");
        let own = OWN
            .into_iter()
            .chain(Units::SETTINGS)
            .chain(["frames", "region"])
            .chain(ColourTransform::SETTINGS.map(|(name, _)| name));
        let settings = own.map(|name| (display_name(name), setting(m, name).unwrap_or("none").to_string()));
        settings.chain(given).collect::<Vec<_>>()
    };
    let pairs = of(before).into_iter().zip(of(now));
    let mut differ = pairs.filter(|(before, now)| before != now);
    differ.next().map(|((what, before), (_, now))| format!("{what}: {}, now {}", shortened(&before), shortened(&now)))
}

/// The name of a setting in messages.
fn display_name(setting: &'static str) -> &'static str {
    let of_colours = ColourTransform::SETTINGS.into_iter().find(|(name, _)| *name == setting);
    of_colours.map_or(setting, |(_, words)| words)
}

/// A setting, shortened for a message: transfer functions may have many points.
fn shortened(setting: &str) -> String {
    const MOST: usize = 60;
    if setting.len() <= MOST { setting.into() } else { setting.chars().take(MOST).chain("...".chars()).collect() }
}

fn number<T: FromStr>(text: &str) -> Option<T> {
    text.parse().ok()
}

/// Whether [`stored_settings`] adds a setting by itself.
fn is_own(file: &Metadata, name: &str) -> bool {
    let of_colours = || ColourTransform::SETTINGS.iter().any(|(ours, _)| *ours == name);
    OWN.contains(&name) || Units::SETTINGS.contains(&name) || setting(file, "colours").is_some() && of_colours()
}

/// The settings that [`stored_settings`] adds by itself, besides those of colours and units.
const OWN: [&str; 9] = [MAX_ERROR, CLIP.0, "chain", "basis", "space", "window", "level", "missing", "range"];

/// The stored name of a basis, which is that of the option. No basis means that any is allowed.
fn basis_name(basis: Option<Basis>) -> &'static str {
    match basis {
        None => "auto",
        Some(Basis::Haar) => "haar",
        Some(Basis::Multi) => "multi",
        Some(Basis::Learned) => "learned",
        Some(Basis::Samples) => "pyramid",
    }
}

/// The stored name of a prediction in space, which is that of the option.
fn space_name(space: SpatialPredictor) -> &'static str {
    match space {
        SpatialPredictor::Any => "auto",
        SpatialPredictor::Alone => "none",
        SpatialPredictor::Pyramid(Stencil::Linear) => "linear",
        SpatialPredictor::Pyramid(Stencil::Cubic) => "cubic",
    }
}

/// What [`of_file`] finds by name. The settings of a file with a name that is missing here are incomplete.
const BASES: [Option<Basis>; 5] =
    [None, Some(Basis::Haar), Some(Basis::Multi), Some(Basis::Learned), Some(Basis::Samples)];

/// As [`BASES`].
const SPACES: [SpatialPredictor; 4] = [
    SpatialPredictor::Any,
    SpatialPredictor::Alone,
    SpatialPredictor::Pyramid(Stencil::Linear),
    SpatialPredictor::Pyramid(Stencil::Cubic),
];
