//! The four bounds as convert, info and verify report them.

use super::{Run, Work, small};
use crate::common::memory::Memory;
use crate::common::{settings, stored_with_a_lie};
use wavesplat::base::grid::{BlockGrid, Grid};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::Basis;
use wavesplat_format::{Compressor, EncodedBlock, Metadata, PartKind, PartStats, pack_missing};

const MODES: [(&str, &str); 5] = [
    ("pointwise", "--bound pointwise"),
    ("rms", "--bound rms"),
    ("relative", "--bound relative"),
    ("relative", "--bound relative --floor 0.25"),
    ("sampled", "--bound sampled --samples 40 --seed 7"),
];

/// Runs a command whose standard output is one JSON object.
fn json(work: &Work, args: &str) -> serde_json::Value {
    work.wavesplat(&format!("{args} --json")).ok().json()
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn every_bound_is_reported_kept_and_verified() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    for (name, options) in MODES {
        let done = json(&work, &format!("convert a.npy -o a.wspl --force --tolerance 0.03 {options}"));
        let info = json(&work, "info a.wspl");
        let windows = info["windows"].as_array().unwrap();
        assert_eq!((done["bound"].as_str(), info["bound"].as_str()), (Some(name), Some(name)));
        assert_eq!(done["per_window"], info["windows"], "{options}");
        assert_eq!([&done["guaranteed"], &info["guaranteed"]], [name != "sampled"; 2], "{options}");
        assert_eq!(windows.len(), 2);
        for window in windows {
            let [promised, reached, share, rms] = ["promised", "reached", "share", "rms"].map(|k| number(&window[k]));
            assert!(0.0 < share && share <= 1.0, "{options}: {window}");
            assert!(rms <= reached && rms <= promised, "{options}: {window}");
            assert!(["rms", "sampled"].contains(&name) || reached <= promised, "{options}: {window}");
            assert!(name != "pointwise" || (share * promised / reached - 1.0).abs() < 1e-12, "{options}: {window}");
        }
        let against = json(&work, "verify a.wspl --against a.npy")["against"].clone();
        let share = windows.iter().map(|w| number(&w["share"])).fold(0.0, f64::max);
        let found = number(&against["largest_share_of_bound"]);
        // Both are rounded up, each in a different way.
        assert!((found / share - 1.0).abs() < 1e-9, "{options}: {found} for {share}");
        let text = work.wavesplat("verify a.wspl --against a.npy").ok();
        assert!(text.text().contains(&format!("{name} bound kept")), "{}", text.text());
    }
}

#[test]
fn settings_of_a_bound_are_in_the_file() {
    let work = Work::with_file("--bound relative --floor 0.25 --tolerance 0.03");
    let info = json(&work, "info a.wspl");
    assert_eq!((number(&info["floor"]), &info["samples"]), (0.25, &serde_json::Value::Null));
    let run = work.wavesplat("info a.wspl").ok();
    for words in ["<= 3e-2 x max(|v|, 2.5e-1)", "pyramid (", ": relative error promised 3.0000e-2, reached "] {
        assert!(run.text().contains(words), "'{words}' in\n{}", run.text());
    }
    let work = Work::with_file("--bound sampled --seed 7");
    let info = json(&work, "info a.wspl");
    assert_eq!([number(&info["samples"]), number(&info["seed"])], [300.0, 7.0]);
    assert_eq!(info["floor"], serde_json::Value::Null);
}

#[test]
fn estimates_are_named_as_such_everywhere() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    let estimate = |run: &Run| format!("{}{}", run.text(), run.err).contains("NOT A GUARANTEE");
    for (name, options) in MODES {
        let said = [
            work.wavesplat(&format!("convert a.npy -o a.wspl --force {options}")).ok(),
            work.wavesplat("info a.wspl").ok(),
            work.wavesplat("info a.wspl --json").ok(),
            work.wavesplat("verify a.wspl --against a.npy").ok(),
        ];
        assert_eq!(said.each_ref().map(estimate), [name == "sampled"; 4], "{options}: {said:?}");
    }
}

