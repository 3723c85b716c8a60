//! The header of an `.npy` file or stream: written without a seek, and read from its text. The payload follows as raw
//! bytes.

mod literal;

use crate::base::sample::SampleType;
use crate::base::stored::StoredType;
use literal::{Literal, Value};
use std::io::{self, Write};

/// The first bytes of every `.npy`; two bytes of its version follow.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Headers are padded with blanks to a multiple of this many bytes.
const ALIGNMENT: usize = 64;

/// Bytes of a written header before its text.
const BEFORE_TEXT: usize = 10;

/// Writes the header of a C-order array, last axis fastest. The shape must be final: there is one header for all
/// frames.
pub fn write_header(ty: SampleType, shape: &[usize], out: &mut impl Write) -> io::Result<()> {
    let order = if ty.size() == 1 { '|' } else { '<' };
    let lengths: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let text = format!("{{'descr': '{order}{}', 'fortran_order': False, 'shape': ({lengths}), }}", numpy_name(ty));
    let len = (BEFORE_TEXT + text.len() + 1).next_multiple_of(ALIGNMENT) - BEFORE_TEXT;
    let stored = u16::try_from(len).map_err(io::Error::other)?;
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&stored.to_le_bytes())?;
    writeln!(out, "{text:<0$}", len - 1)
}

/// The content of a header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// Sample type and whether its most significant byte is first; or the text of a type that is not supported.
    pub samples: Result<(StoredType, bool), String>,
    /// Whether the first axis is the fastest.
    pub is_fortran: bool,
    /// Lengths of the axes.
    pub shape: Vec<u64>,
}

impl Header {
    /// Reads the text of a header: a dictionary of Python.
    ///
    /// # Errors
    /// The reason, in words that follow "its npy header".
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(text).map_err(|_| "is damaged: it is not text")?;
        let Value::Dictionary(entries) = literal::parse(text)?.value else {
            return Err("is damaged: it is not a dictionary".into());
        };
        let entry = |name| {
            let found = entries.iter().find(|(key, _)| key.value == Value::Text(name));
            found.map(|(_, literal)| literal).ok_or_else(|| format!("is damaged: '{name}' is missing"))
        };
        let Value::Truth(is_fortran) = entry("fortran_order")?.value else {
            return Err("is damaged: 'fortran_order' is neither True nor False".into());
        };
        Ok(Self { samples: samples(entry("descr")?)?, is_fortran, shape: shape(entry("shape")?)? })
    }
}

/// A sample type and whether its most significant byte is first, by NumPy's name: `'<f4'`.
fn samples(descr: &Literal<'_>) -> Result<Result<(StoredType, bool), String>, String> {
    match &descr.value {
        Value::Text(name) => Ok(sample_type(name).ok_or_else(|| descr.source.into())),
        Value::Sequence(_) => Ok(Err(descr.source.into())),
        _ => Err("is damaged: 'descr' is no type".into()),
    }
}

fn sample_type(name: &str) -> Option<(StoredType, bool)> {
    let (order, name) = name.split_at_checked(1)?;
    let ty = StoredType::all().find(|ty| numpy_name(*ty) == name)?;
    let is_known = matches!(order, "<" | ">") || order == "|" && ty.size() == 1;
    is_known.then_some((ty, order == ">"))
}

fn shape(literal: &Literal<'_>) -> Result<Vec<u64>, String> {
    let length = |literal: &Literal<'_>| match literal.value {
        Value::Number(n) => Ok(n),
        _ => Err(format!("is damaged: {} is no length of an axis", literal.source)),
    };
    let Value::Sequence(lengths) = &literal.value else {
        return Err("is damaged: 'shape' is no tuple".into());
    };
    let lengths: Vec<u64> = lengths.iter().map(length).collect::<Result<_, _>>()?;
    let samples = lengths.iter().try_fold(1_u64, |all, n| all.checked_mul((*n).max(1)));
    samples.map(|_| lengths).ok_or_else(|| format!("has numbers that are too large: {}", literal.source))
}

/// NumPy's name of a type without byte order: `f4`.
pub fn numpy_name(ty: impl Into<StoredType>) -> String {
    let ty = ty.into();
    format!("{}{}", &ty.name()[..1], ty.size())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
    }

    fn parse(descr: &str, fortran: &str, shape: &str) -> Result<Header, String> {
        Header::parse(text(descr, fortran, shape).as_bytes())
    }

    #[test]
    fn headers_are_those_that_numpy_takes() {
        let mut bytes = Vec::new();
        write_header(SampleType::F32, &[2, 3, 4], &mut bytes).expect("written");
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, 4, ), }";
        let expected = [&b"\x93NUMPY\x01\x00\x76\x00"[..], text.as_bytes(), &[b' '; 53], b"\n"].concat();
        assert_eq!(bytes, expected);
        for axes in 0..30 {
            let mut bytes = Vec::new();
            write_header(SampleType::U8, &vec![10; axes], &mut bytes).expect("written");
            assert_eq!(bytes.len() % ALIGNMENT, 0, "{axes} axes");
            assert_eq!(usize::from(bytes[8]) + 256 * usize::from(bytes[9]), bytes.len() - BEFORE_TEXT);
        }
        assert!(write_header(SampleType::U8, &[1; 30_000], &mut Vec::new()).is_err());
    }

    #[test]
    fn a_written_header_reads_back() {
        for ty in SampleType::ALL {
            for shape in [&[][..], &[5], &[2, 3, 4]] {
                let mut bytes = Vec::new();
                write_header(ty, shape, &mut bytes).expect("written");
                let shape = shape.iter().map(|n| *n as u64).collect();
                let expected = Header { samples: Ok((ty.into(), false)), is_fortran: false, shape };
                assert_eq!(Header::parse(&bytes[BEFORE_TEXT..]), Ok(expected), "{ty}");
            }
        }
    }

    #[test]
    fn entries_may_be_in_any_order_with_either_quotes() {
        let text = "{\"shape\":(7,5,),'more':[],\"descr\":\">i2\",'fortran_order':True}";
        let expected = Header { samples: Ok((SampleType::I16.into(), true)), is_fortran: true, shape: vec![7, 5] };
        assert_eq!(Header::parse(text.as_bytes()), Ok(expected));
    }

    #[test]
    fn types_that_are_not_supported_are_kept_as_text() {
        for descr in ["'<i16'", "'|b1'", "'<c8'", "'|O'", "'<U3'", "'|f4'", "'=f4'", "''", "'é'", "[('a', '<f4')]"] {
            assert_eq!(parse(descr, "False", "(1,)").expect("a header").samples, Err(descr.to_string()));
        }
    }

    #[test]
    fn damage_is_named() {
        let refused = |found: Result<Header, String>, words: &str| {
            let error = found.expect_err(words);
            assert!(error.contains(words), "{error}");
        };
        refused(parse("1", "False", "(1,)"), "'descr' is no type");
        refused(parse("'<f4'", "0", "(1,)"), "'fortran_order' is neither");
        refused(parse("'<f4'", "False", "7"), "'shape' is no tuple");
        refused(parse("'<f4'", "False", "('7',)"), "'7' is no length");
        refused(parse("'<f4'", "False", "(4294967296, 4294967296)"), "too large");
        refused(Header::parse(b"()"), "not a dictionary");
        refused(Header::parse(b"{}"), "'fortran_order' is missing");
        refused(Header::parse(b"{'fortran_order': True}"), "'descr' is missing");
        refused(Header::parse(b"\xff"), "not text");
        refused(Header::parse(b""), "expected a value");
    }
}
