//! The catalogue of numerical stability: the result for every kind of difficult number. `tests/README.md` lists it row
//! by row, and a test below checks that list.

mod arithmetic;
mod images;
mod masks;
mod series;
mod shapes;
mod values;

use crate::bounds::{BOUNDS, Case, Trial};
use crate::common::BASES;
use crate::common::series::{Kind, Mask};
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::sample::SampleType;

/// Converts, extracts and exactly compares samples of a row of voxels (t slowest), with every basis and every bound.
/// Returns the extracted samples.
fn kept(ty: SampleType, mask: Mask, voxels: usize, samples: &[u8], tolerance: f64) -> Vec<Trial> {
    let frames = samples.len() / (voxels * ty.size());
    let codings = BASES.map(|basis| BOUNDS.map(|bound| (basis, bound)));
    let trial = |(basis, bound)| {
        let (kind, window, edge, dims, seed) = (Kind::Mixed, 5, 8, [voxels, 1, 1], 0);
        let case = Case { ty, kind, mask, basis, bound, tolerance, frames, window, edge, dims, seed };
        let trial = case.trial(samples);
        trial.check();
        trial
    };
    codings.concat().into_iter().map(trial).collect()
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let files = entries.flat_map(|p| if p.is_dir() { rust_files(&p) } else { vec![p] });
    files.filter(|p| p.extension().is_some_and(|e| e == "rs")).collect()
}

/// The full name of every test below `tests/`.
fn tests() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut names = Vec::new();
    for file in rust_files(&folder) {
        let text = fs::read_to_string(&file).unwrap();
        let place = file.strip_prefix(&folder).unwrap().with_extension("");
        let parts: Vec<_> = place.iter().map(|p| p.to_str().unwrap()).filter(|p| *p != "mod").collect();
        let module = parts.join("::");
        for (at, _) in text.match_indices("#[test]\n") {
            let name = text[at..].split("fn ").nth(1).unwrap().split('(').next().unwrap();
            names.push(format!("{module}::{name}"));
        }
    }
    names
}

#[test]
fn every_row_of_the_catalogue_names_tests_that_exist() {
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/README.md")).unwrap();
    let tests = tests();
    assert!(tests.len() > 100, "the tests were found");
    let rows: Vec<&str> = readme.lines().filter(|l| l.starts_with("| ") && l.contains(" | ")).collect();
    let rows: Vec<&str> = rows.into_iter().filter(|l| l[2..].starts_with(|c: char| c.is_ascii_digit())).collect();
    let numbers: Vec<usize> = rows.iter().map(|r| r[2..].split(' ').next().unwrap().parse().unwrap()).collect();
    assert_eq!(numbers, Vec::from_iter(1..=32), "the rows of the catalogue");
    for row in &rows {
        let column = row.trim_end_matches('|').rsplit(" | ").next().unwrap();
        let names: Vec<&str> = column.split('`').skip(1).step_by(2).collect();
        assert!(!names.is_empty(), "a row without a test: {row}");
        names.iter().for_each(|n| assert!(tests.iter().any(|t| t == n), "there is no test {n}: {row}"));
    }
    for test in tests.iter().filter(|t| t.starts_with("catalogue::") && t.matches("::").count() > 1) {
        assert!(rows.iter().any(|r| r.contains(&format!("`{test}`"))), "{test} is in no row");
    }
}
