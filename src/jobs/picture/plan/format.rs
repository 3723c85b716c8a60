//! The format of pictures by the name of their file.

use crate::picture::request::PictureRequest;
use std::path::Path;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_engine::render::sink::PictureFormat;

/// Whether pictures go to a web page.
pub(in crate::picture) fn is_page(request: &PictureRequest) -> bool {
    request.format.or_else(|| format_of(&request.output).ok()) == Some(PictureFormat::Page)
}

/// The format of a file, by its extension; PNG for standard output.
pub(in crate::picture) fn format_of(path: &Path) -> Result<PictureFormat> {
    if path == Path::new(STANDARD) {
        return Ok(PictureFormat::Png);
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let format = PictureFormat::named(extension).ok().filter(|format| *format != PictureFormat::Sheet);
    format.ok_or_else(|| {
        let what = match extension {
            "" => "has no extension".into(),
            other => format!("no pictures are written as .{other}"),
        };
        let formats = "take .png for a picture, .apng or .mp4 for a moving one, .html for a page, or webm gif npy y4m rgb24 gray16 exr";
        Error::path(path, format!("{what}; {formats}"))
    })
}
