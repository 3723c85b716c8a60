//! Conversions that go on side by side give the bytes of conversions alone.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::{MEMORY, settings};
use std::path::Path;
use std::sync::{Arc, Mutex};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Conversion, ConvertConfig, ResumePoint, Target, convert, convert_together};
use wavesplat::source::{Archive, FrameSource, FrameWindow};
use wavesplat_format::CompletePrefix;

/// A source that tells which windows were read, and may fail in one of them.
struct Told {
    frames: Memory,
    name: usize,
    read: Arc<Mutex<Vec<(usize, usize)>>>,
    fails_at: Option<usize>,
}

impl FrameSource for Told {
    fn archive(&self) -> &Archive {
        self.frames.archive()
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.read.lock().unwrap().push((self.name, first));
        match self.fails_at {
            Some(frame) if (first..first + count).contains(&frame) => Err(Error::input("a.raw", "is torn")),
            _ => self.frames.window(first, count),
        }
    }
}

const FRAMES: usize = 20;

/// Variables of one archive that differ in all that a variable can have of its own.
fn variables() -> Vec<(Memory, ConvertConfig)> {
    let auto = |config: ConvertConfig| ConvertConfig { coding: ConvertConfig::new(0.0).coding, ..config };
    [
        ([13, 9, 7], SampleType::F32, auto(settings(Basis::Haar, 8, 0.01))),
        ([40, 30, 1], SampleType::I16, auto(settings(Basis::Haar, 4, 0.001))),
        ([5, 6, 7], SampleType::F64, settings(Basis::Multi, 9, 0.02)),
        ([13, 9, 7], SampleType::U8, ConvertConfig { level: 7, ..settings(Basis::Haar, 8, 0.05) }),
        ([20, 20, 20], SampleType::F32, ConvertConfig { block: Some(8), ..auto(settings(Basis::Haar, 8, 0.0)) }),
    ]
    .into_iter()
    .enumerate()
    .map(|(seed, (dims, sample, config))| (waves(seed, dims, sample), config))
    .collect()
}

/// Waves with some noise.
fn waves(seed: usize, dims: [usize; 3], sample: SampleType) -> Memory {
    let (mut random, voxels) = (Random(seed as u64), dims.iter().product::<usize>());
    let mut frames = Vec::new();
    for i in 0..FRAMES * voxels {
        let (t, v) = ((i / voxels) as f64, (i % voxels) as f64);
        let value = 40.0 + 30.0 * (0.1 * v + 0.3 * t + seed as f64).sin() + random.signed();
        crate::common::samples::append(sample, value, &mut frames);
    }
    Memory::new(Grid::unit(dims), sample, frames)
}

fn alone((frames, config): &(Memory, ConvertConfig)) -> Vec<u8> {
    let mut bytes = Vec::new();
    convert(&mut frames.clone(), config, Path::new("a.wspl"), &mut bytes, &Silent).unwrap();
    bytes
}

/// What conversions together did.
struct Done {
    outputs: Vec<Vec<u8>>,
    /// Whether each succeeded.
    is_ok: Vec<bool>,
    /// The variable and the first frame of each window that was read.
    read: Vec<(usize, usize)>,
}

