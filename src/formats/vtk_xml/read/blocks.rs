//! Arrays in blocks that are compressed by zlib one by one.

use super::count::Count;
use crate::shared::words::wrong;
use flate2::bufread::ZlibDecoder;
use std::io::{self, BufReader, Read, Take};

/// The header before the blocks of an array.
#[derive(Debug)]
pub(super) struct Blocks {
    /// Bytes of each block but the last.
    block: u64,
    /// Bytes of the last one.
    last: u64,
    /// Bytes of each as they are stored.
    packed: Vec<u64>,
}

impl Blocks {
    /// Reads the header of an array of `expected` bytes. `left` is an upper bound on the stored bytes.
    pub(super) fn read(reader: &mut dyn Read, count: Count, expected: usize, left: u64) -> io::Result<Self> {
        let [blocks, block, last] = [count.read(reader)?, count.read(reader)?, count.read(reader)?];
        let last = if last == 0 { block } else { last };
        let bytes = blocks.checked_sub(1).and_then(|n| n.checked_mul(block)).and_then(|n| n.checked_add(last));
        if bytes != Some(expected as u64) {
            let bytes = bytes.map_or("too many".into(), |n| n.to_string());
            return Err(wrong(format!("its array has {bytes} bytes, but its extent and type need {expected}")));
        }
        if blocks.saturating_mul(count.size() as u64) > left {
            return Err(wrong(format!("its array is cut short: it has {blocks} blocks")));
        }
        let packed: Vec<u64> = (0..blocks).map(|_| count.read(reader)).collect::<io::Result<_>>()?;
        Ok(Self { block, last, packed })
    }

    /// Stored bytes of the blocks and their header; `None` on overflow.
    pub(super) fn stored(&self, count: Count) -> Option<u64> {
        let before = (self.packed.len() as u64 + 3) * count.size() as u64;
        self.packed.iter().try_fold(before, |sum, bytes| sum.checked_add(*bytes))
    }

    /// Decompresses the blocks that follow in a reader.
    pub(super) fn inflate<R: Read>(self, reader: R) -> Inflated<R> {
        Inflated { next: 0, left: 0, blocks: self, between: Some(reader), inside: None }
    }
}

/// The bytes of blocks one after another.
pub(super) struct Inflated<R> {
    blocks: Blocks,
    next: usize, // block
    left: u64,   // bytes of the block that is being decoded
    between: Option<R>,
    inside: Option<ZlibDecoder<BufReader<Take<R>>>>,
}

impl<R: Read> Inflated<R> {
    /// Starts the next block; false if there is none.
    fn advance(&mut self) -> io::Result<bool> {
        let Some(packed) = self.blocks.packed.get(self.next) else { return Ok(false) };
        self.next += 1;
        self.left = if self.next == self.blocks.packed.len() { self.blocks.last } else { self.blocks.block };
        let block = self.between.take().map(|reader| BufReader::new(reader.take(*packed)));
        self.inside = block.map(ZlibDecoder::new);
        Ok(true)
    }

    /// Checks that a block has no more bytes, and skips to its end.
    fn finish(&mut self, mut block: ZlibDecoder<BufReader<Take<R>>>) -> io::Result<()> {
        if block.read(&mut [0])? > 0 {
            return Err(wrong(format!("block {} holds more than it should", self.next - 1)));
        }
        let mut rest = block.into_inner().into_inner();
        io::copy(&mut rest, &mut io::sink())?;
        self.between = Some(rest.into_inner());
        Ok(())
    }
}

impl<R: Read> Read for Inflated<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.left == 0 {
            if let Some(block) = self.inside.take() {
                self.finish(block)?;
            }
            if !self.advance()? {
                return Ok(0);
            }
        }
        let Some(block) = &mut self.inside else { return Ok(0) };
        let wanted = usize::try_from(self.left).unwrap_or(usize::MAX).min(out.len());
        match block.read(&mut out[..wanted])? {
            0 if wanted > 0 => Err(wrong(format!("block {} holds less than it should", self.next - 1))),
            n => {
                self.left -= n as u64;
                Ok(n)
            }
        }
    }
}
