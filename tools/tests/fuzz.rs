//! What fuzzers found, and seeds of theirs, on any toolchain: no target of `tools/fuzz` panics on any of these files.
#![allow(clippy::unwrap_used)]

#[path = "../fuzz/src/lib.rs"]
pub mod fuzz;

use fuzz::seeds::SEEDS;
use fuzz::series::Case;
use fuzz::{TARGETS, Target};
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::sample::{SampleType, store};
use wavesplat::convert::{Basis, Bound, ConvertConfig, MissingPolicy};
use wavesplat_format::*;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(name)
}

/// The files of a folder by name; none where there is no folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Gives a target every file of a folder; how many there were.
fn replay(folder: &Path, target: Target) -> usize {
    let files = files(folder);
    for file in &files {
        let bytes = fs::read(file).unwrap();
        let survived = std::panic::catch_unwind(|| target(&bytes)).is_ok();
        assert!(survived, "{}: see above", file.display());
    }
    files.len()
}

#[test]
fn no_target_panics_on_corpus_and_regressions() {
    for (name, target) in TARGETS {
        let seeds = replay(&folder("corpus").join(name), target);
        assert!((1..=6 * SEEDS.len()).contains(&seeds), "{seeds} seeds of {name}");
        replay(&folder("regressions").join(name), target);
        target(&[]);
    }
    for kind in ["corpus", "regressions"] {
        for found in files(&folder(kind)) {
            let name = found.file_name().unwrap().to_str().unwrap();
            assert!(TARGETS.iter().any(|(target, _)| *target == name), "{}: of no target", found.display());
        }
    }
}

#[test]
fn a_dissected_file_reassembles_to_the_same_bytes() {
    for (number, (name, file)) in (0..).zip(SEEDS) {
        let (sound, seed) = fuzz::seeds::seed(number);
        assert_eq!((sound, seed.forge(&[])), (file, file.to_vec()), "{name}");
    }
}

/// Frames of a wave in two windows; every 11th sample is missing, where there is no tolerance or a float can say so.
fn case(sample: SampleType, basis: Basis, window: usize, tolerance: f64) -> Case {
    let (dims, frames): ([usize; 3], _) = ([5, 4, 3], 2 * window);
    let voxels = dims.iter().product::<usize>();
    let holes = sample.is_float() || tolerance == 0.0;
    let value = |i: usize| match (i % 11, i % 53) {
        (10, _) if holes => f64::NAN,
        (_, 52) => 90.0,
        _ => 40.0 + 30.0 * libm::sin(i as f64 * 0.11 + (i / voxels) as f64 * 0.3),
    };
    let values: Vec<f64> = (0..voxels * frames).map(value).collect();
    let mut bytes = vec![0; values.len() * sample.size()];
    store(sample, &values, &mut bytes);
    let (missing, block) = (MissingPolicy::Mask, Some(3));
    let config = ConvertConfig {
        coding: basis.into(),
        window,
        missing,
        block,
        memory: 1 << 30,
        ..ConvertConfig::new(tolerance)
    };
    Case { dims, frames, sample, bytes, config }
}

/// A file of one frame of `blocks` voxels, each a block, some of them exact and the others empty.
fn blocks(like: &[u8], blocks: u64, channels: u16) -> Vec<u8> {
    let like = Reader::open(like).unwrap().metadata().clone();
    let window =
        Window { frames: 1, coefficients: 1, levels: vec![1], basis: Basis::Samples, ..like.windows[0].clone() };
    let known = WindowEnd::from_window(0, &Window { missing: 0, coded: 0, outliers: 0, ..window.clone() });
    let window = Window { pyramid: None, functions: Vec::new(), ..window }.with_totals(&WindowEnd::empty(0));
    let metadata = Metadata { dims: [blocks, 1, 1], block_edge: 1, channels, ..like };
    let mut writer = Writer::new(Vec::new(), FileId([7; 16]), &metadata).unwrap();
    let mut compressor = Compressor::new(3).unwrap();
    let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
    writer.begin_window(WindowRecord { number: 0, window, times: Vec::new() }).unwrap();
    for (channel, block) in (0..channels).flat_map(|channel| (0..blocks as u32).map(move |block| (channel, block))) {
        let id = BlockId::new(0, channel, block);
        let mut parts = vec![compressor.part(PartKind::Exact, stats, &vec![50; metadata.sample.size()]).unwrap()];
        parts.retain(|_| block % 8 == 0);
        let stats = BlockStats { step: 0.0, min: 50.0, max: 50.0, reached: 0.0, squared_error: 0.0, dropped: 0.0 };
        if block % 8 == 3 { writer.append_lost(id) } else { writer.append(&EncodedBlock { id, stats, parts }) }
            .unwrap();
    }
    writer.end_window(&known).unwrap();
    writer.finish().unwrap().0
}

