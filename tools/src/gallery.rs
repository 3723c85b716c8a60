//! The gallery: eight pictures of each archive, as `wavesplat-render` draws them with the options written above; and a banner
//! of the first archive over time.

use crate::diff::load::picture;
use crate::plume::plume;
use std::collections::HashSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::base::values::Numbers;
use wavesplat::convert::{ConvertConfig, MissingPolicy};
use wavesplat_cli::{InputArgs, render};
use wavesplat_demo::eddy::Plate;
use wavesplat_demo::experiment::{FRAMES, write_frames};
use wavesplat_demo::output::{Format, Target};
use wavesplat_demo::scenes::{MEMORY, converted};
use wavesplat_demo::sheet::{Image, Style};
use wavesplat_jobs::picture::{Caller, run};

/// The default archives.
pub const USUAL: [&str; 1] = ["plume"];
/// Pixels a side of a picture.
pub const SIDE: usize = 440;
/// Tolerance of all conversions.
const TOLERANCE: f64 = 1e-3;
/// Voxels along x, y and z of the plume, and its frames.
const PLUME: [usize; 4] = [64, 64, 80, 64];
/// The share of an archive's frames after which pictures are taken.
const LATE: f64 = 0.75;
/// The options of the gallery's pictures.
const PICTURES: [&str; 8] = [
    "--colormap viridis",
    "--mode mip --colormap inferno",
    "--mode composite --transfer-function turbo",
    "--mode composite --shade",
    "--iso 30%,70%",
    "--mode slice --slice x=50% --slice y=50% --slice z=50%",
    "--mode composite --opacity 0:0,0.2:0.1,0.3:0,0.6:0,0.7:0.6,0.8:0,1:1",
    "--view top --colormap plasma",
];
const GALLERY: Style = Style { line: 18, ..Style::LIGHT };

/// A picture of the banner.
struct Panel {
    title: &'static str,
    options: &'static str,
    /// The share of the archive's frames after which it is taken.
    time: f64,
}

/// From left to right, over time.
const PANELS: [Panel; 3] = [
    Panel { title: "composite", options: "--mode composite --shade --transfer-function magma", time: 0.45 },
    Panel { title: "surfaces", options: "--iso 20%,60%", time: 0.6 },
    Panel { title: "slices", options: "--mode slice --slice x=50% --slice y=50% --colormap inferno", time: 0.75 },
];
const BANNER: Style = Style { line: 30, ink: [235; 3], paper: [16; 3] };

/// The archives to show, and the output.
#[derive(Debug, Clone)]
pub struct Gallery {
    /// `plume`, `demo`, or inputs as `wavesplat convert` takes them.
    pub archives: Vec<String>,
    /// How inputs are read.
    pub input: InputArgs,
    /// The folder of all files.
    pub folder: PathBuf,
    /// Pixels a side of a picture.
    pub side: usize,
}

/// A converted archive.
struct Archive {
    file: PathBuf,
    frames: u64,
}

impl Gallery {
    /// The sheet of all pictures.
    pub fn sheet(&self) -> PathBuf {
        self.folder.join("gallery.png")
    }

    /// The banner of the first archive.
    pub fn banner(&self) -> PathBuf {
        self.folder.join("banner.png")
    }

