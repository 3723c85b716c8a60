//! Extracted samples in the formats of other programs.

use super::{Archive, Work, npy, read_npy, small};
use std::path::Path;
use std::process::Command;
use wavesplat::base::mapped::Access;
use wavesplat::file::CoefficientFile;

/// The part of [`with_places`] that is extracted, and the file it is written to.
const PART: &str = "--frames 3:20:4 --region 5:17,:3,4:";

/// The small archive as a lossless `a.wspl`, with positions and times.
fn with_places() -> Work {
    let work = Work::new();
    let header = "NRRD0004\ntype: float\ndimension: 4\nspace dimension: 3\nsizes: 20 14 10 40\n\
                  space directions: (0.5,0,0) (0,0.25,0) (0,0,2) none\nspace origin: (-1,2,30)\n\
                  spacings: nan nan nan 0.125\naxis mins: nan nan nan 3\nendian: little\nencoding: raw\n\n";
    work.write("a.nrrd", [header.as_bytes(), &small().bytes()].concat());
    work.wavesplat("convert a.nrrd -o a.wspl --tolerance 0").ok();
    work
}

/// The samples of that part.
fn part() -> Vec<u8> {
    let whole = small();
    Archive::of([12, 3, 6], 5, |x, y, z, t| whole.at([x + 5, y, z + 4], 3 + 4 * t)).bytes()
}

#[test]
fn written_files_read_back_with_positions_and_times() {
    let work = with_places();
    for (name, files) in [
        ("p.nrrd", &["p.nrrd"][..]),
        ("p.nhdr", &["p.raw", "p.nhdr"]),
        ("p.pvd", &["p/p_0003.vti", "p/p_0007.vti", "p/p_0011.vti", "p/p_0015.vti", "p/p_0019.vti", "p.pvd"]),
    ] {
        let report = work.wavesplat(&format!("extract a.wspl {PART} -o {name} --json")).ok().json();
        assert_eq!(report["files"], serde_json::json!(files));
        work.wavesplat(&format!("convert {name} -o {name}.wspl --tolerance 0")).ok();
        assert!(work.wavesplat(&format!("extract {name}.wspl --format raw -o -")).ok().out == part(), "{name}");
        let back = CoefficientFile::open_with(work.path(format!("{name}.wspl")), Access::Read).unwrap();
        assert_eq!((back.grid.spacing, back.grid.origin), ([0.5, 0.25, 2.0], [1.5, 2.0, 38.0]), "{name}");
        assert_eq!(back.metadata().times, [3.375, 3.875, 4.375, 4.875, 5.375], "{name}");
    }
    assert!(!work.names().iter().any(|name| name.ends_with(".part")));
}

#[test]
fn one_frame_has_three_dimensions_or_a_file() {
    let work = with_places();
    work.wavesplat("extract a.wspl --frames 7 -o f.nrrd").ok();
    assert!(String::from_utf8_lossy(&work.read("f.nrrd")).contains("\ndimension: 3\n"));
    work.wavesplat("extract a.wspl --frames 7 -o f.vti").ok();
    work.wavesplat("extract a.wspl --frames 7,9 -o f_%03d.vti").ok();
    assert!(work.read("f.vti") == work.read("f_007.vti"));
    for name in ["f.nrrd", "f.vti", "f_009.vti"] {
        work.wavesplat(&format!("convert {name} -o f.wspl --tolerance 0 --force")).ok();
        let frame = if name == "f_009.vti" { 9 } else { 7 };
        let back = work.wavesplat("extract f.wspl --format raw -o -").ok().out;
        assert!(back == small().frame_bytes(frame), "{name}");
    }
    work.wavesplat("extract a.wspl --frames 7,9 -o g.vti").fails(2, &["g.vti", "2 frames", "frame_%04d.vti"]);
}

#[test]
fn pipes_carry_the_bytes_of_files() {
    let work = with_places();
    let least = work.wavesplat("extract a.wspl -o - --memory 1MiB").fails(2, &["--memory"]).mebibytes();
    for format in ["nrrd", "nc", "npy", "raw"] {
        work.wavesplat(&format!("extract a.wspl {PART} -o p.{format}")).ok();
        let piped = work.wavesplat(&format!("extract a.wspl {PART} --format {format} -o - --memory {least}MiB")).ok();
        assert!(piped.out == work.read(&format!("p.{format}")), "{format}");
    }
    for format in ["nhdr", "pvd"] {
        work.wavesplat(&format!("extract a.wspl --format {format} -o -")).fails(2, &["-:", "beside"]);
    }
    work.wavesplat("extract a.wspl --format vti -o -").fails(2, &["-:", "one .vti", "40 frames"]);
    let piped = work.wavesplat("extract a.wspl --format vti --frames 2 -o -").ok().out;
    work.wavesplat("extract a.wspl --frames 2 -o p.vti").ok();
    assert!(piped == work.read("p.vti"));
}

