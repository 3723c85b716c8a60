//! Progress reports for programs that watch.

use super::{Archive, Run, Work};
use serde_json::Value;

/// The lines of progress that a run prints.
fn lines(run: &Run) -> Vec<Value> {
    let lines = run.err.lines().filter(|line| line.starts_with('{'));
    lines.map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
}

/// Checks that every stage of a run counts up and ends complete.
#[track_caller]
fn counts(run: &Run, stages: &[&str]) {
    let lines = lines(run);
    let mut seen: Vec<&str> = lines.iter().map(|line| line["stage"].as_str().unwrap()).collect();
    seen.dedup();
    assert_eq!(seen, stages, "{}", run.err);
    for stage in stages {
        let of_stage: Vec<&Value> = lines.iter().filter(|line| line["stage"] == *stage).collect();
        let done: Vec<u64> = of_stage.iter().map(|line| line["done"].as_u64().unwrap()).collect();
        let last = of_stage[of_stage.len() - 1];
        assert!(done.is_sorted() && last["done"] == last["total"], "{}", run.err);
        assert!(last["unit"].is_string() && last.get("per_second").is_some() && last.get("seconds_left").is_some());
    }
}

#[test]
fn every_long_command_reports_progress() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([20, 14, 10], 40).npy());
    counts(&work.wavesplat("convert a.npy -o a.wspl --window 8 --progress json").ok(), &["convert"]);
    counts(&work.wavesplat("verify a.wspl --against a.npy --progress json").ok(), &["verify"]);
    counts(&work.wavesplat("extract a.wspl -o b.npy --progress json").ok(), &["extract"]);
    counts(&work.wavesplat("recover a.wspl -o b.wspl --progress json").ok(), &["search", "recover"]);
    counts(&work.wavesplat("append a.wspl a.npy --force --progress json").ok(), &["convert"]);
    counts(&work.render("a.wspl --size 20x20 -o c.npy --progress json").ok(), &["render"]);
    counts(&work.render("a.wspl --size 20x20 --mode mip -o d.npy --progress json").ok(), &["render"]);
    counts(&work.render("a.wspl --size 20x20 --frames 3 -o e.png --progress json").ok(), &["range", "render"]);
    let errors = "a.wspl --size 20x20 --frames 3 -o f.npy --error-image g.png --progress json";
    counts(&work.render(errors).ok(), &["range of errors", "render"]);
    work.write("large.npy", Archive::smooth([80, 80, 80], 2).npy());
    work.wavesplat("convert large.npy -o large.wspl").ok();
    for input in ["large.wspl", "large.npy --method direct"] {
        let run = work.render(&format!("{input} --size 20x20 -o h.png --force --frames 1 --progress json")).ok();
        counts(&run, &["overview", "range", "render"]);
    }
    let colours = "convert a.npy -o c.wspl --transfer-function turbo --progress json";
    counts(&work.wavesplat(colours).ok(), &["values", "convert"]);
}

#[test]
fn progress_is_not_reported_by_default() {
    let work = Work::with_file("");
    for how in ["", "--progress auto", "--progress none", "--progress json -q"] {
        let run = work.wavesplat(&format!("convert a.npy -o a.wspl --force {how}")).ok();
        assert!(lines(&run).is_empty() && run.err.lines().count() <= 1, "{how}: {}", run.err);
    }
    work.wavesplat("convert a.npy -o b.wspl --progress often").fails(2, &["--progress", "auto", "json", "none"]);
}

#[test]
fn a_failing_stage_reports_its_progress() {
    let work = Work::new();
    let archive = Archive::smooth([20, 14, 10], 40);
    let cut = &archive.npy()[..128 + 29 * 11_200];
    let run =
        work.piped("convert - -o a.wspl --window 8 --progress json", cut).fails(3, &["the finished windows are kept"]);
    let lines = lines(&run);
    let last = &lines[lines.len() - 1];
    assert!(last["done"].as_u64() >= Some(3), "{}", run.err);
    let again = work.piped("convert - -o a.wspl --window 8 --progress json --resume", &archive.npy()).ok();
    assert!(again.err.contains("\"done\":5,\"total\":5"), "{}", again.err);
}
