//! Classic NetCDF files: the header and everything before the samples.
//!
//! The samples are the last variable, so they are written as they come. The form is CDF-2 (64-bit offsets), or CDF-5
//! (64-bit counts, more types) if types or lengths need it.

use super::layout::{ALIGNMENT, ATTRIBUTES, DIMENSIONS, FILL, MAGIC, TEXT, VARIABLES, code};
use crate::contents::Contents;
use crate::shared::dataset::{Dataset, number_type};
use std::io::{self, Write};
use wavesplat_core::base::description::{Attribute, NumberType, Numbers, Values};
use wavesplat_core::base::sample::{SampleType, store};

/// Writes the header and all variables before the samples.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut dyn Write) -> io::Result<()> {
    let dataset = ClassicDataset::new(Dataset::new(contents, ty), sample_bytes(contents, ty));
    let encode = |first| Header::new(&dataset, first).bytes;
    out.write_all(&encode(encode(0).len() as u64))?;
    dataset.variables.iter().filter_map(|variable| variable.values.as_ref()).try_for_each(|numbers| {
        let mut bytes = numbers.bytes();
        bytes.chunks_exact_mut(numbers.ty.size()).for_each(<[u8]>::reverse);
        bytes.resize(bytes.len().next_multiple_of(ALIGNMENT as usize), 0);
        out.write_all(&bytes)
    })
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

/// A dataset in terms of the format: all values are numbers, texts are arrays of characters.
struct ClassicDataset {
    dimensions: Vec<(String, u64)>,
    global: Vec<Attribute>,
    variables: Vec<ClassicVariable>,
}

struct ClassicVariable {
    name: String,
    dimensions: Vec<usize>,
    ty: NumberType,
    attributes: Vec<Attribute>,
    bytes: u64,
    /// `None` for the samples, which are the last variable.
    values: Option<Numbers>,
}

impl ClassicDataset {
    fn new(dataset: Dataset, sample_bytes: u64) -> Self {
        let Dataset { dimensions, global, variables, samples } = dataset;
        let mut classic = Self { dimensions, global, variables: Vec::new() };
        for variable in variables {
            let (mut dimensions, mut attributes) = (variable.dimensions, variable.attributes);
            let (values, characters) = classic.numbers(variable.values);
            if let Some(characters) = characters {
                dimensions.push(characters);
                attributes.push(Attribute { name: "_Encoding".into(), value: Values::text("utf-8") });
            }
            let (ty, bytes) = (values.ty, values.bytes().len() as u64);
            let (name, values) = (variable.name, Some(values));
            classic.variables.push(ClassicVariable { name, dimensions, ty, attributes, bytes, values });
        }
        let mut attributes = samples.attributes;
        attributes.extend(samples.fill.map(|fill| fill_value(samples.ty, fill)));
        let (name, ty) = (samples.name, number_type(samples.ty));
        let samples =
            ClassicVariable { name, dimensions: samples.dimensions, ty, attributes, bytes: sample_bytes, values: None };
        classic.variables.push(samples);
        classic
    }

    /// Values as numbers; of texts their characters, with the dimension that counts these.
    fn numbers(&mut self, values: Values) -> (Numbers, Option<usize>) {
        match values {
            Values::Numbers(numbers) => (numbers, None),
            Values::Times(ty) => (Numbers::new(ty, &[]), None), // those of a dataset are numbers
            Values::Texts(texts) => {
                let longest = texts.iter().map(String::len).max().unwrap_or(0).max(1);
                let padded = |text: String| [text.as_bytes(), &vec![0; longest - text.len()]].concat();
                let characters: Vec<u8> = texts.into_iter().flat_map(padded).collect();
                (Numbers::new(NumberType::Char, &characters), Some(self.characters(longest as u64)))
            }
        }
    }

    /// The dimension of texts of a length, as xarray calls it.
    fn characters(&mut self, length: u64) -> usize {
        let dimension = (format!("string{length}"), length);
        let known = self.dimensions.iter().position(|other| *other == dimension);
        known.unwrap_or_else(|| {
            self.dimensions.push(dimension);
            self.dimensions.len() - 1
        })
    }

