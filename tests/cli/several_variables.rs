//! Several variables of an archive: each in a file of its own, or the length of a vector.

use super::disturbed_job::write_two;
#[cfg(target_os = "linux")]
use super::memory::SLACK_MIB;
use super::{Archive, Work, floats, read_npy};

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
fn a_variable_that_cannot_be_converted_does_not_end_the_others() {
    let (work, mut archive) = (Work::new(), Archive::smooth([12, 10, 8], 40));
    archive.values[20 * 12 * 10 * 8] = f32::MAX; // its double is infinite
    write_two(&work, &archive);
    let line = "convert steps/ --variable all --window 8";
    let run = work.wavesplat(&format!("{line} -o %n.wspl"));
    run.fails_with(&[
        "twice.wspl.part: the finished windows are kept",
        "twice.wspl: not converted",
        "step_20.vtk",
        "1 variable(s)",
    ]);
    assert_eq!(work.names(), ["steps", "twice.wspl.part", "wave.wspl"]);
    // What is left is mended and continued; the finished file stays.
    archive.values[20 * 12 * 10 * 8] = 1.0;
    let before = work.read("wave.wspl");
    write_two(&work, &archive);
    work.wavesplat(&format!("{line} -o %n.wspl --resume")).ok();
    assert!(work.read("wave.wspl") == before);
    work.wavesplat("convert steps/ --variable twice --window 8 -o alone.wspl").ok();
    assert!(work.read("twice.wspl") == work.read("alone.wspl"));
}

#[test]
fn a_variable_that_some_frames_lack_is_named() {
    let (work, archive) = (Work::new(), Archive::smooth([6, 5, 4], 4));
    write_two(&work, &archive);
    let mut renamed = work.read("steps/step_3.vtk");
    let at = renamed.windows(13).position(|words| words == b"SCALARS twice").unwrap();
    renamed[at + 8..at + 13].copy_from_slice(b"other");
    work.write("steps/step_3.vtk", renamed);
    let run = work.wavesplat("convert steps/ --variable all -o %n.wspl");
    run.fails_with(&["step_3.vtk", "twice.wspl: not converted", "1 variable(s)"]);
    assert_eq!(work.names(), ["steps", "wave.wspl"]);
    work.wavesplat("convert steps/ --variable wave,twice -o b_%n.wspl").fails_with(&["step_3.vtk"]);
    assert_eq!(work.names(), ["steps", "wave.wspl"]);
}

/// Chunks of Zarr arrays span more frames than a window, so each source keeps one for the next window.
#[cfg(all(feature = "zarr", target_os = "linux"))]
#[test]
fn sources_of_many_variables_share_the_memory_of_one() {
    const CHUNK: usize = 16 * 16 * 16;
    let (work, frames, memory) = (Work::new(), 48, 160);
    for name in ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"] {
        let array = format!(
            r#"{{"zarr_format": 2, "shape": [{frames}, 32, 32, 64], "chunks": [{frames}, 16, 16, 16], "dtype": "<f4",
                "compressor": null, "fill_value": 0, "order": "C", "filters": null}}"#
        );
        work.write(&format!("run.zarr/{name}/.zarray"), array);
        work.write(&format!("run.zarr/{name}/.zattrs"), r#"{"_ARRAY_DIMENSIONS": ["time", "z", "y", "x"]}"#);
        let wave = |i: usize| ((i % CHUNK) as f32 * 0.01 + (i / CHUNK) as f32).sin();
        let samples: Vec<u8> = (0..frames * CHUNK).flat_map(|i| wave(i).to_le_bytes()).collect();
        for chunk in 0..16 {
            let [z, y, x] = [chunk / 8, chunk / 4 % 2, chunk % 4];
            work.write(&format!("run.zarr/{name}/0.{z}.{y}.{x}"), &samples);
        }
    }
    work.write("run.zarr/.zgroup", r#"{"zarr_format": 2}"#);
    let limit = format!("ulimit -d {};", (memory + SLACK_MIB) << 10);
    let convert = format!("exec $WAVESPLAT convert run.zarr --threads 2 --memory {memory}MiB --block 16");
    work.shell(&format!("{limit} {convert} --variable all -o %n.wspl")).ok();
    work.shell(&format!("{limit} {convert} --variable h -o alone.wspl")).ok();
    assert!(work.read("h.wspl") == work.read("alone.wspl"));
}

#[test]
fn files_of_a_folder_are_described_as_one_data_set() {
    let (work, archive) = (Work::new(), Archive::smooth([12, 10, 8], 16));
    write_two(&work, &archive);
    work.wavesplat("convert steps/ --variable all -o %n.wspl --dt 0.5").ok();
    work.shell("mkdir run && mv twice.wspl wave.wspl run && echo finished > run/run.log").ok();
    for inputs in ["run", "run/*.wspl", "run/twice.wspl run/wave.wspl"] {
        let said = work.wavesplat(&format!("info {inputs}")).ok();
        let words =
            ["2 files, 2 variable(s)", "12 x 10 x 8 voxels", "16 frames, 0 to 7.5", "  twice  f32, ", "  wave   f32, "];
        words.iter().for_each(|words| assert!(said.text().contains(words), "{words}: {}", said.text()));
        let found = work.wavesplat(&format!("info {inputs} --json")).ok().json();
        assert_eq!(found["variables"], serde_json::json!(["twice", "wave"]));
        assert_eq!((&found["frames"], &found["files"][1]["frames"]), (&16.into(), &16.into()));
    }
    work.wavesplat("convert steps/ --variable wave -o run/part.wspl --frames 0:8").ok();
    let mixed = work.wavesplat("info run").ok();
    for words in ["3 files, 2 variable(s)", "different numbers of frames, at different times", "16 frames, 0 to 7.5"] {
        assert!(mixed.text().contains(words), "{words}: {}", mixed.text());
    }
    work.wavesplat("info run --frames 0:2").fails(2, &["--frames is for frames"]);
    work.write("run/torn.wspl", "WSPL");
    work.wavesplat("info run").fails_with(&["torn.wspl"]);
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
