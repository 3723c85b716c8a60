//! Several variables of an archive: each in a file of its own, or the length of a vector.

use super::{Work, floats, read_npy};

/// A file of `tests/golden/inputs`.
fn input(name: &str) -> String {
    format!("{}/tests/golden/inputs/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn each_variable_becomes_a_file() {
    let (work, source) = (Work::new(), input("vti/several.vti"));
    let all = work.wavesplat(&format!("info {source} --json")).ok().json();
    let names: Vec<&str> =
        all["variables"].as_array().unwrap().iter().map(|variable| variable["name"].as_str().unwrap()).collect();
    assert!(names.len() > 1, "{names:?}");
    work.wavesplat(&format!("convert {source} -o one.wspl --variable density")).ok();
    work.wavesplat(&format!("convert {source} -o a_%n.wspl --variable all")).ok();
    assert_eq!(work.names().iter().filter(|name| name.starts_with("a_")).count(), names.len());
    assert!(work.read("a_density.wspl") == work.read("one.wspl"));
    let two = names[..2].join(",");
    work.wavesplat(&format!("convert {source} -o b_%n.wspl --variable {two}")).ok();
    assert_eq!(work.names().iter().filter(|name| name.starts_with("b_")).count(), 2);
    work.wavesplat(&format!("verify a_density.wspl --against {source}")).ok();
    work.wavesplat(&format!("convert {source} -o c.wspl --variable {two}")).fails(2, &["%n", "run_%n.wspl"]);
    let one = input("vti/vector.vti");
    work.wavesplat(&format!("convert {one} -o e_%n.wspl --variable all")).ok();
    assert!(work.names().contains(&"e_velocity_2.wspl".to_string()), "{:?}", work.names());
    let twice = format!("convert {source} -o d_%n.wspl --variable {},{}", names[0], names[0]);
    work.wavesplat(&twice).fails(2, &["two variables"]);
}

#[test]
fn a_magnitude_is_computed_from_its_components() {
    let (work, source) = (Work::new(), input("vti/vector.vti"));
    let component = |name: &str| {
        work.wavesplat(&format!("convert {source} -o {name}.wspl --variable velocity[{name}] --tolerance 0")).ok();
        work.wavesplat(&format!("extract {name}.wspl -o {name}.npy")).ok();
        floats(&read_npy(&work.read(&format!("{name}.npy"))).1)
    };
    let [x, y, z] = ["0", "1", "2"].map(component);
    let names = "velocity[0],velocity[1],velocity[2]";
    work.wavesplat(&format!("convert {source} -o length.wspl --magnitude {names} --tolerance 0")).ok();
    work.wavesplat("extract length.wspl -o length.npy").ok();
    let length = floats(&read_npy(&work.read("length.npy")).1);
    for (i, found) in length.iter().enumerate() {
        let expected = [x[i], y[i], z[i]].iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        assert!((f64::from(*found) - expected).abs() <= 1e-6 * expected, "{found} instead of {expected}");
    }
    work.wavesplat(&format!("verify length.wspl --against {source}")).ok(); // the file remembers the components
    let both = format!("convert {source} -o a.wspl --magnitude {names} --variable velocity[0]");
    work.wavesplat(&both).fails(2, &["--variable"]);
}
