//! The files that pictures are written to.

use super::args::{Cli, parse_format};
use crate::base::error::{Error, Result};
use crate::base::output::{Output, STANDARD, names_of_views};
use crate::cli::spare_inputs;
use crate::render::sink::{Depth, PictureFormat, Sink, is_ours};
use crate::render::{RenderConfig, Scene, least_memory};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The files of pictures: one for each view, or one for all.
pub(crate) struct Targets {
    pub(crate) format: PictureFormat,
    pub(crate) names: Vec<PathBuf>,
}

impl Targets {
    pub(crate) fn new(path: &Path, format: Option<PictureFormat>, config: &RenderConfig) -> Result<Self> {
        let format = format.map_or_else(|| format_of(path), Ok)?;
        format.check(path)?;
        let joined = match format.takes_all(path) {
            true => config.frames.len() == 1 || config.paired || format == PictureFormat::Page,
            false => config.paired && config.frames.is_sorted_by(|a, b| a < b),
        };
        Ok(Self { format, names: names_of_views(path, config.views.len(), joined)? })
    }

    /// The view and the frame of each picture in the file of this number.
    pub(crate) fn shown(&self, name: usize, config: &RenderConfig) -> Vec<(usize, usize)> {
        let mut shown = config.shown();
        shown.retain(|(view, _)| self.names.len() == 1 || *view == name);
        shown
    }

    /// Bytes of memory that writing takes.
    pub(crate) fn memory(&self, depth: Depth, config: &RenderConfig) -> Result<usize> {
        let each = config.shown().len() / self.names.len();
        Ok(self.format.memory(depth, config.views[0].size, each)? * self.names.len())
    }
}

impl Cli {
    /// Bytes of memory that are left for rendering. An error if they are too few.
    pub(crate) fn memory_besides_sinks(
        &self,
        scene: &dyn Scene,
        (pictures, errors): &(Targets, Option<Targets>),
        config: &RenderConfig,
    ) -> Result<usize> {
        let errors = errors.as_ref().map_or(Ok(0), |errors| errors.memory(self.depth, config))?;
        let taken = pictures.memory(self.depth, config)? + errors;
        let needed = least_memory(scene, config)? + taken;
        if needed > config.memory {
            let ([width, height], mib) = (self.size.0, needed.div_ceil(1 << 20));
            let what = format!("pictures of {width}x{height} pixels of this volume need at least {mib}MiB");
            return Err(Error::setting("memory", what));
        }
        Ok(config.memory - taken)
    }

    /// The files for pictures and for their errors. No file may be written twice, and no input may be overwritten.
    pub(crate) fn targets(&self, config: &RenderConfig) -> Result<(Targets, Option<Targets>)> {
        if self.format.is_none() {
            refuse_video(&self.inputs, &self.output)?;
        }
        let pictures = Targets::new(&self.output, self.format, config)?;
        self.colour.check(pictures.format, self.around.is_asked())?;
        let errors = self.error_image.as_ref().map(|path| Targets::new(path, None, config)).transpose()?;
        if self.error_image.as_deref() == Some(Path::new(STANDARD)) {
            return Err(Error::usage("--error-image: needs a file, not standard output"));
        }
        let are_png = [Some(&pictures), errors.as_ref()].into_iter().flatten().any(|targets| targets.format.is_png());
        if self.depth == Depth::Sixteen && !are_png {
            let what = "is for png, apng and sheet; gray16 always has 16 bits, npy and exr hold floats";
            return Err(Error::usage(format!("--depth 16: {what}")));
        }
        let mut written = HashSet::new();
        if let Some(path) = &self.sidecar {
            self.check_sidecar(path)?;
            written.insert(path.clone());
        }
        for targets in [Some(&pictures), errors.as_ref()].into_iter().flatten() {
            for (n, name) in targets.names.iter().enumerate() {
                spare_inputs(&self.inputs, name)?;
                let frames: Vec<usize> = targets.shown(n, config).into_iter().map(|(_, frame)| frame).collect();
                let paths = Sink::paths(name, targets.format, &frames)?;
                if let Some(twice) = paths.into_iter().find(|path| !written.insert(path.clone())) {
                    let what = "would be written twice; give the pictures, --error-image and --sidecar different names";
                    return Err(Error::usage(format!("{}: {what}", twice.display())));
                }
            }
        }
        Ok((pictures, errors))
    }

    fn check_sidecar(&self, path: &Path) -> Result<()> {
        if path == Path::new(STANDARD) {
            return Err(Error::usage("--sidecar: needs a file; --json prints the report"));
        }
        spare_inputs(&self.inputs, path)?;
        Output::check(path, self.force || is_ours(path))
    }
}

impl Cli {
    /// Whether pictures go to a web page.
    pub(crate) fn is_page(&self) -> bool {
        self.format.or_else(|| format_of(&self.output).ok()) == Some(PictureFormat::Page)
    }
}

fn format_of(path: &Path) -> Result<PictureFormat> {
    if path == Path::new(STANDARD) {
        return Ok(PictureFormat::Png);
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let format = parse_format(extension).ok().filter(|format| *format != PictureFormat::Sheet);
    format.ok_or_else(|| {
        let what = match extension {
            "" => "has no extension".into(),
            other => format!("no pictures are written as .{other}"),
        };
        let formats = "take .png for a picture, .apng or .mp4 for a moving one, .html for a page, or webm gif npy y4m rgb24 gray16 exr";
        Error::usage(format!("{}: {what}; {formats}", path.display()))
    })
}

/// Extensions of other videos. ffmpeg makes them from a stream of pictures.
const VIDEOS: [&str; 3] = ["mov", "avi", "mkv"];

/// If `output` is the name of a video, an error with the command that makes it.
fn refuse_video(inputs: &[PathBuf], output: &Path) -> Result<()> {
    let ending = output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if !VIDEOS.contains(&ending.as_str()) {
        return Ok(());
    }
    let (name, pixels) = (output.display(), " -pix_fmt yuv420p");
    let inputs: Vec<_> = inputs.iter().map(|input| input.to_string_lossy()).collect();
    let pipe = format!("wavesplat-render {} -o - --format y4m | ffmpeg -i -{pixels} {name}", inputs.join(" "));
    Err(Error::usage(format!("{name}: write .mp4, .webm or .gif, or type: {pipe}")))
}
