//! Tests of streams.

use super::*;
use crate::open_stream;
use crate::testing::{DIMS, check_source, check_window, message, payload};
use wavesplat_core::base::sample::SampleType;

const TY: SampleType = SampleType::F32;

/// Gives its bytes a few at a time, as pipes do.
struct Drip(Cursor<Vec<u8>>);

impl Read for Drip {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let len = out.len().min(13);
        self.0.read(&mut out[..len])
    }
}

fn options(frames: Option<usize>) -> OpenOptions {
    let dims = DIMS.into_iter().chain(frames).collect();
    OpenOptions { dims: Some(dims), sample: Some(TY), ..OpenOptions::default() }
}

fn stream(bytes: Vec<u8>, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    open_stream(Drip(Cursor::new(bytes)), options)
}

fn npy(frames: usize, payload: &[u8]) -> Vec<u8> {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({frames}, 3, 5, 7)}}\n");
    let len = (dict.len() as u16).to_le_bytes();
    [MAGIC, &[1, 0], &len, dict.as_bytes(), payload].concat()
}

#[test]
fn windows_are_held_in_memory_or_spooled() {
    for memory in [0, 1 << 20] {
        for big_endian in [false, true] {
            let bytes = [b"head".to_vec(), payload(TY, 0..5, big_endian)].concat();
            let options = OpenOptions { memory, big_endian, offset: 4, ..options(None) };
            let mut source = stream(bytes, &options).expect("opening");
            check_source(&mut *source, TY, 5);
        }
    }
}

#[test]
fn an_unknown_number_of_frames_is_known_at_the_end() {
    let mut source = stream(payload(TY, 0..5, false), &options(None)).expect("opening");
    assert_eq!(source.archive().frames, None);
    assert_eq!(source.window(0, 3).expect("first").frames(), 3);
    assert_eq!(source.window(3, 3).expect("last").frames(), 2);
    assert_eq!(source.archive().frames, Some(5));
    assert_eq!(source.window(5, 3).expect("nothing").frames(), 0);
}

#[test]
fn frames_may_be_skipped_but_not_taken_again() {
    let mut source = stream(payload(TY, 0..5, false), &options(Some(5))).expect("opening");
    let window = source.window(2, 2).expect("window");
    check_window(&*window, TY, 2);
    assert_eq!(window.name(1), "standard input, frame 3");
    assert!(message(source.window(3, 1)).contains("frame 3 is over"));
    assert_eq!(source.window(9, 2).expect("nothing").frames(), 0);
}

#[test]
fn a_stream_that_ends_early_or_late_is_an_error() {
    let bytes = payload(TY, 0..4, false);
    let all = |bytes: &[u8], frames| message(stream(bytes.to_vec(), &options(frames)).and_then(|mut s| s.window(0, 9)));
    assert!(all(&bytes[..bytes.len() - 1], None).contains("inside frame 3: expected 420 bytes, got 419; Adjust("));
    assert!(all(&bytes, Some(5)).contains("ends after 4 of 5 frames"));
    assert!(all(&bytes, Some(3)).contains("goes on after its 3 frame(s)"));
    assert!(all(&[], None).contains("is empty"));
    let skipping = OpenOptions { offset: 9999, ..options(None) };
    assert!(message(stream(bytes, &skipping)).contains("inside the offset of 9999"));
}

#[test]
fn npy_is_known_by_its_magic() {
    let bytes = npy(4, &payload(TY, 0..4, false));
    let mut source = stream(bytes.clone(), &OpenOptions::default()).expect("opening");
    assert_eq!(source.archive().frames, Some(4));
    check_source(&mut *source, TY, 4);
    assert!(message(stream(bytes.clone(), &options(None))).contains("leave them out"));
    let typed = OpenOptions { sample: Some(TY), ..OpenOptions::default() };
    assert!(message(stream(bytes, &typed)).contains("sample: - says itself"));
    assert!(message(stream(b"data".to_vec(), &OpenOptions::default())).contains("is no npy stream; DescribeSamples"));
    assert!(message(stream(npy(4, &[])[..20].to_vec(), &OpenOptions::default())).contains("npy header"));
}

/// An array of one frame.
fn one(shape: &str, t: usize) -> Vec<u8> {
    let dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape})}}\n");
    let len = (dict.len() as u16).to_le_bytes();
    [MAGIC, &[1, 0], &len, dict.as_bytes(), &payload(TY, t..t + 1, false)].concat()
}

#[test]
fn arrays_one_after_another_are_frames() {
    let bytes: Vec<u8> = (0..5).flat_map(|t| one("3, 5, 7", t)).collect();
    for frames in [1, 5] {
        let bytes = bytes[..bytes.len() / 5 * frames].to_vec();
        let mut source = stream(bytes, &OpenOptions::default()).expect("opening");
        assert_eq!(source.archive().frames, None);
        check_source(&mut *source, TY, frames);
        assert_eq!(source.window(frames, 1).expect("nothing").frames(), 0);
        assert_eq!(source.archive().frames, Some(frames));
    }
    let all = |bytes: Vec<u8>| message(stream(bytes, &OpenOptions::default()).and_then(|mut s| s.window(0, 9)));
    assert!(all(bytes[..bytes.len() - 1].to_vec()).contains("inside frame 4"));
    assert!(all(bytes[..one("3, 5, 7", 0).len() + 5].to_vec()).contains("npy header"));
    assert!(all([one("3, 5, 7", 0), one("3, 7, 5", 1)].concat()).contains("array 1 is 1 frame(s) of 5x7x3 f32"));
    assert!(all([one("3, 5, 7", 0), one("1, 3, 5, 7", 1)].concat()).contains("unlike the first one"));
    assert!(all([one("3, 5, 7", 0), b"more and more".to_vec()].concat()).contains("does not start as an npy"));
    assert!(all([npy(1, &payload(TY, 0..1, false)), one("3, 5, 7", 1)].concat()).contains("must have a frame"));
}
