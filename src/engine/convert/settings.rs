//! The settings stored in a file: enough to verify it against its source, and to append to it.

use super::coded_input::CodedInput;
use super::{CHAIN, ConvertConfig, MissingPolicy, SchemeConstraint, SpatialPredictor};
use crate::file::promise::{MAX_ERROR, max_error};
use crate::file::setting;
use std::str::FromStr;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::{ColourTransform, Units};
use wavesplat_core::wavelet::AnyBasis;
use wavesplat_format::{Keep, Metadata};

/// The settings of a conversion, without those that the metadata holds.
pub(super) fn stored_settings(input: &CodedInput) -> Vec<(String, String)> {
    let CodedInput { config, archive, colour_transform } = input;
    let ConvertConfig { coding, window, level, missing, range, .. } = config;
    let (basis, space) = (coding.basis.name(), coding.space.name());
    let range = range.map(|(lo, hi)| ("range", format!("{lo:?},{hi:?}")));
    let max_error = config.max_error.map(|error| (MAX_ERROR, format!("{error:?}")));
    let given = [("basis", basis.into()), ("space", space.into()), ("window", window.to_string())];
    let more = [("level", level.to_string()), ("missing", missing.name().into())];
    let all = given
        .into_iter()
        .chain(more)
        .chain(range)
        .chain(max_error)
        .chain((config.chain != CHAIN).then(|| ("chain", config.chain.to_string())))
        .chain((!config.keep.is_empty()).then(|| (Keep::SETTING, config.keep.to_string())))
        .chain(colour_transform.iter().flat_map(ColourTransform::settings));
    let units = archive.units.settings().map(|(name, unit)| (name, unit.to_string()));
    let ours: Vec<(String, String)> = all.chain(units).map(|(name, value)| (name.to_string(), value)).collect();
    let is_new = |(name, _): &&(String, String)| ours.iter().all(|(own, _)| own != name);
    let given: Vec<_> = config.settings.iter().filter(is_new).cloned().collect();
    [ours, given].concat()
}

impl ConvertConfig {
    /// The configuration of the conversion that wrote a file, to append to it; none if the file's settings are incomplete.
    pub fn from_file(file: &Metadata, memory: usize) -> Option<Self> {
        let named = |name: &str| setting(file, name);
        let basis = AnyBasis::named(named("basis")?).ok()?;
        let space = SpatialPredictor::named(named("space")?).ok()?;
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
        named(Keep::SETTING).map_or(Some(()), |words| Keep::parse(words).ok().map(drop))?; // not those of a later version
        Some(Self {
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
            keep: file.keep(),
            colours,
            block: Some(file.block_edge as usize),
            level: number(named("level")?)?,
            memory,
            settings: file.settings.iter().filter(|(name, _)| !is_own(file, name)).cloned().collect(),
        })
    }
}

/// The first difference between two conversions, in words. The program's version counts only if `same_program`.
pub(super) fn difference(before: &Metadata, now: &Metadata, same_program: bool) -> Option<String> {
    let settings_of = |m: &Metadata| {
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
            ("kept", m.keep().to_string()),
            ("version of the program", m.program.clone()),
        ];
        let given = given.into_iter().filter(|(what, _)| same_program || *what != "version of the program");
        let own = OWN
            .into_iter()
            .filter(|name| ![Keep::SETTING, "clip"].contains(name)) // one setting by two names
            .chain(Units::SETTINGS)
            .chain(["frames", "region"])
            .chain(ColourTransform::SETTINGS.map(|(name, _)| name));
        let settings = own.map(|name| (display_name(name), setting(m, name).unwrap_or("none").to_string()));
        settings.chain(given).collect::<Vec<_>>()
    };
    let pairs = settings_of(before).into_iter().zip(settings_of(now));
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
const OWN: [&str; 10] =
    [MAX_ERROR, Keep::SETTING, "clip", "chain", "basis", "space", "window", "level", "missing", "range"];
