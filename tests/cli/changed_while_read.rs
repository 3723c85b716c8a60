//! Files that change while they are read: the change is reported by name, or the result is that of one state of the
//! file.
#![cfg(unix)]

use super::{Archive, Run, Work};
use crate::common::random::Random;
use crate::common::{report, times};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::FileExt;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// The kinds of changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Change {
    CutInHalf,
    CutByOne,
    Emptied,
    Longer,
    Overwritten,
    Replaced,
    Removed,
}

const CHANGES: [Change; 7] = [
    Change::CutInHalf,
    Change::CutByOne,
    Change::Emptied,
    Change::Longer,
    Change::Overwritten,
    Change::Replaced,
    Change::Removed,
];

impl Change {
    fn apply(self, work: &Work, name: &str) {
        let (path, len) = (work.path(name), work.read(name).len() as u64);
        let file = || File::options().write(true).open(&path).unwrap();
        match self {
            Self::CutInHalf => file().set_len(len / 2).unwrap(),
            Self::CutByOne => file().set_len(len - 1).unwrap(),
            Self::Emptied => file().set_len(0).unwrap(),
            Self::Longer => file().write_all_at(b"more", len).unwrap(),
            // One page, which a reader sees either before or after the change.
            Self::Overwritten => file().write_all_at(&[0x3f; 16], (len / 2) & !0xfff).unwrap(),
            Self::Replaced => fs::rename(work.path(format!("other_{name}")), &path).unwrap(),
            Self::Removed => fs::remove_file(&path).unwrap(),
        }
    }
}

/// The message and the outputs of a run.
#[derive(Debug, PartialEq, Eq)]
struct Outcome {
    code: Option<i32>,
    error: Option<String>,
    left: Option<Vec<u8>>,
}

/// A command, the input that is changed, and its output.
struct Reading {
    work: Work,
    line: String,
    victim: &'static str,
    output: Option<&'static str>,
}

/// The archives, and files of them.
fn inputs() -> &'static BTreeMap<&'static str, Vec<u8>> {
    static INPUTS: LazyLock<BTreeMap<&'static str, Vec<u8>>> = LazyLock::new(|| {
        let (work, archive) = (Work::new(), Archive::smooth([40, 36, 30], 24));
        let other = Archive { values: archive.values.iter().map(|v| 1.5 - v).collect(), ..archive.clone() };
        work.write("a.npy", archive.npy());
        work.write("other_a.npy", other.npy());
        for name in ["a", "other_a"] {
            work.wavesplat(&format!("convert {name}.npy -o {name}.wspl --window 4 --tolerance 0.001")).ok();
        }
        ["a.npy", "other_a.npy", "a.wspl", "other_a.wspl"].map(|name| (name, work.read(name))).into()
    });
    &INPUTS
}

impl Reading {
    fn new(line: &str, victim: &'static str, output: Option<&'static str>) -> Self {
        let line = format!("exec $WAVESPLAT {line}").replace("$WAVESPLAT render", "$RENDER");
        Self { work: Work::new(), line, victim, output }
    }

    fn reset(&self) {
        for name in self.work.names() {
            fs::remove_file(self.work.path(name)).unwrap();
        }
        inputs().iter().for_each(|(name, bytes)| self.work.write(name, bytes));
    }

    fn outcome(&self, run: &Run) -> Outcome {
        let left = self.output.and_then(|name| fs::read(self.work.path(name)).ok());
        Outcome {
            code: run.code,
            error: run.err.lines().last().filter(|_| run.code != Some(0)).map(String::from),
            left,
        }
    }

    /// The outcome of an undisturbed run, and how long it takes.
    fn undisturbed(&self) -> (Outcome, Duration) {
        self.reset();
        let started = Instant::now();
        let run = self.work.shell(&self.line);
        (self.outcome(&run), started.elapsed())
    }

    /// The outcome for the changed file.
    fn changed(&self, change: Change) -> Outcome {
        self.reset();
        change.apply(&self.work, self.victim);
        self.outcome(&self.work.shell(&self.line))
    }

    /// The outcome if the file changes after some time.
    fn disturbed(&self, change: Change, after: Duration) -> Outcome {
        self.reset();
        let child = self.work.command("sh").args(["-c", &self.line]).spawn().unwrap();
        std::thread::sleep(after);
        change.apply(&self.work, self.victim);
        self.outcome(&Run::of(&self.line, child.wait_with_output().unwrap()))
    }
}

#[test]
fn changes_while_reading_are_noticed_or_make_no_difference() {
    let (started, mut random, mut found) = (Instant::now(), Random(5), BTreeMap::new());
    for (line, victim, output) in [
        ("convert a.npy -o o.wspl --window 4 --block 16", "a.npy", Some("o.wspl")),
        ("append other_a.wspl a.npy", "a.npy", None),
        ("append a.wspl other_a.npy", "a.wspl", None),
        ("render a.wspl -o o.npy --size 24x24", "a.wspl", Some("o.npy")),
        ("extract a.wspl -o o.npy", "a.wspl", Some("o.npy")),
        ("verify a.wspl", "a.wspl", None),
        ("verify a.wspl --against a.npy", "a.npy", None),
    ] {
        let readings = ["", "--no-mmap"].map(|access| Reading::new(&format!("{line} {access}"), victim, output));
        let undisturbed = readings.each_ref().map(Reading::undisturbed);
        for (i, change) in (0..2).flat_map(|i| CHANGES.map(|change| (i, change))) {
            let (reading, (unchanged, duration)) = (&readings[i], &undisturbed[i]);
            let changed = reading.changed(change);
            for _ in 0..times() {
                let run = reading.disturbed(change, duration.mul_f64(random.unit()));
                *found.entry((change, run.code)).or_insert(0) += 1;
                let what = format!("{} {change:?}: {:?} {:?}", reading.line, run.code, run.error);
                let is_of_one_state = run == *unchanged || run == changed;
                assert!(is_of_one_state || noticed(&run, change, victim), "{what}");
            }
        }
    }
    report(&format!("{found:?} in {:.1?}", started.elapsed()));
}

/// Whether a run reports that the file changed or is damaged, and leaves no output.
fn noticed(run: &Outcome, change: Change, victim: &str) -> bool {
    let code = matches!(run.code, Some(3 | 4)) || run.code == Some(1) && change == Change::Removed;
    code && run.error.as_ref().is_some_and(|error| error.contains(victim)) && run.left.is_none()
}
