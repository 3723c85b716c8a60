//! Slices through the volume, against a slow twin.

use super::{Archive, Work, floats, read_npy, small};

fn singles(work: &Work, name: &str) -> Vec<f32> {
    floats(&read_npy(&work.read(name)).1)
}

/// The value between voxels of a frame, in the plainest way; outermost samples go on outside.
pub(super) fn between(archive: &Archive, frame: usize, place: [f64; 3]) -> f64 {
    let mut sum = 0.0;
    for corner in 0..8 {
        let (mut weight, mut voxel) = (1.0, [0; 3]);
        for a in 0..3 {
            let at = place[a].max(0.0).min((archive.dims[a] - 1) as f64);
            let (low, high) = (at.floor() as usize, at.ceil() as usize);
            let share = at - at.floor();
            let is_high = corner >> a & 1 == 1;
            voxel[a] = if is_high { high } else { low };
            weight *= if is_high { share } else { 1.0 - share };
        }
        sum += weight * f64::from(archive.at(voxel, frame));
    }
    sum
}

/// The samples of the file `a.wspl`.
fn decoded(work: &Work) -> Archive {
    work.wavesplat("extract a.wspl -o decoded.npy").ok();
    Archive { values: singles(work, "decoded.npy"), ..small() }
}

#[test]
fn a_single_slice_is_seen_face_on_and_fills_the_picture() {
    let work = Work::with_file("--tolerance 0.02");
    let (archive, source) = (decoded(&work), small());
    let bound = f64::from(source.range()) * 0.02 + 1e-5;
    for (slice, size, [right, up, across], at) in [
        ("z=#3.25", [40, 28], [0, 1, 2], 3.25),
        ("y=0.5", [40, 20], [0, 2, 1], 6.5),
        ("x=19", [28, 20], [1, 2, 0], 19.0),
    ] {
        let [width, height] = size;
        work.render(&format!("a.wspl --slice {slice} --size {width}x{height} --frames 7 -o s.npy --force")).ok();
        for (i, found) in singles(&work, "s.npy").into_iter().enumerate() {
            let (column, row) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let mut place = [0.0; 3];
            place[right] = column / 2.0 - 0.5;
            place[up] = (height as f64 - row) / 2.0 - 0.5;
            place[across] = at;
            let [stored, own] = [&archive, &source].map(|archive| between(archive, 7, place));
            assert!((f64::from(found) - stored).abs() < 1e-5, "{slice} at {place:?}: {found}, not {stored}");
            assert!((f64::from(found) - own).abs() <= bound, "{slice} at {place:?}: beyond the bound");
        }
    }
}

/// Right, up and forward of a view, as the guide says.
fn axes(azimuth: f64, elevation: f64) -> [[f64; 3]; 3] {
    let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    [[-ca, -sa, 0.0], [sa * se, -ca * se, ce], [sa * ce, -ca * ce, -se]]
}

#[test]
fn several_slices_show_the_nearest_from_any_side() {
    let work = Work::with_file("--tolerance 1e-3");
    let archive = decoded(&work);
    let planes = [(0, 5.5), (2, 3.0), (1, 13.0)];
    for (azimuth, elevation) in [(33.0, 21.0), (-120.0, -47.0)] {
        let seen = format!("--view {azimuth},{elevation} --size 50x44 --scale 2.1 --center 9,6.5,4");
        work.render(&format!("a.wspl --slice x=#5.5,z=#3 --slice y=1.0 {seen} --frames 3,30 -o s.npy --force")).ok();
        work.render(&format!("a.wspl --slice x=#5.5,z=#3,y=13 {seen} --frames 3,30 -o t.npy --force --method direct"))
            .ok();
        let (found, direct) = (singles(&work, "s.npy"), singles(&work, "t.npy"));
        assert_eq!(
            found.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
            direct.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        );
        let [right, up, forward] = axes(azimuth, elevation);
        let mut shown = [0; 4];
        for (i, found) in found.into_iter().enumerate() {
            let (frame, pixel) = ([3, 30][i / 2200], i % 2200);
            let (h, v) = (((pixel % 50) as f64 + 0.5 - 25.0) / 2.1, (22.0 - (pixel / 50) as f64 - 0.5) / 2.1);
            let start: Vec<f64> = (0..3).map(|a| [9.0, 6.5, 4.0][a] + h * right[a] + v * up[a]).collect();
            let mut nearest: Option<(f64, usize, [f64; 3])> = None;
            for (n, (axis, at)) in planes.into_iter().enumerate() {
                let depth = (at - start[axis]) / forward[axis];
                let place: [f64; 3] = std::array::from_fn(|a| start[a] + depth * forward[a]);
                let inside = (0..3).all(|a| (-0.5..archive.dims[a] as f64 - 0.5).contains(&place[a]));
                if inside && nearest.is_none_or(|(other, ..)| depth < other) {
                    nearest = Some((depth, n, place));
                }
            }
            match nearest {
                None => assert!(found.is_nan(), "background at {pixel}"),
                Some((_, _, place)) => {
                    assert!((f64::from(found) - between(&archive, frame, place)).abs() < 1e-4, "{pixel}: {place:?}");
                }
            }
            shown[nearest.map_or(3, |(_, n, _)| n)] += 1;
        }
        assert!(shown.iter().all(|n| *n > 50), "every plane and the background are seen: {shown:?}");
    }
}

