//! The benchmark of sizes in small, as a program: every row is there and keeps its bound. No time is judged, and the
//! peers are played by a shell, so that no Python is needed.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use wavesplat_tools::bench::size::{BASELINE, Results, SCHEMES, complaints};

fn size(output: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"));
    command.args(["bench", "size", "--small", "--repeats", "1", "--tolerances", "1e-1,1e-3", "-o"]).arg(output);
    command.args(args).output().unwrap()
}

fn results(output: &Path) -> Results {
    serde_json::from_slice(&fs::read(output.join("size.json")).unwrap()).unwrap()
}

#[test]
fn wavesplat_alone_has_a_row_for_every_scheme_and_tolerance() {
    let folder = tempfile::tempdir().unwrap();
    let run = size(folder.path(), &["--kinds", "demo,noise"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let results = results(folder.path());
    assert_eq!(complaints(&results), [""; 0]);
    assert_eq!((results.data[0].dims, results.data[0].frames), ([38, 38, 11], 8));
    assert_eq!(results.rows.len(), 2 * 2 * SCHEMES.len());
    for row in &results.rows {
        let own = row.own.as_ref().unwrap();
        assert!(row.holds() && row.bytes > 0 && row.ratio > 0.5 && own.codes_per_sample > 0.0, "{row:?}");
        assert!(row.encode_seconds > 0.0 && row.decode_seconds > 0.0 && own.codes_seconds > 0.0, "{row:?}");
    }
    let rival = |name: &str| name != BASELINE;
    let judged = results.verdicts.iter().filter(|v| rival(&v.scheme) && v.target == "fewer codes than haar");
    assert_eq!(judged.count(), 2 * 2 * (SCHEMES.len() - 1), "and nothing else is judged");
    let tables = fs::read(folder.path().join("size.md")).unwrap();
    assert_eq!(tables, run.stdout);
    assert!(!folder.path().join("size-work").exists());
}

/// Answers for one peer, which is tiny and slow at the larger tolerance, and huge, fast and wrong at the other.
#[cfg(unix)]
const SCRIPT: &str = r#"
[ "$1" = measure ] || exit 1
echo '{"tolerance": 0.1, "peer": "sz3-4d", "bytes": 1, "bound": 0.1, "largest_error": 0.05, "encode_seconds": 9, "decode_seconds": 1e9}'
echo '{"tolerance": 1e-3, "peer": "sz3-4d", "bytes": 100000000, "bound": 0.1, "largest_error": null, "encode_seconds": 9, "decode_seconds": 1e-9}'
"#;

#[cfg(unix)]
#[test]
fn peers_are_measured_beside_it_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("script.sh");
    fs::write(&script, SCRIPT).unwrap();
    let input = folder.path().join("mine.npy");
    let made = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"))
        .args(["synth", "smooth", "--dims", "9x8x7x20", "--dtype", "i16", "-o"])
        .arg(&input)
        .status();
    assert!(made.unwrap().success());
    let run = size(folder.path(), &[input.to_str().unwrap(), "--peers", "sh", "--script", script.to_str().unwrap()]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let results = results(folder.path());
    assert_eq!(results.data.len(), 1, "no others are made");
    let broken = results.rows.iter().find(|r| r.coder == "sz3-4d" && r.tolerance == 1e-3).unwrap();
    assert!(!broken.holds());
    let met = |target: &str| {
        let of_target = results.verdicts.iter().filter(|v| v.target == target && v.scheme == "default");
        of_target.map(|v| v.met).collect::<Vec<_>>()
    };
    assert_eq!((met("bytes / sz3-4d"), met("bytes / zfp-4d")), (vec![false, true], vec![]));
    assert_eq!(met("faster to values than sz3-4d"), [true, false]);
    assert!(String::from_utf8_lossy(&run.stdout).contains('✗'));
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let code = |args: &[&str]| size(folder.path(), args).status.code();
    assert_eq!(code(&["--kinds", "cloud"]), Some(2), "needs the script");
    assert_eq!(code(&["--script", "x.py"]), Some(2), "goes with --peers");
    assert_eq!(code(&["--peers", "/nowhere/python", "--kinds", "plate"]), Some(1));
    assert_eq!(code(&["--kinds", "demo", "--tolerances", "0"]), Some(2));
}
