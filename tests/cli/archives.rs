//! Archives written by other programs: one command converts them, one makes pictures, and their metadata is kept.

use super::render::decode_png;
use super::{Archive, Work};
use std::collections::HashSet;

/// A file or folder of `tests/golden/inputs`.
fn input(name: &str) -> String {
    format!("{}/tests/golden/inputs/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn every_kind_of_archive_becomes_a_picture_by_two_commands() {
    for name in
        ["netcdf/era5.nc", "netcdf/maps.nc", "vti/series", "nifti/4d.nii.gz", "metaimage/itk_4d.mha", "hdf5/gzip.h5"]
    {
        let work = Work::new();
        work.wavesplat(&format!("convert {} -o a.wspl", input(name))).ok();
        work.render("a.wspl -o a_%d.png --size 64x48").ok();
        let pixels = decode_png(&work.read("a_3.png"));
        let colours: HashSet<&[u8; 3]> = pixels.as_chunks::<3>().0.iter().collect();
        assert!(colours.len() > 20, "{name}: {} colours", colours.len());
    }
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn positions_times_and_units_are_kept_from_file_to_file() {
    let work = Work::new();
    let told = |name: &str| {
        let told = work.wavesplat(&format!("info {name} --json")).ok().json();
        ["dims", "spacing", "origin", "times", "variable", "sample"].map(|key| told[key].clone())
    };
    let units = |name: &str| {
        let told = work.wavesplat(&format!("info {name} --json")).ok().json();
        ["units", "time_units", "space_units"].map(|key| told[key].clone())
    };
    let source = input("netcdf/netcdf4.nc");
    work.wavesplat(&format!("convert {source} -o a.wspl --tolerance 0")).ok();
    work.wavesplat("extract a.wspl -o b.nc").ok();
    assert_eq!(told("a.wspl"), told(&source));
    assert_eq!(told("b.nc"), told(&source));
    assert_eq!(units("b.nc"), units(&source));
    assert_eq!(units(&source)[0], "kg m-3");
    work.wavesplat(&format!("verify a.wspl --against {source}")).ok();
    work.wavesplat("verify a.wspl --against b.nc").ok();
    work.render("a.wspl -o a.npy --splat-error 0 --size 40x30").ok();
    work.render(&format!("{source} --method direct -o b.npy --splat-error 0 --size 40x30")).ok();
    assert!(work.read("a.npy") == work.read("b.npy"));
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn declared_missing_values_are_missing_by_default() {
    for name in ["fill_1e20", "fill_nan", "packed_i16", "missing_value"] {
        let (work, source) = (Work::new(), input(&format!("netcdf/{name}.nc")));
        work.wavesplat(&format!("convert {source} -o a.wspl")).ok();
        let told = work.wavesplat("info a.wspl --json").ok().json();
        assert_eq!(told["missing"], 3, "{name}");
        assert!(told["value_range"][1].as_f64().unwrap() < 30.0, "{name}");
        work.wavesplat(&format!("convert {source} -o b.wspl --missing error")).fails(3, &["has a missing value"]);
    }
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn ambiguous_variables_are_listed_and_chosen() {
    let (work, source) = (Work::new(), input("netcdf/several.nc"));
    let listed = ["has several variables", "density: i8 (time 4, z 3, y 5, x 7) in kg m-3", "--variable"];
    work.wavesplat(&format!("convert {source} -o a.wspl")).fails(3, &listed);
    work.wavesplat(&format!("convert {source} -o a.wspl --variable density")).ok();
    work.wavesplat(&format!("verify a.wspl --against {source}")).ok(); // uses the variable that the file remembers
    work.wavesplat(&format!("convert {source} -o b.wspl --variable nothing")).fails(3, &["has no variable nothing"]);
    let order = input("hdf5/axes_xyzt.h5");
    work.wavesplat(&format!("convert {order} -o c.wspl --axes xyzt")).ok();
    work.wavesplat(&format!("verify c.wspl --against {order}")).ok();
    work.wavesplat(&format!("convert {order} -o d.wspl --axes xyz")).fails(3, &["the axes xyz are 3", "--axes"]);
}

#[test]
fn info_lists_the_variables_to_choose_from() {
    let work = Work::new();
    for (name, line) in [
        ("netcdf/several.nc", "  density: i8 (time 4, z 3, y 5, x 7) in kg m-3\n"),
        ("hdf5/several.h5", " (4, 3, 5, 7)"),
        ("vti/several.vti", ": f32 (z 3, y 5, x 7)\n"),
        ("vti/vector.vti", ", 3 components "),
        ("nrrd/refused_vector.nrrd", "  samples[1]: "),
        ("metaimage/refused_channels.mha", "  samples[1]: "),
        ("nifti/refused_vector.nii", "[1]: "),
    ] {
        let told = work.wavesplat(&format!("info {}", input(name))).ok();
        assert!(told.text().contains(line), "{name}: {}", told.text());
        assert!(told.text().ends_with("choose one with --variable NAME\n"), "{name}: {}", told.text());
        let told = work.wavesplat(&format!("info --json {}", input(name))).ok().json();
        let first = &told["variables"][0];
        let chosen = match first["components"].as_u64() {
            Some(1) => first["name"].as_str().unwrap().into(),
            _ => format!("{}[0]", first["name"].as_str().unwrap()),
        };
        let told = work.wavesplat(&format!("info --json {} --variable {chosen}", input(name))).ok().json();
        assert_eq!(told["sample"], first["sample"], "{name}");
        work.wavesplat(&format!("convert {} -o a.wspl", input(name))).fails(3, &["--variable"]);
    }
    for name in ["netcdf/era5.nc", "vti/active.vti", "vtk/several.vtk", "hdf5/gzip.h5", "nrrd/f32.nrrd"] {
        assert!(work.wavesplat(&format!("info {}", input(name))).ok().text().starts_with("format "), "{name}");
    }
}

#[test]
fn a_filter_that_is_not_supported_is_named_with_the_command_that_removes_it() {
    let source = input("hdf5/refused_lzf.h5");
    let refused = Work::new().wavesplat(&format!("convert {source} -o a.wspl"));
    refused.fails(3, &["refused_lzf.h5", "LZF", "h5repack -f GZIP=4 IN OUT"]);
}

#[test]
fn info_describes_frames_and_estimates_their_file() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([50, 40, 30], 40).npy());
    let told = work.wavesplat("info a.npy").ok();
    for words in ["NumPy array, read in place", "50 x 40 x 30 voxels", "f32 (unnamed), 40 frame(s)", "9600000 bytes"] {
        assert!(told.text().contains(words), "{words}: {}", told.text());
    }
    for tolerance in ["0.01", "0.0001"] {
        let told = work.wavesplat(&format!("info a.npy --estimate={tolerance} --json")).ok().json();
        work.wavesplat(&format!("convert a.npy -o a.wspl --force --tolerance {tolerance}")).ok();
        let ratio = told["estimate"]["bytes"].as_f64().unwrap() / work.read("a.wspl").len() as f64;
        assert!((0.6..1.6).contains(&ratio), "{tolerance}: {ratio} times the true size");
    }
    let estimate = |options: &str| {
        let told = work.wavesplat(&format!("info --json {options}")).ok().json();
        (told["estimate"]["tolerance"].as_f64(), told["frames"].as_u64())
    };
    assert_eq!(estimate("a.npy --estimate 0.1 --frames 0:4"), (Some(0.1), Some(4)));
    assert_eq!(estimate("--estimate 0.1 --frames 0:4 a.npy"), (Some(0.1), Some(4)));
    let table = work.wavesplat("info --frames 0:4 a.npy --estimate --json").ok().json();
    let told = work.wavesplat("info --frames 0:4 --estimate=0.001 a.npy --json").ok().json();
    assert!(table["estimate"].is_null() && table["estimates"][2] == told["estimate"], "{table}");
    let of = |key: &str| -> Vec<f64> { (0..5).map(|i| table["estimates"][i][key].as_f64().unwrap()).collect() };
    assert_eq!(of("tolerance"), [0.1, 0.01, 1e-3, 1e-4, 1e-5]);
    assert!(
        of("bytes").is_sorted() && of("error").is_sorted_by(|a, b| a > b) && of("lost").is_sorted_by(|a, b| a >= b)
    );
    let text = work.wavesplat("info --frames 0:4 a.npy --estimate").ok();
    assert!(text.text().lines().any(|line| line.trim_start().starts_with("0.001 ")), "{}", text.text());
    work.wavesplat("info a.npy --estimate few").fails(2, &["--estimate", "few", "0.02 or 2%"]);
    work.wavesplat("info --estimate a.npy").fails(2, &["--estimate", "after the inputs"]);
    work.wavesplat("info a.wspl --estimate").fails(2, &["--estimate is for frames"]);
    work.piped("info - --estimate", &work.read("a.npy")).fails(2, &["standard input"]);
}

#[test]
fn a_table_of_estimates_of_a_larger_archive_is_near_the_true_sizes() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([80, 72, 60], 26).npy());
    let told = work.wavesplat("info a.npy --estimate --json").ok().json();
    for estimate in told["estimates"].as_array().unwrap().iter().take(4) {
        let tolerance = estimate["tolerance"].as_f64().unwrap();
        work.wavesplat(&format!("convert a.npy -o a.wspl --force --tolerance {tolerance}")).ok();
        let ratio = estimate["bytes"].as_f64().unwrap() / work.read("a.wspl").len() as f64;
        assert!((0.6..1.6).contains(&ratio), "{tolerance}: {ratio} times the true size");
    }
}

