//! Writes the header of a NRRD.

use super::layout::{NAME, TYPES};
use crate::contents::{Contents, Lattice, plain};
use std::fmt::Display;
use std::io::{self, Write};
use wavesplat_core::base::sample::SampleType;

/// Writes the header of an attached file, or of one with its samples in the file `data` of the same folder.
pub(super) fn write_header(
    contents: &Contents,
    ty: SampleType,
    data: Option<&str>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let lattice = contents.lattice();
    let [x, y, z] = lattice.dims;
    let frames = contents.frames.len();
    let one = frames == 1;
    let space = match lattice.space.as_str() {
        "" => "space dimension: 3".into(),
        space => format!("space: {}", plain(space)),
    };
    writeln!(out, "NRRD0004\ncontent: {}\ntype: {}", contents.name, TYPES.name(ty))?;
    match one {
        true => writeln!(out, "dimension: 3\n{space}\nsizes: {x} {y} {z}\nkinds: domain domain domain")?,
        false => writeln!(out, "dimension: 4\n{space}\nsizes: {x} {y} {z} {frames}\nkinds: domain domain domain time")?,
    }
    write_geometry(contents, &lattice, one, out)?;
    if let Some((first, step)) = contents.regular_times() {
        writeln!(out, "spacings: nan nan nan {step}\naxis mins: nan nan nan {first}")?;
        if let Some(units) = &contents.time_units {
            writeln!(out, r#"units: "" "" "" {}"#, quoted(units))?;
        }
    }
    if let Some(units) = &contents.units {
        writeln!(out, "sample units: {units}")?;
    }
    writeln!(out, "endian: little\nencoding: raw")?;
    for (key, text) in contents.texts_from(NAME) {
        writeln!(out, "{key}:={text}")?;
    }
    match data {
        Some(name) => writeln!(out, "data file: {name}"),
        None => writeln!(out),
    }
}

/// Writes the positions of voxels in world space.
fn write_geometry(contents: &Contents, lattice: &Lattice, one: bool, out: &mut dyn Write) -> io::Result<()> {
    let time = if one { "" } else { " none" };
    let [x, y, z] = lattice.steps().map(|step| joined(step.map(|along| along + 0.0), ","));
    writeln!(out, "space directions: ({x}) ({y}) ({z}){time}")?;
    writeln!(out, "space origin: ({})", joined(lattice.first, ","))?;
    match contents.space_units.as_deref().map(quoted) {
        Some(units) => writeln!(out, "space units: {units} {units} {units}"),
        None => Ok(()),
    }
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace(['"', '\\'], "'"))
}

fn joined(numbers: [impl Display; 3], between: &str) -> String {
    numbers.map(|n| n.to_string()).join(between)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contents::testing::contents;

    #[test]
    fn units_are_told_where_there_are_axes_for_them() {
        let header = |contents: &Contents, data| {
            let mut bytes = Vec::new();
            write_header(contents, SampleType::I16, data, &mut bytes).expect("written");
            String::from_utf8(bytes).expect("text")
        };
        let text = header(&contents(), Some("a b.raw"));
        let lines = [
            "dimension: 4",
            "sizes: 5 4 3 3",
            "space directions: (0.5,0,0) (0,2,0) (0,0,1) none",
            "space origin: (-1,0,7.5)",
            r#"space units: "mm" "mm" "mm""#,
            "spacings: nan nan nan 0.25",
            "axis mins: nan nan nan 0.25",
            r#"units: "" "" "" "s""#,
            "sample units: <K>",
            "data file: a b.raw",
        ];
        lines.into_iter().for_each(|line| assert!(text.lines().any(|l| l == line), "{line} in\n{text}"));
        let text = header(&Contents { frames: vec![2], times: vec![0.25], ..contents() }, None);
        assert!(text.contains("dimension: 3\n") && text.ends_with("\n\n") && !text.contains("none"), "{text}");
        let text = header(&Contents { times: vec![0.0, 1.0, 7.0], ..contents() }, None);
        assert!(!text.contains("spacings") && !text.contains("\nunits"), "{text}");
    }
}
