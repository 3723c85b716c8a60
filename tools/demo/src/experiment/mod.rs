//! The demo: the experiment of [Dobashi](wavesplat_core::bibliography), sections 4.1 and 4.2, in small, from a solver's frames to
//! figure 5 and table 1.
//!
//! As in the paper, every sample is first turned into red, green and blue, and all methods splat three channels. The
//! costs of the same methods for one channel, coloured after projection, are printed below.

mod figure;
mod table;

use crate::differences::Differences;
use crate::eddy::{Magnet, Plate, eddy_currents};
use crate::output::{Format, Target};
use crate::scenes::{MEMORY, converted, pictures};
use crate::textbook::{self, Splatter};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::colour::{ColourSpace, TransferFunction};
use wavesplat_core::source::{self, FrameSource, OpenOptions};
use wavesplat_core::view::camera::View;
use wavesplat_core::view::footprint::Kernel;
use wavesplat_engine::convert::{Basis, ConvertConfig, ConvertReport};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::verify::{Comparison, verify};
use wavesplat_engine::render::{CoefficientScene, FrameScene, RenderConfig, RenderReport, Scene, SplatSource};

/// The folder of its files.
pub const FOLDER: &str = "demo-output";
/// Frames of the experiment.
pub const FRAMES: usize = 32;
/// The tolerance of the paper, about 5/256.
const TOLERANCE: f64 = 0.02;
/// The splat error that all methods may add.
const SPLAT_ERROR: f64 = TOLERANCE / 10.0;
/// The colours of samples, from small to large. The n-th of N stands at the share (n / N)^2 of the range, because most
/// currents are far smaller than the largest one.
const COLOURS: [u32; 7] = [0xffffff, 0xfee0a0, 0xfdae61, 0xf0603f, 0xc1304b, 0x7a1f70, 0x2c115f];
/// The share of the plate's thickness over which attenuation reaches a factor of e. Currents stay near the face that
/// the magnet passes; a mean through the whole plate would show only the first colours.
const ATTENUATION: f64 = 0.1;

/// The folder of the demo's files, and the size of the experiment.
#[derive(Debug, Clone)]
pub struct Demo {
    /// The folder of all files.
    pub folder: PathBuf,
    /// The plate that carries the currents.
    pub plate: Plate,
    /// Pixels of a picture.
    pub size: [usize; 2],
}

impl Demo {
    /// The size of the paper's experiment, in a folder.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, plate: Plate::default(), size: [240, 240] }
    }

    fn frames(&self) -> PathBuf {
        self.folder.join("frames")
    }

    /// Figure 5.
    pub fn figure(&self) -> PathBuf {
        self.folder.join("figure5.png")
    }
}

/// The settings that all methods share.
#[derive(Debug, Clone, Copy)]
enum Method {
    Conventional,
    Wavelets(Basis, usize),
}

/// In the order of figure 5.
const METHODS: [(&str, Method); 3] = [
    ("conventional", Method::Conventional),
    ("Haar", Method::Wavelets(Basis::Haar, 32)),
    ("Multi", Method::Wavelets(Basis::Multi, 33)),
];

/// One method's pictures and costs.
struct Run {
    name: &'static str,
    /// All frames, one after another.
    pictures: Vec<f32>,
    render: RenderReport,
    /// For methods with coefficients: the conversion, and the comparison with the frames.
    converted: Option<(ConvertReport, Comparison)>,
}

impl Run {
    /// Seconds to transform, to splat (with decoding), and to invert.
    fn seconds(&self) -> [f64; 3] {
        let RenderReport { decode_seconds, splat_seconds, inverse_seconds, .. } = &self.render;
        let transform = self.converted.as_ref().map_or(0.0, |(report, _)| report.seconds);
        [transform, decode_seconds + splat_seconds, *inverse_seconds]
    }

    fn total(&self) -> f64 {
        self.seconds().iter().sum()
    }

    /// Seconds without the transform.
    fn view(&self) -> f64 {
        self.seconds()[1..].iter().sum()
    }

    /// The guaranteed bound; the conventional method needs none.
    fn bound(&self) -> f64 {
        self.converted.as_ref().map_or(0.0, |(report, _)| report.delta)
    }

