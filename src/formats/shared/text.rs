//! Samples as text: numbers with white space between them.

use super::pieces::Packed;
use super::words::wrong;
use std::io::{self, Read};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::base::stored::StoredType;

const PIECE: usize = 64 << 10; // bytes read at a time

/// The characters of a text in a file, up to the next `<`.
pub(crate) struct Characters {
    file: FileBytes,
    at: u64,
    /// Whether a `<` or the end of the file came.
    pub(crate) ended: bool,
}

impl Characters {
    pub(crate) fn new(file: FileBytes, start: u64) -> Self {
        Self { file, at: start, ended: false }
    }

    /// Appends some more of them.
    pub(crate) fn read(&mut self, text: &mut Vec<u8>) -> io::Result<()> {
        let len = usize::try_from(self.file.len().saturating_sub(self.at)).unwrap_or(PIECE).min(PIECE);
        let before = text.len();
        text.resize(before + len, 0);
        self.file.read_at(self.at, &mut text[before..])?;
        self.at += len as u64;
        let end = text[before..].iter().position(|c| *c == b'<');
        text.truncate(before + end.unwrap_or(len));
        self.ended |= end.is_some() || len == 0;
        Ok(())
    }
}

/// Samples from a place in a file, read as bytes with the most significant one first.
#[derive(Debug)]
pub(crate) struct Words {
    pub(crate) start: u64,
    pub(crate) count: usize,
    pub(crate) ty: StoredType,
}

impl Packed for Words {
    fn open(&self, file: FileBytes) -> io::Result<Box<dyn Read>> {
        Ok(Box::new(Numbers::new(file, self.start, self.count, self.ty, true)))
    }
}

/// The bytes of samples that are written as numbers.
pub(crate) struct Numbers {
    characters: Characters,
    ty: StoredType,
    big_endian: bool, // the bytes that are read
    count: usize,     // numbers that may come
    left: Vec<u8>,    // characters of a number that is not whole yet
    samples: Vec<u8>, // bytes that are next
    used: usize,      // of these
}

impl Numbers {
    /// The first `count` numbers from a place in a file.
    pub(crate) fn new(file: FileBytes, start: u64, count: usize, ty: StoredType, big_endian: bool) -> Self {
        let characters = Characters::new(file, start);
        Self { characters, ty, big_endian, count, left: Vec::new(), samples: Vec::new(), used: 0 }
    }

    fn refill(&mut self) -> io::Result<()> {
        (self.used, self.samples) = (0, Vec::new());
        while self.samples.is_empty() && self.count > 0 && !self.characters.ended {
            self.characters.read(&mut self.left)?;
            let space = self.left.iter().rposition(u8::is_ascii_whitespace);
            let whole = if self.characters.ended { self.left.len() } else { space.unwrap_or(0) };
            let text: Vec<u8> = self.left.drain(..whole).collect();
            let words = text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take(self.count);
            let mut samples = Vec::new();
            for word in words {
                self.count -= 1;
                append(word, self.ty, &mut samples).ok_or_else(|| no_number(word))?;
            }
            if self.left.len() > PIECE {
                return Err(no_number(&self.left));
            }
            if self.big_endian {
                self.ty.swap_endian(&mut samples);
            }
            self.samples = samples;
        }
        Ok(())
    }
}

/// Appends the bytes of a number, the least significant one first; `None` if it is no number that its type can hold.
fn append(word: &[u8], ty: StoredType, bytes: &mut Vec<u8>) -> Option<()> {
    let text = std::str::from_utf8(word).ok()?;
    match ty {
        StoredType::I64 => bytes.extend(text.parse::<i64>().ok()?.to_le_bytes()),
        StoredType::U64 => bytes.extend(text.parse::<u64>().ok()?.to_le_bytes()),
        _ => {
            let (value, start) = (value(text, ty.sample())?, bytes.len());
            bytes.resize(start + ty.size(), 0);
            sample::store(ty.sample(), &[value], &mut bytes[start..]);
        }
    }
    Some(())
}

/// A number that samples of this type can be.
fn value(text: &str, ty: SampleType) -> Option<f64> {
    if ty == SampleType::F32 {
        return text.parse::<f32>().map(f64::from).ok();
    }
    let value: f64 = text.parse().ok()?;
    (ty.is_float() || sample::round_to(ty, value) == value).then_some(value)
}

fn no_number(word: &[u8]) -> io::Error {
    let word = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
    wrong(format!("{word:?} is no number that its type can hold"))
}

impl Read for Numbers {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.used == self.samples.len() {
            self.refill()?;
        }
        let len = out.len().min(self.samples.len() - self.used);
        out[..len].copy_from_slice(&self.samples[self.used..][..len]);
        self.used += len;
        Ok(len)
    }
}
