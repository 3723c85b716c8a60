//! The text between the binary arrays of a file.

use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;

const PIECE: usize = 256; // bytes read at a time
const LONGEST: usize = 16 << 10; // bytes of a line

/// A place in a file.
pub(super) struct Lines<'a> {
    pub(super) file: &'a FileBytes,
    /// The next byte.
    pub(super) at: u64,
}

impl Lines<'_> {
    /// The next line as words, empty lines and white space before it left out; none at the end of the file.
    pub(super) fn words(&mut self) -> Result<Option<Vec<String>>> {
        while let Some(line) = self.line()? {
            let words: Vec<_> = line.split_whitespace().map(String::from).collect();
            if !words.is_empty() {
                return Ok(Some(words));
            }
        }
        Ok(None)
    }

    /// The next line without its end; none at the end of the file.
    pub(super) fn line(&mut self) -> Result<Option<String>> {
        let mut line = Vec::new();
        loop {
            let piece = self.peek(PIECE)?;
            if piece.is_empty() && line.is_empty() {
                return Ok(None);
            }
            let end = piece.iter().position(|byte| *byte == b'\n');
            line.extend(&piece[..end.unwrap_or(piece.len())]);
            self.at += end.map_or(piece.len(), |end| end + 1) as u64;
            if end.is_some() || piece.is_empty() {
                return Ok(Some(String::from_utf8_lossy(&line).into_owned()));
            }
            if line.len() > LONGEST {
                let what = format!(
                    "has no end of a line within {LONGEST} bytes before byte {}: is no VTK file, or damaged",
                    self.at
                );
                return Err(Error::input(self.file.path(), what));
            }
        }
    }

    /// Goes past words, as many as must be there.
    pub(super) fn skip_words(&mut self, count: usize) -> Result<()> {
        let (mut left, mut inside) = (count, false);
        while left > 0 {
            let piece = self.peek(LONGEST)?;
            if piece.is_empty() && (left > 1 || !inside) {
                return Err(Error::input(
                    self.file.path(),
                    format!("is cut short: {left} of {count} numbers are missing"),
                ));
            }
            for byte in piece.iter().chain(piece.is_empty().then_some(&b'\n')) {
                left -= usize::from(inside && byte.is_ascii_whitespace());
                if left == 0 {
                    return Ok(());
                }
                inside = !byte.is_ascii_whitespace();
                self.at += 1;
            }
        }
        Ok(())
    }

    /// The next bytes, fewer at the end.
    pub(super) fn peek(&self, bytes: usize) -> Result<Vec<u8>> {
        let left = usize::try_from(self.file.len().saturating_sub(self.at)).unwrap_or(bytes);
        let mut piece = vec![0; left.min(bytes)];
        self.file.read_at(self.at, &mut piece).map_err(|e| Error::io(self.file.path(), "reading", e))?;
        Ok(piece)
    }
}
