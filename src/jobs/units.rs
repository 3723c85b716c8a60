//! Names and units as people write them.

use wavesplat_core::base::description::{Attribute, Description, Values};
use wavesplat_core::base::error::Result;
use wavesplat_core::source::Archive;
use wavesplat_engine::file::{CoefficientFile, setting};

/// The name and the unit of a file's values.
pub(crate) fn values_of(file: &CoefficientFile) -> Result<String> {
    let (m, description) = (file.metadata(), file.description()?);
    Ok(named(m.variable.as_deref(), setting(m, "units"), description.as_ref()))
}

/// The name and the unit of an archive's values.
pub(crate) fn values_of_archive(archive: &Archive) -> String {
    named(archive.variable.as_deref(), archive.units.samples.as_deref(), archive.description.as_ref())
}

/// The name and the unit of a variable, preferably those that its description has for readers.
fn named(variable: Option<&str>, unit: Option<&str>, description: Option<&Description>) -> String {
    let text = |name: &str| description.and_then(|all| attribute_text(&all.attributes, name));
    let name = text("long_name").or_else(|| text("standard_name").map(|name| name.replace('_', " ")));
    let name = name.or_else(|| variable.map(ToString::to_string)).unwrap_or_default();
    let unit = in_letters(&unit.map(ToString::to_string).or_else(|| text("units")).unwrap_or_default());
    if unit.is_empty() || name.is_empty() { name + &unit } else { format!("{name} ({unit})") }
}

/// The text of an attribute.
pub(crate) fn attribute_text(attributes: &[Attribute], name: &str) -> Option<String> {
    match &attributes.iter().find(|attribute| attribute.name == name)?.value {
        Values::Texts(texts) => texts.first().map(|text| text.trim().to_string()),
        _ => None,
    }
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
