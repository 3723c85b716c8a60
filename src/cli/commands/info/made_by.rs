//! The options that make a file again.

use crate::commands::convert::ConvertArgs;
use clap::{Args, Command};
use std::collections::BTreeMap;
use wavesplat_engine::convert::Bound;
use wavesplat_engine::file::promise::max_error;
use wavesplat_engine::file::{CoefficientFile, setting};

/// The options of `wavesplat convert` that make the same file from the same samples, with their values, including
/// defaults. Colours given as a file of points are left out, because no option value names them.
pub(super) fn options(file: &CoefficientFile) -> BTreeMap<String, String> {
    let (metadata, exact) = (file.metadata(), max_error(file.metadata()));
    let (name, error) = exact.map_or(("tolerance", metadata.tolerance), |error| ("max-error", error));
    let mut options = vec![(name, format!("{error:?}")), ("bound", metadata.bound.name().into())];
    match metadata.bound {
        Bound::Relative { floor } => options.push(("floor", format!("{floor:?}"))),
        Bound::Sampled { samples, seed } => {
            options.extend([("samples", samples.to_string()), ("seed", seed.to_string())]);
        }
        Bound::Pointwise | Bound::Rms => {}
    }
    let colours = file.colour_transform().map(|transform| &transform.colours);
    if let Some((colours, name)) = colours.and_then(|colours| Some((colours, colours.name()?))) {
        let (lo, hi) = colours.range();
        options.extend([("transfer-function", name.into()), ("range", format!("{lo:?},{hi:?}"))]);
    }
    options.extend(metadata.missing_value.map(|value| ("missing-value", format!("{value:?}"))));
    options.push(("block", metadata.block_edge.to_string()));
    let own = options.into_iter().map(|(name, value)| (name.to_string(), value));
    own.chain(stored(file, exact.is_none() && colours.is_none())).collect()
}

/// The settings of a file that are options by the same names. Its range is one if it is not fixed by other options.
fn stored(file: &CoefficientFile, has_range: bool) -> impl Iterator<Item = (String, String)> + '_ {
    let convert = ConvertArgs::augment_args(Command::new("convert"));
    let is_option = move |name: &str| match name {
        "max-error" => false, // it has been looked at
        "range" => has_range,
        "dtype" => setting(file.metadata(), "dims").is_some(), // else of samples that were coloured
        "times" => setting(file.metadata(), "times") != Some("list"), // of a file that has no name here
        _ => convert.get_arguments().any(|arg| arg.get_long() == Some(name)),
    };
    file.metadata().settings.iter().filter(move |(name, _)| is_option(name)).cloned()
}
