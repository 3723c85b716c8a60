//! Using a file: info, verify and extract.

use super::{Archive, Work, floats, npy, read_npy, small};

#[test]
fn info_says_what_the_file_holds() {
    let work = Work::with_file("--tolerance 0.02 --frames 4: --region :,2:,:");
    let text = work.wavesplat("info a.wspl").ok();
    for word in ["20 x 12 x 10", "f32", "36 frames", "2e-2", "window", "pyramid ("] {
        assert!(text.text().contains(word), "'{word}' in\n{}", text.text());
    }
    let info = work.wavesplat("info a.wspl --json").ok().json();
    assert_eq!(info["schema"], 1);
    assert_eq!(info["dims"], serde_json::json!([20, 12, 10]));
    assert_eq!(info["sample"], "f32");
    assert_eq!(info["frames"], 36);
    assert_eq!(info["bytes"], work.read("a.wspl").len());
    assert_eq!(info["raw_bytes"], 20 * 12 * 10 * 36 * 4);
    assert_eq!(info["tolerance"], 0.02);
    assert_eq!(info["windows"].as_array().unwrap().len(), 2);
    assert!(info["windows"].as_array().unwrap().iter().all(|w| w["reached"].as_f64() <= w["promised"].as_f64()));
}

#[test]
fn verify_compares_with_the_source() {
    let work = Work::with_file("");
    assert!(work.wavesplat("verify a.wspl").ok().text().contains("whole"));
    assert!(work.wavesplat("verify a.wspl --against a.npy").ok().text().contains("bound kept"));
    let report = work.wavesplat("verify a.wspl --against a.npy --json").ok().json();
    assert_eq!(report["against"]["samples"], small().values.len());
    assert_eq!(report["against"]["series_outside"], 0);
    assert!(report["against"]["largest_share_of_bound"].as_f64().unwrap() <= 1.0);
    work.write("raw", small().bytes());
    work.wavesplat("verify a.wspl --against raw --dims 20x14x10x40 --dtype f32").ok();
}