    /// The largest difference of any pixel and channel from those of another run, as a share of the bound.
    fn pixel_share(&self, truth: &Self) -> f64 {
        Differences::of(&self.pictures, &truth.pictures).largest() / self.bound()
    }
}

/// All runs. The first of each list is the conventional method by the lattice that the others use.
struct Experiment {
    /// With three channels.
    coloured: Vec<Run>,
    /// With one channel.
    plain: Vec<Run>,
    /// The conventional method as the paper has it, with three channels.
    textbook: Run,
}

/// Solves, converts, renders and compares. Draws figure 5 and returns table 1, and where the figure is, as text. Reports progress through `say`.
///
/// # Errors
/// Files cannot be written or read again.
pub fn run(demo: &Demo, say: &mut dyn FnMut(&str)) -> Result<String> {
    let table = table::text(demo, &demo.experiment(say)?);
    Ok(format!("\n{table}\nFigure 5 is {}.\n", demo.figure().display()))
}

/// Writes the solver's frames of |J| (A/m^2) as `frame_0000.npy` and so on.
///
/// # Errors
/// The folder or its files cannot be written.
pub fn write_frames(folder: &Path, plate: Plate, frames: usize) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, "creating", e))?;
    let solution = eddy_currents(plate, Magnet::default(), frames);
    Target::Directory(folder.into(), Format::Npy).write_f32(plate.dims, frames, solution)
}

impl Demo {
    fn source(&self) -> Result<Box<dyn FrameSource>> {
        let spacing = Some([self.plate.spacing; 3]);
        wavesplat_formats::open(&[self.frames()], &OpenOptions { spacing, ..OpenOptions::default() })
    }

    /// All methods with three channels, which figure 5 shows, and with one.
    fn experiment(&self, say: &mut dyn FnMut(&str)) -> Result<Experiment> {
        let [x, y, z] = self.plate.dims;
        say(&format!("solving for eddy currents in a plate under a passing magnet ({x}x{y}x{z}, {FRAMES} frames)"));
        write_frames(&self.frames(), self.plate, FRAMES)?;
        let colours = self.colours()?;
        let coloured = self.all_methods(Some(&colours), say)?;
        figure::draw(self, &coloured, &colours)?;
        say("conventional, three channels, by a table of footprints");
        let textbook = self.textbook(&colours)?;
        Ok(Experiment { coloured, plain: self.all_methods(None, say)?, textbook })
    }

    /// Colours over the range of all samples.
    fn colours(&self) -> Result<TransferFunction> {
        let range = source::value_range(self.source()?.as_mut(), None, &Silent)?;
        let share = |n: usize| n as f64 / (COLOURS.len() - 1) as f64;
        let colour = |rgb: u32| [16, 8, 0].map(|bits| f64::from(rgb >> bits & 0xff) / 255.0);
        let points = COLOURS.iter().enumerate().map(|(n, rgb)| (share(n).powi(2), colour(*rgb))).collect();
        let colours = TransferFunction::from_points(points, ColourSpace::Rgb, None, None).map_err(Error::usage)?;
        colours.over(colours.suitable(range.unwrap_or((0.0, 1.0))))
    }

    /// Three channels if in colour, otherwise one.
    fn all_methods(&self, colours: Option<&TransferFunction>, say: &mut dyn FnMut(&str)) -> Result<Vec<Run>> {
        let channels = colours.map_or("one channel", |_| "three channels");
        let run = |(name, method): (&'static str, Method)| {
            say(&format!("{name}, {channels}"));
            match method {
                Method::Conventional => self.conventional(name, colours),
                Method::Wavelets(basis, window) => self.by_coefficients(name, basis, window, colours),
            }
        };
        METHODS.into_iter().map(run).collect()
    }

    fn conventional(&self, name: &'static str, colours: Option<&TransferFunction>) -> Result<Run> {
        let mut scene = match colours {
            Some(colours) => FrameScene::coloured(self.source()?, None, colours.clone()),
            None => FrameScene::new(self.source()?, None),
        };
        let (pictures, render) = self.pictures(&mut scene)?;
        Ok(Run { name, pictures, render, converted: None })
    }

