//! Helpers that several topics share.

pub(crate) mod computed;
pub(crate) mod exact;
pub(crate) mod formula;
pub(crate) mod http;
pub(crate) mod memory;
pub(crate) mod random;
pub(crate) mod samples;
pub(crate) mod series;
pub(crate) mod views;

use memory::Memory;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tempfile::NamedTempFile;
use wavesplat::base::grid::Grid;
use wavesplat::base::mapped::Access;
use wavesplat::base::progress::Silent;
use wavesplat::convert::{Basis, ConvertConfig, ConvertReport, MissingPolicy, convert};
use wavesplat::extract::{ExtractConfig, extract};
use wavesplat::file::CoefficientFile;
use wavesplat::render::{Pixel, Quantity, RenderConfig, RenderReport, Scene, render};
use wavesplat::source::{FrameSource, read_frames};
use wavesplat::view::camera::View;
use wavesplat::view::footprint::Kernel;
use wavesplat_core::codec::encode::Encoder;
use wavesplat_format::{BlockId, EncodedBlock, Metadata, WindowEnd, WindowRecord, Writer};

/// A memory budget that suffices for every test.
pub(crate) const MEMORY: usize = 256 << 20;

/// Every basis; those that [Dobashi](wavesplat::bibliography) does not have come with a pyramid.
pub(crate) const BASES: [Basis; 4] = [Basis::Haar, Basis::Multi, Basis::Samples, Basis::Learned];

/// Every basis with a window length of `n`, or `n + 1` if the basis needs it.
pub(crate) fn windows(n: usize) -> [(Basis, usize); 4] {
    BASES.map(|basis| (basis, n + usize::from(basis == Basis::Multi)))
}

/// A pointwise bound; missing samples are kept.
pub(crate) fn settings(basis: Basis, window: usize, tolerance: f64) -> ConvertConfig {
    let (coding, missing) = (basis.into(), MissingPolicy::Mask);
    let plain = ConvertConfig { refuse_fill: false, ..ConvertConfig::new(tolerance) };
    ConvertConfig { coding, window, missing, level: 1, memory: MEMORY, ..plain }
}

/// A coefficient file without a folder of its own: thousands of folders take longer to create than their files to write.
pub(crate) struct Stored {
    file: NamedTempFile,
    pub(crate) report: ConvertReport,
}

impl Stored {
    pub(crate) fn path(&self) -> PathBuf {
        self.file.path().into()
    }

    pub(crate) fn open(&self) -> CoefficientFile {
        CoefficientFile::open_with(self.path(), Access::Read).unwrap()
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        std::fs::read(self.path()).unwrap()
    }
}

pub(crate) fn stored(source: &mut dyn FrameSource, config: &ConvertConfig) -> Stored {
    let mut bytes = Vec::new();
    let report = convert(source, config, Path::new("a.wspl"), &mut bytes, &Silent).unwrap();
    let mut file = tempfile::Builder::new().suffix(".wspl").tempfile().unwrap();
    file.write_all(&bytes).unwrap();
    Stored { file, report }
}

/// A coefficient file in which one block, (window, block), holds wrong samples. The metadata is consistent with them.
pub(crate) fn stored_with_a_lie(
    memory: &Memory,
    config: &ConvertConfig,
    place: (u32, u32),
    lie: impl Fn(&mut EncodedBlock, &mut Metadata),
) -> Vec<u8> {
    let file = stored(&mut memory.clone(), config).open();
    let mut metadata = file.metadata().clone();
    let mut encoder = Encoder::new(config.level).unwrap();
    let mut writer = Writer::new(Vec::new(), file.id(), &metadata).unwrap();
    for window in 0..file.metadata().windows.len() as u32 {
        let times = metadata.times.get(file.window_range(window)).unwrap_or_default().to_vec();
        let begun = WindowEnd::empty(window);
        let record =
            WindowRecord { number: window, window: metadata.windows[window as usize].with_totals(&begun), times };
        writer.begin_window(record).unwrap();
        let (codec, frames) = (file.codec(window).unwrap(), file.window_range(window));
        let samples = memory.clone().window(frames.start, frames.len()).unwrap();
        for block in 0..file.blocks.len() {
            let region = file.blocks.region(block);
            let bytes = read_frames(samples.as_ref(), 0..frames.len(), &region, file.sample()).unwrap();
            let id = BlockId::new(window, 0, block as u32);
            let mut encoded = encoder.block(&codec, id, region.dims(), bytes[..].into(), None).unwrap().block;
            if (id.window, id.block) == place {
                lie(&mut encoded, &mut metadata);
            }
            writer.append(&encoded).unwrap();
        }
        writer.end_window(&WindowEnd::from_window(window, &metadata.windows[window as usize])).unwrap();
    }
    writer.finish().unwrap().0
}

