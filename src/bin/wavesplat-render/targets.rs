//! Which files pictures go to.

use std::path::{Path, PathBuf};
use wavesplat::error::{Error, Result};
use wavesplat::output::STANDARD;
use wavesplat::render::RenderConfig;
use wavesplat::render::sink::{PictureFormat, names_of_views};

/// Where pictures go: a name for each view, or one for all.
pub(crate) struct Targets {
    pub(crate) format: PictureFormat,
    pub(crate) names: Vec<PathBuf>,
}

impl Targets {
    pub(crate) fn new(path: &Path, format: Option<PictureFormat>, config: &RenderConfig) -> Result<Self> {
        let format = format.map_or_else(|| format_of(path), Ok)?;
        let joined = config.frames.len() == 1 && format.takes_all(path);
        Ok(Self { format, names: names_of_views(path, config.views.len(), joined)? })
    }

    /// Which frame each picture is of that goes to one name.
    pub(crate) fn frames(&self, config: &RenderConfig) -> Vec<usize> {
        config.frames.repeat(config.views.len() / self.names.len())
    }

    /// Bytes that writing takes.
    pub(crate) fn memory(&self, config: &RenderConfig) -> Result<usize> {
        let each = self.format.memory(config.views[0].size, self.frames(config).len())?;
        Ok(each * self.names.len())
    }
}

pub(crate) fn parse_format(text: &str) -> std::result::Result<PictureFormat, String> {
    let found = PictureFormat::NAMES.into_iter().find(|(name, _)| *name == text);
    found.map(|(_, format)| format).ok_or_else(|| "one of png npy y4m rgb24 gray16 apng sheet".into())
}

fn format_of(path: &Path) -> Result<PictureFormat> {
    if path == Path::new(STANDARD) {
        return Ok(PictureFormat::Png);
    }
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let format = parse_format(ending).ok().filter(|format| *format != PictureFormat::Sheet);
    format.ok_or_else(|| {
        let what = "the ending says no format: one of png npy y4m rgb24 gray16 apng";
        Error::usage(format!("{}: {what}", path.display()))
    })
}
