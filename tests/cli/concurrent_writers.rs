//! Several processes that write the same file at once: one succeeds, the others name the process that holds it.

use super::disturbed_job::{FILE, Job};
use super::{Archive, Run};
use crate::common::{report, times};
use std::time::Instant;

/// Runs one process per command line, all at once.
fn together(job: &Job, more: &[&str]) -> Vec<Run> {
    let children: Vec<_> = more.iter().map(|more| job.command("exec", more).spawn().unwrap()).collect();
    children.into_iter().map(|child| Run::of(&job.line, child.wait_with_output().unwrap())).collect()
}

#[test]
fn one_of_many_conversions_to_one_file_wins() {
    let job = Job::convert(&Archive::smooth([24, 20, 16], 24), "a.npy", "--window 4 --threads 1");
    let (started, mut held, mut existed) = (Instant::now(), 0, 0);
    for round in 0..25 * times() {
        job.reset();
        let resumes = round % 3 == 2; // then the later ones find the file finished
        let runs = together(&job, &[if resumes { "--resume" } else { "" }; 8]);
        let winners = runs.iter().filter(|run| run.code == Some(0)).count();
        assert!(winners == 1 || resumes && winners > 1, "{runs:?}");
        for run in runs.into_iter().filter(|run| run.code != Some(0)) {
            let (holder, exists) = (run.err.contains("is writing it"), run.err.contains("exists already"));
            (held, existed) = (held + usize::from(holder), existed + usize::from(exists));
            assert!(holder || exists, "{run:?}");
            run.fails(2, &[FILE]);
        }
        assert!(job.is_done());
        assert_eq!(job.work.names(), ["a.npy", FILE]);
    }
    report(&format!("{held} found it locked, {existed} found it there, in {:.1?}", started.elapsed()));
}

#[test]
fn many_replacements_of_one_file_each_leave_a_complete_one() {
    let job = Job::convert(&Archive::smooth([24, 20, 16], 24), "a.npy", "--window 4 --threads 1");
    for _ in 0..8 * times() {
        job.reset();
        let runs = together(&job, &["--force"; 6]);
        assert!(runs.iter().any(|run| run.code == Some(0)), "{runs:?}");
        for run in runs.into_iter().filter(|run| run.code != Some(0)) {
            run.fails(2, &[FILE, "is writing it"]);
        }
        assert!(job.is_done());
        assert_eq!(job.work.names(), ["a.npy", FILE]);
    }
}

#[test]
fn an_append_and_a_conversion_at_once_leave_the_result_of_one() {
    let archive = Archive::smooth([24, 20, 16], 24);
    let append = Job::append(&archive, 8, "--window 4 --threads 1");
    let work = &append.work;
    work.wavesplat("convert first.npy -o other.wspl --window 8").ok();
    let other = work.read("other.wspl");
    for round in 0..12 * times() {
        append.reset();
        let convert = format!("exec $WAVESPLAT convert first.npy -o {FILE} --window 8 --force");
        let first = (round % 2 == 0).then(|| work.command("sh").args(["-c", &convert]).spawn().unwrap());
        let appending = append.command("exec", "").spawn().unwrap();
        let converting = first.unwrap_or_else(|| work.command("sh").args(["-c", &convert]).spawn().unwrap());
        let runs = [appending, converting].map(|c| Run::of("both", c.wait_with_output().unwrap()));
        let [appended, converted] = &runs;
        let found = work.read(FILE);
        // One may finish before the other starts. Then the second appends to a different file.
        match [appended.code, converted.code] {
            [Some(0), Some(2)] => assert!(append.is_done()),
            [Some(2 | 4), Some(0)] => assert!(found == other, "{runs:?}"),
            [Some(0), Some(0)] => {
                let frames = work.wavesplat(&format!("info {FILE} --json")).ok().json()["frames"].as_u64();
                assert!(found == other || frames == Some(24), "{runs:?}");
            }
            _ => panic!("{runs:?}"),
        }
        work.wavesplat(&format!("verify {FILE} -q")).ok();
        assert!(!work.path(format!("{FILE}.part")).exists(), "{runs:?}");
    }
}
