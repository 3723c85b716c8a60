//! Pictures of bodies: sides of a patient, slices side by side, greys, thick layers.

use super::render::decode_png;
use super::{Archive, Work, floats, read_npy};

/// Voxels along x, y and z.
const DIMS: [usize; 3] = [7, 5, 3];

/// A volume of one frame in which no two voxels are alike, as `b.nrrd`: along each axis, voxels go to the right, to the front and up,
/// or the other way where `signs` has -1.
fn body(signs: [i32; 3]) -> Work {
    let work = Work::new();
    let [x, y, z] = signs;
    let head = format!(
        "NRRD0004\ntype: float\ndimension: 3\nspace: RAS\nsizes: 7 5 3\nspace directions: ({x},0,0) (0,{y},0) (0,0,{z})\n\
         space origin: (0,0,0)\nendian: little\nencoding: raw\n\n"
    );
    let samples = (0..105).flat_map(|n| (n as f32).to_le_bytes());
    work.write("b.nrrd", head.into_bytes().into_iter().chain(samples).collect::<Vec<u8>>());
    work
}

/// The values of a picture.
fn picture(work: &Work, options: &str) -> Vec<f32> {
    floats(&read_npy(&work.render(&format!("{options} -o - --format npy")).ok().out).1)
}

#[test]
fn slices_show_a_patients_sides_where_people_expect_them() {
    for signs in (0..8).map(|n| [0, 1, 2].map(|axis| if n >> axis & 1 == 1 { -1 } else { 1 })) {
        let work = body(signs);
        // The voxel on a side of the patient.
        let at = |axis: usize, is_far: bool| if is_far == (signs[axis] > 0) { DIMS[axis] - 1 } else { 0 };
        for (convention, right_is_far) in [("", true), ("--convention radiological", false)] {
            for (name, [across, up, cut]) in [("x", [1, 2, 0]), ("y", [0, 2, 1]), ("z", [0, 1, 2])] {
                let size = [across, up].map(|axis| 4 * DIMS[axis]);
                let options = format!("b.nrrd --method direct --slice {name}=50% --size {}x{}", size[0], size[1]);
                let shown = picture(&work, &format!("{options} {convention}"));
                for (is_right, is_top) in [(true, true), (false, true), (true, false), (false, false)] {
                    let mut voxel = [0; 3];
                    voxel[cut] = DIMS[cut] / 2;
                    voxel[across] = at(across, is_right == (across == 1 || right_is_far));
                    voxel[up] = at(up, is_top);
                    let corner = [if is_right { size[0] - 1 } else { 0 }, if is_top { 0 } else { size[1] - 1 }];
                    let expected = (voxel[0] + 7 * (voxel[1] + 5 * voxel[2])) as f32;
                    let found = shown[corner[1] * size[0] + corner[0]];
                    assert!((found - expected).abs() < 1e-3, "{signs:?} {convention} {name} {corner:?}: {found}");
                }
            }
        }
    }
}

/// The rectangles of pixels that have a value, each as first and last column and row.
fn rectangles(shown: &[f32], width: usize) -> Vec<[usize; 4]> {
    let (height, mut found) = (shown.len() / width, Vec::<[usize; 4]>::new());
    let is_there = |x: usize, y: usize| x < width && y < height && !shown[y * width + x].is_nan();
    for at in (0..shown.len()).filter(|at| !shown[*at].is_nan()) {
        let (x, y) = (at % width, at / width);
        if found.iter().all(|[left, right, top, bottom]| x < *left || x > *right || y < *top || y > *bottom) {
            let right = (x..).find(|x| !is_there(x + 1, y)).unwrap();
            let bottom = (y..).find(|y| !is_there(x, y + 1)).unwrap();
            found.push([x, right, y, bottom]);
        }
    }
    found
}

