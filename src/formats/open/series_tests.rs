//! Tests of files as one archive.

use super::open;
use crate::testing::{DIMS, Folder, check_window, message, payload, refused};
use wavesplat_core::base::error::Error;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::{Archive, OpenOptions};

fn raw() -> OpenOptions {
    OpenOptions { dims: Some(DIMS.into()), sample: Some(SampleType::U8), ..OpenOptions::default() }
}

fn nrrd(sizes: &str, bytes: &[u8]) -> Vec<u8> {
    let text = format!("NRRD0004\ntype: uchar\ndimension: 4\nsizes: {sizes}\nencoding: raw\n\n");
    [text.as_bytes(), bytes].concat()
}

#[test]
fn windows_cross_files_of_several_frames() {
    let folder = Folder::new();
    let all = payload(SampleType::U8, 0..6, false);
    let files = [(0, 2), (2, 3), (5, 1)].map(|(first, count)| {
        let bytes = &all[first * 105..(first + count) * 105];
        folder.write(&format!("f{first}.nrrd"), nrrd(&format!("7 5 3 {count}"), bytes))
    });
    let options = OpenOptions { allow_gaps: true, ..OpenOptions::default() };
    let mut source = open(&files, &options).expect("opening");
    for (first, count) in [(0, 6), (1, 3), (3, 1), (4, 2), (5, 1), (2, 3)] {
        let window = source.window(first, count).expect("window");
        assert_eq!(window.frames(), count);
        check_window(&*window, SampleType::U8, first);
    }
    assert!(source.window(4, 2).expect("window").name(0).ends_with("f2.nrrd, frame 2"));
    assert!(message(source.window(usize::MAX, 2)).contains("there are 6"));
}

#[test]
fn steps_cross_files() {
    let folder = Folder::new();
    let files = [(0, 2), (2, 1), (3, 4)].map(|(first, count)| {
        let bytes = payload(SampleType::U8, first..first + count, false);
        folder.write(&format!("f{first}.nrrd"), nrrd(&format!("7 5 3 {count}"), &bytes))
    });
    let options = OpenOptions { allow_gaps: true, ..OpenOptions::default() };
    let mut source = open(&files, &options).expect("opening");
    for (first, count, step) in [(0, 3, 3), (1, 3, 2), (1, 2, 5), (6, 1, 9), (7, 0, 4)] {
        let window = source.window_of(first, count, step).expect("window");
        assert_eq!(window.frames(), count);
        for frame in 0..count {
            let mut found = vec![0; 105];
            window.read_box(frame, &Grid::unit(DIMS).whole(), &mut found).expect("reading");
            let index = first + step * frame;
            assert_eq!(found, payload(SampleType::U8, index..index + 1, false), "{first}, {step}");
        }
    }
}

#[test]
fn a_frame_of_another_shape_is_named() {
    let folder = Folder::new();
    let a = folder.write("a.nrrd", nrrd("7 5 3 1", &[0; 105]));
    let b = folder.write("b.nrrd", nrrd("7 3 5 1", &[0; 105]));
    refused(&[a, b], &OpenOptions::default(), "b.nrrd: has 7x3x5 u8 samples, but the first frame");
}

#[test]
fn what_a_file_says_otherwise_than_the_first_is_refused_or_noted() {
    let folder = Folder::new();
    let file = |name: &str, more: &str| {
        let text = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: 7 5 3\n{more}encoding: raw\n\n");
        folder.write(name, [text.as_bytes(), &[0; 105]].concat())
    };
    let spaced = |by: &str| format!("spacings: {by} 1 1\n");
    let files = [("f0", "0.5"), ("f1", "0.50000001"), ("f2", "0.75"), ("f3", "2")]
        .map(|(name, by)| file(&format!("{name}.nrrd"), &spaced(by)));
    let source = open(&files, &OpenOptions::default()).expect("opening");
    assert_eq!(source.archive().grid.spacing, [0.5, 1.0, 1.0]);
    let [note] = &source.archive().notes[..] else { panic!("{:?}", source.archive().notes) };
    assert!(note.text.contains("those of the first file") && note.text.ends_with("f2.nrrd has others"), "{note}");
    assert!(open(&files[..2], &OpenOptions::default()).expect("opening").archive().notes.is_empty());
    let given = OpenOptions { spacing: Some([1.0; 3]), ..OpenOptions::default() };
    assert!(open(&files, &given).expect("opening").archive().notes.is_empty(), "the user's holds for all");
}

#[test]
fn times_that_are_no_numbers_are_left_out_and_those_that_go_back_are_noted() {
    let folder = Folder::new();
    for t in 0..3 {
        folder.write(&format!("f{t}.nrrd"), nrrd("7 5 3 1", &[0; 105]));
    }
    let archive = |times: [&str; 3]| {
        let set = |t: usize| format!("<DataSet timestep=\"{}\" file=\"f{t}.nrrd\"/>", times[t]);
        let sets: String = (0..3).map(set).collect();
        let list = folder.write("a.pvd", format!("<VTKFile type=\"Collection\">{sets}</VTKFile>"));
        open(&[list], &OpenOptions::default()).expect("opening").archive().clone()
    };
    assert!(archive(["-1", "0", "2"]).notes.is_empty());
    for bad in ["nan", "inf", "1e999"] {
        let Archive { times, notes, .. } = archive(["0", bad, "2"]);
        assert!(times.is_empty(), "{bad}");
        assert_eq!(notes, ["times are not all finite: frames are numbered".into()]);
    }
    let Archive { times, notes, .. } = archive(["0", "2", "1"]);
    assert_eq!(times, [0.0, 2.0, 1.0]);
    assert!(notes.len() == 1 && notes[0].text.contains("do not ascend"), "{notes:?}");
}

#[test]
fn a_file_that_changes_after_opening_is_noticed() {
    let folder = Folder::new();
    let file = folder.write("a.raw", payload(SampleType::U8, 0..1, false));
    let mut source = open(std::slice::from_ref(&file), &raw()).expect("opening");
    let window = source.window(0, 1).expect("window");
    std::fs::write(&file, [0; 200]).expect("writing");
    assert!(matches!(window.check_unchanged(), Err(Error::Changed { .. })));
    assert!(matches!(source.window(0, 1), Err(Error::Changed { .. })));
}

#[test]
fn the_user_may_give_another_grid() {
    let folder = Folder::new();
    let file = [folder.write("a.raw", payload(SampleType::U8, 0..1, false))];
    let given = OpenOptions { spacing: Some([1.0, 2.0, 3.0]), origin: Some([4.0, 5.0, 6.0]), ..raw() };
    let grid = open(&file, &given).expect("opening").archive().grid;
    assert_eq!(grid, Grid { dims: DIMS, spacing: [1.0, 2.0, 3.0], origin: [4.0, 5.0, 6.0] });
    refused(&file, &OpenOptions { spacing: Some([1.0, 0.0, 1.0]), ..raw() }, "not positive");
    refused(&file, &OpenOptions { origin: Some([f64::NAN, 0.0, 1.0]), ..raw() }, "not finite");
}
