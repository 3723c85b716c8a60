//! Times: of files that count from different days, of the user, and as people read them.

use super::remembered_options::part;
use super::{Work, small};
use serde_json::json;

/// A folder of `tests/golden/inputs`.
fn daily(calendar: &str) -> String {
    format!("{}/tests/golden/inputs/netcdf/daily_{calendar}", env!("CARGO_MANIFEST_DIR"))
}

/// Times and dates of a file.
fn told(work: &Work, name: &str) -> [serde_json::Value; 3] {
    let told = work.wavesplat(&format!("info {name} --json")).ok().json();
    ["times", "dates", "settings"].map(|key| told[key].clone())
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn files_that_count_from_their_own_day_are_on_the_clock_of_the_first() {
    for (calendar, dates) in [
        ("standard", ["2000-02-27 06:00", "2000-02-28 06:00", "2000-02-29 06:00", "2000-03-01 06:00"]),
        ("noleap", ["2000-02-27 06:00", "2000-02-28 06:00", "2000-03-01 06:00", "2000-03-02 06:00"]),
        ("360_day", ["2000-02-28 06:00", "2000-02-29 06:00", "2000-02-30 06:00", "2000-03-01 06:00"]),
    ] {
        let (work, days) = (Work::new(), daily(calendar));
        work.wavesplat(&format!("convert {days} -o a.wspl")).ok();
        let (times, dates) = (json!([0.25, 1.25, 2.25, 3.25]), json!(dates));
        let [found, read, _] = told(&work, "a.wspl");
        assert!(found == times && read == dates, "{calendar}: {found} {read}");
        let span = format!("times      {} to {} (0.25 to 3.25 days since", dates[0], dates[3]).replace('"', "");
        assert!(work.wavesplat("info a.wspl").ok().text().contains(&span));
        assert!(work.wavesplat(&format!("info {days}")).ok().text().contains(&span));
        work.wavesplat(&format!("verify a.wspl --against {days}")).ok();
        // Appended files are on the clock that the file has.
        work.shell(&format!("$WAVESPLAT convert {days}/day_[01].nc -o b.wspl")).ok();
        work.shell(&format!("$WAVESPLAT append b.wspl {days}/day_[23].nc")).ok();
        assert_eq!(told(&work, "b.wspl")[..2], [times, dates]);
    }
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn frames_are_numbered_where_clocks_do_not_agree_and_a_note_says_why() {
    let work = Work::new();
    let (one, other) = (format!("{}/day_0.nc", daily("standard")), format!("{}/day_1.nc", daily("noleap")));
    let run = work.wavesplat(&format!("convert {one} {other} -o a.wspl")).ok();
    let words = "day_1.nc has times in \"days since 2000-02-28\" (noleap), but the first file in \"days since 2000-02-27\" (standard): \
                 the calendars differ: frames are numbered";
    assert!(run.err.contains(words), "{}", run.err);
    assert_eq!(told(&work, "a.wspl")[..2], [json!([]), json!([])]);
    work.wavesplat(&format!("convert {one} -o b.wspl")).ok();
    work.wavesplat(&format!("append b.wspl {other}")).fails(2, &["was begun with another time-units"]);
}

#[test]
fn the_user_gives_times_to_files_and_to_streams() {
    let work = Work::new();
    let archive = small();
    work.write("a.npy", archive.npy());
    work.write("a.raw", archive.bytes());
    let raw = "--dims 20x14x10 --dtype f32";
    work.wavesplat("convert a.npy -o a.wspl --times 1,0.1 --time-unit s").ok();
    work.shell(&format!("cat a.raw | $WAVESPLAT convert - {raw} -o b.wspl --times 1,0.1 --time-unit s")).ok();
    let expected: Vec<f64> = (0..40).map(|t| 1.0 + 0.1 * f64::from(t)).collect();
    assert!(told(&work, "a.wspl")[0] == json!(expected) && told(&work, "b.wspl")[0] == json!(expected));
    assert!(work.wavesplat("info a.wspl").ok().text().contains("times      1 to 4.9 s\n"));
    work.wavesplat("convert a.npy -o c.wspl --dt 0.25 --frames 4:12:2").ok();
    work.shell(&format!("cat a.raw | $WAVESPLAT convert - {raw} -o d.wspl --dt 0.25 --frames 4:12:2")).ok();
    let times = json!([1.0, 1.5, 2.0, 2.5]);
    assert!(told(&work, "c.wspl")[0] == times && told(&work, "d.wspl")[0] == times);
    let list: String = (0..40).map(|t| format!("{} # frame {t}\n", t * t)).collect();
    work.write("times.txt", format!("# seconds\n\n{list}"));
    work.shell("$WAVESPLAT convert a.npy -o e.wspl --times times.txt --time-unit 'days since 2000-01-01'").ok();
    let [times, dates, settings] = told(&work, "e.wspl");
    assert!(times[3] == 9.0 && dates[39] == "2004-03-01" && settings.to_string().contains(r#"["times","list"]"#));
    work.wavesplat("verify e.wspl --against a.npy").ok();
}

#[test]
fn appended_frames_continue_the_times() {
    let (work, archive) = (Work::new(), small());
    work.write("all.npy", archive.npy());
    for (name, first, end) in [("a", 0, 16), ("b", 16, 32), ("c", 32, 40)] {
        work.write(&format!("{name}.npy"), part(&archive, first, end).npy());
    }
    let options = "--times 2,0.1 --window 16 --basis haar --range=-9,9";
    work.wavesplat(&format!("convert all.npy -o all.wspl {options}")).ok();
    work.wavesplat(&format!("convert a.npy -o a.wspl {options}")).ok();
    work.wavesplat("append a.wspl b.npy").ok();
    work.shell("cat c.npy | $WAVESPLAT append a.wspl -").ok();
    assert_eq!(told(&work, "a.wspl"), told(&work, "all.wspl"));
    work.wavesplat(&format!("convert all.npy -o b.wspl --frames 0:16 {options}")).ok();
    work.wavesplat("append b.wspl all.npy --frames 16:40").ok();
    assert_eq!(told(&work, "b.wspl")[0], told(&work, "all.wspl")[0]);
    let list = |first: i32, end| (first..end).map(|t| format!("{t}\n")).collect::<String>();
    work.write("a.txt", list(0, 16));
    work.write("b.txt", list(16, 32));
    work.wavesplat("convert a.npy -o c.wspl --times a.txt --window 16").ok();
    work.wavesplat("append c.wspl b.npy").fails(2, &["the times of the file are from a list", "--times"]);
    work.wavesplat("append c.wspl b.npy --times b.txt").ok();
    assert_eq!(told(&work, "c.wspl")[0], json!((0..32).map(f64::from).collect::<Vec<_>>()));
}

#[test]
fn a_conversion_is_not_resumed_with_other_times() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    let list = |last: &str| (0..39).map(|t| format!("{t}\n")).chain([last.into()]).collect::<String>();
    for (name, last) in [("a.txt", "39"), ("b.txt", "40")] {
        work.write(name, list(last));
    }
    work.wavesplat("convert a.npy -o a.wspl --times a.txt").ok();
    work.wavesplat("convert a.npy -o a.wspl --times a.txt --resume").ok();
    work.wavesplat("convert a.npy -o a.wspl --times b.txt --resume").fails(2, &["is complete, but with other"]);
}

#[test]
fn impossible_times_are_refused() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    work.write("few.txt", "1\n2\n");
    work.write("nan.txt", "0\n# a comment\nnan\n");
    work.write("long.txt", "1".repeat(1 << 16));
    let fails = |options: &str, code, words: &[&str]| {
        work.wavesplat(&format!("convert a.npy -o a.wspl {options}")).fails(code, words);
    };
    fails("--times long.txt", 3, &["long.txt", "line 1: is too long"]);
    fails("--times few.txt", 2, &["--times", "there are 2 for 40 frame(s)"]);
    fails("--times nan.txt", 3, &["nan.txt", "line 3", "\"nan\" is no finite number"]);
    fails("--times /dev/zero", 3, &["/dev/zero", "is a device, not a regular file"]);
    fails("--times 0,x", 2, &["0,x", "neither START,STEP nor a file"]);
    fails("--times 0,-1", 2, &["--times", "a step above 0"]);
    fails("--dt 0", 2, &["--dt", "takes a number above 0"]);
    fails("--dt 1 --times 0,1", 2, &["--dt", "--times"]);
    work.wavesplat("convert a.npy -o a.wspl --time-unit s").ok();
    work.write("a.raw", small().bytes());
    let stream = "cat a.raw | $WAVESPLAT convert - --dims 20x14x10 --dtype f32 -o s.wspl --times few.txt";
    work.shell(stream).fails(2, &["--times", "for a stream, give a start and a step"]);
    work.wavesplat("info a.wspl --dt 1").fails(2, &["--dt", "a coefficient file does not need it"]);
}
