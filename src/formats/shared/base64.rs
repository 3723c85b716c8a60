//! VTK's base64: one or more encoded texts in a row, perhaps broken by white space.

use super::text::Characters;
use super::words::wrong;
use ::base64::Engine;
use ::base64::engine::general_purpose::STANDARD;
use std::io::{self, Read};
use wavesplat_core::base::mapped::FileBytes;

const GROUP: usize = 4; // characters that are decoded together

/// The bytes that text encodes, from a place in a file up to the next `<`. An `=` ends one text; another may follow it.
pub(crate) struct Text {
    characters: Characters,
    left: Vec<u8>,    // characters of a group that is not whole yet
    decoded: Vec<u8>, // bytes that are next
    used: usize,      // of these
}

impl Text {
    pub(crate) fn new(file: FileBytes, start: u64) -> Self {
        Self { characters: Characters::new(file, start), left: Vec::new(), decoded: Vec::new(), used: 0 }
    }

    fn refill(&mut self) -> io::Result<()> {
        (self.used, self.decoded) = (0, Vec::new());
        while self.decoded.is_empty() && !self.characters.ended {
            self.characters.read(&mut self.left)?;
            self.left.retain(|c| !c.is_ascii_whitespace());
            let whole = self.left.len() / GROUP * GROUP;
            let groups: Vec<u8> = self.left.drain(..whole).collect();
            let mut rest = groups.as_slice();
            while !rest.is_empty() {
                let padding = rest.iter().position(|c| *c == b'=');
                let (text, after) = rest.split_at(padding.map_or(rest.len(), |at| (at / GROUP + 1) * GROUP));
                let damaged = |e| wrong(format!("its base64 array is damaged: {e}"));
                STANDARD.decode_vec(text, &mut self.decoded).map_err(damaged)?;
                rest = after;
            }
        }
        Ok(())
    }
}

impl Read for Text {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.used == self.decoded.len() {
            self.refill()?;
        }
        let len = out.len().min(self.decoded.len() - self.used);
        out[..len].copy_from_slice(&self.decoded[self.used..][..len]);
        self.used += len;
        Ok(len)
    }
}