    /// Makes, converts and renders all archives. Reports progress through `say`.
    ///
    /// # Errors
    /// Archives cannot be read, two have the same name, or files cannot be written.
    pub fn draw(&self, say: &mut dyn FnMut(&str)) -> Result<()> {
        let names = self.names()?;
        fs::create_dir_all(&self.folder).map_err(|e| Error::io(&self.folder, "creating", e))?;
        let mut sheets = Vec::new();
        for (name, archive) in names.iter().zip(&self.archives) {
            let archive = self.converted(archive, name, say)?;
            if sheets.is_empty() {
                say("drawing the banner");
                self.banner_of(&archive)?.save(&self.banner(), true)?;
            }
            say(&format!("drawing {name}"));
            sheets.push(self.pictures(&archive)?);
        }
        GALLERY.stacked(&sheets).save(&self.sheet(), true)
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

    /// Makes an archive that is not given, and converts it.
    fn converted(&self, archive: &str, name: &str, say: &mut dyn FnMut(&str)) -> Result<Archive> {
        let own =
            InputArgs { spacing: None, origin: None, dims: None, dtype: None, variable: None, ..self.input.clone() };
        let frames = self.folder.join(name);
        let (path, input) = match archive {
            "plume" => {
                say("computing a plume");
                let file = frames.with_extension("npy");
                let [x, y, z, frames] = PLUME;
                let plume = plume([x, y, z], frames);
                Target::File(file.clone(), Format::Npy).write_f32([x, y, z], frames, plume)?;
                (file, own)
            }
            "demo" => {
                say("solving for eddy currents in a plate under a passing magnet");
                let plate = Plate::default();
                write_frames(&frames, plate, FRAMES)?;
                (frames, InputArgs { spacing: Some(Numbers([plate.spacing; 3])), ..own })
            }
            given => (given.into(), self.input.clone()),
        };
        say(&format!("converting {name}"));
        let mut source = input.open_quietly(&[path], MEMORY / 4)?;
        let config = ConvertConfig { missing: MissingPolicy::Mask, memory: MEMORY, ..ConvertConfig::new(TOLERANCE) };
        let file = self.folder.join(format!("{name}.wspl"));
        let report = converted(source.as_mut(), &config, &file)?;
        Ok(Archive { file, frames: report.frames })
    }

    /// The pictures of an archive, with their options above.
    fn pictures(&self, archive: &Archive) -> Result<Image> {
        let frame = (LATE * archive.frames as f64) as usize;
        let titles = PICTURES.map(|options| GALLERY.broken(options, self.side));
        let lines = titles.iter().map(Vec::len).max().unwrap_or(0);
        let mut pictures = Vec::new();
        for (options, mut title) in PICTURES.into_iter().zip(titles) {
            let common = format!("--frames {frame} --size {0}x{0} --annotate=box,bar --theme light", self.side);
            title.resize(lines, String::new());
            pictures.push(GALLERY.titled(&self.picture(archive, &format!("{options} {common}"))?, &title));
        }
        Ok(GALLERY.contact_sheet(&pictures, PICTURES.len() / 2))
    }

    /// A row of pictures over time.
    fn banner_of(&self, archive: &Archive) -> Result<Image> {
        let [r, g, b] = BANNER.paper;
        let mut pictures = Vec::new();
        for Panel { title, options, time } in &PANELS {
            let frame = (time * archive.frames as f64) as usize;
            let size = format!("{}x{}", self.side, self.side * 4 / 3);
            let background = format!("--background #{r:02x}{g:02x}{b:02x}");
            let options = format!("{options} --frames {frame} --size {size} --annotate=box {background}");
            pictures.push(BANNER.titled(&self.picture(archive, &options)?, &[format!("{title}, frame {frame}")]));
        }
        Ok(BANNER.contact_sheet(&pictures, PANELS.len()))
    }

    /// A picture by the options of `wavesplat-render`.
    fn picture(&self, Archive { file, .. }: &Archive, options: &str) -> Result<Image> {
        let path = self.folder.join("picture.png");
        let mut words: Vec<OsString> = vec![file.into(), "--force".into(), "-o".into(), path.clone().into()];
        words.extend(options.split(' ').map(Into::into));
        let parsed = render::parsed(words)?;
        run(&parsed.session, &parsed.request, &Caller(&Silent))?;
        let picture = picture(&path)?;
        fs::remove_file(&path).map_err(|e| Error::io(&path, "removing", e))?;
        Ok(picture)
    }
}

/// The base name of an archive's files.
fn name(archive: &str) -> String {
    let path = Path::new(archive.trim_end_matches('/'));
    path.file_stem().map_or_else(|| "archive".into(), |stem| stem.to_string_lossy().replace(['*', '?'], ""))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::synth::{Kind, Synth};
    use wavesplat::base::sample::SampleType;
    use wavesplat_demo::output::Shape;
    use wavesplat_demo::sheet::Rgb;

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
    fn every_archive_has_eight_pictures() {
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
        assert_eq!(
            said,
            ["converting above", "drawing the banner", "drawing above", "converting signed", "drawing signed"]
        );
        let (sheet, gap) = (picture(&gallery.sheet()).unwrap(), GALLERY.gap());
        assert!(sheet.width == gap + 4 * (40 + gap) && sheet.height > 4 * 40, "{} {}", sheet.width, sheet.height);
        let banner = picture(&gallery.banner()).unwrap();
        let width = 40 + BANNER.gap();
        let shows = |n: usize| {
            let row = |row: &[Rgb]| row[BANNER.gap() + n * width..][..40].iter().any(|pixel| *pixel != BANNER.paper);
            banner.pixels.chunks_exact(banner.width).any(row)
        };
        assert!((0..PANELS.len()).all(shows), "every picture shows something");
    }

    #[test]
    fn files_of_two_archives_are_not_mixed_up() {
        let folder = tempfile::tempdir().unwrap();
        let twice = gallery(folder.path(), vec!["a/run.npy".into(), "b/run.npy".into()]);
        assert_eq!(twice.draw(&mut |_| ()).unwrap_err().exit_code(), 2, "before anything is opened");
        assert_eq!([name("frames/"), name("f_*.vti"), name("/")], ["frames", "f_", "archive"]);
    }
}