/// All samples of a file.
pub(crate) fn extracted(file: &CoefficientFile) -> Vec<u8> {
    extracted_channel(file, 0)
}

/// All samples of one of its channels.
pub(crate) fn extracted_channel(file: &CoefficientFile, channel: usize) -> Vec<u8> {
    let config = ExtractConfig { channel, memory: MEMORY, ..ExtractConfig::new(file) };
    let mut out = Vec::new();
    extract(file, &config, Path::new("out"), &mut out, &Silent).unwrap();
    out
}

/// All frames and voxels by the exact method with the default kernel.
pub(crate) fn looking(view: View, tau: f64, quantity: Quantity, grid: &Grid, frames: usize) -> RenderConfig {
    let kernel = Kernel::new(None, tau, grid).unwrap();
    let frames = (0..frames).collect();
    RenderConfig {
        views: vec![view],
        kernel,
        quantity,
        frames,
        paired: false,
        region: None,
        splat_error: 0.0,
        fast: false,
        allowed: None,
        error: Default::default(),
        certify: false,
        memory: MEMORY,
        mode: Default::default(),
    }
}

/// Renders the pictures, one after another.
pub(crate) fn pictures(scene: &mut dyn Scene, config: &RenderConfig) -> (Vec<f32>, RenderReport) {
    let (pictures, _, report) = rendered(scene, config);
    (pictures, report)
}

/// Renders the pictures and, if requested, their certified errors.
pub(crate) fn rendered(scene: &mut dyn Scene, config: &RenderConfig) -> (Vec<f32>, Vec<f32>, RenderReport) {
    rendered_if_it_can_be(scene, config).unwrap()
}

/// Like the above; returns the error if rendering is refused.
pub(crate) fn rendered_if_it_can_be(
    scene: &mut dyn Scene,
    config: &RenderConfig,
) -> wavesplat::base::error::Result<(Vec<f32>, Vec<f32>, RenderReport)> {
    let (mut pictures, mut errors, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
    let report = render(scene, config, &Silent, &mut |rendered| {
        numbers.push(rendered.frame);
        pictures.extend_from_slice(rendered.picture);
        errors.extend_from_slice(rendered.error.unwrap_or_default());
        Ok(())
    })?;
    assert_eq!(numbers, config.frames);
    let numbers = if config.mode.pixel() == Pixel::Light { pictures.len() / 4 } else { pictures.len() };
    assert_eq!(errors.len(), if config.certify { numbers } else { 0 });
    Ok((pictures, errors, report))
}

/// The unchanged frames of `memory`.
pub(crate) fn direct(memory: &Memory, missing_value: Option<f64>) -> wavesplat::render::FrameScene {
    wavesplat::render::FrameScene::new(Box::new(memory.clone()), missing_value)
}

/// Prints a line on standard error, whether or not the test fails.
pub(crate) fn report(what: &str) {
    std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("{what}\n")).unwrap();
}

/// `WAVESPLAT_CASES`.
fn asked_cases() -> Option<usize> {
    let asked = std::env::var("WAVESPLAT_CASES").ok()?;
    Some(asked.parse().unwrap_or_else(|_| panic!("WAVESPLAT_CASES={asked}: takes a whole number")))
}

/// How often to try all cases: `WAVESPLAT_CASES`, or once.
pub(crate) fn times() -> usize {
    asked_cases().unwrap_or(1)
}

/// How many random cases to try, of `all`: an eighth, or all of them `WAVESPLAT_CASES` times.
pub(crate) fn cases(all: usize) -> usize {
    asked_cases().map_or(all.div_ceil(8), |times| all * times)
}

/// Whether a sweep takes its case `number`: one in `share`, or all with `WAVESPLAT_CASES`.
pub(crate) fn is_taken(number: usize, share: usize) -> bool {
    asked_cases().is_some() || number.is_multiple_of(share)
}

/// Reports how many series were tried since `started`; fails if there are fewer than `least`.
pub(crate) fn tried(series: usize, least: usize, started: Instant) {
    report(&format!("{series} series in {:.1?}", started.elapsed()));
    assert!(series >= least, "only {series} series");
}
