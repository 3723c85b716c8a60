//! The little of XML that `.vti` and `.pvd` need.

use quick_xml::XmlVersion;
use quick_xml::events::BytesStart;
use wavesplat_core::source::Parsed;

/// An attribute's text, if the element has it.
pub(crate) fn attribute(element: &BytesStart<'_>, name: &str) -> Parsed<Option<String>> {
    let damaged =
        |e: &dyn std::fmt::Display| format!("attribute {name} of <{}> is damaged: {e}", element.name().as_ref());
    let Some(attribute) = element.try_get_attribute(name).map_err(|e| damaged(&e))? else { return Ok(None) };
    let text = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| damaged(&e))?;
    Ok(Some(text.into_owned()))
}

/// An attribute that must be there.
pub(crate) fn required(element: &BytesStart<'_>, name: &str) -> Parsed<String> {
    attribute(element, name)?.ok_or_else(|| format!("<{}> has no {name}", element.name().as_ref()))
}
