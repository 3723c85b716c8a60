//! The gallery: pictures of archives in every mode, a row for each archive.

mod tiles;

use crate::demo;
use crate::eddy::Plate;
use crate::output::{Format, Shape, Target};
use crate::scenes::{MEMORY, converted, pictures};
use crate::sheet::{GAP, Image, LETTER, Rgb, contact_sheet, stacked, titled};
use crate::synth::{Kind, Synth};
use clap::ValueEnum;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tiles::{SampleStyle, Tile, short};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Region;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::base::values::Numbers;
use wavesplat::colour::{Distribution, TransferFunction};
use wavesplat::convert::{ConvertConfig, MissingPolicy};
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Mode, OverviewRequest, RenderConfig, Scene, SplatSource, Thinning};
use wavesplat::source::FrameSource;
use wavesplat::view::camera::View;
use wavesplat_cli::InputArgs;
use wavesplat_core::base::output::Output;

/// The default archives.
pub const USUAL: [&str; 2] = ["demo", "smooth"];
/// Pixels a side of a picture.
pub const SIDE: usize = 216;
/// Tolerance of all conversions.
const TOLERANCE: f64 = 1e-3;
const WINDOW: usize = 32;
/// Size of synthetic archives.
const SHAPE: Shape = Shape { dims: [64; 3], frames: 32, ty: SampleType::F32 };
/// Azimuth and elevation of pictures.
const VIEW: [f64; 2] = [300.0, 35.0];
const PAPER: Rgb = [40; 3];
const INK: Rgb = [255; 3];

/// The archives to show, and the output.
#[derive(Debug, Clone)]
pub struct Gallery {
    /// `demo`, kinds of synthetic archives, or inputs as `wavesplat convert` takes them.
    pub archives: Vec<String>,
    /// How inputs are read.
    pub input: InputArgs,
    /// The folder of all files.
    pub folder: PathBuf,
    /// Pixels a side of a picture.
    pub side: usize,
}

impl Gallery {
    /// The sheet of all pictures.
    pub fn sheet(&self) -> PathBuf {
        self.folder.join("gallery.png")
    }

    /// Makes, converts and renders all archives. Reports progress through `say`.
    ///
    /// # Errors
    /// Archives cannot be read, two have the same name, or files cannot be written.
    pub fn draw(&self, say: &mut dyn FnMut(&str)) -> Result<()> {
        let names = self.names()?;
        fs::create_dir_all(&self.folder).map_err(|e| Error::io(&self.folder, "creating", e))?;
        let rows = self.archives.iter().zip(&names).map(|(archive, name)| self.row(archive, name, say));
        let rows = rows.collect::<Result<Vec<_>>>()?;
        let mut out = Output::create(&self.sheet(), true)?;
        stacked(&rows, PAPER).write_png(&mut out)?;
        out.commit()
    }

    /// The base name of each archive's files.
    fn names(&self) -> Result<Vec<String>> {
        let names: Vec<String> = self.archives.iter().map(|archive| name(archive)).collect();
        let mut seen = HashSet::new();
        match names.iter().find(|name| !seen.insert(*name)) {
            Some(twice) => Err(Error::usage(format!("{twice}: two archives have that name; give one another"))),
            None => Ok(names),
        }
    }

    /// The pictures of an archive, with a label above each.
    fn row(&self, archive: &str, name: &str, say: &mut dyn FnMut(&str)) -> Result<Image> {
        let input = self.made(archive, name, say)?;
        say(&format!("converting {archive}"));
        let file = self.converted(&input, name, None)?;
        say(&format!("rendering {archive} in all modes"));
        let mut scene = CoefficientScene::new(file.clone(), SplatSource::Coefficients);
        let base = self.base(&scene);
        let look = self.look(&mut scene, &base, &file)?;
        let mut images = Vec::new();
        for tile in look.tiles()? {
            images.push(self.shown(&mut scene, &base, &tile)?);
        }
        say(&format!("converting {archive} again, in colours, and rendering these"));
        let tile = look.before_all()?;
        let file = self.converted(&input, &format!("{name}-colours"), Some(&tile.map))?;
        images.push(self.shown(&mut CoefficientScene::new(file, SplatSource::Coefficients), &base, &tile)?);
        let columns = images.len();
        let sheet = contact_sheet(&images, columns, GAP, PAPER);
        Ok(titled(&sheet, &["", &self.title(name, &scene, &base, look.range)], INK, PAPER))
    }

    fn title(&self, name: &str, scene: &dyn Scene, base: &RenderConfig, range: (f64, f64)) -> String {
        let (lo, hi) = (short(range.0), short(range.1));
        let ([x, y, z], frames) = (scene.grid().dims, scene.frames().unwrap_or(0));
        let [azimuth, elevation] = VIEW;
        let seen = format!("--frames {} --view {azimuth},{elevation}", base.frames[0]);
        format!(" {name}: {x}x{y}x{z} voxels, {frames} frames; {seen}; samples in colours: --range {lo},{hi}")
    }

    /// Makes an archive that is not given; returns its path and how to read it.
    fn made(&self, archive: &str, name: &str, say: &mut dyn FnMut(&str)) -> Result<(PathBuf, InputArgs)> {
        let plain =
            InputArgs { spacing: None, origin: None, dims: None, dtype: None, variable: None, ..self.input.clone() };
        if archive == "demo" {
            say("solving for eddy currents in a plate under a passing magnet");
            let (folder, plate) = (self.folder.join(name), Plate::default());
            demo::write_frames(&folder, plate, demo::FRAMES)?;
            return Ok((folder, InputArgs { spacing: Some(Numbers([plate.spacing; 3])), ..plain }));
        }
        let Ok(kind) = Kind::from_str(archive, false) else { return Ok((archive.into(), self.input.clone())) };
        say(&format!("making {archive}"));
        let path = self.folder.join(format!("{name}.npy"));
        let synth = Synth { kind, shape: SHAPE, seed: 0 };
        Target::File(path.clone(), Format::Npy).write(&SHAPE, |frame, bytes| synth.fill(frame, bytes))?;
        Ok((path, plain))
    }