#[test]
#[ignore = "makes missing seeds and inputs of the corpus"]
fn seeds_are_made() {
    let mut multi = case(SampleType::F64, Basis::Multi, 5, 0.02);
    multi.config.bound = Bound::Rms;
    let exact = case(SampleType::U16, Basis::Haar, 4, 0.0).convert().unwrap();
    let files = [
        ("haar", case(SampleType::I16, Basis::Haar, 8, 0.01).convert().unwrap()),
        ("multi", multi.convert().unwrap()),
        ("learned", case(SampleType::F32, Basis::Learned, 6, 0.01).convert().unwrap()),
        ("pyramid", case(SampleType::F16, Basis::Samples, 9, 0.03).convert().unwrap()),
        ("channels", blocks(&exact, 3, 2)),
        ("leaves", blocks(&exact, 520, 1)),
        ("exact", exact),
        ("nested", nested(Basis::Samples, SampleType::F32)),
        ("ghosts", nested(Basis::Learned, SampleType::F64)),
        ("tiers", tiered()),
        ("listed", listed()),
    ];
    let mut corpus = Vec::new();
    for (name, file) in &files {
        keep(&folder("seeds").join(format!("{name}.wspl")), file);
        if *name != "leaves" {
            corpus.push(("file", name.to_string(), file.clone()));
            let metadata = Reader::open(file).unwrap().metadata().encode().unwrap();
            corpus.push(("metadata", name.to_string(), metadata));
        }
    }
    corpus.push(("description", "every_kind".into(), description(&files[0].1)));
    changes(&mut corpus);
    payloads(&mut corpus);
    inputs(&mut corpus);
    for (target, name, bytes) in corpus {
        let folder = folder("corpus").join(target);
        fs::create_dir_all(&folder).unwrap();
        keep(&folder.join(name), &bytes);
    }
}

/// A description with values of every kind, of the file of the target.
fn description(file: &[u8]) -> Vec<u8> {
    let reader = Reader::open(file).unwrap();
    let (metadata, text) = (reader.metadata(), |name: &str| Attribute { name: name.into(), value: Values::text("m") });
    let [x, y, z] = metadata.dims;
    let lengths = [("time", metadata.frames), ("z", z), ("y", y), ("x", x), ("nv", 2)];
    let dimension = |(name, length): (&str, u64)| Dimension { name: name.into(), length, unlimited: name == "time" };
    let roles = [AxisRole::Frames, AxisRole::Z, AxisRole::Y, AxisRole::X];
    let axis = |(dimension, role)| ArrayAxis { dimension, role, reversed: role == AxisRole::Y };
    let variable = |name: &str, dimensions: &[u32], values| Variable {
        name: name.into(),
        dimensions: dimensions.to_vec(),
        values,
        attributes: vec![text("units")],
    };
    let floats = |count: u64| Values::floats(&(0..count).map(|i| i as f64 / 4.0).collect::<Vec<_>>());
    let (directions, spacing) = ([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], [0.5, 1.0, 2.0]);
    let description = Description {
        source: "NetCDF".into(),
        dimensions: lengths.map(dimension).into(),
        axes: (0..).zip(roles).map(axis).collect(),
        attributes: vec![text("long_name")],
        global: vec![text("title")],
        variables: vec![
            variable("time", &[0], Values::Times(NumberType::I64)),
            variable("bounds", &[0, 4], floats(2 * metadata.frames)),
            variable("lat", &[2, 3], floats(x * y)),
            variable("name", &[1], Values::Texts(vec!["level".into(); z as usize])),
        ],
        orientation: Some(Orientation { space: "RAS".into(), first: [1.0; 3], directions, spacing }),
    };
    description.encode(metadata).unwrap()
}