/// Converts the variables together. Each continues the bytes that it has; one may fail in a window.
fn together(variables: &[(Memory, ConvertConfig)], begun: &[Vec<u8>], fails: Option<(usize, usize)>) -> Done {
    let read = Arc::new(Mutex::new(Vec::new()));
    let fails_at = |name| fails.filter(|(failing, _)| *failing == name).map(|(_, frame)| frame);
    let told = |(name, (frames, _)): (usize, &(Memory, ConvertConfig))| Told {
        frames: frames.clone(),
        name,
        read: read.clone(),
        fails_at: fails_at(name),
    };
    let mut sources: Vec<Told> = variables.iter().enumerate().map(told).collect();
    let prefixes: Vec<_> = begun.iter().map(|bytes| CompletePrefix::read(&bytes.as_slice()).ok()).collect();
    let whole = |(bytes, prefix): (&Vec<u8>, &Option<CompletePrefix>)| {
        bytes[..prefix.as_ref().map_or(0, |prefix| prefix.bytes() as usize)].to_vec()
    };
    let mut outputs: Vec<Vec<u8>> = begun.iter().zip(&prefixes).map(whole).collect();
    let resume = |complete| ResumePoint { complete, first_window: 0, description: None };
    let conversions = sources.iter_mut().zip(variables).zip(&mut outputs).zip(prefixes);
    let conversions = conversions.map(|(((source, (_, config)), out), prefix)| Conversion {
        source,
        config,
        target: Target { name: Path::new("a.wspl"), out, resume_from: prefix.map(resume) },
    });
    let is_ok = convert_together(conversions.collect(), &Silent).unwrap().iter().map(Result::is_ok).collect();
    let read = read.lock().unwrap().clone();
    Done { outputs, is_ok, read }
}

#[test]
fn conversions_side_by_side_give_the_bytes_of_each_alone() {
    let variables = variables();
    let expected: Vec<Vec<u8>> = variables.iter().map(alone).collect();
    let Done { outputs, is_ok, read } = together(&variables, &vec![Vec::new(); variables.len()], None);
    assert!(is_ok.iter().all(|is_ok| *is_ok) && outputs == expected);
    // No source is read twice, nor while another is behind it.
    let mut next = vec![0; variables.len()];
    for (name, first) in read {
        assert_eq!(first, next[name], "variable {name}");
        assert!(next.iter().all(|frames| *frames >= first), "{next:?}, {first}");
        next[name] = FRAMES.min(first + variables[name].1.window);
    }
    assert!(next.iter().all(|frames| *frames == FRAMES), "{next:?}");
}

#[test]
fn conversions_side_by_side_go_on_where_each_ended() {
    let variables = variables();
    let expected: Vec<Vec<u8>> = variables.iter().map(alone).collect();
    let mut random = Random(5);
    for _ in 0..6 {
        let begun: Vec<_> = expected.iter().map(|all| all[..random.below(all.len())].to_vec()).collect();
        assert!(together(&variables, &begun, None).outputs == expected);
    }
}

#[test]
fn a_conversion_that_fails_does_not_end_the_others() {
    let variables = variables();
    let expected: Vec<Vec<u8>> = variables.iter().map(alone).collect();
    for failing in 0..variables.len() {
        let frame = 2 * variables[failing].1.window; // in the third window
        let Done { outputs: found, is_ok, .. } =
            together(&variables, &vec![Vec::new(); variables.len()], Some((failing, frame)));
        for (name, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!((is_ok[name], found == expected), (name != failing, name != failing), "variable {name}");
        }
        let kept = CompletePrefix::read(&found[failing].as_slice()).unwrap();
        assert_eq!(kept.metadata().windows.len(), 2, "its windows before are complete");
        assert!(expected[failing].starts_with(&found[failing][..kept.bytes() as usize]));
    }
}

#[test]
fn a_setting_that_cannot_be_met_ends_all_before_anything_is_read() {
    let mut variables = variables();
    variables[3].1.memory = MEMORY >> 20;
    let (mut first, mut last) = (variables[0].0.clone(), variables[3].0.clone());
    let (mut out, mut none) = (Vec::new(), Vec::new());
    let target = |out| Target { name: Path::new("a.wspl"), out, resume_from: None };
    let conversions = vec![
        Conversion { source: &mut first, config: &variables[0].1, target: target(&mut out) },
        Conversion { source: &mut last, config: &variables[3].1, target: target(&mut none) },
    ];
    let error = convert_together(conversions, &Silent).unwrap_err();
    assert!(error.to_string().contains("memory"), "{error}");
    assert!(out.is_empty() && none.is_empty());
}