#[test]
fn only_the_blocks_that_planes_cut_are_read() {
    let work = Work::with_file("--block 8");
    let read = |slices: &str| {
        let json = work.render(&format!("a.wspl --slice {slices} --frames 5 -o s.npy --force --json")).ok().json();
        (json["blocks_read"].as_u64().unwrap(), json["bytes_read"].as_u64().unwrap(), json["picture"].clone())
    };
    // 3 x 2 x 2 blocks
    let (blocks, bytes, picture) = read("z=#3");
    assert_eq!((blocks, picture["mode"].as_str(), picture["slice"].as_str()), (6, Some("slice"), Some("z=@3")));
    let whole = work.wavesplat("extract a.wspl -o all.npy --frames 5 --json").ok().json();
    assert!(bytes > 0 && bytes < whole["bytes_read"].as_u64().unwrap());
    assert_eq!((read("z=#7.5").0, read("x=#19").0, read("x=#0,y=#0").0), (12, 4, 8));
}

#[test]
fn pictures_do_not_depend_on_threads_and_memory() {
    let work = Work::with_file("--block 8");
    let picture = |more: &str| {
        work.render(&format!("a.wspl --slice x=0.3,z=0.7 --view 40,20 --size 60x50 -o p.npy --force {more}")).ok();
        work.read("p.npy")
    };
    let plain = picture("");
    assert!(picture("--threads 1") == plain && picture("--threads 3 --memory 20MiB") == plain);
    work.render("a.wspl --slice x=0.3 --size 60x50 --annotate --frames ::10 -o p.apng").ok();
    work.render(
        "a.wspl --slice x=0.3 --size 60x50 --region 0:10,2:9,: --exaggerate 2 --roll 10 -o r_%d.png --frames 1",
    )
    .ok();
}

#[test]
fn missing_samples_are_background() {
    let work = Work::new();
    let archive = Archive::of([8, 8, 8], 4, |x, _, _, t| if x == 3 { f32::NAN } else { t as f32 });
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o a.wspl --missing mask --tolerance 0.01").ok();
    work.render("a.wspl --slice z=#4 --size 8x8 --frames 2 -o s.npy").ok();
    let row = &singles(&work, "s.npy")[..8];
    assert!(row.iter().enumerate().all(|(x, v)| v.is_nan() == (x == 3)), "{row:?}");
    work.render("a.wspl --slice x=#2.5 --size 8x8 --frames 2 -o t.npy").ok();
    assert!(singles(&work, "t.npy").iter().all(|v| v.is_nan()));
}

#[test]
fn thin_and_constant_volumes_have_slices() {
    for dims in [[9, 7, 1], [1, 7, 9], [1, 1, 1]] {
        let work = Work::new();
        work.write("a.npy", Archive::of(dims, 3, |_, _, _, _| 2.5).npy());
        work.wavesplat("convert a.npy -o a.wspl").ok();
        for axis in ["x", "y", "z"] {
            for method in ["coefficients", "direct"] {
                work.render(&format!("a.wspl --slice {axis}=0.5 --method {method} --size 20x20 -o s.npy --force")).ok();
                let seen = singles(&work, "s.npy");
                assert!(seen.iter().any(|v| !v.is_nan()) && seen.iter().all(|v| v.is_nan() || *v == 2.5), "{dims:?}");
            }
        }
        work.render("a.npy --slice z=0.5 --method direct --size 20x20 -o f_%d.png").ok();
    }
}