#[test]
fn an_estimate_finds_a_peak_within_a_window() {
    let (work, mut archive) = (Work::new(), Archive::smooth([50, 40, 30], 40));
    let voxels = archive.frame_len();
    archive.values[20 * voxels..21 * voxels].iter_mut().for_each(|v| *v *= 100.0);
    work.write("a.npy", archive.npy());
    let told = work.wavesplat("info a.npy --estimate 0.001 --json").ok().json();
    let converted = work.wavesplat("convert a.npy -o a.wspl --tolerance 0.001 --json").ok().json();
    let ratio = told["estimate"]["bytes"].as_f64().unwrap() / converted["output_bytes"].as_f64().unwrap();
    assert!((0.6..1.6).contains(&ratio), "{ratio} times the true size");
}

#[test]
fn a_coefficient_file_with_the_extension_of_another_format_is_refused() {
    let work = Work::with_file("");
    for name in ["b.nc", "b.NPY", "b.vti"] {
        work.wavesplat(&format!("convert a.npy -o {name}")).fails(2, &[name, "named .wspl", "extract"]);
        assert!(!work.names().contains(&name.to_string()));
    }
    work.wavesplat("convert a.npy -o b.coefficients").ok();
}

#[test]
fn a_pipe_carries_a_coefficient_file_unchanged() {
    let work = Work::with_file("");
    work.shell("cat a.npy | $WAVESPLAT convert - -o - | cat > b.wspl").ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    let mean = "import io, sys, array; d = sys.stdin.buffer.read(); a = array.array('f', d[128:]); print(len(a))";
    let counted = work.shell(&format!("$WAVESPLAT extract a.wspl -o - --frames 10:20 | python3 -c \"{mean}\"")).ok();
    assert_eq!(counted.text().trim(), "28000");
    let early = work.shell("$WAVESPLAT extract a.wspl -o - --format nc | head -c 100 | wc -c").ok();
    assert_eq!((early.text().trim(), early.err.as_str()), ("100", ""));
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn what_is_not_read_is_named() {
    let work = Work::new();
    let refused = |name: &str, words: &[&str]| drop(work.wavesplat(&format!("info {}", input(name))).fails(3, words));
    refused("hdf5/links_alone.h5", &["far: a link to /deep/v in other.h5", "all: a virtual dataset"]);
    refused("hdf5/links_alone.h5 --variable all", &["all: a virtual dataset is not supported"]);
    refused("hdf5/refused_above_most.h5", &["damaged", "[4, 3, 9, 7]"]);
    refused("hdf5/refused_minc2.h5", &["MINC", "mnc2nii"]);
    refused("netcdf/refused_minc1.nc", &["MINC", "mnc2nii"]);
    refused("hdf5/openpmd --variable data/0/fields/E/x", &["run_000050.h5", "data/%T/fields/E/x"]);
    let told = work.wavesplat(&format!("info {}", input("hdf5/openpmd"))).ok().out;
    assert!(String::from_utf8(told).unwrap().contains("data/%T/fields/E/y: f32"), "a file for each iteration");
    for name in ["hdf5/links.h5", "hdf5/links_earliest.h5"] {
        let told = work.wavesplat(&format!("info {}", input(name))).ok().out;
        let told = String::from_utf8(told).unwrap();
        for words in ["far is not read", "soft is not read", "all is not read: it is a virtual dataset"] {
            assert!(told.contains(words), "{words} in {told}");
        }
    }
    let told = work.wavesplat(&format!("info {}", input("netcdf/two_times.nc"))).ok().out;
    assert!(String::from_utf8(told).unwrap().contains("first and second give different times"));
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn names_and_coordinates_of_arrays_come_back() {
    let work = Work::new();
    let variables = |source: &str, more: &str| {
        work.wavesplat(&format!("convert {} {more} -o a.wspl --tolerance 0 --force -q", input(source))).ok();
        work.wavesplat("extract a.wspl -o a.nc --force").ok();
        let header = work.read("a.nc");
        move |name: &str| {
            let mut named = vec![0, 0, 0, name.len() as u8]; // its length, then its text
            named.extend(name.as_bytes());
            header.windows(named.len()).filter(|bytes| *bytes == named).count()
        }
    };
    let found = variables("netcdf/coordinates.nc", "");
    assert!(["valid", "z_rho", "zeta", "density"].iter().all(|name| found(name) == 1));
    let found = variables("hdf5/openpmd", "--variable E/x");
    assert_eq!((found("E_x"), found("x"), found("y")), (1, 3, 3), "dimensions, coordinates and their long names");
    for source in ["netcdf/named_as_axis.nc", "netcdf/named_as_axis_4.nc"] {
        let found = variables(source, "--variable z");
        assert_eq!((found("values_z"), found("z")), (1, 1), "{source}");
    }
    let found = variables("hdf5/dedalus.h5", "");
    assert!(["t", "z", "y", "x"].iter().all(|name| found(name) == 2));
    let found = variables("netcdf/wrf_xtime.nc", "");
    assert_eq!((found("XTIME"), found("Time")), (1, 1));
}
