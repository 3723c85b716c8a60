//! A web page that holds its pictures, and opens from a disk without a server.

use super::page_encoder::{BlockOfFrames, PageEncoder};
use super::{Rendered, SinkConfig};
use crate::render::page::{self, Planes};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;

/// A page in work.
pub(super) struct Page {
    out: Output,
    encoder: PageEncoder,
    nonce: String,
}

impl Page {
    /// Begins the page.
    pub(super) fn new(mut out: Output, config: &SinkConfig) -> Result<Self> {
        let encoder = PageEncoder::new(config.clone())?;
        let nonce = page::nonce(format!("{:?}", encoder.about()).as_bytes());
        let begun = page::begin(&mut out, &config.provenance.software, &nonce, encoder.about());
        begun.map_err(|e| Error::io(out.path(), "writing", e))?;
        Ok(Self { out, encoder, nonce })
    }

    /// Adds a picture, and writes the block that it completes.
    pub(super) fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        self.encoder.look(rendered);
        let (step, out) = (self.encoder.step(), &mut self.out);
        self.encoder.picture(rendered, &mut |block, planes| write(out, block, planes, step))
    }

    /// Writes the rest, and gives the file its final name.
    pub(super) fn finish(mut self) -> Result<()> {
        let (step, out) = (self.encoder.step(), &mut self.out);
        self.encoder.rest(&mut |block, planes| write(out, block, planes, step))?;
        let ended = page::end(&mut self.out, &self.nonce, self.encoder.about());
        ended.map_err(|e| Error::io(self.out.path(), "writing", e))?;
        self.out.commit()
    }
}

/// Writes a block of pictures.
fn write(out: &mut Output, block: BlockOfFrames, planes: Planes, step: f32) -> Result<()> {
    let BlockOfFrames { sequence, first, count } = block;
    let written = planes.coded(step).and_then(|bytes| page::write_block(out, sequence, first, count, &bytes));
    written.map_err(|e| Error::io(out.path(), "writing", e))
}
