//! The text around the samples of a `.vti`, and the list of a `.pvd`.

use super::contents::Contents;
use crate::sample::SampleType;
use quick_xml::escape::escape;
use std::io::{self, Write};

/// What follows the samples.
pub(super) const END: &[u8] = b"\n  </AppendedData>\n</VTKFile>\n";

/// Writes what precedes the samples of a frame, their count in bytes included.
pub(super) fn write_header(contents: &Contents, ty: SampleType, time: f64, out: &mut impl Write) -> io::Result<()> {
    let [x, y, z] = contents.grid.dims.map(|n| n - 1);
    let (extent, name, ty_name) = (format!("0 {x} 0 {y} 0 {z}"), escape(&contents.name), name_of(ty));
    let [spacing, origin] = [contents.grid.spacing, contents.grid.origin].map(|v| v.map(|n| n.to_string()).join(" "));
    write!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}">
    <FieldData>
      <DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{time}</DataArray>
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

/// The samples' units, where VTK keeps them.
fn units(contents: &Contents) -> String {
    let key = |units| format!(r#"<InformationKey name="UNITS_LABEL" location="vtkDataArray">{units}</InformationKey>"#);
    contents.units.as_deref().map(escape).map(key).unwrap_or_default()
}

/// Writes the list of the files of all frames, by their names from the list's folder, with their times.
pub(super) fn write_list(contents: &Contents, names: &[String], out: &mut impl Write) -> io::Result<()> {
    let start = r#"<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
  <Collection>"#;
    writeln!(out, "{start}")?;
    for (time, name) in contents.times.iter().zip(names) {
        writeln!(out, r#"    <DataSet timestep="{time}" part="0" file="{}"/>"#, escape(name))?;
    }
    writeln!(out, "  </Collection>\n</VTKFile>")
}

fn name_of(ty: SampleType) -> &'static str {
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