#[test]
fn netcdf_ends_with_the_samples_most_significant_byte_first() {
    let work = with_places();
    work.wavesplat(&format!("extract a.wspl {PART} -o p.nc")).ok();
    let (file, expected) = (work.read("p.nc"), part());
    assert_eq!(file[..4], *b"CDF\x02");
    let swapped: Vec<u8> = expected.as_chunks::<4>().0.iter().flat_map(|b| [b[3], b[2], b[1], b[0]]).collect();
    assert!(file.ends_with(&swapped));
    assert!(file.len() < swapped.len() + 8 * (5 + 12 + 3 + 6) + 1000);
}

#[test]
fn samples_keep_their_type_where_a_format_has_it() {
    let work = Work::new();
    let halves: Vec<u8> = (0..120).flat_map(|i: u16| (0x3c00 + 7 * i).to_le_bytes()).collect();
    work.write("h.npy", npy("<f2", "3, 2, 4, 5", &halves));
    work.wavesplat("convert h.npy -o h.wspl --tolerance 0").ok();
    for name in ["h.nrrd", "h.nhdr", "h.pvd", "h.nc"] {
        let run = work.wavesplat(&format!("extract h.wspl -o {name}")).ok();
        assert!(run.err.contains("no f16") && run.err.contains("f32"), "{}", run.err);
    }
    assert!(work.wavesplat("extract h.wspl -o h2.npy").ok().err.is_empty());
    work.wavesplat("convert h.pvd -o f.wspl --tolerance 0").ok();
    let (header, floats) = read_npy(&work.wavesplat("extract f.wspl -o -").ok().out);
    let value = |b: &[u8; 4]| half_of(f32::from_le_bytes(*b));
    assert!(header.contains("<f4") && floats.as_chunks::<4>().0.iter().flat_map(value).collect::<Vec<_>>() == halves);
    for (ty, size) in [("u1", 1), ("i1", 1), ("u2", 2), ("i2", 2), ("u4", 4), ("i4", 4), ("f8", 8)] {
        let order = if size == 1 { '|' } else { '<' };
        let samples: Vec<u8> = (0..120 * size).map(|i| (i * 7 % 31) as u8).collect();
        work.write("t.npy", npy(&format!("{order}{ty}"), "3, 2, 4, 5", &samples));
        work.wavesplat("convert t.npy -o t.wspl --force --tolerance 0").ok();
        for name in ["t.nrrd", "t.pvd"] {
            assert!(work.wavesplat(&format!("extract t.wspl -o {name} --force")).ok().err.is_empty());
            work.wavesplat(&format!("convert {name} -o b.wspl --force --tolerance 0")).ok();
            assert!(read_npy(&work.wavesplat("extract b.wspl -o -").ok().out).1 == samples, "{ty} {name}");
        }
    }
}

/// The `f16` bytes of a number that is normal in half precision.
fn half_of(value: f32) -> [u8; 2] {
    let bits = value.to_bits();
    (((bits >> 13) - ((127 - 15) << 10)) as u16).to_le_bytes()
}

#[test]
fn times_that_a_nrrd_cannot_hold_are_omitted_with_a_note() {
    let work = with_places();
    let run = work.wavesplat("extract a.wspl --frames 1,2,7 -o p.nrrd").ok();
    assert!(run.err.contains("regular"), "{}", run.err);
    assert!(!String::from_utf8_lossy(&work.read("p.nrrd")).contains("spacings"));
    assert!(work.wavesplat("extract a.wspl --frames 1,2,7 -o p.pvd").ok().err.is_empty());
    let list = String::from_utf8(work.read("p.pvd")).unwrap();
    work.wavesplat("extract a.wspl --frames 1,2,7 -o 5%.pvd").ok();
    assert!(work.read("5%/5%_0007.vti") == work.read("p/p_0007.vti"));
    for words in [r#"timestep="3.125""#, r#"timestep="3.875""#, r#"file="p/p_0007.vti""#] {
        assert!(list.contains(words), "{words} in {list}");
    }
}

