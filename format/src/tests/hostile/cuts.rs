//! Files that end early.

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
fn files_cut_anywhere_are_refused_by_place_and_resume_before_it() {
    let (original, began) = (fat(), Instant::now());
    (0..original.file.len()).for_each(|len| check(&original, len));
    tell("cut at every byte, resumed", original.file.len() as u64, 8 << 10, began);
}

#[test]
fn files_cut_anywhere_are_saved_up_to_there() {
    for (original, step, name) in [(lean(), 1, "lean"), (fat(), 5, "fat")] {
        let (began, len) = (Instant::now(), original.file.len());
        let saved: Vec<bool> =
            (0..len).step_by(step).map(|len| original.check_recovery(&original.file[..len])).collect();
        assert!(saved.is_sorted() && saved.contains(&true), "more is not less");
        tell(&format!("cut and recovered, {name}"), saved.len() as u64, (len / step) as u64, began);
    }
}
