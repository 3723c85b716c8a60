//! The demo: the paper's experiment in small (sections 4.1 and 4.2), from a solver's frames to figure 5 and table 1.

use crate::diff::measure::Differences;
use crate::eddy::{Magnet, Plate, eddy_currents};
use crate::output::{Format, Shape, Target};
use crate::sheet::{Image, contact_sheet, difference_images};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use wavesplat::camera::View;
use wavesplat::colour::{Norm, Scale, TransferFunction};
use wavesplat::convert::{ConvertConfig, ConvertReport, convert};
use wavesplat::error::{Error, Result};
use wavesplat::file::CoefficientFile;
use wavesplat::footprint::Kernel;
use wavesplat::mapped::Access;
use wavesplat::output::Output;
use wavesplat::progress::Silent;
use wavesplat::render::{CoefficientScene, FrameScene, Quantity, RenderConfig, RenderReport, Scene, What, render};
use wavesplat::sample::SampleType;
use wavesplat::source::{self, FrameSource, OpenOptions};
use wavesplat::verify::{Comparison, verify};
use wavesplat::wavelet::Basis;

/// Frames of the experiment.
pub const FRAMES: usize = 32;
/// The tolerance of the paper, about 5/256.
const TOLERANCE: f64 = 0.02;
/// The frames that figure 5 shows.
const SHOWN: [usize; 4] = [5, 10, 15, 20];
/// Pixels of a picture.
const SIZE: [usize; 2] = [384, 256];
/// What splatting may add, for all methods alike.
const SPLAT_ERROR: f64 = TOLERANCE / 10.0;
const MEMORY: usize = 512 << 20;

/// Where the demo's files are.
#[derive(Debug, Clone)]
pub struct Files {
    /// The folder of all.
    pub folder: PathBuf,
}

impl Files {
    fn frames(&self) -> PathBuf {
        self.folder.join("frames")
    }

    /// Figure 5.
    pub fn figure(&self) -> PathBuf {
        self.folder.join("figure5.png")
    }
}

/// One method's pictures and what they cost.
struct Run {
    name: &'static str,
    /// All frames, one after another.
    pictures: Vec<f32>,
    render: RenderReport,
    /// Of a method with coefficients: the conversion, and the comparison with the frames.
    converted: Option<(ConvertReport, Comparison)>,
}

/// Solves, converts, renders and compares; draws figure 5 and returns table 1 as text. `say` hears what is going on.
pub fn run(files: &Files, say: &mut dyn FnMut(&str)) -> Result<String> {
    say("solving for eddy currents in a plate under a passing magnet (75x75x20, 32 frames)");
    write_frames(&files.frames(), FRAMES)?;
    say("rendering the frames by the conventional method");
    let conventional = conventional(files)?;
    say("converting and rendering with Haar wavelets");
    let haar = by_coefficients(files, "Haar", Basis::Haar, 32)?;
    say("converting and rendering with multiwavelets");
    let multi = by_coefficients(files, "Multi", Basis::Multi, 33)?;
    let bound = haar.converted.as_ref().map_or(0.0, |(c, _)| c.delta);
    draw(&[&conventional, &haar, &multi], bound, &files.figure())?;
    Ok(table(&[&haar, &multi, &conventional], &conventional.pictures, bound))
}

/// Writes the solver's frames of |J| (A/m^2) as `frame_0000.npy` and so on.
pub fn write_frames(folder: &Path, frames: usize) -> Result<()> {
    let plate = Plate::default();
    let shape = Shape { dims: plate.dims, frames, ty: SampleType::F32 };
    let mut solution = eddy_currents(plate, Magnet::default(), frames);
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, "creating", e))?;
    Target::Directory(folder.into(), Format::Npy).write(&shape, |_, bytes| {
        let values = solution.next().into_iter().flatten();
        bytes.as_chunks_mut().0.iter_mut().zip(values).for_each(|(b, v)| *b = v.to_le_bytes());
    })
}

fn open_frames(files: &Files) -> Result<Box<dyn FrameSource>> {
    let spacing = Some([Plate::default().spacing; 3]);
    source::open(&[files.frames()], &OpenOptions { spacing, ..OpenOptions::default() })
}

fn conventional(files: &Files) -> Result<Run> {
    let mut scene = FrameScene::new(open_frames(files)?, None);
    let (pictures, render) = pictures(&mut scene)?;
    Ok(Run { name: "conventional", pictures, render, converted: None })
}

fn by_coefficients(files: &Files, name: &'static str, basis: Basis, window: usize) -> Result<Run> {
    let path = files.folder.join(format!("{}.wspl", name.to_lowercase()));
    let config = ConvertConfig::new(basis, window, TOLERANCE, MEMORY);
    let mut out = Output::create(&path, true)?;
    let report = convert(open_frames(files)?.as_mut(), &config, &path, &mut out, &Silent)?;
    out.commit()?;
    let open = || CoefficientFile::open(&path, Access::Map);
    let compared = verify(&open()?, Some(open_frames(files)?.as_mut()), MEMORY, &Silent)?.against.unwrap_or_default();
    let (pictures, render) = pictures(&mut CoefficientScene::new(open()?, What::Coefficients))?;
    Ok(Run { name, pictures, render, converted: Some((report, compared)) })
}

