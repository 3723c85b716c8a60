//! The header of a MetaImage with its samples in the same file.

use super::layout::{NAME, TYPES};
use crate::contents::Contents;
use std::io::{self, Write};
use wavesplat_core::base::description::RAS;
use wavesplat_core::base::sample::SampleType;

/// Writes the header.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut dyn Write) -> io::Result<()> {
    let (lattice, frames) = (contents.lattice().turned_from(RAS), contents.frames.len());
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
    for (name, text) in contents.texts_from(NAME) {
        writeln!(out, "{name} = {text}")?;
    }
    writeln!(out, "ElementSpacing = {}", words(&with_time(lattice.spacing().to_vec(), time.1)))?;
    writeln!(out, "DimSize = {}", words(&with_time(dims, frames as f64)))?;
    writeln!(out, "ElementType = {}\nElementDataFile = LOCAL", TYPES.name(ty))
}

/// Numbers in one line, without negative zeros.
fn words(numbers: &[f64]) -> String {
    numbers.iter().map(|number| (number + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}