#[test]
fn invalid_slices_are_refused() {
    let work = Work::with_file("");
    for (args, words) in [
        ("--slice z", &["--slice", "AXIS=PLACE"][..]),
        ("--slice z=", &["--slice", "no place"]),
        ("--slice z=nan", &["--slice", "no place"]),
        ("--slice w=0.5", &["--slice", "no axis 'w'", "x, y, z"]),
        ("--slice z=#10", &["--slice", "#10", "#0 to #9"]),
        ("--slice z=#-1", &["--slice", "#-1"]),
        ("--slice z=120", &["--slice", "120", "axis z", "0 to 9"]),
        ("--slice z=1e300", &["--slice", "axis z"]),
        ("--slice z=-0.5", &["--slice", "-0.5", "axis z"]),
        ("--slice z=3m", &["--slice", "another unit", "has no unit"]),
        ("--slice z=200%", &["--slice", "share"]),
        ("--mode slice", &["--mode slice", "--slice z=0.5"]),
        ("--slice z=0.5 --mode mip", &["--slice", "mip"]),
        ("--slice z=0.5 --tau 1", &["--tau"]),
        ("--slice z=0.5 --sigma 1", &["--slice", "--sigma"]),
        ("--slice z=0.5 --error-image e.npy", &["--error-image"]),
        ("--slice z=0.5 --transfer-function turbo", &["--transfer-function", "--colormap"]),
        ("--slice z=#8 --region :,:,0:4", &["--slice", "--region"]),
    ] {
        work.render(&format!("a.wspl {args} -o out.npy")).fails(2, words);
    }
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[test]
fn a_level_of_detail_has_slices() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([32, 32, 32], 8).npy());
    work.wavesplat("convert a.npy -o a.wspl --space cubic").ok();
    work.render("a.wspl --slice z=#8 --lod 1 --size 32x32 --frames 2 -o s.npy").ok();
    work.wavesplat("extract a.wspl -o d.npy --region :,:,8:9 --frames 2").ok();
    let (found, all) = (singles(&work, "s.npy"), singles(&work, "d.npy"));
    // Pixels are as large as fine voxels; those on even voxels are on voxels of the coarse lattice.
    for (x, y) in (0..30).step_by(2).flat_map(|x| (0..30).step_by(2).map(move |y| (x, y))) {
        let (found, stored) = (found[(31 - y) * 32 + x], all[y * 32 + x]);
        assert!((found - stored).abs() < 1e-5, "{x}, {y}: {found}, not {stored}");
    }
}

#[test]
fn slices_within_a_composite_hide_what_is_behind() {
    let work = Work::with_file("--tolerance 1e-3");
    let shown = |name: &str, more: &str| {
        work.render(&format!("a.wspl --frames 2 --size 48x40 --mode composite --range 0,3 {more} -o {name}.npy")).ok();
        singles(&work, &format!("{name}.npy"))
    };
    let (plain, cut) = (shown("plain", ""), shown("cut", "--slice z=0.5"));
    let opaque = |light: &[f32]| light.iter().skip(3).step_by(4).filter(|a| **a > 0.999).count();
    assert!(opaque(&cut) > opaque(&plain) + 100, "{} {}", opaque(&cut), opaque(&plain));
    let clear = shown("clear", "--slice z=0.5 --opacity 0:0,1:0");
    assert!(opaque(&clear) > 100 && clear.chunks(4).all(|p| p[3] < 1e-5 || p[3] == 1.0), "the slice alone");
    let json = work.render("a.wspl --frames 2 --mode composite --slice z=0.5 -o s.png --json").ok().json();
    assert!(json["picture"]["slice"].as_str().is_some_and(|slice| slice.starts_with("z=")), "{json}");
    work.render("a.wspl --frames 2 --mode mip --slice z=0.5 -o m.npy").fails(2, &["--slice", "slice or composite"]);
}
