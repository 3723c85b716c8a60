//! VTK's base64 arrays: a byte count and the samples, each encoded or both together, perhaps broken by white space.

use crate::error::{Error, Result};
use crate::mapped::FileBytes;
use crate::source::Parsed;
use ::base64::Engine;
use ::base64::engine::general_purpose::STANDARD;

const PIECE: usize = 64 << 10; // bytes read at a time

/// Where an encoded array is in its file.
#[derive(Debug, Clone, Copy)]
pub(in crate::source) struct Place {
    /// First byte of the text.
    pub(in crate::source) start: u64,
    /// How the byte count before the samples is stored.
    pub(in crate::source) count: Count,
}

/// The byte count that VTK puts before the samples of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::source) struct Count {
    /// Whether it has 64 bits, not 32.
    pub(in crate::source) wide: bool,
    /// Whether its most significant byte comes first.
    pub(in crate::source) big_endian: bool,
}

impl Count {
    /// Bytes of the count itself.
    pub(in crate::source) fn size(self) -> usize {
        if self.wide { 8 } else { 4 }
    }

    /// Checks a stored count, whose bytes these are, against what it should be.
    pub(in crate::source) fn check(self, stored: &[u8], expected: usize) -> Parsed<()> {
        let mut bytes = [0; 8];
        bytes[..stored.len()].copy_from_slice(stored);
        if self.big_endian {
            bytes[..stored.len()].reverse();
        }
        match u64::from_le_bytes(bytes) {
            n if n == expected as u64 => Ok(()),
            n => Err(format!("its array has {n} bytes, but its extent and type need {expected}")),
        }
    }
}

/// How the text of an array is laid out.
struct Text {
    separate: bool, // the count is encoded on its own
    chars: usize,   // of the count and the samples, white space aside
}

impl Place {
    /// Checks the count of an array of `expected` bytes, and that the file can hold its text; with `whole`, that it
    /// does.
    pub(in crate::source) fn check(&self, file: &FileBytes, expected: usize, whole: bool) -> Result<()> {
        let text = self.text(file, expected)?;
        if whole {
            return take(file, self.start, text.chars).map(|_| ());
        }
        match self.start.checked_add(text.chars as u64) {
            Some(end) if end <= file.len() => Ok(()),
            _ => Err(ends_early(file, text.chars)),
        }
    }

    /// The samples, `expected` bytes.
    pub(in crate::source) fn decode(&self, file: &FileBytes, expected: usize) -> Result<Vec<u8>> {
        let text = self.text(file, expected)?;
        let mut chars = take(file, self.start, text.chars)?;
        let mut count = self.count.size();
        if text.separate {
            chars.drain(..encoded(count));
            count = 0;
        }
        let mut bytes = decode(file, &chars)?;
        bytes.drain(..count.min(bytes.len()));
        match bytes.len() {
            n if n == expected => Ok(bytes),
            n => Err(Error::input(file.path(), format!("its base64 array holds {n} bytes, not {expected}"))),
        }
    }

    fn text(&self, file: &FileBytes, expected: usize) -> Result<Text> {
        let count = self.count.size();
        let chars = take(file, self.start, encoded(count))?;
        let bytes = decode(file, &chars)?;
        let stored = bytes.get(..count).ok_or_else(|| ends_early(file, encoded(count)))?;
        self.count.check(stored, expected).map_err(|e| Error::input(file.path(), e))?;
        let separate = bytes.len() == count; // together, the samples' first bytes fill the last group
        let chars = if separate {
            encoded(expected).checked_add(encoded(count))
        } else {
            expected.checked_add(count).map(encoded)
        };
        let chars = chars.ok_or_else(|| Error::input(file.path(), "its base64 array is too large"))?;
        Ok(Text { separate, chars })
    }
}

/// Characters that encode so many bytes.
fn encoded(bytes: usize) -> usize {
    bytes.div_ceil(3).saturating_mul(4)
}

fn decode(file: &FileBytes, chars: &[u8]) -> Result<Vec<u8>> {
    STANDARD.decode(chars).map_err(|e| Error::input(file.path(), format!("its base64 array is damaged: {e}")))
}

/// The next characters of a file's text, white space aside.
fn take(file: &FileBytes, start: u64, chars: usize) -> Result<Vec<u8>> {
    let (mut text, mut at, mut piece) = (Vec::new(), start, vec![0; PIECE]);
    while text.len() < chars {
        let len = usize::try_from(file.len().saturating_sub(at)).unwrap_or(PIECE).min(PIECE);
        let piece = &mut piece[..len];
        file.read_at(at, piece).map_err(|e| Error::io(file.path(), "reading base64", e))?;
        let end = piece.iter().position(|b| *b == b'<').unwrap_or(len);
        text.extend(piece[..end].iter().filter(|b| !b.is_ascii_whitespace()).take(chars - text.len()));
        if (end < len || len == 0) && text.len() < chars {
            return Err(ends_early(file, chars));
        }
        at += len as u64;
    }
    Ok(text)
}

fn ends_early(file: &FileBytes, chars: usize) -> Error {
    Error::input(file.path(), format!("its base64 array ends early: {chars} characters were expected"))
}
