//! A camera that moves while time passes, and the speed of movies.

use super::Work;
use super::render::decode_png;
use std::io::Cursor;

const SIZE: &str = "--size 48x40 --range 0,3";

/// The pictures of a stream of raw pixels.
fn pictures(stream: &[u8]) -> Vec<&[u8]> {
    stream.chunks(48 * 40 * 3).collect()
}

#[test]
fn an_orbit_over_time_takes_each_picture_from_its_own_view() {
    let work = Work::with_file("");
    for mode in ["", "--mode composite --transfer-function grey", "--mode mip", "--method direct"] {
        let all = work.render(&format!("a.wspl {SIZE} {mode} --frames :4 --orbit 8 --over-time -o - --format rgb24"));
        let stream = all.ok().out;
        let found = pictures(&stream);
        assert_eq!(found.len(), 8);
        work.render(&format!("a.wspl {SIZE} {mode} --frames :4 --orbit 8 -o v%v_%d.png --force")).ok();
        for (view, picture) in found.into_iter().enumerate() {
            assert!(decode_png(&work.read(&format!("v{view}_{}.png", view / 2))) == picture, "{mode}: view {view}");
        }
    }
    work.render(&format!("a.wspl {SIZE} --frames :4 --view top --view front --over-time -o t.y4m")).ok();
    assert_eq!(work.read("t.y4m").windows(6).filter(|w| w == b"FRAME\n").count(), 2);
}

#[test]
fn moving_views_are_numbered_by_frame_or_by_view() {
    let work = Work::with_file("");
    let json = work.render(&format!("a.wspl {SIZE} --frames 1,3 --orbit 4 --over-time -o v%v.png --json")).ok().json();
    assert_eq!(json["picture"]["frames"], serde_json::json!([1, 1, 3, 3]));
    work.render(&format!("a.wspl {SIZE} --frames 1,3,5 --orbit 3 --over-time -o f%02d.png")).ok();
    let names = work.names();
    for name in ["v0.png", "v3.png", "f01.png", "f05.png"] {
        assert!(names.iter().any(|found| found == name), "{names:?}");
    }
    work.render(&format!("a.wspl {SIZE} --frames 1 --orbit 4 --over-time -o f%d.png")).fails(2, &["%v"]);
    work.render(&format!("a.wspl {SIZE} --over-time -o a.apng")).fails(2, &["--over-time", "--orbit"]);
}

#[test]
fn key_frames_move_the_camera() {
    let work = Work::with_file("");
    work.write("keys.csv", "frame,azimuth,elevation,zoom\n1,20,10,1\n3,60,10,1\n5,60,50,2\n");
    let render = |options: &str| work.render(&format!("a.wspl {SIZE} {options}"));
    let stream = render("--key-frames keys.csv --frames :8 -o - --format rgb24").ok().out;
    let found = pictures(&stream);
    assert_eq!(found.len(), 8);
    let json = render("--key-frames keys.csv --frames :8 -o k.apng --json").ok().json();
    let views = json["views"].as_array().unwrap();
    let angles: Vec<[f64; 2]> =
        views.iter().map(|v| ["azimuth", "elevation"].map(|k| v[k].as_f64().unwrap())).collect();
    assert_eq!([angles[0], angles[1], angles[3], angles[7]], [[20.0, 10.0], [20.0, 10.0], [60.0, 10.0], [60.0, 50.0]]);
    assert!(angles[2] == [40.0, 10.0] && angles[4] == [60.0, 30.0], "{angles:?}");
    let scale = |n: usize| views[n]["scale"].as_f64().unwrap();
    assert!((scale(5) / scale(1) - 2.0).abs() < 1e-12 && (scale(4) / scale(1) - 2.0_f64.sqrt()).abs() < 1e-12);
    let at = format!("--frames 4 --view 60,30 --scale {}", scale(4));
    assert!(render(&format!("{at} -o - --format rgb24")).ok().out == found[4]);
    render("--key-frames keys.csv --annotate --frames :3 -o k%d.png").ok();
    work.write("bad.csv", "0,1,2\n0,1,2\n");
    render("--key-frames bad.csv -o b.apng").fails(3, &["bad.csv", "line 2", "ascend"]);
    render("--key-frames none.csv -o b.apng").fails(1, &["none.csv"]);
    render("--key-frames keys.csv --orbit 3 -o b.apng").fails(2, &["--key-frames", "--orbit"]);
}

#[test]
fn movies_run_as_fast_as_asked() {
    let work = Work::with_file("--times 0,0.25 --time-unit s");
    let delay = |options: &str| {
        work.render(&format!("a.wspl {SIZE} {options} -o d.apng")).ok();
        let mut reader = png::Decoder::new(Cursor::new(work.read("d.apng"))).read_info().unwrap();
        reader.next_frame(&mut vec![0; 48 * 40 * 3]).unwrap();
        let control = *reader.info().frame_control().unwrap();
        f64::from(control.delay_num) / f64::from(control.delay_den)
    };
    assert_eq!(["--frames :4", "--frames :4 --fps 10", "--frames 1 --fps 2.5"].map(delay), [0.04, 0.1, 0.4]);
    assert_eq!(["--speed 1", "--speed 0.5 --frames 3:5", "--speed 2.5 --frames ::2"].map(delay), [0.25, 0.5, 0.2]);
    assert_eq!(delay("--frames :4 --speed 1 --orbit 7 --over-time"), 0.125, "7 pictures in 0.75 s");
    let render = |options: &str| work.render(&format!("a.wspl {SIZE} {options} -o e.apng"));
    render("--speed 1e9").fails(2, &["--speed", "frames per second"]);
    render("--frames 3 --speed 1").fails(2, &["--speed", "no time passes"]);
    render("--speed 1 --fps 3").fails(2, &["--speed", "--fps"]);
    let timeless = Work::with_file("");
    timeless.render("a.wspl --speed 1 -o e.apng").fails(2, &["--speed", "no times"]);
}

#[test]
fn sheets_of_several_views_state_the_angles() {
    let work = Work::with_file("");
    let sheet = |options: &str| {
        work.render(&format!("a.wspl --size 200x160 --range 0,3 --frames 2 {options} -o s.png --format sheet")).ok();
        decode_png(&work.read("s.png"))
    };
    let top = |sheet: &[u8], across: usize| sheet[..across * 3 * 20].chunks(3).filter(|pixel| pixel[0] > 128).count();
    let (one, two) = (sheet("--view top --annotate=time"), sheet("--view top --view front --annotate=time"));
    assert!(top(&two, 400) > 3 * top(&one, 200), "{} {}", top(&two, 400), top(&one, 200));
}
