//! The benchmark in small: every stage runs, every promise is kept, an interrupted run goes on. No time is judged.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use wavesplat_tools::bench::plan::Sweep;
use wavesplat_tools::bench::point::Results;
use wavesplat_tools::bench::{Config, run, sanity};

fn bench(output: &Path) -> (Results, Vec<String>) {
    let program = env!("CARGO_BIN_EXE_wavesplat-tools").into();
    let config = Config { sweep: Sweep::quick(), output: output.into(), program, force: false, date: None };
    let mut said = Vec::new();
    let results = run(&config, &mut |line| said.push(line.to_string())).unwrap();
    (results, said)
}

#[test]
fn the_quick_sweep_is_sane_and_resumes_after_an_interruption() {
    let folder = tempfile::tempdir().unwrap();
    let (results, said) = bench(folder.path());
    assert_eq!(sanity::complaints(&results.points), [""; 0]);
    assert!(results.points.iter().any(|p| p.conversion.is_some()) && said.iter().all(|s| s.contains("measuring")));
    #[cfg(target_os = "linux")]
    assert!(results.points.iter().all(|p| p.rendering.peak_bytes.is_some()));
    for name in ["results.md", "time.svg", "size.svg", "conversion.svg"] {
        assert!(fs::metadata(folder.path().join(name)).unwrap().len() > 1000, "{name}");
    }
    let json = fs::read(folder.path().join("results.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Results>(&json).unwrap().points.len(), results.points.len());

    let journal = folder.path().join("points.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 100]).unwrap();
    let (again, said) = bench(folder.path());
    assert_eq!(said.iter().filter(|s| s.contains("measuring")).count(), 1, "the group of the torn line");
    assert_eq!(again.points.len(), results.points.len());
    assert_eq!(again.points[0], results.points[0]);
}