/// A file of version 1.1 whose blocks have ghost nodes.
fn nested(basis: Basis, sample: SampleType) -> Vec<u8> {
    let mut case = case(sample, basis, 9, 1e-3);
    case.config.block = Some(4);
    case.convert().unwrap()
}

/// A file of version 1.2 with three tiers.
fn tiered() -> Vec<u8> {
    let mut case = case(SampleType::F32, Basis::Samples, 5, 1e-2);
    case.config.block = Some(2);
    case.convert().unwrap()
}

/// A file of version 1.2 whose blocks list their values: labels, some of them missing.
fn listed() -> Vec<u8> {
    let mut case = case(SampleType::F32, Basis::Samples, 5, 1e-2);
    let label = |i: usize| if i % 60 == 59 { f32::NAN } else { (i / 7 % 5 * i % 60 / 9) as f32 };
    case.bytes = (0..case.bytes.len() / 4).flat_map(|i| label(i).to_le_bytes()).collect();
    case.convert().unwrap()
}

/// Writes a file that is missing or empty. Others stay: they are of earlier versions.
fn keep(path: &Path, bytes: &[u8]) {
    if fs::read(path).is_ok_and(|held| held.is_empty()) || !path.exists() {
        fs::write(path, bytes).unwrap();
    }
}