#[test]
fn settings_of_a_bound_change_bytes_only_with_a_tolerance() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    let options = ["", "--floor 0.5", "--samples 30", "--samples 30 --seed 1", "--samples 31"];
    let mut files = Vec::new();
    for (i, more) in options.into_iter().enumerate() {
        let bound = if i < 2 { "relative" } else { "sampled" };
        work.wavesplat(&format!("convert a.npy -o {i}.wspl --bound {bound} {more}")).ok();
        files.push(work.read(&format!("{i}.wspl")));
    }
    assert!((0..files.len()).all(|i| files[i + 1..].iter().all(|f| *f != files[i])));
    for (_, options) in MODES {
        work.wavesplat(&format!("convert a.npy -o a.wspl --force --tolerance 0 {options}")).ok();
        work.wavesplat("extract a.wspl -o a.raw --force").ok();
        assert!(work.read("a.raw") == small().bytes(), "{options}");
        let info = json(&work, "info a.wspl");
        assert!(info["guaranteed"] == true && info["promise"].as_str().unwrap().contains("every bit"), "{options}");
    }
}

#[test]
fn samples_outside_a_bound_give_code_4() {
    let (work, mut archive) = (Work::new(), small());
    work.write("a.npy", archive.npy());
    let (frame, voxel) = (33, 4 + 20 * (5 + 14 * 6));
    archive.values[frame * 2800 + voxel] += 1.5;
    work.write("other.npy", archive.npy());
    for (_, options) in MODES {
        work.wavesplat(&format!("convert a.npy -o a.wspl --force {options}")).ok();
        let run = work.wavesplat("verify a.wspl --against other.npy -q");
        run.fails(4, &["1 series outside the bound", "frame 33, x 4, y 5, z 6", "times the bound"]);
    }
}

/// Block 5 of window 1 of an archive holds wrong samples. Returns the report of `verify --against`.
fn verify_a_lie(lie: impl Fn(&mut EncodedBlock, &mut Metadata)) -> Run {
    let (work, archive) = (Work::new(), small());
    work.write("a.npy", archive.npy());
    let memory = Memory::new(Grid::unit(archive.dims), SampleType::F32, archive.bytes());
    let config = wavesplat::convert::ConvertConfig { block: Some(8), ..settings(Basis::Haar, 32, 0.01) };
    work.write("lie.wspl", stored_with_a_lie(&memory, &config, (1, 5), lie));
    work.wavesplat("verify lie.wspl --against a.npy -q")
}

#[test]
fn a_block_with_errors_beyond_those_stated_gives_code_4() {
    verify_a_lie(|_, _| ()).ok();
    let words = ["errors above those stated in the file: 1", "block 5 of window 1"];
    verify_a_lie(|b, _| b.stats.reached *= 0.999).fails(4, &words);
    verify_a_lie(|b, _| b.stats.reached = 0.0).fails(4, &words);
    verify_a_lie(|b, _| b.stats.max = b.stats.max.next_down()).fails(4, &words);
    verify_a_lie(|b, _| b.stats.min = b.stats.min.next_up()).fails(4, &words);
}

#[test]
fn a_block_with_coefficients_beyond_those_stated_gives_code_3() {
    let lie = |b: &mut EncodedBlock, _: &mut Metadata| b.parts[0].stats.largest = b.parts[0].stats.largest.next_down();
    verify_a_lie(lie).fails(3, &["window 1 block 5", "larger than the directory says"]);
}

#[test]
fn a_sample_that_is_masked_but_was_not_missing_gives_code_4() {
    let lie = |b: &mut EncodedBlock, m: &mut Metadata| {
        let mut mask = vec![false; 8 * 8 * 8 * m.windows[1].frames as usize];
        let (nx, ny, nz) = (m.dims[0] as usize, m.dims[1] as usize, m.dims[2] as usize);
        let blocks = BlockGrid::cubes([nx, ny, nz], 8);
        mask.truncate(blocks.region(5).voxels() * m.windows[1].frames as usize);
        mask[7] = true;
        let mut raw = Vec::new();
        pack_missing(&mask, &f32::NAN.to_le_bytes(), 4, &mut raw);
        let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
        b.parts.push(Compressor::new(1).unwrap().part(PartKind::Missing, stats, &raw).unwrap());
        b.parts.sort_by_key(|p| p.kind);
        m.windows[1].missing += 1;
    };
    verify_a_lie(lie).fails(4, &["1 series outside the bound"]);
}