/// The errors of differences between frames and of means, from extracted samples.
#[test]
fn reports_tell_what_becomes_of_results() {
    let work = Work::new();
    let archive = Archive::smooth([8, 7, 6], 8);
    work.write("a.npy", archive.npy());
    let report = work.wavesplat("convert a.npy -o a.wspl --tolerance 0.02 --keep side=0.5 --json").ok().json();
    work.wavesplat("extract a.wspl -o b.npy").ok();
    let decoded = floats(&read_npy(&work.read("b.npy")).1);
    let [source, decoded] = [&archive.values, &decoded].map(|all| Vec::from_iter(all.iter().map(|v| f64::from(*v))));
    let voxels = 8 * 7 * 6;
    let differences = |all: &[f64]| Vec::from_iter((voxels..all.len()).map(|i| all[i] - all[i - voxels]));
    let rms = |all: Vec<f64>| (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt();
    let [a, b] = [&source, &decoded].map(|all| differences(all));
    let share = rms(a.iter().zip(&b).map(|(a, b)| b - a).collect()) / rms(a.clone());
    let frames = source.chunks(voxels).zip(decoded.chunks(voxels));
    let mean =
        frames.map(|(a, b)| (a.iter().sum::<f64>() - b.iter().sum::<f64>()).abs() / voxels as f64).fold(0.0, f64::max);
    for results in [&report["results"], &work.wavesplat("verify a.wspl --against a.npy --json").ok().json()["results"]]
    {
        let near = |name: &str, truth: f64| (results[name].as_f64().unwrap() - truth).abs() < 1e-6 * truth;
        assert!(near("difference", share) && near("mean", mean) && share > 1e-3, "{results}, not {share}, {mean}");
        assert!(results["laplacian"].as_f64() > results["gradient"].as_f64());
        assert_eq!(results["sides"], serde_json::json!([0.0]));
    }
    let line = "of what is computed: differences off by ";
    let told = |run: &str, is_told: bool| {
        let ran = work.wavesplat(run).ok();
        assert_eq!(format!("{}{}", ran.err, ran.text()).contains(line), is_told, "{run}");
    };
    told("verify a.wspl --against a.npy", true);
    told("verify a.wspl", false);
    told("convert a.npy -o c.wspl -v", true);
    told("convert a.npy -o d.wspl", false);
    told("convert a.npy -o e.wspl -v --transfer-function turbo", false);
    let verified = work.piped("verify a.wspl --against - --json", &archive.npy()).ok().json();
    assert!(verified["results"].is_null() && verified["against"]["samples"] == source.len());
    let piped = work.piped("convert - -o f.wspl --json", &archive.npy()).ok().json();
    assert!(piped["results"].is_null() && piped["frames"] == 8);
}

#[test]
fn verify_finds_one_altered_sample() {
    let work = Work::with_file("");
    let mut archive = small();
    let range = archive.range();
    let [x, y, z, frame] = [7, 3, 6, 35];
    archive.values[frame * 2800 + (z * 14 + y) * 20 + x] += 0.1 * range;
    work.write("altered.npy", archive.npy());
    let run = work.wavesplat("verify a.wspl --against altered.npy");
    assert!(run.text().contains("MISSED"), "{}", run.text());
    assert_eq!(run.code, Some(4), "{}", run.err);
    for word in ["a.wspl", "outside the bound", "frame 35", "x 7, y 3, z 6"] {
        assert!(run.err.contains(word), "'{word}' in {}", run.err);
    }
    let report = work.wavesplat("verify a.wspl --against altered.npy --json");
    assert_eq!(report.code, Some(4));
    assert_eq!(report.json()["against"]["series_outside"], 1);
    assert!(report.json()["against"]["largest_share_of_bound"].as_f64().unwrap() > 5.0);
}

#[test]
fn verify_refuses_another_source() {
    let work = Work::with_file("");
    work.write("other.npy", Archive::smooth([20, 14, 9], 40).npy());
    work.write("short.npy", Archive::smooth([20, 14, 10], 39).npy());
    work.wavesplat("verify a.wspl --against other.npy").fails(2, &["--against", "20x14x9", "20x14x10"]);
    work.wavesplat("verify a.wspl --against short.npy").fails(2, &["--against", "39", "40"]);
    work.wavesplat("verify a.wspl --against absent.npy").fails(1, &["absent.npy"]);
}

#[test]
fn verify_remembers_frames_and_region() {
    let work = Work::with_file("--frames 3:30:2 --region 2:18,:,1:9");
    let report = work.wavesplat("verify a.wspl --against a.npy --json").ok().json();
    assert_eq!(report["against"]["samples"], 16 * 14 * 8 * 14);
    work.wavesplat("convert a.npy -o last.wspl --frames -5:").ok();
    let report = work.wavesplat("verify last.wspl --against a.npy --json").ok().json();
    assert_eq!(report["against"]["samples"], 20 * 14 * 10 * 5);
}

#[test]
fn tolerance_0_gives_every_bit_back() {
    for more in ["", "--basis multi", "--window 8"] {
        let work = Work::with_file(&format!("--tolerance 0 {more}"));
        work.wavesplat("extract a.wspl -o b.npy").ok();
        let (header, samples) = read_npy(&work.read("b.npy"));
        assert!(header.contains("'<f4'") && header.contains("(40, 10, 14, 20)"), "{header}");
        assert!(samples == small().bytes(), "{more}");
    }
}

#[test]
fn every_sample_is_within_the_bound() {
    let work = Work::with_file("--tolerance 0.003");
    work.wavesplat("extract a.wspl -o b.raw").ok();
    let (archive, decoded) = (small(), floats(&work.read("b.raw")));
    let bound = 0.003 * archive.range() * (1.0 + 1e-6);
    assert!(archive.values.iter().zip(&decoded).all(|(a, b)| (a - b).abs() <= bound));
    assert!(work.read("a.wspl").len() < work.read("b.raw").len() / 4);
}

#[test]
fn parts_are_slices_of_the_whole() {
    let work = Work::with_file("--block 8");
    work.wavesplat("extract a.wspl -o whole.raw").ok();
    let whole = Archive { values: floats(&work.read("whole.raw")), ..small() };
    let frames = [3, 7, 11, 15, 19, 30, 31, 32, 33, 39];
    work.wavesplat("extract a.wspl --frames 3:20:4,30:34,-1 --region 5:17,:3,4: -o part.npy").ok();
    let (header, samples) = read_npy(&work.read("part.npy"));
    assert!(header.contains("(10, 6, 3, 12)"), "{header}");
    let slice = Archive::of([12, 3, 6], 10, |x, y, z, t| whole.at([x + 5, y, z + 4], frames[t]));
    assert!(floats(&samples) == slice.values);
    let raw = work.wavesplat("extract a.wspl --frames 3:20:4,30:34,-1 --region 5:17,:3,4: -o - --format raw").ok();
    assert!(raw.out == slice.bytes());
    let mapped = work.wavesplat("extract a.wspl -o -").ok().out;
    assert!(read_npy(&mapped).1 == whole.bytes());
    assert!(work.wavesplat("extract a.wspl -o - --no-mmap").ok().out == mapped);
    let small_memory = work.wavesplat("extract a.wspl -o - --memory 1MiB").fails(2, &["--memory"]).mebibytes();
    assert!(work.wavesplat(&format!("extract a.wspl -o - --memory {small_memory}MiB")).ok().out == mapped);
}

/// A plain file gets its samples block by block, a pipe in order.
#[test]
fn a_file_has_the_bytes_of_a_pipe_with_any_memory() {
    let work = Work::new();
    work.write("b.npy", Archive::smooth([40, 30, 26], 40).npy());
    work.wavesplat("convert b.npy -o b.wspl --block 8 --window 16").ok();
    let least = work.wavesplat("extract b.wspl -o - --memory 1MiB").fails(2, &["--memory"]).mebibytes();
    for chosen in ["", "--frames 3:20:4,30:34,-1 --region 5:37,:13,4:"] {
        for (format, memory) in [("npy", least), ("npy", least + 1), ("raw", least + 2), ("nrrd", 512)] {
            let line = format!("extract b.wspl --memory {memory}MiB --format {format} {chosen}");
            let pipe = work.wavesplat(&format!("{line} -o -")).ok().out;
            work.wavesplat(&format!("{line} -o b.out --force --threads 2")).ok();
            assert!(work.read("b.out") == pipe, "{line}");
        }
    }
}

#[test]
fn converting_an_extraction_of_all_types_works() {
    let work = Work::new();
    let types = [
        ("u8", "|u1"),
        ("i8", "|i1"),
        ("u16", "<u2"),
        ("i16", "<i2"),
        ("u32", "<u4"),
        ("i32", "<i4"),
        ("f16", "<f2"),
        ("f32", "<f4"),
        ("f64", "<f8"),
    ];
    for (name, descr) in types {
        let size: usize = name[1..].parse::<usize>().unwrap() / 8;
        // Bytes below 0x20 are finite numbers in every type.
        let samples: Vec<u8> = (0..6 * 5 * 4 * 9 * size).map(|i| (i * 7 % 31) as u8).collect();
        work.write("t.npy", npy(descr, "9, 4, 5, 6", &samples));
        work.wavesplat("convert t.npy -o t.wspl --force --tolerance 0").ok();
        let back = work.wavesplat("extract t.wspl -o -").ok();
        let (header, decoded) = read_npy(&back.out);
        assert!(header.contains(descr), "{header}");
        assert!(decoded == samples, "{name}");
        work.wavesplat("convert t.npy -o l.wspl --force --tolerance 0.05").ok();
        work.wavesplat("verify l.wspl --against t.npy").ok();
    }
}

#[test]
fn a_coarse_lattice_is_every_few_voxels() {
    let work = Work::with_file("--block 8");
    let (_, all) = read_npy(&work.wavesplat("extract a.wspl -o -").ok().out);
    let (header, coarse) = read_npy(&work.wavesplat("extract a.wspl --lod 2 -o -").ok().out);
    assert!(header.contains("(40, 3, 4, 5)"), "{header}");
    let of_voxel = |t: usize, [x, y, z]: [usize; 3]| all[4 * (x + 20 * (y + 14 * (z + 10 * t)))..][..4].to_vec();
    let thinned = |frames: std::ops::Range<usize>, [xs, ys, zs]: [std::ops::Range<usize>; 3]| -> Vec<u8> {
        let on = |range: std::ops::Range<usize>| range.filter(|n| n.is_multiple_of(4)).collect::<Vec<_>>();
        let (xs, ys, zs) = (on(xs), on(ys), on(zs));
        let rows = frames.flat_map(|t| zs.iter().flat_map(move |z| [(t, *z)])).collect::<Vec<_>>();
        let voxels = rows.iter().flat_map(|(t, z)| ys.iter().map(move |y| (*t, *y, *z)));
        voxels.flat_map(|(t, y, z)| xs.iter().flat_map(move |x| of_voxel(t, [*x, y, z])).collect::<Vec<_>>()).collect()
    };
    assert!(coarse == thinned(0..40, [0..20, 0..14, 0..10]));
    let some = work.wavesplat("extract a.wspl --lod 2 --region 3:20,1:9,4:10 --frames 7:9 -o -").ok();
    assert!(read_npy(&some.out).1 == thinned(7..9, [3..20, 1..9, 4..10]));
    work.wavesplat("extract a.wspl --lod 2 --region 1:4,:,: -o b.npy").fails(2, &["--region", "no voxel", "--lod 2"]);
    work.wavesplat("extract a.wspl --lod 4 -o b.npy").fails(2, &["--lod", "takes at most 3", "blocks of 8"]);
    work.wavesplat("extract a.wspl --lod 2 -o b.nrrd").ok();
    let nrrd = work.read("b.nrrd");
    let spacing = nrrd.windows(9).any(|word| word == b"(4,0,0,0)");
    assert!(spacing, "{}", String::from_utf8_lossy(&nrrd[..400]));
}

#[test]
fn coefficient_files_are_repacked() {
    let work = Work::with_file("");
    let golden = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/samples-u16.wspl");
    work.write("old.wspl", std::fs::read(golden).unwrap());
    let told = work.wavesplat("convert old.wspl -o new.wspl --json").ok().json();
    assert_eq!(told["output_bytes"], work.read("new.wspl").len());
    work.wavesplat("verify new.wspl").ok();
    work.wavesplat("extract old.wspl -o old.npy").ok();
    work.wavesplat("extract new.wspl -o new.npy").ok();
    assert!(work.read("old.npy") == work.read("new.npy"));
    assert!(work.wavesplat("convert a.wspl -o -").ok().out == work.read("a.wspl"), "this version's files stay");
    work.wavesplat("convert old.wspl -o new.wspl").fails(2, &["new.wspl", "exists"]);
    work.wavesplat("convert old.wspl -o old.wspl --force").fails(2, &["old.wspl"]);
    for option in ["--tolerance 0.1", "--block 4", "--frames 1:2", "--resume", "--basis haar", "--dims 1x2x3"] {
        let name = option.split(' ').next().unwrap();
        work.wavesplat(&format!("convert old.wspl -o b.wspl {option}")).fails(2, &[name, "is for frames"]);
    }
    let mut damaged = work.read("old.wspl");
    let place = damaged.windows(4).position(|bytes| bytes == b"LEAF").unwrap();
    damaged[place + 30] ^= 1;
    work.write("damaged.wspl", damaged);
    work.wavesplat("convert damaged.wspl -o b.wspl").fails(3, &["damaged.wspl", "directory"]);
    assert!(!work.names().contains(&"b.wspl".to_string()));
}

#[test]
fn boxes_are_given_in_voxels_shares_and_coordinates() {
    let work = Work::with_file("--spacing 0.5,1,2 --origin 10,0,-4");
    let region = |of: &str| {
        work.wavesplat(&format!("extract a.wspl --frames 3 --region={of} -o r.npy --force")).ok();
        work.read("r.npy")
    };
    let plain = region("2:7,4:7,2:5");
    for same in ["@11:@13,25%:50%,#2:#5", "@10.9:@13.2,4:7,@0:@4", "2:7,4:7,@4:@-0.5"] {
        assert!(region(same) == plain, "{same}");
    }
    work.wavesplat("convert a.npy -o b.wspl --spacing 0.5,1,2 --origin 10,0,-4 --region @11:@13,:,:").ok();
    assert_eq!(work.wavesplat("info b.wspl --json").ok().json()["dims"][0], 5);
    for (wrong, words) in [
        ("@30:@40,:,:", ["--region", "empty, or not within"]),
        ("#1.5:,:,:", ["--region", "whole voxels"]),
        ("@1km:,:,:", ["--region", "'km' is another unit"]),
        ("0:99,:,:", ["--region", "20x14x10"]),
    ] {
        work.wavesplat(&format!("extract a.wspl --region={wrong} -o x.npy")).fails(2, &words);
        work.render(&format!("a.wspl --region={wrong} -o x.npy")).fails(2, &words);
    }
}
