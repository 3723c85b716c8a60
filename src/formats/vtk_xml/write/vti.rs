//! The text before the samples of a `.vti`.

use super::{field_data, units};
use crate::contents::{Contents, Lattice};
use crate::vtk_xml::layout::TYPES;
use crate::writer::Samples;
use quick_xml::escape::escape;
use std::io::{self, Write};

/// Writes the text before the samples of a frame, and their number of bytes.
pub(crate) fn write_header(
    contents: &Contents,
    lattice: &Lattice,
    samples: Samples,
    out: &mut dyn Write,
) -> io::Result<()> {
    let [x, y, z] = lattice.dims.map(|n| n - 1);
    let (extent, name, ty_name) = (format!("0 {x} 0 {y} 0 {z}"), escape(&contents.name), TYPES.name(samples.ty));
    let [spacing, origin] = [lattice.spacing(), lattice.first].map(|v| v.map(|n| n.to_string()).join(" "));
    let direction = direction(lattice);
    let fields = field_data::text(contents, contents.times[samples.frame]);
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
    out.write_all(&contents.voxels().saturating_mul(samples.ty.size() as u64).to_le_bytes())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contents::testing::contents;
    use wavesplat_core::base::sample::SampleType;

    #[test]
    fn names_and_units_are_escaped() {
        let (mut bytes, samples) = (Vec::new(), Samples { ty: SampleType::I16, frame: 0 });
        write_header(&contents(), &contents().lattice(), samples, &mut bytes).expect("written");
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
    }
}