#[test]
fn no_existing_output_is_replaced_unasked() {
    let work = with_places();
    work.write("p/p_0007.vti", "mine");
    work.write("q.raw", "mine");
    work.wavesplat("extract a.wspl --frames 7,8 -o p.pvd").fails(2, &["p_0007.vti", "exists", "--force"]);
    work.wavesplat("extract a.wspl -o q.nhdr").fails(2, &["q.raw", "exists", "--force"]);
    work.wavesplat("extract a.wspl --frames 7,8 -o p/p_%04d.vti").fails(2, &["p_0007.vti", "exists"]);
    assert!(work.read("p/p_0007.vti") == b"mine" && work.read("q.raw") == b"mine");
    work.wavesplat("extract a.wspl --frames 7,8 -o p.pvd --force").ok();
    work.wavesplat("extract a.wspl -o q.nhdr --force").ok();
    let whole = work.read("a.wspl");
    work.write("in.raw", &whole);
    work.write("in/in_0007.vti", &whole);
    work.wavesplat("extract in.raw -o in.nhdr --force").fails(2, &["in.raw", "would replace"]);
    work.wavesplat("extract in/in_0007.vti --frames 7 -o in.pvd --force").fails(2, &["in_0007.vti", "would replace"]);
    assert!(work.read("in.raw") == whole && work.read("in/in_0007.vti") == whole);
    work.write("file", "mine");
    work.wavesplat("extract a.wspl -o file.pvd --force").fails(2, &["file", "folder"]);
}

#[test]
fn a_damaged_file_leaves_no_list_and_no_empty_folder() {
    let work = with_places();
    let mut bytes = work.read("a.wspl");
    bytes[2000] ^= 1;
    work.write("bad.wspl", &bytes);
    work.wavesplat("extract bad.wspl -o p.pvd").fails(3, &["bad.wspl", "damaged"]);
    assert_eq!(work.names(), ["a.nrrd", "a.wspl", "bad.wspl"]);
    let run = work.wavesplat("extract bad.wspl -o p.nc --skip-damaged");
    assert_eq!(run.code, Some(3), "{}", run.err);
    let name = b"_FillValue\0\0\0\0\0\x05\0\0\0\x01\x7f\xc0\0\0";
    assert!(work.read("p.nc").windows(name.len()).any(|bytes| bytes == name));
}

#[test]
fn unknown_extensions_are_refused_with_the_known_ones() {
    let work = with_places();
    let all = [".npy", ".raw", ".nrrd", ".nhdr", ".vti", ".pvd", ".nc", "--format"];
    work.wavesplat("extract a.wspl -o p.xyz").fails(2, &all);
    work.wavesplat("extract a.wspl -o p.xyz --format hdf").fails(2, &["npy raw nrrd nhdr vti pvd nc"]);
    assert_eq!(work.names(), ["a.nrrd", "a.wspl"]);
}

#[test]
fn other_programs_read_the_same() {
    let Ok(python) = std::env::var("WAVESPLAT_PYTHON") else {
        crate::common::report(
            "not run: WAVESPLAT_PYTHON names no Python with what tools/python/requirements.txt lists",
        );
        return;
    };
    let work = with_places();
    for name in ["p.npy", "p.nc", "p.pvd"] {
        work.wavesplat(&format!("extract a.wspl {PART} -o {name}")).ok();
    }
    work.wavesplat("extract a.wspl --region 5:17,:3,4: --frames 3 -o p.nrrd").ok();
    let bytes: Vec<u8> = (0..120).map(|i| (i * 11 % 251) as u8).collect();
    work.write("u.npy", npy("|u1", "3, 2, 4, 5", &bytes));
    work.wavesplat("convert u.npy -o u.wspl --tolerance 0").ok();
    work.wavesplat("extract u.wspl -o u.nc").ok();
    work.wavesplat(&format!("extract a.wspl {PART} -o q.nrrd")).ok();
    for name in ["u.nrrd", "u.nhdr", "u.nii"] {
        work.wavesplat(&format!("extract u.wspl -o {name}")).ok();
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/formats_out.py");
    let output = Command::new(python).arg(script).current_dir(work.path("")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
