//! Truncated files.

use super::fat::*;
use crate::*;
use std::time::Instant;

fn check(original: &Original, len: usize) {
    let cut = &original.file[..len];
    match Reader::open(cut).expect_err("cut") {
        Error::Corrupt { place, .. } => assert!(["header", "footer"].contains(&&*place), "{place}"),
        error => assert!(matches!(error, Error::Foreign(_)) && len < 8, "{error}"),
    }
    original.check_prefix(cut);
}

#[test]
fn truncated_files_are_refused_and_resume_before_the_cut() {
    let (original, began) = (fat(), Instant::now());
    (0..original.file.len()).for_each(|len| check(&original, len));
    tell("cut at every byte, resumed", original.file.len() as u64, 8 << 10, began);
}

#[test]
fn truncated_files_are_recovered_up_to_the_cut() {
    for (original, step, name) in [(lean(), 1, "lean"), (fat(), 5, "fat")] {
        let (began, len) = (Instant::now(), original.file.len());
        let saved: Vec<bool> =
            (0..len).step_by(step).map(|len| original.check_recovery(&original.file[..len])).collect();
        assert!(saved.is_sorted() && saved.contains(&true), "a longer file recovers at least as much");
        tell(&format!("cut and recovered, {name}"), saved.len() as u64, (len / step) as u64, began);
    }
}