    /// Whether types or lengths need CDF-5.
    fn is_64_bit(&self) -> bool {
        let is_plain = |ty: NumberType| {
            use NumberType::{Char, F32, F64, I8, I16, I32};
            matches!(ty, Char | I8 | I16 | I32 | F32 | F64)
        };
        let of_attribute = |attribute: &Attribute| match &attribute.value {
            Values::Numbers(numbers) => is_plain(numbers.ty),
            Values::Texts(_) | Values::Times(_) => true,
        };
        let of_variables = self.variables.iter().flat_map(|variable| &variable.attributes);
        !(self.variables.iter().all(|variable| is_plain(variable.ty))
            && self.global.iter().chain(of_variables).all(of_attribute)
            && self.dimensions.iter().all(|(_, length)| *length <= i32::MAX as u64))
    }
}

fn fill_value(ty: SampleType, fill: f64) -> Attribute {
    let mut bytes = vec![0; ty.size()];
    store(ty, &[fill], &mut bytes);
    Attribute { name: FILL.into(), value: Values::Numbers(Numbers::new(number_type(ty), &bytes)) }
}

/// The header encoded so far.
struct Header {
    bytes: Vec<u8>,
    /// Whether counts have 64 bits.
    wide: bool,
}

impl Header {
    /// The whole header; the values of the variables start at byte `first` of the file.
    fn new(dataset: &ClassicDataset, first: u64) -> Self {
        let wide = dataset.is_64_bit();
        let mut header = Self { bytes: [MAGIC, &[if wide { 5 } else { 2 }]].concat(), wide };
        header.count(0); // no records: no dimension is unlimited
        header.list(DIMENSIONS, dataset.dimensions.len());
        for (name, length) in &dataset.dimensions {
            header.name(name);
            header.count(*length);
        }
        header.attributes(&dataset.global);
        header.list(VARIABLES, dataset.variables.len());
        dataset.variables.iter().fold(first, |begin, variable| header.variable(variable, begin));
        header
    }

    /// Encodes a variable whose values begin at byte `begin` of the file; returns where they end.
    fn variable(&mut self, variable: &ClassicVariable, begin: u64) -> u64 {
        self.name(&variable.name);
        self.count(variable.dimensions.len() as u64);
        variable.dimensions.iter().for_each(|dimension| self.count(*dimension as u64));
        self.attributes(&variable.attributes);
        self.int(code(variable.ty));
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

    /// The beginning of a list; an empty one has no tag.
    fn list(&mut self, tag: u32, items: usize) {
        self.int(if items == 0 { 0 } else { tag });
        self.count(items as u64);
    }

    fn name(&mut self, name: &str) {
        self.count(name.len() as u64);
        self.bytes.extend(name.as_bytes());
        self.pad();
    }

    fn attributes(&mut self, attributes: &[Attribute]) {
        self.list(ATTRIBUTES, attributes.len());
        attributes.iter().for_each(|attribute| self.attribute(attribute));
    }

    /// Several texts become one, a line for each.
    fn attribute(&mut self, Attribute { name, value }: &Attribute) {
        self.name(name);
        match value {
            Values::Texts(texts) => {
                self.int(TEXT);
                self.name(&texts.join("\n"));
            }
            Values::Numbers(numbers) => self.numbers(numbers),
            Values::Times(_) => self.numbers(&Numbers::new(NumberType::F64, &[])), // of variables alone
        }
    }

    fn numbers(&mut self, numbers: &Numbers) {
        self.int(code(numbers.ty));
        self.count(numbers.count() as u64);
        let mut bytes = numbers.bytes();
        bytes.chunks_exact_mut(numbers.ty.size()).for_each(<[u8]>::reverse);
        self.bytes.extend(bytes);
        self.pad();
    }

    fn pad(&mut self) {
        self.bytes.resize(self.bytes.len().next_multiple_of(ALIGNMENT as usize), 0);
    }
}

fn reversed<const N: usize>(mut bytes: [u8; N]) -> [u8; N] {
    bytes.reverse();
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contents::testing::contents;

    /// The header and coordinates of samples of a type, and where the header says that the samples begin.
    fn written(contents: &Contents, ty: SampleType) -> (Vec<u8>, usize) {
        let mut bytes = Vec::new();
        write_header(contents, ty, &mut bytes).expect("written");
        let begin = bytes[..bytes.len() - coordinates(contents)].last_chunk().copied().expect("a header");
        (bytes, u64::from_le_bytes(reversed(begin)) as usize)
    }

    /// Bytes of times and positions.
    fn coordinates(contents: &Contents) -> usize {
        8 * (contents.frames.len() + contents.grid.dims.iter().sum::<usize>())
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
        let size_and_begin = &bytes[bytes.len() - coordinates(&large) - 12..][..4];
        assert_eq!(size_and_begin, [0xff; 4]);
    }
}
