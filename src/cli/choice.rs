//! Options with a few named values.

use super::messages;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use wavesplat_core::base::choice::Choice;

/// Parses the name of a value. Help texts list all names.
pub(super) fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let value = |(name, _, help): &(&'static str, T, &'static str)| match *help {
        "" => PossibleValue::new(*name),
        help => PossibleValue::new(*name).help(messages::picture_text(help)),
    };
    PossibleValuesParser::new(T::CHOICES.iter().map(value)).try_map(|name| T::named(&name))
}
