//! Writes the text around the samples of VTK's formats of XML.

pub(super) mod field_data;
pub(super) mod vti;
pub(super) mod vtr;

use crate::contents::Contents;
use quick_xml::escape::escape;

/// The text after the samples.
pub(super) const END: &[u8] = b"\n  </AppendedData>\n</VTKFile>\n";

/// The samples' unit, in VTK's own key.
fn units(contents: &Contents) -> String {
    let key = |units| format!(r#"<InformationKey name="UNITS_LABEL" location="vtkDataArray">{units}</InformationKey>"#);
    contents.units.as_deref().map(escape).map(key).unwrap_or_default()
}