    /// The file of an archive, in colours if there are some.
    fn converted(
        &self,
        (path, input): &(PathBuf, InputArgs),
        name: &str,
        colours: Option<&TransferFunction>,
    ) -> Result<Arc<CoefficientFile>> {
        let mut source: Box<dyn FrameSource> = input.open_quietly(std::slice::from_ref(path), MEMORY / 4)?;
        let (missing, colours) = (MissingPolicy::Mask, colours.cloned());
        let config =
            ConvertConfig { missing, colours, window: WINDOW, memory: MEMORY, ..ConvertConfig::new(TOLERANCE) };
        let path = self.folder.join(format!("{name}.wspl"));
        converted(source.as_mut(), &config, &path)?;
        CoefficientFile::open(&path).map(Arc::new)
    }

    /// The middle frame, as all modes see it.
    fn base(&self, scene: &dyn Scene) -> RenderConfig {
        let [azimuth, elevation] = VIEW;
        let view = View { azimuth, elevation, roll: 0.0, size: [self.side; 2], scale: None, center: None };
        let (frames, splat_error) = (vec![scene.frames().unwrap_or(0) / 2], TOLERANCE / 2.0);
        RenderConfig { frames, splat_error, ..RenderConfig::new(scene, view) }
    }

    /// Chooses settings that suit the samples, by the largest ones that rays meet.
    fn look(&self, scene: &mut dyn Scene, base: &RenderConfig, file: &CoefficientFile) -> Result<SampleStyle> {
        let mip = RenderConfig { mode: Mode::Mip { slices: None }, ..base.clone() };
        let (largest, _) = pictures(scene, &mip)?;
        let region = Region { start: [0; 3], end: scene.grid().dims };
        let thinning = Thinning { blocks: scene.blocks(), stride: 1 };
        let samples = scene.overview(&OverviewRequest { thinning, frames: &base.frames, region }, &Silent)?;
        let samples = Distribution::new(samples.unwrap_or_default());
        Ok(SampleStyle::new(file.metadata().range(), (samples, &largest), scene.grid()))
    }

    fn shown(&self, scene: &mut dyn Scene, base: &RenderConfig, tile: &Tile) -> Result<Image> {
        let config = RenderConfig { mode: tile.mode.clone(), ..base.clone() };
        let (picture, _) = pictures(scene, &config)?;
        let lines = lines(&tile.label, self.side / LETTER - 1);
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        Ok(titled(&tile.image(&picture, self.side)?, &lines, INK, PAPER))
    }
}

/// The base name of an archive's files.
fn name(archive: &str) -> String {
    let path = Path::new(archive.trim_end_matches('/'));
    path.file_stem().map_or_else(|| "archive".into(), |stem| stem.to_string_lossy().replace(['*', '?'], ""))
}

/// Lines that every label has room for.
const LINES: usize = 5;

/// Breaks a text into lines of limited length, after spaces and commas if possible.
fn lines(text: &str, letters: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_inclusive([' ', ',']) {
        match lines.last_mut() {
            Some(line) if line.len() + word.trim_end().len() <= letters => line.push_str(word),
            _ => lines.push(word.into()),
        }
    }
    lines.resize(LINES, String::new());
    lines
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn gallery(folder: &Path, archives: Vec<String>) -> Gallery {
        Gallery { archives, input: plain(), folder: folder.into(), side: 40 }
    }

    fn plain() -> InputArgs {
        #[derive(clap::Parser)]
        struct Only {
            #[command(flatten)]
            input: InputArgs,
        }
        <Only as clap::Parser>::parse_from(["test"]).input
    }

    #[test]
    fn every_archive_has_a_row_of_eight_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let shape = Shape { dims: [9, 8, 7], frames: 5, ty: SampleType::F32 };
        let archive = |kind, name: &str| {
            let path = folder.path().join(name);
            let synth = Synth { kind, shape, seed: 1 };
            Target::File(path.clone(), Format::Npy).write(&shape, |f, bytes| synth.fill(f, bytes)).unwrap();
            path.to_str().unwrap().to_string()
        };
        let archives = vec![archive(Kind::Smooth, "above.npy"), archive(Kind::Oscillating, "signed.npy")];
        let gallery = gallery(&folder.path().join("out"), archives);
        let mut said = Vec::new();
        gallery.draw(&mut |text| said.push(text.to_string())).unwrap();
        assert_eq!(said.len(), 2 * 3, "{said:?}");
        let file = std::io::BufReader::new(fs::File::open(gallery.sheet()).unwrap());
        let (width, height) = png::Decoder::new(file).read_info().unwrap().info().size();
        assert!(width as usize == GAP + 8 * (40 + GAP) && height > 80, "{width} {height}");
    }

    #[test]
    fn files_of_two_archives_are_not_mixed_up() {
        let folder = tempfile::tempdir().unwrap();
        let twice = gallery(folder.path(), vec!["a/run.npy".into(), "b/run.npy".into()]);
        assert_eq!(twice.draw(&mut |_| ()).unwrap_err().exit_code(), 2, "before anything is opened");
        assert_eq!([name("frames/"), name("f_*.vti"), name("/")], ["frames", "f_", "archive"]);
    }

    #[test]
    fn labels_are_cut_where_they_can_be() {
        assert_eq!(lines("one two,three", 7), ["one ", "two,", "three", "", ""]);
        assert_eq!(lines("one two", 7), ["one two", "", "", "", ""]);
    }
}
