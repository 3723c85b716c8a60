//! The text around the samples of a `.vti`, and the list of a `.pvd`.

use super::contents::{Contents, Lattice};
use super::field_data;
use crate::base::sample::SampleType;
use quick_xml::escape::escape;
use std::io::{self, Write};

/// The text after the samples.
pub(super) const END: &[u8] = b"\n  </AppendedData>\n</VTKFile>\n";

/// Writes the text before the samples of a frame, and their number of bytes.
pub(super) fn write_header(
    contents: &Contents,
    lattice: &Lattice,
    (ty, time): (SampleType, f64),
    out: &mut impl Write,
) -> io::Result<()> {
    let [x, y, z] = lattice.dims.map(|n| n - 1);
    let (extent, name, ty_name) = (format!("0 {x} 0 {y} 0 {z}"), escape(&contents.name), name_of(ty));
    let [spacing, origin] = [lattice.spacing(), lattice.first].map(|v| v.map(|n| n.to_string()).join(" "));
    let direction = direction(lattice);
    let fields = field_data::text(contents, time);
    write!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}"{direction}>
    <FieldData>
      {fields}
    </FieldData>
    <Piece Extent="{extent}">
      <PointData Scalars="{name}">
        <DataArray type="{ty_name}" Name="{name}" format="appended" offset="0">{}</DataArray>
      </PointData>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
   _"#,
        units(contents)
    )?;
    out.write_all(&contents.voxels().saturating_mul(ty.size() as u64).to_le_bytes())
}

/// The directions of the axes as columns of a matrix; nothing if they are those of the world.
fn direction(lattice: &Lattice) -> String {
    let columns = lattice.directions();
    let rows: Vec<f64> = (0..3).flat_map(|row| columns.map(|column| column[row] + 0.0)).collect();
    if rows == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] {
        return String::new();
    }
    format!(r#" Direction="{}""#, rows.iter().map(f64::to_string).collect::<Vec<_>>().join(" "))
}

/// The samples' unit, in VTK's own key.
pub(super) fn units(contents: &Contents) -> String {
    let key = |units| format!(r#"<InformationKey name="UNITS_LABEL" location="vtkDataArray">{units}</InformationKey>"#);
    contents.units.as_deref().map(escape).map(key).unwrap_or_default()
}

/// Writes the list of the files of all frames with their times; `names` are relative to the list's folder.
pub(super) fn write_list(
    contents: &Contents,
    names: impl Iterator<Item = String>,
    out: &mut impl Write,
) -> io::Result<()> {
    let start = r#"<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
  <Collection>"#;
    writeln!(out, "{start}")?;
    for (time, name) in contents.times.iter().zip(names) {
        writeln!(out, r#"    <DataSet timestep="{time}" part="0" file="{}"/>"#, escape(&name))?;
    }
    writeln!(out, "  </Collection>\n</VTKFile>")
}

pub(super) fn name_of(ty: SampleType) -> &'static str {
    match ty {
        SampleType::U8 => "UInt8",
        SampleType::I8 => "Int8",
        SampleType::U16 => "UInt16",
        SampleType::I16 => "Int16",
        SampleType::U32 => "UInt32",
        SampleType::I32 => "Int32",
        SampleType::F16 | SampleType::F32 => "Float32",
        SampleType::F64 => "Float64",
    }
}

#[cfg(test)]
mod tests {
    use super::super::contents::testing::contents;
    use super::*;

    #[test]
    fn names_and_units_are_escaped() {
        let mut bytes = Vec::new();
        write_header(&contents(), &contents().lattice(), (SampleType::I16, 0.25), &mut bytes).expect("written");
        let (text, count) = bytes.split_at(bytes.len() - 8);
        let text = std::str::from_utf8(text).expect("text");
        for words in [
            r#"Scalars="a &amp; &quot;b&quot;""#,
            r#"type="Int16" Name="a &amp; &quot;b&quot;""#,
            ">&lt;K&gt;</InformationKey>",
            r#"WholeExtent="0 4 0 3 0 2" Origin="-1 0 7.5" Spacing="0.5 2 1""#,
            ">0.25</DataArray>",
        ] {
            assert!(text.contains(words), "{words} in\n{text}");
        }
        assert!(text.ends_with('_') && *count == [120, 0, 0, 0, 0, 0, 0, 0], "{count:?}");
        let mut list = Vec::new();
        let names = ["a&b/1.vti", "a&b/2.vti", "a&b/3.vti"].map(String::from);
        write_list(&contents(), names.into_iter(), &mut list).expect("written");
        let list = String::from_utf8(list).expect("text");
        assert!(list.contains(r#"timestep="0.75" part="0" file="a&amp;b/3.vti""#), "{list}");
    }
}
