//! Writes the header of a NRRD.

use super::layout::{NAME, TYPES};
use crate::contents::{Contents, Lattice, plain};
use std::fmt::Display;
use std::io::{self, Write};
use wavesplat_core::base::description::{LPS, RAS};
use wavesplat_core::base::sample::SampleType;

/// Writes the header of an attached file, or of one with its samples in the file `data` of the same folder.
pub(super) fn write_header(
    contents: &Contents,
    ty: SampleType,
    data: Option<&str>,
    out: &mut dyn Write,
) -> io::Result<()> {
    // Time is a fourth axis of space, as ITK wants it, which turns three axes of such a space alone: not those of RAS.
    let one = contents.frames.len() == 1;
    let lattice = if one { contents.lattice() } else { contents.lattice().turned_from(RAS) };
    let [x, y, z] = lattice.dims;
    writeln!(out, "NRRD0004\ncontent: {}\ntype: {}", contents.name, TYPES.name(ty))?;
    match one {
        true => writeln!(out, "dimension: 3\n{}\nsizes: {x} {y} {z}", space(&lattice.space, 3, ""))?,
        false => {
            let name = if lattice.space == RAS { LPS } else { &lattice.space };
            writeln!(out, "dimension: 4\n{}\nsizes: {x} {y} {z} {}", space(name, 4, "-time"), contents.frames.len())?;
        }
    }
    writeln!(out, "kinds: domain domain domain{}", if one { "" } else { " time" })?;
    match one {
        true => write_places(contents, &lattice, out)?,
        false => write_places_and_times(contents, &lattice, out)?,
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

/// The space by its name, with a word after it, or by its axes.
fn space(name: &str, axes: usize, more: &str) -> String {
    if name.is_empty() { format!("space dimension: {axes}") } else { format!("space: {}{more}", plain(name)) }
}

/// Writes the positions of voxels in world space.
fn write_places(contents: &Contents, lattice: &Lattice, out: &mut dyn Write) -> io::Result<()> {
    let [x, y, z] = lattice.steps().map(|step| joined(step.map(|along| along + 0.0), ","));
    writeln!(out, "space directions: ({x}) ({y}) ({z})")?;
    writeln!(out, "space origin: ({})", joined(lattice.first, ","))?;
    match contents.space_units.as_deref().map(quoted) {
        Some(units) => writeln!(out, "space units: {units} {units} {units}"),
        None => Ok(()),
    }
}

/// Writes the positions of voxels and frames in a space whose fourth axis is time. Without regular times the
/// axis of frames has no direction.
fn write_places_and_times(contents: &Contents, lattice: &Lattice, out: &mut dyn Write) -> io::Result<()> {
    let [x, y, z] = lattice.steps().map(|step| joined(step.map(|along| along + 0.0), ","));
    let times = contents.regular_times();
    let along_time = times.map_or_else(|| "none".into(), |(_, step)| format!("(0,0,0,{step})"));
    writeln!(out, "space directions: ({x},0) ({y},0) ({z},0) {along_time}")?;
    let first = times.map_or(0.0, |(first, _)| first);
    writeln!(out, "space origin: ({},{first})", joined(lattice.first, ","))?;
    let time = contents.time_units.as_deref().filter(|_| times.is_some());
    if contents.space_units.is_none() && time.is_none() {
        return Ok(());
    }
    let [space, time] = [contents.space_units.as_deref(), time].map(|units| quoted(units.unwrap_or_default()));
    writeln!(out, "space units: {space} {space} {space} {time}")
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
            "space dimension: 4",
            "space directions: (0.5,0,0,0) (0,2,0,0) (0,0,1,0) (0,0,0,0.25)",
            "space origin: (-1,0,7.5,0.25)",
            r#"space units: "mm" "mm" "mm" "s""#,
            "sample units: <K>",
            "data file: a b.raw",
        ];
        lines.into_iter().for_each(|line| assert!(text.lines().any(|l| l == line), "{line} in\n{text}"));
        let text = header(&Contents { frames: vec![2], times: vec![0.25], ..contents() }, None);
        assert!(text.contains("dimension: 3\n") && text.ends_with("\n\n") && !text.contains("none"), "{text}");
        let text = header(&Contents { times: vec![0.0, 1.0, 7.0], ..contents() }, None);
        assert!(text.contains("(0,0,1,0) none\n") && text.contains(r#""mm" """#), "{text}");
    }
}
