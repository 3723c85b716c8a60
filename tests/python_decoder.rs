//! The Python decoder, written from `FORMAT.md` alone, gives the same bytes.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::series::{Kind, Mask, volume};
use crate::common::{extracted_channel, report, settings, stored, times};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use wavesplat::base::grid::Grid;
use wavesplat::base::mapped::Access;
use wavesplat::base::sample::SampleType;
use wavesplat::colour::TransferFunction;
use wavesplat::convert::{Basis, Bound, ConvertConfig, SchemeConstraint, SpatialPredictor};
use wavesplat::file::CoefficientFile;
use wavesplat_format::Keep;

const FILES: usize = 300;

/// Runs the decoder on files; it writes `NAME.out` beside each. Returns its message for each file.
fn decode(python: &str, work: &Path, files: &[PathBuf]) -> Vec<String> {
    let line = |file: &PathBuf| format!("{}\t{}\n", file.display(), file.with_extension("out").display());
    let list = work.join("list");
    fs::write(&list, files.iter().map(line).collect::<String>()).unwrap();
    let module = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/python/wspl.py");
    let output = Command::new(python).arg(module).arg("extract-many").arg(list).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(said.lines().count(), files.len(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    said.lines().map(str::to_string).collect()
}

/// A random file.
fn random_file(random: &mut Random) -> Vec<u8> {
    let dims = [0; 3].map(|_| 1 + random.below(20));
    let ty = SampleType::ALL[random.below(SampleType::ALL.len())];
    let kinds = [Kind::Wave, Kind::Noise, Kind::Ramp, Kind::Steps, Kind::Flash, Kind::Mixed];
    let mask = if ty.is_float() && random.below(3) == 0 { Mask::Special } else { Mask::None };
    let voxels = dims.iter().product();
    let data = volume(kinds[random.below(kinds.len())], ty, mask, voxels, 1 + random.below(40), random.bits());
    let bases = [None, Some(Basis::Haar), Some(Basis::Multi), Some(Basis::Samples), Some(Basis::Learned)];
    let basis = bases[random.below(bases.len())];
    let alone = matches!(basis, Some(Basis::Haar | Basis::Multi | Basis::Learned)) && random.below(2) == 0;
    let space = if alone { SpatialPredictor::Alone } else { SpatialPredictor::Any };
    let window = 1 << random.below(6);
    let window = if basis == Some(Basis::Multi) { window.max(2) + 1 } else { window };
    let plain = settings(Basis::Haar, window, [0.0, 0.2, 0.02, 1e-3, 1e-6][random.below(5)]);
    let bound = [Bound::Pointwise, Bound::Rms, Bound::Relative { floor: 0.1 }][random.below(3)];
    let rainbow = TransferFunction::open("rainbow").unwrap();
    let colours = (random.below(8) == 0).then_some(rainbow); // most values lie beyond the ends of the map
    let block = Some(1 + random.below(24));
    let words = ["", "", "range", "sign", "side=0.3,0 range", "side=-7,-0.25,0.5,9", "sum", "sum range side=0.25"];
    let words = words[random.below(words.len())];
    let keep = if colours.is_some() { Keep::default() } else { Keep::parse(words).unwrap() };
    let config = ConvertConfig { coding: SchemeConstraint { basis, space }, bound, block, colours, keep, ..plain };
    stored(&mut Memory::new(Grid::unit(dims), ty, data), &config).bytes()
}

#[test]
fn python_decodes_the_same_bytes_and_refuses_damage() {
    let Ok(python) = std::env::var("WAVESPLAT_PYTHON") else {
        report("not run: WAVESPLAT_PYTHON names no Python with what tools/python/requirements.txt lists");
        return;
    };
    let (work, mut random) = (tempfile::tempdir().unwrap(), Random(6));
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let (mut files, mut damaged) = (Vec::new(), Vec::new());
    let put = |name: String, bytes: &[u8]| {
        let path = work.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    for name in fs::read_dir(golden).unwrap().map(|e| e.unwrap().path()) {
        let whole = name.extension().is_some_and(|e| e == "wspl") && name.file_stem().is_some_and(|n| n != "lost");
        files.extend(whole.then(|| put(name.file_name().unwrap().to_string_lossy().into(), &fs::read(&name).unwrap())));
    }
    for number in 0..FILES * times() {
        let mut bytes = random_file(&mut random);
        files.push(put(format!("{number}.wspl"), &bytes));
        if number % 3 == 0 {
            let bit = random.below(8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
            damaged.push(put(format!("bad{number}.wspl"), &bytes));
        }
    }
    for (file, said) in files.iter().zip(decode(&python, work.path(), &files)) {
        assert!(said.starts_with("ok "), "{said}");
        let open = CoefficientFile::open_with(file, Access::Read).unwrap();
        let expected: Vec<u8> = (0..open.channels()).flat_map(|channel| extracted_channel(&open, channel)).collect();
        assert!(fs::read(file.with_extension("out")).unwrap() == expected, "{}", file.display());
    }
    for said in decode(&python, work.path(), &damaged) {
        assert!(said.starts_with("damaged "), "{said}");
    }
    report(&format!("Python: {} files decoded to the same bytes, {} refused", files.len(), damaged.len()));
}
