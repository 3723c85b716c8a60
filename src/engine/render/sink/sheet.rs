//! A contact sheet: all pictures of a run in one file.

use super::png::{self, Samples};
use super::{Picture, Rendered, SinkConfig};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::Output;

/// Largest side in pixels; most programs show no larger pictures.
const MOST_SIDE: usize = 1 << 15;

/// Pictures in rows, in their order.
#[derive(Debug)]
pub(super) struct Sheet {
    out: Output,
    /// Width and height in pixels.
    size: [usize; 2],
    /// The bytes of the sheet's pixels; empty before the first picture.
    samples: Vec<u8>,
    /// The provenance of the pictures.
    texts: Vec<(String, String)>,
    placed: usize,
}

impl Sheet {
    pub(super) fn new(out: Output, config: &SinkConfig) -> Result<Self> {
        let size = size(config.size, config.shown.len())?;
        Ok(Self { out, size, samples: Vec::new(), texts: Vec::new(), placed: 0 })
    }

    pub(super) fn picture(&mut self, config: &SinkConfig, rendered: &Rendered<'_>, picture: Picture<'_>) {
        let ([width, height], [across, down]) = (config.size, self.size);
        let (kind, columns) = (Samples::new(config), across / width);
        if self.samples.is_empty() {
            self.samples = kind.pixel(config.colours.background()).repeat(across * down);
            self.texts = config.texts_of_all(rendered);
        }
        let first = self.placed / columns * height * across + self.placed % columns * width;
        let bytes = kind.bytes();
        for (y, row) in png::samples(config, rendered, picture).chunks_exact(width * bytes).enumerate() {
            self.samples[(first + y * across) * bytes..][..row.len()].copy_from_slice(row);
        }
        self.placed += 1;
    }

    pub(super) fn finish(mut self, config: &SinkConfig) -> Result<()> {
        let written = png::write(config, self.size, &self.texts, &self.samples, &mut self.out);
        written.map_err(|e| Error::io(self.out.path(), "writing", e))?;
        self.out.commit()
    }
}

/// Width and height in pixels of a nearly square sheet of `pictures` pictures.
///
/// # Errors
/// A side that is too long.
pub(super) fn size([width, height]: [usize; 2], pictures: usize) -> Result<[usize; 2]> {
    let rows = |columns: usize| pictures.div_ceil(columns);
    let wide = |columns: &usize| columns.saturating_mul(width) >= rows(*columns).saturating_mul(height);
    let columns = (1..=pictures).find(wide).unwrap_or(pictures.max(1));
    let size = [columns.saturating_mul(width), rows(columns).max(1).saturating_mul(height)];
    if size.into_iter().all(|side| side <= MOST_SIDE) {
        return Ok(size);
    }
    let [across, down] = size;
    let what = format!(
        "a sheet of {pictures} pictures would have {across}x{down} pixels; each side may have at most {MOST_SIDE}"
    );
    Err(Error::setting("format", Note::with(what, Remedy::Adjust(&["size", "frames"]))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_are_nearly_square() {
        let sizes = [1, 2, 3, 4, 5, 16, 17].map(|n| size([20, 10], n).expect("small"));
        assert_eq!(sizes, [[20, 10], [20, 20], [40, 20], [40, 20], [40, 30], [60, 60], [60, 60]]);
        assert_eq!(size([1 << 15, 1 << 15], 1).expect("just"), [1 << 15, 1 << 15]);
        assert!(size([512, 512], 5000).is_err() && size([usize::MAX, 2], 9).is_err());
    }
}
