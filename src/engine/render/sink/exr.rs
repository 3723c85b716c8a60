//! OpenEXR files of unconverted numbers, if the feature `exr` is enabled.

/// Whether the feature is enabled.
pub(super) const IS_BUILT: bool = cfg!(feature = "exr");

/// The message if it is not.
pub(super) const NOT_BUILT: &str = "OpenEXR is not part of this build; .npy is";

#[cfg(not(feature = "exr"))]
pub(super) fn write(
    _: &super::SinkConfig,
    _: &[(String, String)],
    _: super::Picture<'_>,
    _: &mut impl std::io::Write,
) -> std::io::Result<()> {
    Err(std::io::Error::other(NOT_BUILT))
}

#[cfg(feature = "exr")]
pub(super) use with_crate::write;

#[cfg(feature = "exr")]
mod with_crate {
    use super::super::{Picture, Pixel, SinkConfig};
    use ::exr::prelude::*;
    use std::io::{self, Cursor, Write};

    /// Writes one picture: float32 channels with lossless compression. The provenance goes into the standard attributes
    /// `software` and `comments`, one line for each name, because custom attributes have no fixed order.
    pub(in super::super) fn write(
        config: &SinkConfig,
        texts: &[(String, String)],
        picture: Picture<'_>,
        out: &mut impl Write,
    ) -> io::Result<()> {
        let lines: Vec<String> = texts.iter().map(|(name, text)| format!("{name}: {text}")).collect();
        let attributes = LayerAttributes {
            software_name: Some(text(&config.provenance.software)),
            comments: Some(text(&lines.join("\n"))),
            ..LayerAttributes::default()
        };
        let [width, height] = config.size;
        let channels = channels(config.pixel, picture);
        let layer = Layer::new((width, height), attributes, Encoding::SMALL_LOSSLESS, channels);
        let mut bytes = Cursor::new(Vec::new()); // the encoder seeks
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(cause)?;
        out.write_all(bytes.get_ref())
    }

    /// A text in Latin-1, or in UTF-8 if it has other letters.
    fn text(text: &str) -> Text {
        Text::new_or_none(text).unwrap_or_else(|| Text::from_slice_unchecked(text.as_bytes()))
    }

    fn channels(pixel: Pixel, picture: Picture<'_>) -> AnyChannels<FlatSamples> {
        let names: &[&str] = match pixel {
            Pixel::Value => &["Y"],
            Pixel::Channels => &["R", "G", "B"],
            Pixel::Light => &["R", "G", "B", "A"],
        };
        let numbers = |n| picture.iter().skip(n).step_by(names.len()).copied().collect();
        let channel = |(n, name): (usize, &&str)| AnyChannel::new(*name, FlatSamples::F32(numbers(n)));
        AnyChannels::sort(names.iter().enumerate().map(channel).collect())
    }

    /// The system's error, if there was one.
    fn cause(error: Error) -> io::Error {
        match error {
            Error::Io(e) => e,
            other => io::Error::other(other),
        }
    }
}
