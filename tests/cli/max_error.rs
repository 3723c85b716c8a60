//! Errors in the samples' unit, through the programs: what they say of the bound, and what they make again.

use super::{Archive, Work, small};

/// Values around 280, so that a range of 0 to 1 would be far off.
fn warm() -> Archive {
    let mut archive = small();
    archive.values.iter_mut().for_each(|v| *v = 280.0 + 10.0 * *v);
    archive
}

fn work() -> Work {
    let work = Work::new();
    work.write("a.npy", warm().npy());
    work.wavesplat("convert a.npy -o a.wspl --max-error 0.1").ok();
    work
}

#[test]
fn every_report_names_the_error_and_no_range_of_0_to_1() {
    let work = work();
    let promise = "the error of every sample <= 1e-1";
    let info = work.wavesplat("info a.wspl").ok();
    assert!(info.text().contains(&format!("bound      pointwise: {promise}\n")), "{}", info.text());
    assert!(info.text().contains(" --max-error=0.1 "), "{}", info.text());
    let verified = work.wavesplat("verify a.wspl --against a.npy").ok();
    assert!(verified.text().contains(promise), "{}", verified.text());
    let converted = work.wavesplat("convert a.npy -o b.wspl --max-error 0.1 --json").ok();
    assert!(converted.err.contains("of 1.0000e-1 allowed"), "{}", converted.err);
    for report in [
        converted.json(),
        work.wavesplat("info a.wspl --json").ok().json(),
        work.wavesplat("verify a.wspl --against a.npy --json").ok().json(),
    ] {
        assert_eq!((report["max_error"].as_f64(), report["delta"].as_f64()), (Some(0.1), Some(0.1)), "{report}");
        assert_eq!(report["promise"], promise);
        assert!(report["range"].is_null() || report["range"][0].as_f64().unwrap() > 200.0, "{report}");
    }
    let picture = work.render("a.wspl --size 20x20 --frames 3 -o a.png --json").ok().json();
    assert_eq!(picture["picture"]["file_promise"], promise);
}

#[test]
fn a_share_is_reported_with_its_error_in_the_samples_unit() {
    let work = work();
    let report = work.wavesplat("convert a.npy -o b.wspl --json").ok().json();
    let (promise, delta) = (report["promise"].as_str().unwrap(), report["delta"].as_f64().unwrap());
    let (before, largest) = promise.rsplit_once(", at most ").unwrap();
    assert!(before.contains("1e-2 x range (2."), "{promise}");
    let largest: f64 = largest.parse().unwrap();
    assert!(report["max_error"].is_null() && (delta..delta * 1.001).contains(&largest), "{largest} for {delta}");
}

#[test]
fn pictures_take_shares_of_the_decoded_values() {
    let work = work();
    let share = work.wavesplat("convert a.npy -o share.wspl --tolerance 0.001").ok();
    drop(share);
    let of =
        |file: &str| work.render(&format!("{file} --size 20x20 --tolerance 0.01 -o {file}.npy --json")).ok().json();
    let [absolute, share] = ["a.wspl", "share.wspl"].map(|file| of(file)["picture"]["sample_error"].as_f64().unwrap());
    assert!((absolute / share - 1.0).abs() < 0.02, "{absolute} and {share}");
    work.render("a.wspl --size 20x20 --tolerance 1e-6 -o b.npy").fails(2, &["--tolerance", "of its range off"]);
    let splat = |file: &str| work.render(&format!("{file} --size 20x20 -o {file}.npy --force --json")).ok().json();
    assert!(splat("a.wspl")["picture"]["splat_error"].as_f64().unwrap() <= 1e-3);
}

#[test]
fn remembered_options_reproduce_a_file() {
    let work = work();
    let info = work.wavesplat("info a.wspl --json").ok().json();
    let options = info["options"].as_object().unwrap();
    assert!(options["max-error"] == "0.1" && !options.contains_key("range") && !options.contains_key("tolerance"));
    let again: String = options.iter().map(|(name, value)| format!(" --{name}={}", value.as_str().unwrap())).collect();
    work.wavesplat(&format!("convert a.npy -o b.wspl {again}")).ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    work.piped("convert - -o pipe.wspl --max-error 0.1", &warm().npy()).ok();
    assert!(work.read("a.wspl") == work.read("pipe.wspl"));
    work.wavesplat("convert a.wspl -o packed.wspl").ok();
    assert_eq!(work.wavesplat("info packed.wspl --json").ok().json()["max_error"], 0.1);
    work.wavesplat("convert a.wspl -o new.wspl --max-error 1").fails(2, &["is a coefficient file", "--max-error"]);
}

#[test]
fn errors_can_be_given_for_each_variable_by_name() {
    let work = work();
    work.wavesplat("convert a.npy -o b.wspl --max-error a=0.1").fails(2, &["--max-error", "given for a", "no name"]);
    let inputs = format!("{}/tests/golden/inputs", env!("CARGO_MANIFEST_DIR"));
    let axes = format!("{inputs}/hdf5/axes_xyzt.h5 --axes xyzt --spacing 2,2,2");
    let info = work.wavesplat(&format!("info {axes} --json")).ok().json();
    let name = info["variable"].as_str().unwrap().to_string();
    work.wavesplat(&format!("convert {axes} -o c.wspl --max-error other=3,{name}=0.25")).ok();
    assert_eq!(work.wavesplat("info c.wspl --json").ok().json()["max_error"], 0.25);
    let wrong = format!("convert {axes} -o d.wspl --max-error x=3,y=0.25");
    work.wavesplat(&wrong).fails(2, &["--max-error", "x, y", &name]);
    assert!(!work.names().contains(&"d.wspl".to_string()));
}
