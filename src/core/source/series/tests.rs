//! Tests of frames in parts as one archive.

use super::*;
use crate::base::mapped::State;
use crate::base::sample::SampleType;
use crate::source::file_header::{Mismatch, Units};
use crate::source::parts::{Decode, Stored};
use crate::source::testing::{DIMS, payload};
use std::sync::Mutex;

/// Stands for frames that are decoded one at a time, and remembers which were.
#[derive(Debug)]
struct Counted(Arc<Mutex<Vec<usize>>>);

impl Decode for Counted {
    fn decode(&mut self, _path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        self.0.lock().expect("no panic").push(frames.start);
        out.write_at(0, &payload(SampleType::U8, frames, false)).expect("room");
        Ok(())
    }
}

#[test]
fn frames_that_are_stepped_over_are_not_decoded_and_spooled_ones_share_a_file() {
    let shape = Shape::new(DIMS, SampleType::U8).expect("small");
    let decoded = Arc::new(Mutex::new(Vec::new()));
    let part = Part {
        path: "a".into(),
        state: State::HELD,
        frames: 40,
        stored: Stored::plain(DIMS, 1, SampleType::U8, false).expect("small"),
        at: DataLocation::Decoded(Box::new(Counted(decoded.clone()))),
    };
    let options = OpenOptions { memory: 210, ..OpenOptions::default() };
    let header = FileHeader::plain(shape, vec![part]);
    let mut series = Series::single(header, Path::new("a"), &options).expect("opening");
    let window = series.window_of(2, 5, 7).expect("window");
    assert_eq!(*decoded.lock().expect("no panic"), [2, 9, 16, 23, 30]);
    assert_eq!(window.frames(), 5);
    for frame in 0..5 {
        let mut found = vec![0; 105];
        window.read_box(frame, &Grid::unit(DIMS).whole(), &mut found).expect("reading");
        let index = 2 + 7 * frame;
        assert_eq!(found, payload(SampleType::U8, index..index + 1, false));
        assert!(window.name(frame).ends_with(&format!("frame {index}")));
    }
    assert!(series.window_of(2, 7, 7).is_err() && series.window_of(1, usize::MAX, 2).is_err(), "beyond the end");
}

#[test]
fn files_follow_one_another_in_the_same_units() {
    let shape = Shape::new(DIMS, SampleType::U8).expect("small");
    let plain = || FileHeader { times: vec![1.0], ..FileHeader::plain(shape, Vec::new()) };
    let units = |samples: &str, times: &str| Units {
        samples: Some(samples.into()),
        times: Some(times.into()),
        ..Units::default()
    };
    let first = FileHeader { units: units("K", "hours since 2020-01-01"), missing: Some(-1.0), ..plain() };
    let later = |units| FileHeader { units, missing: Some(-1.0), ..plain() };
    let refusal = |file: &FileHeader| file.follows(&first, "a").expect_err("another");
    let same = later(units("K", "hours since 2020-01-01")).follows(&first, "a");
    assert_eq!(same, Ok(Mismatch { grid: false, times: false }));
    let tomorrow = later(units("K", "hours since 2020-01-02"));
    assert_eq!(tomorrow.follows(&first, "a"), Ok(Mismatch { grid: false, times: true }));
    let untimed = FileHeader { times: Vec::new(), ..tomorrow };
    assert_eq!(untimed.follows(&first, "a"), Ok(Mismatch { grid: false, times: false }));
    assert_eq!(refusal(&later(units("C", ""))), "has samples in the unit C, but a has K".into());
    assert_eq!(refusal(&FileHeader { missing: None, ..untimed }), "has the missing value none, but a has -1".into());
}
