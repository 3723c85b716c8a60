//! The header of a MetaImage with its samples in the same file.

use super::contents::{Contents, Lattice, plain};
use crate::base::description::{RAS, Values};
use crate::base::sample::SampleType;
use std::io::{self, Write};

/// Writes the header.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut impl Write) -> io::Result<()> {
    let (lattice, frames) = (in_lps(contents.lattice()), contents.frames.len());
    let (axes, time) = (if frames == 1 { 3 } else { 4 }, contents.regular_times().unwrap_or((0.0, 1.0)));
    let with_time = |space: Vec<f64>, time: f64| if axes == 4 { [space, vec![time]].concat() } else { space };
    let dims: Vec<f64> = lattice.dims.iter().map(|n| *n as f64).collect();
    let mut matrix: Vec<f64> = Vec::new();
    for direction in lattice.directions() {
        matrix.extend(with_time(direction.to_vec(), 0.0));
    }
    matrix.extend(if axes == 4 { vec![0.0, 0.0, 0.0, 1.0] } else { Vec::new() });
    writeln!(out, "ObjectType = Image\nNDims = {axes}\nBinaryData = True\nBinaryDataByteOrderMSB = False")?;
    writeln!(out, "CompressedData = False\nTransformMatrix = {}", words(&matrix))?;
    writeln!(out, "Offset = {}", words(&with_time(lattice.first.to_vec(), time.0)))?;
    writeln!(out, "CenterOfRotation = {}", words(&vec![0.0; axes]))?;
    write_texts(contents, out)?;
    writeln!(out, "ElementSpacing = {}", words(&with_time(lattice.spacing().to_vec(), time.1)))?;
    writeln!(out, "DimSize = {}", words(&with_time(dims, frames as f64)))?;
    writeln!(out, "ElementType = {}\nElementDataFile = LOCAL", name_of(ty))
}

/// A lattice in the world of ITK. A world without a name is taken as that.
fn in_lps(lattice: Lattice) -> Lattice {
    if lattice.space == RAS { lattice.turned() } else { lattice }
}

/// Writes the texts of a source of this format.
fn write_texts(contents: &Contents, out: &mut impl Write) -> io::Result<()> {
    let of_source = contents.description.as_ref().filter(|description| description.source == "MetaImage");
    for attribute in of_source.iter().flat_map(|description| &description.global) {
        if let Values::Texts(texts) = &attribute.value {
            writeln!(out, "{} = {}", plain(&attribute.name), plain(&texts.join(" ")))?;
        }
    }
    Ok(())
}

/// Numbers in one line, without negative zeros.
fn words(numbers: &[f64]) -> String {
    numbers.iter().map(|number| (number + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}

fn name_of(ty: SampleType) -> &'static str {
    match ty {
        SampleType::U8 => "MET_UCHAR",
        SampleType::I8 => "MET_CHAR",
        SampleType::U16 => "MET_USHORT",
        SampleType::I16 => "MET_SHORT",
        SampleType::U32 => "MET_UINT",
        SampleType::I32 => "MET_INT",
        SampleType::F16 | SampleType::F32 => "MET_FLOAT",
        SampleType::F64 => "MET_DOUBLE",
    }
}