/// All frames of a scene, seen obliquely from above; attenuation lets the near face stand out.
fn pictures(scene: &mut dyn Scene) -> Result<(Vec<f32>, RenderReport)> {
    let config = RenderConfig {
        views: vec![View { azimuth: 25.0, elevation: 55.0, roll: 0.0, size: SIZE, scale: None, center: None }],
        kernel: Kernel::new(None, 20.0, scene.grid())?,
        quantity: Quantity::Mean,
        frames: (0..FRAMES).collect(),
        region: None,
        splat_error: SPLAT_ERROR,
        allowed: None,
        limited: Default::default(),
        certify: false,
        memory: MEMORY,
        reserved: 0,
        mode: Default::default(),
    };
    let mut all = Vec::new();
    let report = render(scene, &config, &Silent, &mut |rendered| {
        all.extend_from_slice(rendered.picture);
        Ok(())
    })?;
    Ok((all, report))
}

/// The shown frames out of all pictures.
fn shown(run: &Run) -> Vec<f32> {
    let pixels = SIZE[0] * SIZE[1];
    SHOWN.iter().flat_map(|f| &run.pictures[f * pixels..(f + 1) * pixels]).copied().collect()
}

/// Figure 5: a row for each method, and a row for what each differs from the first.
fn draw(runs: &[&Run], bound: f64, path: &Path) -> Result<()> {
    let brightest = shown(runs[0]).into_iter().fold(0.0, f32::max);
    let rainbow = TransferFunction::open("rainbow")?;
    let map = Scale::new(&rainbow, (0.0, f64::from(brightest)), Norm::Linear, [0; 3])?;
    let mut rows = Vec::new();
    for (letter, run) in ('a'..).zip(runs) {
        let images = shown(run);
        for (frame, picture) in SHOWN.iter().zip(images.chunks_exact(SIZE[0] * SIZE[1])) {
            let image = Image::from_fn(SIZE[0], SIZE[1], |x, y| map.colour(picture[y * SIZE[0] + x]));
            rows.push(labelled(image, &format!("({letter}) {} frame {frame}", run.name)));
        }
    }
    for (letter, run) in ('a'..).skip(runs.len()).zip(&runs[1..]) {
        for (frame, image) in SHOWN.iter().zip(difference_images(&shown(runs[0]), &shown(run), SIZE, bound)) {
            rows.push(labelled(image, &format!("({letter}) |{} - (a)| frame {frame}", run.name)));
        }
    }
    let file = File::create(path).map_err(|e| Error::io(path, "creating", e))?;
    contact_sheet(&rows, SHOWN.len(), 4, [40; 3]).write_png(file)
}

fn labelled(mut image: Image, text: &str) -> Image {
    image.label(text, 6, 6, 1, [255; 3]);
    image
}

/// Table 1, with what the paper could not say: sizes and errors.
fn table(runs: &[&Run], truth: &[f32], bound: f64) -> String {
    let mut text = String::from(
        "                 seconds, one channel                       against      coefficients  file        largest error / bound\n\
         method           transform  splatting  inverse   total     conventional per sample    bytes       voxel     pixel\n",
    );
    let total = |r: &RenderReport| r.decode_seconds + r.splat_seconds + r.inverse_seconds;
    let reference = runs.last().map_or(0.0, |r| total(&r.render));
    for run in runs {
        let transform = run.converted.as_ref().map_or(0.0, |(c, _)| c.seconds);
        let (splat, inverse) = (run.render.decode_seconds + run.render.splat_seconds, run.render.inverse_seconds);
        let sum = transform + splat + inverse;
        let _ = write!(
            text,
            "{:<16} {transform:>9.3}  {splat:>9.3}  {inverse:>7.3}  {sum:>6.3}  {:>10.2}x",
            run.name,
            reference / sum
        );
        if let Some((c, compared)) = &run.converted {
            let _ = write!(
                text,
                "  {:>12.4}  {:>10}  {:>8.4}  {:>8.4}",
                c.coefficients_per_sample,
                c.output_bytes,
                compared.largest_share_of_bound,
                Differences::of(&run.pictures, truth).largest() / bound
            );
        }
        text.push('\n');
    }
    text.push_str(
        "Paper, 3 colours: Haar 68.0 + 323.3 + 8.0 = 399.3 s (4.1x), Multi 202.8 + 341.6 + 15.4 = 559.8 s (2.9x), conventional 1643.0 s.\n\
         A further view costs no transform. Both sides share footprints among frames; the sum of weights is left out of both.\n",
    );
    text
}
