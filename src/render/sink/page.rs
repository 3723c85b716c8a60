//! A web page that holds its pictures, and opens from a disk without a server.

use super::film::{Film, Place};
use super::{Rendered, SinkConfig};
use crate::base::error::{Error, Result};
use crate::base::output::Output;
use crate::render::page::{self, Planes};

/// A page in work.
pub(super) struct Page {
    out: Output,
    film: Film,
    nonce: String,
}

impl Page {
    /// Begins the page.
    pub(super) fn new(mut out: Output, config: &SinkConfig) -> Result<Self> {
        let film = Film::new(config.clone())?;
        let nonce = page::nonce(film.about());
        let begun = page::begin(&mut out, (&config.provenance.software, &nonce), film.about());
        begun.map_err(|e| Error::io(out.path(), "writing", e))?;
        Ok(Self { out, film, nonce })
    }

    /// Adds a picture, and writes the block that it completes.
    pub(super) fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        let (step, out) = (self.film.step(), &mut self.out);
        self.film.picture(rendered, &mut |place, planes| write(out, place, planes, step))
    }

    /// Writes the rest, and gives the file its final name.
    pub(super) fn finish(mut self) -> Result<()> {
        let (step, out) = (self.film.step(), &mut self.out);
        self.film.rest(&mut |place, planes| write(out, place, planes, step))?;
        let ended = page::end(&mut self.out, &self.nonce, self.film.about());
        ended.map_err(|e| Error::io(self.out.path(), "writing", e))?;
        self.out.commit()
    }
}

/// Writes a block of pictures.
fn write(out: &mut Output, Place { sequence, first, count }: Place, planes: Planes, step: f32) -> Result<()> {
    let written = planes.coded(step).and_then(|block| page::write_block(out, (sequence, first, count), &block));
    written.map_err(|e| Error::io(out.path(), "writing", e))
}
