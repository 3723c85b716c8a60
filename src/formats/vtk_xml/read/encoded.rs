//! Where an array is in a file, and how it is written there.

use super::blocks::Blocks;
use super::count::Count;
use crate::shared::base64::Text;
use crate::shared::deflated::FileReader;
use crate::shared::pieces::Packed;
use crate::shared::text::{Characters, Numbers};
use crate::shared::words::wrong;
use std::io::{self, Read};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;

/// How bytes are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Raw,
    /// As text, among XML.
    Base64,
    /// As text, appended to the XML.
    AppendedBase64,
    /// As numbers, among XML.
    Ascii,
}

/// An array.
#[derive(Debug, Clone, Copy)]
pub(super) struct EncodedArray {
    /// Its first byte, or that of its text.
    pub(super) start: u64,
    pub(super) form: Form,
    pub(super) compressed: bool,
    pub(super) count: Count,
    pub(super) ty: StoredType,
    /// Bytes of its samples.
    pub(super) bytes: usize,
}

impl EncodedArray {
    /// Where its samples are, if they are stored raw.
    pub(crate) fn plain(&self) -> Option<u64> {
        let plain = self.form == Form::Raw && !self.compressed;
        plain.then(|| self.start + self.count.size() as u64)
    }

    /// Checks that the array states the expected number of bytes, and that the file has them.
    pub(super) fn check(&self, file: &FileBytes) -> Result<()> {
        let path = file.path();
        let refused = |e: io::Error| match e.raw_os_error() {
            Some(_) => Error::io(path, "reading an array's length", e),
            None => Error::input(path, e.to_string()),
        };
        if self.form == Form::Ascii {
            return Ok(());
        }
        let mut reader = self.reader(FileBytes::open(path, Access::Read)?);
        let left = file.len().saturating_sub(self.start);
        let stored = if self.compressed {
            let blocks = Blocks::read(&mut *reader, self.count, self.bytes, left).map_err(refused)?;
            blocks.stored(self.count)
        } else {
            self.check_count(&mut *reader).map_err(refused)?;
            Some((self.count.size() + self.bytes) as u64)
        };
        let cut = |what: &str| Error::input(path, format!("is cut short: its {what}"));
        let stored = stored.ok_or_else(|| cut("array is too large for any file"))?;
        match self.form {
            Form::Raw if stored <= left => Ok(()),
            Form::Raw => Err(cut(&format!(
                "array ends at byte {}, the file at {}",
                u128::from(self.start) + u128::from(stored),
                file.len()
            ))),
            Form::Base64
                if self.has_text(FileBytes::open(path, Access::Read)?, characters(stored)).map_err(refused)? =>
            {
                Ok(())
            }
            Form::AppendedBase64 if characters(stored) <= left => Ok(()),
            _ => Err(cut(&format!("base64 array ends early: {} characters were expected", characters(stored)))),
        }
    }

    fn check_count(&self, reader: &mut dyn Read) -> io::Result<()> {
        match self.count.read(reader)? {
            n if n == self.bytes as u64 => Ok(()),
            n => Err(wrong(format!("its array has {n} bytes, but its extent and type need {}", self.bytes))),
        }
    }

    /// The bytes that are stored.
    fn reader(&self, file: FileBytes) -> Box<dyn Read> {
        match self.form {
            Form::Raw => Box::new(FileReader::new(file, self.start)),
            Form::Base64 | Form::AppendedBase64 => Box::new(Text::new(file, self.start)),
            Form::Ascii => {
                let count = self.bytes / self.ty.size() + 1; // one too many is noticed
                Box::new(Numbers::new(file, self.start, count, self.ty, self.count.big_endian))
            }
        }
    }

    /// Whether so many characters come before the text ends.
    fn has_text(&self, file: FileBytes, characters: u64) -> io::Result<bool> {
        let (mut text, mut seen, mut piece) = (Characters::new(file, self.start), 0, Vec::new());
        while seen < characters && !text.ended {
            piece.clear();
            text.read(&mut piece)?;
            seen += piece.iter().filter(|c| !c.is_ascii_whitespace()).count() as u64;
        }
        Ok(seen >= characters)
    }
}

impl Packed for EncodedArray {
    fn open(&self, file: FileBytes) -> io::Result<Box<dyn Read>> {
        let left = file.len().saturating_sub(self.start);
        let mut reader = self.reader(file);
        if self.form == Form::Ascii {
            return Ok(reader);
        }
        if self.compressed {
            let blocks = Blocks::read(&mut *reader, self.count, self.bytes, left)?;
            return Ok(Box::new(blocks.inflate(reader)));
        }
        self.check_count(&mut *reader)?;
        Ok(Box::new(reader.take(self.bytes as u64)))
    }
}

/// Characters that encode so many bytes, if not more.
fn characters(bytes: u64) -> u64 {
    bytes.div_ceil(3).saturating_mul(4)
}
