//! Round trips: any samples, converted and decoded, keep their error bound.

use super::files::{read_all, with_file};
use super::input::Input;
use std::io::Cursor;
use std::path::Path;
use wavesplat::base::mapped::Access;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::{SampleType, is_missing, load, store};
use wavesplat::convert::{
    Basis, Bound, ConvertConfig, MissingPolicy, SchemeConstraint, SpatialPredictor, Stencil, convert,
};
use wavesplat::extract::{ExtractConfig, SampleOrder, extract};
use wavesplat::file::CoefficientFile;
use wavesplat::file::verify::verify;
use wavesplat::formats::open_stream;
use wavesplat::source::{FrameSource, OpenOptions};

/// Upper bound on the rounding of a sum or a product in the checks here.
const UP: f64 = 1.0 + 1e-9;
const MEMORY: usize = 1 << 30;

/// Frames, and how to convert them.
#[derive(Debug)]
pub struct Case {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Number of frames.
    pub frames: usize,
    /// Type of the samples.
    pub sample: SampleType,
    /// All samples, little-endian.
    pub bytes: Vec<u8>,
    /// How to convert them.
    pub config: ConvertConfig,
}

impl Case {
    fn new(input: &mut Input<'_>) -> Self {
        let dims = [(); 3].map(|()| 1 + input.below(6));
        let (frames, sample) = (1 + input.below(20), input.pick(&SampleType::ALL));
        let config = config(input);
        let count = dims.iter().product::<usize>() * frames;
        Self { dims, frames, sample, bytes: samples(input, sample, count), config }
    }

    /// The frames as a source.
    pub fn source(&self) -> Box<dyn FrameSource> {
        let dims = Some(self.dims.into_iter().chain([self.frames]).collect());
        let options = OpenOptions { dims, sample: Some(self.sample), ..OpenOptions::default() };
        open_stream(Cursor::new(self.bytes.clone()), &options).expect("samples of these frames")
    }

    /// The file of the frames, unless they cannot be converted with these settings.
    pub fn convert(&self) -> Option<Vec<u8>> {
        let mut file = Vec::new();
        convert(&mut *self.source(), &self.config, Path::new("-"), &mut file, &Silent).ok()?;
        Some(file)
    }
}

fn config(input: &mut Input<'_>) -> ConvertConfig {
    let bases = [None, Some(Basis::Haar), Some(Basis::Multi), Some(Basis::Learned), Some(Basis::Samples)];
    let cubic = SpatialPredictor::Pyramid(Stencil::Cubic);
    let coding = SchemeConstraint {
        basis: input.pick(&bases),
        space: input.pick(&[
            SpatialPredictor::Any,
            SpatialPredictor::Alone,
            SpatialPredictor::Pyramid(Stencil::Linear),
            cubic,
        ]),
    };
    let window = input.pick(&[1, 2, 4, 8, 16, 3, 5, 9, 17, 6]);
    let tolerance = input.pick(&[0.0, 1e-9, 1e-4, 0.01, 0.1, 1.0]);
    let floor = input.pick(&[0.0, 1.0, 1e-300, 1e300]);
    let sampled = Bound::Sampled { samples: 3, seed: 1 };
    ConvertConfig {
        bound: input.pick(&[Bound::Pointwise, Bound::Rms, Bound::Relative { floor }, sampled]),
        missing: input.pick(&[MissingPolicy::Mask, MissingPolicy::Error]),
        missing_value: input.pick(&[None, Some(0.0), Some(1e35), Some(-1.0)]),
        refuse_fill: false, // any number may repeat
        block: Some(1 + input.below(6)),
        coding,
        window,
        memory: MEMORY,
        ..ConvertConfig::new(tolerance)
    }
}

/// Samples made of the bits of an input, repeated, or smooth samples with some of these in between.
fn samples(input: &mut Input<'_>, sample: SampleType, count: usize) -> Vec<u8> {
    let (smooth, scale) = (input.below(3), input.pick(&[1.0, 100.0, 1e-30, 1e30]));
    let bits = if input.rest().is_empty() { &[0] } else { input.rest() };
    let mut bytes: Vec<u8> = bits.iter().copied().cycle().take(count * sample.size()).collect();
    if smooth > 0 {
        let values: Vec<f64> = (0..count).map(|i| ((i as f64 * 0.1).sin() + 1.0) * scale).collect();
        let mut even = vec![0; bytes.len()];
        store(sample, &values, &mut even);
        let every = if smooth == 1 { usize::MAX } else { 7 };
        let one = sample.size();
        let pairs = bytes.chunks_exact_mut(one).zip(even.chunks_exact(one)).enumerate();
        pairs.filter(|(i, _)| i % every != every - 1).for_each(|(_, (bits, even))| bits.copy_from_slice(even));
    }
    bytes
}

