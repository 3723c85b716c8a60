//! The files that pictures are written to.

use super::annotations::is_annotated;
use super::colours::check_format;
use super::request::PictureRequest;
use crate::base::choice::Choice;
use crate::base::error::{Error, Result};
use crate::base::inputs::spare_inputs;
use crate::base::output::{Output, STANDARD, names_of_views};
use crate::render::sink::{Depth, PictureFormat, Sink, is_ours};
use crate::render::{RenderConfig, Scene, least_memory};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The files of pictures: one for each view, or one for all.
pub(super) struct Targets {
    pub(super) format: PictureFormat,
    pub(super) names: Vec<PathBuf>,
}

impl Targets {
    pub(super) fn new(path: &Path, format: Option<PictureFormat>, config: &RenderConfig) -> Result<Self> {
        let format = format.map_or_else(|| format_of(path), Ok)?;
        format.check(path)?;
        let joined = match format.takes_all(path) {
            true => config.frames.len() == 1 || config.paired || format == PictureFormat::Page,
            false => config.paired && config.frames.is_sorted_by(|a, b| a < b),
        };
        Ok(Self { format, names: names_of_views(path, config.views.len(), joined)? })
    }

    /// The view and the frame of each picture in the file of this number.
    pub(super) fn shown(&self, name: usize, config: &RenderConfig) -> Vec<(usize, usize)> {
        let mut shown = config.shown();
        shown.retain(|(view, _)| self.names.len() == 1 || *view == name);
        shown
    }

    /// Bytes of memory that writing takes.
    pub(super) fn memory(&self, depth: Depth, config: &RenderConfig) -> Result<usize> {
        let each = config.shown().len() / self.names.len();
        Ok(self.format.memory(depth, config.views[0].size, each)? * self.names.len())
    }
}

/// The files of pictures, and of their errors.
pub(super) struct AllTargets {
    pub(super) pictures: Targets,
    pub(super) errors: Option<Targets>,
}

impl AllTargets {
    /// The files for pictures and for their errors. No file may be written twice, and no input may be overwritten.
    pub(super) fn new(request: &PictureRequest, inputs: &[PathBuf], config: &RenderConfig) -> Result<Self> {
        if request.format.is_none() {
            refuse_video(inputs, &request.output)?;
        }
        let pictures = Targets::new(&request.output, request.format, config)?;
        check_format(request, pictures.format, is_annotated(request))?;
        let errors = request.error_image.as_ref().map(|path| Targets::new(path, None, config)).transpose()?;
        if request.error_image.as_deref() == Some(Path::new(STANDARD)) {
            return Err(Error::usage("--error-image: needs a file, not standard output"));
        }
        let targets = Self { pictures, errors };
        targets.check_depth(request.depth)?;
        targets.check_names(request, inputs, config)?;
        Ok(targets)
    }

    fn all(&self) -> impl Iterator<Item = &Targets> {
        std::iter::once(&self.pictures).chain(&self.errors)
    }

    fn check_depth(&self, depth: Depth) -> Result<()> {
        if depth == Depth::Sixteen && !self.all().any(|targets| targets.format.is_png()) {
            let what = "is for png, apng and sheet; gray16 always has 16 bits, npy and exr hold floats";
            return Err(Error::usage(format!("--depth 16: {what}")));
        }
        Ok(())
    }

    fn check_names(&self, request: &PictureRequest, inputs: &[PathBuf], config: &RenderConfig) -> Result<()> {
        let mut written = HashSet::new();
        if let Some(path) = &request.sidecar {
            check_sidecar(path, inputs, request.force)?;
            written.insert(path.clone());
        }
        for targets in self.all() {
            for (n, name) in targets.names.iter().enumerate() {
                spare_inputs(inputs, name)?;
                let frames: Vec<usize> = targets.shown(n, config).into_iter().map(|(_, frame)| frame).collect();
                let paths = Sink::paths(name, targets.format, &frames)?;
                if let Some(twice) = paths.into_iter().find(|path| !written.insert(path.clone())) {
                    let what = "would be written twice; give the pictures, --error-image and --sidecar different names";
                    return Err(Error::usage(format!("{}: {what}", twice.display())));
                }
            }
        }
        Ok(())
    }

    /// Bytes of memory that are left for rendering. An error if they are too few.
    pub(super) fn memory_besides(&self, scene: &dyn Scene, depth: Depth, config: &RenderConfig) -> Result<usize> {
        let errors = self.errors.as_ref().map_or(Ok(0), |errors| errors.memory(depth, config))?;
        let taken = self.pictures.memory(depth, config)? + errors;
        let needed = least_memory(scene, config)? + taken;
        if needed > config.memory {
            let ([width, height], mib) = (config.views[0].size, needed.div_ceil(1 << 20));
            let what = format!("pictures of {width}x{height} pixels of this volume need at least {mib}MiB");
            return Err(Error::setting("memory", what));
        }
        Ok(config.memory - taken)
    }
}

fn check_sidecar(path: &Path, inputs: &[PathBuf], force: bool) -> Result<()> {
    if path == Path::new(STANDARD) {
        return Err(Error::usage("--sidecar: needs a file; --json prints the report"));
    }
    spare_inputs(inputs, path)?;
    Output::check(path, force || is_ours(path))
}

/// Whether pictures go to a web page.
pub(super) fn is_page(request: &PictureRequest) -> bool {
    request.format.or_else(|| format_of(&request.output).ok()) == Some(PictureFormat::Page)
}

fn format_of(path: &Path) -> Result<PictureFormat> {
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
