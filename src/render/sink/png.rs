//! PNG files, still and moving.

use super::{Picture, SinkConfig};
use crate::colour::Rgb;
use crate::error::{Error, Result};
use crate::output::Output;
use std::cell::RefCell;
use std::io::{self, Write};
use std::rc::Rc;

/// Writes one picture.
pub(super) fn write(size: [usize; 2], pixels: &[Rgb], out: &mut impl Write) -> io::Result<()> {
    let mut writer = encoder(size, out).write_header().map_err(cause)?;
    writer.write_image_data(pixels.as_flattened()).map_err(cause)?;
    writer.finish().map_err(cause)
}

fn encoder<W: Write>([width, height]: [usize; 2], out: W) -> png::Encoder<'static, W> {
    let mut encoder = png::Encoder::new(out, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder
}

/// A PNG that moves, again and again.
pub(super) struct Animation {
    out: Shared,
    /// None before the first picture.
    writer: Option<png::Writer<Shared>>,
}

impl Animation {
    pub(super) fn new(out: Output) -> Self {
        Self { out: Shared(Rc::new(RefCell::new(out))), writer: None }
    }

    pub(super) fn picture(&mut self, config: &SinkConfig, frame: usize, picture: Picture<'_>) -> Result<()> {
        let written = self.write(config, &config.image(frame, picture));
        written.map_err(|e| Error::io(self.path(), format!("writing frame {frame}"), e))
    }

    fn write(&mut self, config: &SinkConfig, pixels: &[Rgb]) -> io::Result<()> {
        let writer = match &mut self.writer {
            Some(writer) => writer,
            None => self.writer.insert(begin(config, self.out.clone()).map_err(cause)?),
        };
        writer.write_image_data(pixels.as_flattened()).map_err(cause)
    }

    pub(super) fn finish(mut self) -> Result<()> {
        let finished = self.writer.take().map_or(Ok(()), png::Writer::finish).map_err(cause);
        finished.map_err(|e| Error::io(self.path(), "writing", e))?;
        Rc::into_inner(self.out.0).map_or(Ok(()), |out| out.into_inner().commit())
    }

    fn path(&self) -> std::path::PathBuf {
        self.out.0.borrow().path().to_path_buf()
    }
}

fn begin(config: &SinkConfig, out: Shared) -> std::result::Result<png::Writer<Shared>, png::EncodingError> {
    let mut encoder = encoder(config.size, out);
    encoder.set_animated(config.frames.len() as u32, 0)?;
    encoder.set_frame_delay(1, config.fps as u16)?;
    encoder.write_header()
}

/// The encoder keeps what it writes to; here it is still at hand when that is done.
#[derive(Clone)]
struct Shared(Rc<RefCell<Output>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.borrow_mut().flush()
    }
}

/// What the system said, whose kind tells a broken pipe from other failures.
fn cause(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(e) => e,
        other => io::Error::other(other),
    }
}
