//! The benchmark of speed in small, as a program: every command has a row. No time is judged, and the programs are played
//! by a shell.
#![allow(clippy::unwrap_used)]
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

fn speed(output: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"));
    command.args(["bench", "speed", "--dims", "6x5x4x8", "--repeats", "2", "-o"]).arg(output).args(args);
    command.output().unwrap()
}

/// Two programs that note their words, and do what `body` says.
fn programs(folder: &Path, body: &str) {
    fs::create_dir_all(folder).unwrap();
    for name in ["wavesplat", "wavesplat-render"] {
        let path = folder.join(name);
        fs::write(&path, format!("#!/bin/sh\necho \"{name} $*\" >> {}\n{body}\n", folder.join("log").display()))
            .unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
}

#[test]
fn every_command_has_a_row_for_both_builds() {
    let folder = tempfile::tempdir().unwrap();
    let [own, other] = ["own", "other"].map(|name| folder.path().join(name));
    // A shell may end within half a millisecond, which the table rounds to zero.
    programs(&own, "sleep 0.005");
    programs(&other, "sleep 0.005");
    let (own_text, other_text) = (own.to_str().unwrap(), other.to_str().unwrap());
    let run = speed(folder.path(), &["--programs", own_text, "--against", other_text, "--kinds", "smooth,noise"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = fs::read_to_string(folder.path().join("speed.md")).unwrap();
    assert_eq!(text.as_bytes(), run.stdout);
    let rows: Vec<Vec<&str>> = text
        .lines()
        .filter(|line| line.starts_with("| smooth") || line.starts_with("| noise"))
        .map(|line| line.split(" | ").collect())
        .collect();
    assert_eq!(rows.len(), 2 * 21);
    assert!(
        rows.iter().all(|row| row[2..].iter().all(|cell| cell.trim_end_matches(" |").parse::<f64>().unwrap() > 0.0)),
        "{text}"
    );
    let [log, other_log] = [own, other].map(|folder| fs::read_to_string(folder.join("log")).unwrap());
    for log in [&log, &other_log] {
        assert_eq!(log.lines().count(), 2 * (1 + 2 * 21), "the conversion of the file, and two rounds");
    }
    assert!(!log.contains("file1.wspl") && !other_log.contains("file0.wspl"), "each build reads its own file");
    assert!(log.contains("wavesplat-render") && log.contains("--range 0") && !log.contains("FILE"), "{log}");
    assert!(!folder.path().join("speed-work").exists());
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    programs(folder.path(), "exit 3");
    let programs = folder.path().to_str().unwrap();
    let failed = |args: &[&str], code, words: &str| {
        let run = speed(folder.path(), args);
        let text = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.code() == Some(code) && text.contains(words), "{args:?}: {text}");
    };
    failed(&["--threads", "0"], 2, "--threads");
    failed(&["--programs", programs], 3, "convert");
    failed(&["--programs", "nowhere"], 1, "nowhere");
}