    /// Every frame by a textbook's table of footprints.
    fn textbook(&self, colours: &TransferFunction) -> Result<Run> {
        let mut source = self.source()?;
        let grid = source.archive().grid;
        let colour = |sample: f32| colours.colour(sample.into()).unwrap_or_default().map(|c| c as f32);
        let (mut pictures, splatter) =
            (Vec::new(), Splatter::new(&grid, &self.view(), self.kernel(&grid)?, textbook::CUT)?);
        let clock = Instant::now();
        textbook::render(source.as_mut(), FRAMES, &splatter, colour, &mut |_, picture| {
            pictures.extend_from_slice(picture.as_flattened());
        })?;
        let render = RenderReport { splat_seconds: clock.elapsed().as_secs_f64(), ..RenderReport::default() };
        Ok(Run { name: "conventional", pictures, render, converted: None })
    }

    fn by_coefficients(
        &self,
        name: &'static str,
        basis: Basis,
        window: usize,
        colours: Option<&TransferFunction>,
    ) -> Result<Run> {
        let ending = colours.map_or("-one-channel.wspl", |_| ".wspl");
        let path = self.folder.join(name.to_lowercase() + ending);
        let config = ConvertConfig {
            coding: basis.into(),
            window,
            colours: colours.cloned(),
            memory: MEMORY,
            ..ConvertConfig::new(TOLERANCE)
        };
        let report = converted(self.source()?.as_mut(), &config, &path)?;
        let open = || CoefficientFile::open(&path);
        let compared = verify(&open()?, Some(self.source()?.as_mut()), MEMORY, &Silent)?.against.unwrap_or_default();
        let (pictures, render) = self.pictures(&mut CoefficientScene::new(open()?, SplatSource::Coefficients))?;
        Ok(Run { name, pictures, render, converted: Some((report, compared)) })
    }

    /// Seen from above, where the magnet passes.
    fn view(&self) -> View {
        View { azimuth: 0.0, elevation: 90.0, roll: 0.0, size: self.size, scale: None, center: None }
    }

    fn kernel(&self, grid: &Grid) -> Result<Kernel> {
        let thickness = self.plate.spacing * self.plate.dims[2] as f64;
        Kernel::new(None, 1.0 / (ATTENUATION * thickness), grid)
    }

    /// All frames of a scene.
    fn pictures(&self, scene: &mut dyn Scene) -> Result<(Vec<f32>, RenderReport)> {
        let kernel = self.kernel(scene.grid())?;
        let config = RenderConfig { kernel, splat_error: SPLAT_ERROR, ..RenderConfig::new(scene, self.view()) };
        pictures(scene, &config)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_small_plate_gives_the_figure_and_a_table_within_the_bound() {
        let folder = tempfile::tempdir().unwrap();
        let plate = Plate { dims: [38, 38, 11], spacing: 4e-3, ..Plate::default() };
        let demo = Demo { folder: folder.path().into(), plate, size: [72, 48] };
        let mut said = 0;
        let experiment = demo.experiment(&mut |_| said += 1).unwrap();
        assert_eq!(said, 8, "the solver, three methods twice, and the textbook's");
        let table = table::text(&demo, &experiment);
        let Experiment { coloured: runs, textbook, .. } = experiment;
        assert!(table.contains("399.3") && table.contains("1643.0"), "{table}");
        let file = std::io::BufReader::new(fs::File::open(demo.figure()).unwrap());
        let info = png::Decoder::new(file).read_info().unwrap().info().size();
        assert!(info.0 as usize > 4 * 72 && info.1 as usize > 5 * 48, "{info:?}");
        assert!(runs.iter().all(|run| run.pictures.len() == FRAMES * 72 * 48 * 3));
        let apart = Differences::of(&textbook.pictures, &runs[0].pictures);
        assert!(apart.rms() < Some(0.01), "both conventional methods draw the same: {apart:?}");
        for run in &runs[1..] {
            let (report, compared) = run.converted.as_ref().unwrap();
            assert!((report.delta - TOLERANCE).abs() < 1e-9, "of full brightness: {}", report.delta);
            assert!(compared.largest_share_of_bound <= 1.0 && compared.series_outside == 0, "{compared:?}");
            assert!((0.01..1.0).contains(&run.pixel_share(&runs[0])), "{}", run.pixel_share(&runs[0]));
        }
    }
}
