//! The text and the coordinates before the samples of a `.vtr`: a VTK rectilinear grid.

use super::{field_data, units};
use crate::contents::Contents;
use crate::vtk_xml::layout::TYPES;
use crate::writer::Samples;
use quick_xml::escape::escape;
use std::io::{self, Write};

/// Writes the text before the samples of a frame, the coordinates of each axis, and the samples' number of bytes.
pub(crate) fn write_header(contents: &Contents, samples: Samples, out: &mut dyn Write) -> io::Result<()> {
    let [x, y, z] = contents.grid.dims.map(|n| n - 1);
    let (extent, name, ty_name) = (format!("0 {x} 0 {y} 0 {z}"), escape(&contents.name), TYPES.name(samples.ty));
    let places: Vec<Vec<f64>> = (0..3).map(|axis| contents.coordinates(axis)).collect();
    let fields = field_data::text(contents, contents.times[samples.frame]);
    let mut offset = 0;
    let mut coordinates = String::new();
    for (axis, places) in ["x", "y", "z"].into_iter().zip(&places) {
        coordinates +=
            &format!("\n        <DataArray type=\"Float64\" Name=\"{axis}\" format=\"appended\" offset=\"{offset}\"/>");
        offset += size_of::<u64>() + size_of_val(places.as_slice());
    }
    write!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="RectilinearGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <RectilinearGrid WholeExtent="{extent}">
    <FieldData>
      {fields}
    </FieldData>
    <Piece Extent="{extent}">
      <PointData Scalars="{name}">
        <DataArray type="{ty_name}" Name="{name}" format="appended" offset="{offset}">{}</DataArray>
      </PointData>
      <Coordinates>{coordinates}
      </Coordinates>
    </Piece>
  </RectilinearGrid>
  <AppendedData encoding="raw">
   _"#,
        units(contents)
    )?;
    for places in &places {
        out.write_all(&(size_of_val(places.as_slice()) as u64).to_le_bytes())?;
        places.iter().try_for_each(|place| out.write_all(&place.to_le_bytes()))?;
    }
    out.write_all(&contents.voxels().saturating_mul(samples.ty.size() as u64).to_le_bytes())
}
