//! The header of a classic NetCDF file, with the variables described by the conventions for climate and forecast data
//! (CF).
//!
//! The samples are the last variable, so they are written as they come. The form is CDF-2 (64-bit offsets), or CDF-5
//! (64-bit counts, more types) if types or lengths need it.

use super::contents::Contents;
use crate::base::sample::{SampleType, store};
use std::io::{self, Write};

/// Zeros after the samples fill up to a multiple of this many bytes.
const ALIGNMENT: u64 = 4;

const DIMENSIONS: u32 = 0x0a;
const VARIABLES: u32 = 0x0b;
const ATTRIBUTES: u32 = 0x0c;
const TEXT: u32 = 2;

/// The dimensions, slowest first. Each has a variable of the same name with its times or positions.
const NAMES: [&str; 4] = ["time", "z", "y", "x"];

/// Writes the header, times and positions.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut impl Write) -> io::Result<()> {
    let variables = variables(contents, ty);
    let encode = |first| Header::of(contents, &variables, first).bytes;
    out.write_all(&encode(encode(0).len() as u64))?;
    write_coordinates(contents, out)
}

/// The zeros after the samples.
pub(super) fn padding(contents: &Contents, ty: SampleType) -> Vec<u8> {
    let bytes = sample_bytes(contents, ty);
    vec![0; (bytes.next_multiple_of(ALIGNMENT) - bytes) as usize]
}

fn sample_bytes(contents: &Contents, ty: SampleType) -> u64 {
    let most = u64::MAX - ALIGNMENT;
    contents.voxels().saturating_mul((contents.frames.len() * ty.size()) as u64).min(most)
}

fn lengths(contents: &Contents) -> [u64; 4] {
    let [x, y, z] = contents.grid.dims;
    [contents.frames.len(), z, y, x].map(|n| n as u64)
}

fn write_coordinates(contents: &Contents, out: &mut impl Write) -> io::Result<()> {
    let mut write = |number: f64| out.write_all(&reversed(number.to_le_bytes()));
    contents.times.iter().try_for_each(|time| write(*time))?;
    for axis in [2, 1, 0] {
        let grid = &contents.grid;
        (0..grid.dims[axis]).try_for_each(|i| write(grid.position([i; 3])[axis]))?;
    }
    Ok(())
}

/// A variable without its values.
struct Variable {
    name: String,
    /// Its range in [`NAMES`].
    dimensions: std::ops::Range<usize>,
    ty: SampleType,
    texts: Vec<(&'static str, String)>,
    /// The value of missing samples.
    fill: Option<f64>,
    bytes: u64,
}

fn variables(contents: &Contents, ty: SampleType) -> Vec<Variable> {
    let coordinates = NAMES.iter().enumerate().map(|(i, name)| Variable {
        name: (*name).into(),
        dimensions: i..i + 1,
        ty: SampleType::F64,
        texts: coordinate_texts(contents, name),
        fill: None,
        bytes: lengths(contents)[i] * size_of::<f64>() as u64,
    });
    let mut texts = vec![("long_name", contents.name.clone())];
    texts.extend(contents.units.clone().map(|units| ("units", units)));
    let (name, fill, bytes) = (name_of(contents), contents.missing, sample_bytes(contents, ty));
    coordinates.chain([Variable { name, dimensions: 0..NAMES.len(), ty, texts, fill, bytes }]).collect()
}

fn coordinate_texts(contents: &Contents, name: &str) -> Vec<(&'static str, String)> {
    let (space, time) = (contents.space_units.as_ref(), contents.time_units.as_ref());
    // ParaView reads an axis marked X or Y as longitude or latitude, and bends the volume.
    let (long, axis, units) = match name {
        "time" if contents.numbered => ("number of the frame", Some("T"), None),
        "time" => ("time", Some("T"), time),
        "z" => ("z", Some("Z"), space),
        _ => (name, None, space),
    };
    let mut texts = vec![("long_name", long.to_string())];
    texts.extend(axis.map(|axis| ("axis", axis.into())));
    texts.extend(units.map(|units| ("units", units.clone())));
    texts.extend(contents.calendar.clone().filter(|_| name == "time").map(|calendar| ("calendar", calendar)));
    texts
}

/// The variable's name in letters, digits and underscores, different from all dimensions.
fn name_of(contents: &Contents) -> String {
    let name: String = contents.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic());
    if starts_well && !NAMES.contains(&name.as_str()) { name } else { format!("values_{name}") }
}

/// The header encoded so far.
struct Header {
    bytes: Vec<u8>,
    /// Whether counts have 64 bits.
    wide: bool,
}

