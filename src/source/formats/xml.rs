//! The little of XML that `.vti` and `.pvd` need.

use crate::source::Parsed;
use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;
use std::str::FromStr;

/// An attribute's text, if the element has it.
pub(in crate::source) fn attribute(element: &BytesStart<'_>, name: &str) -> Parsed<Option<String>> {
    let damaged =
        |e: &dyn std::fmt::Display| format!("attribute {name} of <{}> is damaged: {e}", element.name().as_ref());
    let Some(attribute) = element.try_get_attribute(name).map_err(|e| damaged(&e))? else { return Ok(None) };
    let text = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| damaged(&e))?;
    Ok(Some(text.into_owned()))
}

/// An attribute that must be there.
pub(in crate::source) fn required(element: &BytesStart<'_>, name: &str) -> Parsed<String> {
    attribute(element, name)?.ok_or_else(|| format!("<{}> has no {name}", element.name().as_ref()))
}

/// `N` numbers separated by spaces.
pub(in crate::source) fn numbers<T: FromStr + Copy, const N: usize>(text: &str, what: &str) -> Parsed<[T; N]> {
    let found: Option<Vec<T>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
    let wrong = || format!("{what} must be {N} numbers, not {text:?}");
    found.and_then(|v| v.try_into().ok()).ok_or_else(wrong)
}
