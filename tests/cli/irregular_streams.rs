//! Producers behind a pipe that are slow, irregular, or end anywhere.

use super::{Archive, CONVERT, Run, Work};
use crate::common::random::Random;
use crate::common::report;
use std::io::Write;
use std::time::{Duration, Instant};

const ARGS: &str = "convert - -o out.wspl --window 4 --basis haar";

fn archive() -> Archive {
    Archive::smooth([7, 6, 5], 10)
}

/// Feeds a conversion piece by piece until it closes the pipe.
fn fed<'a>(work: &Work, args: &str, pieces: impl Iterator<Item = (&'a [u8], Duration)>) -> Run {
    let mut child = work.command(CONVERT).args(args.split(' ')).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    for (piece, pause) in pieces {
        std::thread::sleep(pause);
        if input.write_all(piece).is_err() {
            break; // the caller checks its message
        }
    }
    drop(input);
    Run::of(args, child.wait_with_output().unwrap())
}

#[test]
fn sizes_of_pieces_and_pauses_change_no_byte() {
    let (work, bytes, mut random) = (Work::new(), archive().npy(), Random(3));
    work.write("a.npy", &bytes);
    work.wavesplat(&ARGS.replacen("- -o out", "a.npy -o right", 1)).ok();
    let right = work.read("right.wspl");
    let same = |pieces: &mut dyn Iterator<Item = (&[u8], Duration)>| {
        fed(&work, &format!("{ARGS} --force"), pieces).ok();
        assert!(work.read("out.wspl") == right);
    };
    same(&mut bytes.chunks(1).map(|piece| (piece, Duration::ZERO)));
    for _ in 0..20 {
        let mut rest = bytes.as_slice();
        same(&mut std::iter::from_fn(|| {
            let (piece, left) = rest.split_at_checked(1 + random.below(1500)).unwrap_or((rest, &[]));
            rest = left;
            let pause = Duration::from_micros(random.below(4) as u64 * 700);
            (!piece.is_empty()).then_some((piece, pause))
        }));
    }
    for at in [5, 100, 128, 2000, 128 + 4 * 840, bytes.len() - 1, bytes.len()] {
        let (first, last) = bytes.split_at(at);
        same(&mut [(first, Duration::ZERO), (last, Duration::from_millis(80))].into_iter());
    }
}

#[test]
fn complete_windows_are_kept_wherever_a_stream_ends() {
    let (work, bytes, started) = (Work::new(), archive().npy(), Instant::now());
    work.piped(ARGS, &bytes).ok();
    let right = work.read("out.wspl");
    let frame = 4 * archive().frame_len();
    let near = (0..=10).flat_map(|n| [-1, 0, 1].map(|d| (128 + n * frame).saturating_add_signed(d)));
    let ends: Vec<usize> = (0..128).step_by(9).chain(near).chain((128..bytes.len()).step_by(311)).collect();
    let ends: Vec<usize> = ends.into_iter().filter(|end| *end < bytes.len()).collect();
    for end in &ends {
        for name in work.names() {
            std::fs::remove_file(work.path(name)).unwrap();
        }
        work.piped(ARGS, &bytes[..*end]).fails(if *end < 6 { 2 } else { 3 }, &["-: "]);
        let whole = end.saturating_sub(128) / (4 * frame) * 4;
        let left: &[&str] = if whole > 0 { &["out.wspl.part"] } else { &[] };
        assert_eq!(work.names(), left, "ended at {end}");
        let run = work.piped(&format!("{ARGS} --resume"), &bytes).ok();
        assert!(whole == 0 || run.err.contains(&format!(", {whole} of them from before")), "{end}: {}", run.err);
        assert!(work.read("out.wspl") == right, "ended at {end}");
    }
    report(&format!("{} ends in {:.1?}", ends.len(), started.elapsed()));
}