type Corpus = Vec<(&'static str, String, Vec<u8>)>;

/// For the targets that change a sound file: each of them, and each place.
fn changes(corpus: &mut Corpus) {
    for seed in 0..SEEDS.len() as u8 {
        let edit = [2 * seed, 0, 20 * seed, 0, seed + 3, 1];
        let name = SEEDS[usize::from(seed)].0.to_string();
        for (azimuth, mode) in [(30, 0), (0, 1), (200, 2)] {
            let picture = [seed, mode, mode + seed, azimuth, seed];
            corpus.push(("render", format!("{name}-{azimuth}"), picture.to_vec()));
            corpus.push(("render", format!("{name}-{azimuth}-edit"), [&picture[..], &edit].concat()));
        }
        for target in ["forged", "decode"] {
            corpus.push((target, name.clone(), [&[seed][..], &edit].concat()));
            corpus.push((target, format!("{name}-twice"), [&[seed][..], &edit, &[4, 0, 16, 0, 5, 4]].concat()));
            corpus.push((target, format!("{name}-whole"), vec![seed]));
        }
        corpus.push(("bare", name.clone(), vec![seed]));
        corpus.push(("bare", format!("{name}-changed"), vec![seed, 200 + seed, 0, seed + 1]));
        corpus.push(("bare", format!("{name}-twice"), vec![seed, 44 + 7 * seed, 1, 255, 90, 2, 1]));
        corpus.push(("prefix", name.clone(), vec![seed, 0xFF, 0xFF]));
        corpus.push(("prefix", format!("{name}-cut"), [&[seed, 20, 0][..], &edit].concat()));
        for how in 0..5 {
            let damage = [how, 40 + how, 0, 3, 100, 0, 20, 0];
            corpus.push(("recovery", format!("{name}-{how}"), [&[seed, 0, 1][..], &damage].concat()));
        }
        corpus.push(("recovery", format!("{name}-forged"), [&[seed, 1, 0][..], &edit].concat()));
    }
    for basis in 0..5 {
        let settings = [4, 3, 2, 11, basis + 3, basis, basis % 4, basis, 3, 0, basis % 4, 0, 0, 2, basis % 3, 1];
        corpus.push(("roundtrip", format!("basis-{basis}"), [&settings[..], &[1, 2, 3, 200, 100, 7]].concat()));
    }
}

fn payloads(corpus: &mut Corpus) {
    let codes: Vec<i32> = (0..48).map(|i| if i % 3 == 0 { (i - 20) * (i - 20) * (i - 20) } else { 0 }).collect();
    let mut raw = Vec::new();
    pack_codes(&codes, &mut raw);
    corpus.push(("codes", "packed".into(), [&[48, 0][..], &raw].concat()));
    raw.clear();
    let few = [CodeBox::contiguous([4, 3, 2, 2])];
    let many = [CodeBox::contiguous([12, 12, 12, 1]), CodeBox::contiguous([5, 1, 1, 1])];
    for (name, packing, byte) in [("flat", Packing::Flat, 0), ("nested", Packing::Nested, 1)] {
        packing.pack(&DenseCodes::one_after_another(&codes, &few), &mut raw);
        let head = [4, 3, 2, 2, 0, 0, 0, 0, 0, 0, 0, 0, byte];
        corpus.push(("cells", format!("packed-{name}"), [&head[..], &raw].concat()));
        raw.clear();
        packing.pack(&DenseCodes::one_after_another(&[1; 12 * 12 * 12 + 5], &many), &mut raw);
        let head = [12, 12, 12, 1, 5, 1, 1, 1, 0, 0, 0, 0, byte];
        corpus.push(("cells", format!("long-{name}"), [&head[..], &raw].concat()));
        raw.clear();
    }
    pack_outliers(&Outliers { positions: vec![0, 3, 4], samples: vec![1, 2, 3, 4, 5, 6] }, 2, &mut raw);
    corpus.push(("payloads", "outliers".into(), [&[1, 9, 0][..], &raw].concat()));
    raw.clear();
    pack_missing(&[true, false, true, false, false], &[1, 2, 3, 4, 5, 6, 7, 8], 4, &mut raw);
    corpus.push(("payloads", "missing".into(), [&[2, 5, 0][..], &raw].concat()));
    corpus.push(("payloads", "exact".into(), vec![0, 4, 0, 1, 2, 3, 4]));
}

fn inputs(corpus: &mut Corpus) {
    let npy = fuzz::sources::NPY;
    let vti = |array: &str, end: &str| {
        format!(
            "<VTKFile type=\"ImageData\" header_type=\"UInt32\"><ImageData WholeExtent=\"0 1 0 1 0 0\" Spacing=\"1 2 3\">\
             <Piece Extent=\"0 1 0 1 0 0\"><PointData Scalars=\"a\"><DataArray Name=\"a\" type=\"UInt8\" {array}\
             </PointData></Piece></ImageData>{end}"
        )
    };
    let appended = "<AppendedData encoding=\"raw\">_\u{4}\0\0\0abcd</AppendedData></VTKFile>";
    let base64 = "format=\"binary\">BAAAAA==YWJjZA==</DataArray>";
    let nrrd = "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 1 2\nencoding: raw\nspacings: 1 2 3 0.5\n";
    let nhdr = nrrd.replace("2 2 1 2", "4 3 2 4") + "endian: little\ndata file: b.raw\n";
    let lists = nrrd.replace("2 2 1 2", "4 6 4 1") + "data file: LIST\nb.raw\n";
    let pvd =
        "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"1\" file=\"b.npy\"/></Collection></VTKFile>";
    let files = [
        ("nrrd", 0, format!("{nrrd}\nabcdefgh")),
        ("nhdr", 1, nhdr),
        ("list", 1, lists),
        ("vti-raw", 2, vti("format=\"appended\" offset=\"0\"/>", appended)),
        ("vti-base64", 2, vti(base64, "</VTKFile>")),
        ("pvd", 3, pvd.into()),
    ];
    for (name, kind, text) in files {
        corpus.push(("inputs", name.into(), [&[kind, 0][..], text.as_bytes()].concat()));
    }
    corpus.push(("inputs", "npy".into(), [&[4, 0][..], npy].concat()));
    corpus.push(("stream", "npy".into(), [&[0][..], npy].concat()));
    corpus.push(("stream", "raw".into(), [&[1, 2, 1, 1, 2, 2, 1, 1][..], b"xabcdefgh"].concat()));
    for text in
        ["1:9:2", "-3:", ":", "7", "1:2,5,-1", "0:4,:,1:", "2x3x4x5", "512MiB", "1,2.5,-3e4", "0.5,1", "640x480"]
    {
        corpus.push(("values", text.replace(':', "_"), [&[99, 0, 9, 9, 9][..], text.as_bytes()].concat()));
    }
}