#[test]
fn three_slices_across_all_axes_stand_side_by_side() {
    let work = Work::new();
    let archive = Archive::smooth([20, 14, 6], 2);
    work.write("a.npy", archive.npy());
    for size in [[300, 120], [200, 200], [120, 300]] {
        let common = format!("a.npy --method direct --frames 1 --size {}x{}", size[0], size[1]);
        let slices = "--slice y=#6 --slice x=#9 --slice z=#2"; // in any order
        let plain = picture(&work, &format!("{common} {slices}"));
        let found = rectangles(&plain, size[0]);
        assert_eq!(found.len(), 3, "{size:?}: {found:?}");
        let mut seen = Vec::new();
        for [left, right, top, bottom] in found {
            let sides = [right + 1 - left, bottom + 1 - top].map(|n| n as f64);
            let is_like = |across: usize, up: usize| {
                let [a, b] = [across, up].map(|axis| archive.dims[axis] as f64);
                (sides[0] / sides[1] - a / b).abs() < 0.12 * a / b
            };
            let cut = [(1, 2), (0, 2), (0, 1)].into_iter().position(|(across, up)| is_like(across, up)).unwrap();
            let [across, up] = [[1, 2], [0, 2], [0, 1]][cut];
            for (x, y) in (left..=right).flat_map(|x| (top..=bottom).map(move |y| (x, y))) {
                let mut place = [9.0, 6.0, 2.0];
                let share = |at: usize, first: usize, side: f64| (at as f64 + 0.5 - first as f64) / side;
                place[across] = share(x, left, sides[0]) * archive.dims[across] as f64 - 0.5;
                place[up] = (1.0 - share(y, top, sides[1])) * archive.dims[up] as f64 - 0.5;
                let expected = super::slices::between(&archive, 1, place);
                let value = f64::from(plain[y * size[0] + x]);
                assert!((value - expected).abs() < 0.08, "{size:?} {cut} {x} {y}: {value} {expected}");
            }
            seen.push(cut);
        }
        seen.sort_unstable();
        assert_eq!(seen, [0, 1, 2]);
        for other in ["--view 30,30", "--scale 2", "--roll 90"] {
            let within = picture(&work, &format!("{common} {slices} {other}"));
            assert!(rectangles(&within, size[0]) != rectangles(&plain, size[0]), "within the volume with {other}");
        }
    }
}

#[test]
fn bodies_are_grey_and_a_few_bright_spots_do_not_darken_them() {
    let work = body([1; 3]);
    let colours = |options: &str| {
        let png = work.render(&format!("b.nrrd --method direct --slice z=#1 --size 48x40 {options} -o -")).ok().out;
        decode_png(&png).chunks(3).filter(|rgb| rgb[0] != rgb[1] || rgb[1] != rgb[2]).count()
    };
    assert_eq!(colours(""), 0);
    assert!(colours("--colormap viridis") > 1000);
    let mut archive =
        Archive::of([30, 30, 12], 1, |x, y, _, _| if x.abs_diff(15) + y.abs_diff(15) < 12 { 500.0 } else { 4.0 });
    for spot in [13 * 30 + 11, 16 * 30 + 18] {
        archive.values[6 * 900 + spot] = 4000.0; // 1 % of all pixels, 3 % of the body
    }
    let head = "NRRD0004\ntype: float\ndimension: 3\nspace: RAS\nsizes: 30 30 12\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n\
                space origin: (0,0,0)\nendian: little\nencoding: raw\n\n";
    let samples = archive.values.iter().flat_map(|value| value.to_le_bytes());
    work.write("spots.nrrd", head.bytes().chain(samples).collect::<Vec<u8>>());
    let json = work.render("spots.nrrd --method direct --slice z=#6 --size 64x64 -o s.png --json").ok().json();
    let most = json["range"][1].as_f64().unwrap();
    assert!((450.0..780.0).contains(&most), "{most}");
}

/// Largest values end at the box, and thick layers do not blur them across.
#[test]
fn thick_layers_do_not_smear_the_largest_values() {
    let work = Work::new();
    let archive = Archive::of([24, 20, 6], 1, |x, y, _, _| if [x, y] == [12, 10] { 1.0 } else { 0.0 });
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o a.wspl --spacing 1,1,5 --tolerance 0").ok();
    let shown = picture(&work, "a.wspl --mode mip --view front --size 100x140 --scale 3");
    let rows: Vec<&[f32]> = shown.chunks(100).filter(|row| row.iter().any(|value| !value.is_nan())).collect();
    assert!((84..=104).contains(&rows.len()), "six layers of 15 pixels: {}", rows.len());
    let middle = rows[rows.len() / 2];
    let most = middle.iter().copied().fold(0.0, f32::max);
    let wide = middle.iter().filter(|value| **value > most / 2.0).count();
    assert!(wide < 9, "a line of a voxel is {wide} pixels wide, not some 5");
}
