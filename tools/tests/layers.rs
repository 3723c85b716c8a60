//! The benchmark of looser tolerances in small, as a program: every row is there and keeps its certificate.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::process::Command;
use wavesplat_tools::bench::layers::Results;

#[test]
fn an_archive_has_a_row_for_every_tolerance_and_measure() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("mine.npy");
    let program = || Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"));
    let made = program().args(["synth", "moving", "--dims", "16x12x10x8", "-o"]).arg(&input).status();
    assert!(made.unwrap().success());
    let args = ["bench", "layers", "--tolerances", "1e-2,1e-1,1", "-o"];
    let run = program().args(args).arg(folder.path()).arg(&input).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let results: Results = serde_json::from_slice(&fs::read(folder.path().join("layers.json")).unwrap()).unwrap();
    assert_eq!((results.rows.len(), results.rows[0].codes), (1 + 2 * 3, 1.0));
    let bytes = |measure: &str| {
        let of = |limit: &Option<(f64, String)>| limit.as_ref().is_some_and(|(_, name)| name == measure);
        results.rows.iter().filter(|r| of(&r.limit)).map(|r| r.bytes).collect::<Vec<_>>()
    };
    for measure in ["certified", "expected"] {
        assert!(bytes(measure).is_sorted_by(|a, b| a >= b) && bytes(measure)[2] < 0.5, "{:?}", bytes(measure));
    }
    assert_eq!(fs::read(folder.path().join("layers.md")).unwrap(), run.stdout);
    assert!(!folder.path().join("layers-work.wspl").exists());
}