impl Header {
    /// The whole header; the values of the variables start at byte `first` of the file.
    fn of(contents: &Contents, variables: &[Variable], first: u64) -> Self {
        let lengths = lengths(contents);
        let has_type = |v: &Variable| !matches!(v.ty, SampleType::U8 | SampleType::U16 | SampleType::U32);
        let wide = !variables.iter().all(has_type) || lengths.iter().any(|n| *n > i32::MAX as u64);
        let mut header = Self { bytes: vec![b'C', b'D', b'F', if wide { 5 } else { 2 }], wide };
        header.count(0); // no records: no dimension is unlimited
        header.list(DIMENSIONS, NAMES.len());
        for (name, length) in NAMES.iter().zip(lengths) {
            header.name(name);
            header.count(length);
        }
        header.list(ATTRIBUTES, 1);
        header.text("Conventions", "CF-1.8");
        header.list(VARIABLES, variables.len());
        variables.iter().fold(first, |begin, variable| header.variable(variable, begin));
        header
    }

    /// Encodes a variable whose values begin at byte `begin` of the file; returns where they end.
    fn variable(&mut self, variable: &Variable, begin: u64) -> u64 {
        self.name(&variable.name);
        self.count(variable.dimensions.len() as u64);
        variable.dimensions.clone().for_each(|dimension| self.count(dimension as u64));
        self.list(ATTRIBUTES, variable.texts.len() + usize::from(variable.fill.is_some()));
        variable.texts.iter().for_each(|(name, text)| self.text(name, text));
        if let Some(fill) = variable.fill {
            self.number("_FillValue", variable.ty, fill);
        }
        self.int(code_of(variable.ty));
        let padded = variable.bytes.next_multiple_of(ALIGNMENT);
        self.count(if self.wide { padded } else { padded.min(u32::MAX.into()) }); // the last may be "more"
        self.bytes.extend(reversed(begin.to_le_bytes()));
        begin.saturating_add(padded)
    }

    fn int(&mut self, number: u32) {
        self.bytes.extend(reversed(number.to_le_bytes()));
    }

    fn count(&mut self, number: u64) {
        let bytes = reversed(number.to_le_bytes());
        self.bytes.extend(if self.wide { &bytes[..] } else { &bytes[4..] });
    }

    fn list(&mut self, tag: u32, items: usize) {
        self.int(tag);
        self.count(items as u64);
    }

    fn name(&mut self, name: &str) {
        self.count(name.len() as u64);
        self.bytes.extend(name.as_bytes());
        self.pad();
    }

    fn text(&mut self, name: &str, text: &str) {
        self.name(name);
        self.int(TEXT);
        self.name(text);
    }

    fn number(&mut self, name: &str, ty: SampleType, value: f64) {
        self.name(name);
        self.int(code_of(ty));
        self.count(1);
        let mut bytes = vec![0; ty.size()];
        store(ty, &[value], &mut bytes);
        self.bytes.extend(bytes.iter().rev());
        self.pad();
    }

    fn pad(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(ALIGNMENT as usize), 0);
    }
}

fn code_of(ty: SampleType) -> u32 {
    match ty {
        SampleType::I8 => 1,
        SampleType::I16 => 3,
        SampleType::I32 => 4,
        SampleType::F16 | SampleType::F32 => 5,
        SampleType::F64 => 6,
        SampleType::U8 => 7,
        SampleType::U16 => 8,
        SampleType::U32 => 9,
    }
}

fn reversed<const N: usize>(mut bytes: [u8; N]) -> [u8; N] {
    bytes.reverse();
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::contents::testing::contents;
    use super::*;

    /// The header and coordinates of samples of a type, and where the header says that the samples begin.
    fn written(contents: &Contents, ty: SampleType) -> (Vec<u8>, usize) {
        let mut bytes = Vec::new();
        write_header(contents, ty, &mut bytes).expect("written");
        let coordinates = 8 * lengths(contents).iter().sum::<u64>() as usize;
        let begin = bytes[..bytes.len() - coordinates].last_chunk().copied().expect("a header");
        (bytes, u64::from_le_bytes(reversed(begin)) as usize)
    }

    #[test]
    fn samples_begin_where_the_header_says() {
        for ty in SampleType::ALL {
            for missing in [None, Some(-1.0)] {
                let (bytes, begin) = written(&Contents { missing, ..contents() }, ty);
                assert_eq!(begin, bytes.len(), "{ty}");
                let unsigned = matches!(ty, SampleType::U8 | SampleType::U16 | SampleType::U32);
                assert_eq!(bytes[..4], [b'C', b'D', b'F', if unsigned { 5 } else { 2 }], "{ty}");
            }
        }
    }

    #[test]
    fn samples_of_more_bytes_than_a_count_has_are_the_last() {
        let mut large = contents();
        large.grid.dims = [1 << 11, 1 << 10, 1 << 10];
        let (bytes, begin) = written(&large, SampleType::F32);
        assert_eq!(begin, bytes.len());
        let size_and_begin = &bytes[bytes.len() - 8 * lengths(&large).iter().sum::<u64>() as usize - 12..][..4];
        assert_eq!(size_and_begin, [0xff; 4]);
    }

    #[test]
    fn names_are_those_that_the_conventions_allow() {
        let named = |name: &str| name_of(&Contents { name: name.into(), ..contents() });
        assert_eq!(
            ["T", "wind speed/m", "2m", "x", "\u{3b8}"].map(named),
            ["T", "wind_speed_m", "values_2m", "values_x", "values__"]
        );
    }
}