/// Converts and decodes samples. A tolerance of 0 keeps every bit, and missing samples always keep theirs.
pub fn roundtrip(data: &[u8]) {
    let case = Case::new(&mut Input::new(data));
    let Some(file) = case.convert() else { return };
    read_all(&file).expect("what was just written is sound");
    with_file(&file, |path| {
        let file = CoefficientFile::open_with(path, Access::Read).expect("what was just written is sound");
        check(&case, &file, path);
        let verified = verify(&file, Some(&mut *case.source()), MEMORY, &Silent).expect("the same frames");
        let against = verified.against.expect("a source was given");
        assert_eq!((verified.damaged, against.series_outside, against.blocks_beyond_stated), (0, 0, 0), "{verified:?}");
    });
}

fn check(case: &Case, file: &CoefficientFile, path: &Path) {
    let mut decoded = Vec::new();
    let (frames, region) = ((0..case.frames).collect(), file.grid.whole());
    let config = ExtractConfig { frames, region, channel: 0, order: SampleOrder::default(), memory: MEMORY };
    extract(file, &config, path, &mut decoded, &Silent).expect("what was just written is sound");
    if case.config.tolerance == 0.0 {
        assert_eq!(decoded, case.bytes, "bits");
    }
    let (given, found) = (numbers(case.sample, &case.bytes), numbers(case.sample, &decoded));
    let declared = file.metadata().missing_value;
    let size = case.sample.size();
    for (i, value) in given.iter().enumerate().filter(|(_, value)| is_missing(**value, declared)) {
        assert_eq!(decoded[i * size..][..size], case.bytes[i * size..][..size], "a missing sample of {value}");
    }
    let voxels = case.dims.iter().product::<usize>();
    for window in 0..file.metadata().windows.len() as u32 {
        let frames = file.window_range(window);
        let so_far = given[..frames.end * voxels].iter().filter(|value| !is_missing(**value, declared));
        let range = so_far.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let delta = match case.config.bound {
            Bound::Sampled { .. } => file.metadata().windows[window as usize].delta,
            _ => case.config.tolerance * (range.1 - range.0).max(0.0),
        };
        for voxel in 0..voxels {
            let at = frames.clone().map(|frame| frame * voxels + voxel);
            let pairs = at.map(|i| (given[i], found[i])).filter(|(value, _)| !is_missing(*value, declared));
            keeps(&case.config, delta, &pairs.collect::<Vec<_>>(), frames.len());
        }
    }
}

/// Whether a series of source and decoded samples keeps its bound.
fn keeps(config: &ConvertConfig, delta: f64, pairs: &[(f64, f64)], frames: usize) {
    let error = |(value, found): (f64, f64)| (value - found).abs();
    let worst = pairs.iter().map(|pair| error(*pair)).fold(0.0, f64::max);
    match config.bound {
        Bound::Pointwise => assert!(worst <= delta * UP, "{worst} of {delta}: {config:?}"),
        Bound::Relative { floor } => {
            let within = |pair: &(f64, f64)| error(*pair) <= config.tolerance * pair.0.abs().max(floor) * UP;
            assert!(pairs.iter().all(within), "{pairs:?}: {config:?}");
        }
        Bound::Rms | Bound::Sampled { .. } => {
            // In units of the largest error, because squares could overflow.
            let squares: f64 = pairs.iter().map(|pair| (error(*pair) / worst.max(f64::MIN_POSITIVE)).powi(2)).sum();
            let rms = worst * (squares / frames as f64).sqrt();
            assert!(rms <= delta * UP, "{rms} of {delta}: {config:?}");
        }
    }
}

fn numbers(sample: SampleType, bytes: &[u8]) -> Vec<f64> {
    let mut values = vec![0.0; bytes.len() / sample.size()];
    load(sample, bytes, &mut values);
    values
}
