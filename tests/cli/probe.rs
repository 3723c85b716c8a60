//! Time series of points and regions.

use super::{Archive, Work, floats, read_npy, small};

fn decoded(work: &Work) -> Archive {
    work.wavesplat("extract a.wspl -o decoded.npy").ok();
    Archive { values: floats(&read_npy(&work.read("decoded.npy")).1), ..small() }
}

/// The numbers of a table without quotes, row by row.
fn table(text: &str) -> (String, Vec<Vec<f64>>) {
    let (head, rows) = text.split_once('\n').unwrap();
    (head.into(), rows.lines().map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

#[test]
fn a_point_is_read_from_one_block_of_each_window() {
    let work = Work::with_file("--block 8 --window 16");
    let archive = decoded(&work);
    let json = work.render("a.wspl --probe #3,#4,#5 -o s.csv --json").ok().json();
    let windows = 40_u64.div_ceil(16);
    assert_eq!((json["blocks_read"].as_u64(), json["frames"].as_u64()), (Some(windows), Some(40)));
    assert!(json["bytes_read"].as_u64().unwrap() < json["file_bytes"].as_u64().unwrap() / 4);
    let (head, rows) = table(&String::from_utf8(work.read("s.csv")).unwrap());
    assert!(head.starts_with("frame,") && head.contains("x=3 y=4 z=5"), "{head}");
    assert_eq!(rows.len(), 40);
    for row in rows {
        assert_eq!(row[row.len() - 1] as f32, archive.at([3, 4, 5], row[0] as usize));
    }
}

#[test]
fn values_between_voxels_are_interpolated() {
    let work = Work::with_file("");
    let archive = decoded(&work);
    let out = work.render("a.wspl --probe #3.5,#4.25,1.0 --probe 0.0,0,#9 --frames 2::7 -o -").ok().out;
    let (_, rows) = table(&String::from_utf8(out).unwrap());
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), [2.0, 9.0, 16.0, 23.0, 30.0, 37.0]);
    for row in rows {
        let at = |x: usize, y: usize| f64::from(archive.at([x, y, 9], row[0] as usize));
        let expected = 0.75 * (at(3, 4) + at(4, 4)) / 2.0 + 0.25 * (at(3, 5) + at(4, 5)) / 2.0;
        let [.., found, corner] = row[..] else { panic!("{row:?}") };
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        assert_eq!(corner, at(0, 0));
    }
}

#[test]
fn regions_have_a_mean_and_extremes() {
    let work = Work::with_file("--block 8");
    let archive = decoded(&work);
    work.render("a.wspl --probe-region 2:11,:,7:9 -o s.csv").ok();
    let text = String::from_utf8(work.read("s.csv")).unwrap();
    let (head, rows) = text.split_once('\n').unwrap();
    assert!(["mean", "min", "max"].iter().all(|word| head.contains(word)) && head.contains('"'), "{head}");
    for (frame, row) in rows.lines().enumerate() {
        let mut all = Vec::new();
        for (x, y, z) in (2..11).flat_map(|x| (0..14).flat_map(move |y| (7..9).map(move |z| (x, y, z)))) {
            all.push(f64::from(archive.at([x, y, z], frame)));
        }
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        let [.., mean, least, most] = cells[..] else { panic!("{row}") };
        assert!((mean - all.iter().sum::<f64>() / all.len() as f64).abs() < 1e-9);
        assert_eq!(least, all.iter().copied().fold(f64::INFINITY, f64::min));
        assert_eq!(most, all.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    }
}

#[test]
fn a_chart_has_lines_bands_and_a_legend() {
    let work = Work::with_file("");
    work.render("a.wspl --probe 0.5,0.5,0.5 --probe-region 0:4,0:4,0:4 -o s.svg").ok();
    let svg = String::from_utf8(work.read("s.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    assert_eq!((svg.matches("stroke-linejoin").count(), svg.matches("fill-opacity").count()), (4, 4));
    assert!(["x=9.5 y=6.5 z=4.5", "mean 0:4,0:4,0:4"].iter().all(|name| svg.contains(name)));
}

#[test]
fn invalid_probes_are_refused() {
    let work = Work::with_file("");
    work.wavesplat("convert a.npy -o c.wspl --transfer-function turbo").ok();
    for (args, words) in [
        ("a.wspl --probe 0.5,0.5 -o s.csv", &["--probe", "X,Y,Z"][..]),
        ("a.wspl --probe 0.5,0.5,nan -o s.csv", &["--probe", "no place"]),
        ("a.wspl --probe #20,#0,#0 -o s.csv", &["--probe", "#20", "axis x"]),
        ("a.wspl --probe 1e300,0,0 -o s.csv", &["--probe", "axis x", "0 to 19"]),
        ("a.wspl --probe 0,0,5km -o s.csv", &["--probe", "another unit"]),
        ("a.wspl --probe-region 0:99,:,: -o s.csv", &["--probe-region", "20x14x10"]),
        ("a.wspl --probe 0,0,0 -o s.png", &["s.png", ".csv or .svg"]),
        ("a.wspl --probe 0,0,0 --view 3,4 -o s.csv", &["--probe", "--view"]),
        ("a.wspl --probe 0,0,0 --slice z=0.5 -o s.csv", &["--probe", "--slice"]),
        ("a.wspl --probe 0,0,0 --colormap turbo -o s.csv", &["--probe", "--colormap"]),
        ("a.wspl --probe 0,0,0 --frames 99 -o s.csv", &["--frames"]),
        ("a.wspl --probe 0,0,0 -o a.wspl", &["a.wspl"]),
        ("c.wspl --probe 0,0,0 -o s.csv", &["--probe", "colours"]),
        ("a.wspl c.wspl --probe 0,0,0 -o s.csv", &["--probe", "one coefficient file"]),
    ] {
        work.render(args).fails(2, words);
    }
    assert_eq!(work.names(), ["a.npy", "a.wspl", "c.wspl"]);
}

#[test]
fn damaged_blocks_stop_a_probe_unless_they_are_skipped() {
    let work = Work::with_file("--basis haar --block 8");
    let mut bad = work.read("a.wspl");
    let place = bad.len() / 3;
    bad[place] ^= 0x10;
    work.write("bad.wspl", bad);
    let all = "bad.wspl --probe-region :,:,: -o s.csv";
    work.render(all).fails(3, &["bad.wspl", "block"]);
    assert!(!work.names().contains(&"s.csv".into()));
    work.render(&format!("{all} --skip-damaged")).fails(3, &["bad.wspl", "damaged"]);
    let rows = String::from_utf8(work.read("s.csv")).unwrap();
    assert!(rows.lines().count() == 41 && !rows.contains("NaN"), "the mean of what is left: {rows}");
    work.render("bad.wspl --slice z=0.5 --view 30,30 -o s.npy").fails(3, &["bad.wspl", "block"]);
}
