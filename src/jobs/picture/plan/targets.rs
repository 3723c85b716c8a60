//! The files that pictures are written to.

use super::format::format_of;
use crate::picture::request::PictureRequest;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::inputs::spare_inputs;
use wavesplat_core::base::output::{Output, STANDARD, names_of_views};
use wavesplat_engine::render::sink::{Depth, PictureFormat, Sink, is_ours};
use wavesplat_engine::render::{RenderConfig, Scene, least_memory};

/// The files of pictures: one for each view, or one for all.
pub(in crate::picture) struct Targets {
    pub(in crate::picture) format: PictureFormat,
    pub(in crate::picture) names: Vec<PathBuf>,
}

impl Targets {
    pub(in crate::picture) fn new(path: &Path, format: Option<PictureFormat>, config: &RenderConfig) -> Result<Self> {
        let format = format.map_or_else(|| format_of(path), Ok)?;
        format.check(path)?;
        let joined = match format.takes_all(path) {
            true => config.frames.len() == 1 || config.paired || format == PictureFormat::Page,
            false => config.paired && config.frames.is_sorted_by(|a, b| a < b),
        };
        Ok(Self { format, names: names_of_views(path, config.views.len(), joined)? })
    }

    /// The view and the frame of each picture in the file of this number.
    pub(in crate::picture) fn shown(&self, name: usize, config: &RenderConfig) -> Vec<(usize, usize)> {
        let mut shown = config.shown();
        shown.retain(|(view, _)| self.names.len() == 1 || *view == name);
        shown
    }

    /// Bytes of memory that writing takes.
    pub(in crate::picture) fn memory(&self, depth: Depth, config: &RenderConfig) -> Result<usize> {
        let each = config.shown().len() / self.names.len();
        Ok(self.format.memory(depth, config.views[0].size, each)? * self.names.len())
    }
}

/// The files of pictures, and of their errors.
pub(in crate::picture) struct AllTargets {
    pub(in crate::picture) pictures: Targets,
    pub(in crate::picture) errors: Option<Targets>,
}

impl AllTargets {
    /// The files for pictures and for their errors. No file may be written twice, and no input may be overwritten.
    pub(in crate::picture) fn new(request: &PictureRequest, inputs: &[PathBuf], config: &RenderConfig) -> Result<Self> {
        if request.format.is_none() {
            refuse_video(inputs, &request.output)?;
        }
        let pictures = Targets::new(&request.output, request.format, config)?;
        check_format(request, pictures.format, request.is_annotated())?;
        let errors = request.error_image.as_ref().map(|path| Targets::new(path, None, config)).transpose()?;
        if request.error_image.as_deref() == Some(Path::new(STANDARD)) {
            return Err(Error::setting("error_image", "needs a file, not standard output"));
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
            return Err(Error::value("depth", 16, what));
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
                    let what = "would be written twice; give the pictures, `error_image` and `sidecar` different names";
                    return Err(Error::path(twice, what));
                }
            }
        }
        Ok(())
    }

    /// Bytes of memory that are left for rendering. An error if they are too few.
    pub(in crate::picture) fn memory_besides(
        &self,
        scene: &dyn Scene,
        depth: Depth,
        config: &RenderConfig,
    ) -> Result<usize> {
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
        return Err(Error::setting("sidecar", "needs a file; `json` prints the report"));
    }
    spare_inputs(inputs, path)?;
    Output::check(path, force || is_ours(path))
}

/// Extensions of other videos. ffmpeg makes them from a stream of pictures.
const VIDEOS: [&str; 3] = ["mov", "avi", "mkv"];

/// If `output` is the name of a video, an error with the command that makes it.
fn refuse_video(inputs: &[PathBuf], output: &Path) -> Result<()> {
    let ending = output.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if !VIDEOS.contains(&ending.as_str()) {
        return Ok(());
    }
    let name = output.display();
    let inputs: Vec<_> = inputs.iter().map(|input| input.to_string_lossy()).collect();
    let pipe = format!("wavesplat-render {} -o - `format` y4m | ffmpeg -i - {name}", inputs.join(" "));
    Err(Error::path(output, format!("write .mp4, .webm or .gif, or type: {pipe}")))
}

/// An error if a format cannot hold colours or annotations.
pub(in crate::picture) fn check_format(
    request: &PictureRequest,
    format: PictureFormat,
    is_annotated: bool,
) -> Result<()> {
    let in_colours = request.colormap.is_some();
    if format == PictureFormat::Exr && in_colours {
        return Err(Error::setting("colormap", "an .exr holds numbers, not colours; take png with `depth` 16"));
    }
    let why = match format {
        PictureFormat::Gray16 => "gray16 has no colours to draw in; take png, or another format",
        PictureFormat::Exr => "an .exr holds numbers to compute with; take png, or another format",
        PictureFormat::Npy if !in_colours => "an .npy holds values to compute with; give `colormap` for colours",
        _ => return Ok(()),
    };
    if is_annotated { Err(Error::setting("annotate", why)) } else { Ok(()) }
}
