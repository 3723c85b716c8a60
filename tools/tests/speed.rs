//! The benchmark of speed in small, as a program: every row is there, measured or with the reason why not. No time is
//! judged, and the peers are played by a shell, so that no Python is needed.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use wavesplat_tools::bench::speed::{Results, Row};

fn speed(output: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"));
    command.args(["bench", "speed", "--small", "-o"]).arg(output).args(args).output().unwrap()
}

fn results(run: &Output, output: &Path) -> Results {
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert_eq!(fs::read(output.join("speed.md")).unwrap(), run.stdout);
    assert!(!output.join("speed-work").exists());
    serde_json::from_slice(&fs::read(output.join("speed.json")).unwrap()).unwrap()
}

/// What was measured of a row, or why nothing was.
fn said(row: &Row) -> bool {
    row.value.map_or(!row.note.is_empty(), |v| v >= 0.0 && v.is_finite())
}

#[test]
fn every_row_has_a_value_or_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let results = results(&speed(folder.path(), &["--large"]), folder.path());
    assert_eq!(results.archives.len(), 3);
    assert!(results.rows.iter().all(said), "{:?}", results.rows.iter().find(|r| !said(r)));
    let of = |words: &str| results.rows.iter().filter(|r| r.target.contains(words)).collect::<Vec<_>>();
    let (files, spacings, threads) = (4, 2, 2);
    for words in ["than the textbook form", "conventional's", "nothing cached", "SZ3", "on the CPU", "Mesa", "zstd"] {
        let views = of(words).into_iter().filter(|r| r.data != "the paper's").count();
        assert_eq!(views, 3 * files * spacings * threads, "{words}");
    }
    for words in ["than the textbook form", "plain read", "largest image error", "rms image error"] {
        assert!(of(words).iter().any(|r| r.value.is_some()), "{words}");
    }
    let errors = of("largest image error").into_iter().filter(|r| r.wanted.is_some()).collect::<Vec<_>>();
    assert!(errors.len() == 3 * spacings && errors.iter().all(|r| r.value.unwrap() < 1e-2), "{errors:?}");
    assert!(of("SZ3").iter().all(|r| r.value.is_none() && r.met.is_none() && r.note.contains("--peers")));
    #[cfg(target_os = "linux")]
    assert_eq!(of("peak heap").iter().filter(|r| r.value.is_some()).count(), 3);
    for archive in &results.archives {
        let frames = &archive.measured["frames 1"];
        assert!(frames.bytes > 0 && frames.bytes <= archive.measured["view auto 1e-2 2.3 px x1"].bytes);
        assert_eq!(archive.measured["true errors"].errors.len(), 1 + 5 + 2);
    }
}

/// Answers for SZ3, and for one of two renderers.
#[cfg(unix)]
const PEERS: &str = r#"
echo '{"tolerance": 1e-2, "peer": "sz3-3d", "bytes": 1, "bound": 0.1, "largest_error": 0.05, "encode_seconds": 9, "decode_seconds": 1e9}'
"#;
#[cfg(unix)]
const VIEWS: &str = r#"
echo '{"renderer": "vtk-cpu", "seconds": [1e9, 2e9]}'
echo '{"renderer": "vtk-mesa", "seconds": null, "why": "VTK is not installed"}'
"#;

#[cfg(unix)]
#[test]
fn given_archives_are_measured_beside_other_programs() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("mine.npy");
    let made = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"))
        .args(["synth", "smooth", "--dims", "9x8x7x20", "--dtype", "i16", "-o"])
        .arg(&input)
        .status();
    assert!(made.unwrap().success());
    let script = folder.path().join("peers.py");
    fs::write(&script, PEERS).unwrap();
    fs::write(folder.path().join("views.py"), VIEWS).unwrap();
    let few = ["--tolerances", "1e-2", "--threads", "1", "--spacings", "2", "--peers", "sh", "--script"];
    let args = [&few[..], &[script.to_str().unwrap(), input.to_str().unwrap()]].concat();
    let results = results(&speed(folder.path(), &args), folder.path());
    assert_eq!(results.archives.len(), 1, "no others are made");
    let row = |words: &str| results.rows.iter().find(|r| r.target.contains(words) && r.data == "mine").unwrap();
    assert_eq!((row("SZ3").met, row("on the CPU").met, row("Mesa").met), (Some(true), Some(true), None));
    assert!(row("Mesa").note.contains("not installed"));
    assert!(row("than the textbook form").note.contains("f32"), "the archive is of integers");
    assert!(input.exists());
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let code = |args: &[&str]| speed(folder.path(), args).status.code();
    assert_eq!(code(&["--threads", "0"]), Some(2));
    assert_eq!(code(&["--script", "x.py"]), Some(2), "goes with --peers");
    assert_eq!(code(&["--repeats", "0"]), Some(2));
}
