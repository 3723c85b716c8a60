//! Partial sums of pictures: the sum of all parts is the picture, and parts of other pictures are refused.

use super::{Archive, Run, Work, floats, places_of, read_npy};
use serde_json::{Value, json};
use std::path::PathBuf;
use wavesplat::base::progress::Silent;
use wavesplat::render::partial::PartialTotal;
use xxhash_rust::xxh3::xxh3_64;

/// Regions that are no whole blocks, without overlap; together they are all voxels of 20 x 14 x 10.
const REGIONS: [&str; 4] = ["0:7,:,:", "7:,0:9,:", "7:13,9:,:", "13:,9:,:"];

/// The largest f32 rounding of a number that is written, relative to it.
const WRITTEN: f64 = f32::EPSILON as f64;

/// Writes `NAME-1.wpart` and so on, one for each region.
fn parts(work: &Work, name: &str, options: &str) {
    for (n, region) in (1..).zip(REGIONS) {
        work.render(&format!("a.wspl --partial --region {region} -o {name}-{n}.wpart {options}")).ok();
    }
}

fn sum(work: &Work, name: &str, out: &str) -> Run {
    work.shell(&format!("$RENDER --sum $(ls -r {name}-*.wpart) -o {out} --force --json")).ok()
}

fn numbers(work: &Work, name: &str) -> Vec<f64> {
    floats(&read_npy(&work.read(name)).1).into_iter().map(f64::from).collect()
}

fn stated(run: &Run) -> Vec<f64> {
    let report: Value = serde_json::from_str(run.text()).unwrap();
    report["views"].as_array().unwrap().iter().map(|view| view["stated_splat_error"].as_f64().unwrap()).collect()
}

/// An archive with travelling waves, whose samples are missing in a ball and in every seventh frame at some voxels.
fn with_gaps() -> Archive {
    let smooth = Archive::smooth([20, 14, 10], 16);
    Archive::of([20, 14, 10], 16, |x, y, z, t| {
        let far = [x.abs_diff(6), y.abs_diff(9), z.abs_diff(4)].map(|n| n * n).iter().sum::<usize>();
        let missing = far < 9 || (t % 7 == 3 && (x * y + z) % 5 == 0);
        if missing { f32::NAN } else { smooth.at([x, y, z], t) }
    })
}

fn converted(archive: &Archive, options: &str) -> Work {
    let work = Work::new();
    work.write("a.npy", archive.npy());
    work.wavesplat(&format!("convert a.npy -o a.wspl --window 8 --block 8 --missing mask {options}")).ok();
    work
}

#[test]
fn one_part_with_all_voxels_gives_the_picture() {
    for (archive, convert, options) in [
        (Archive::smooth([20, 14, 10], 16), "", "--view 30,30 --view 0,0"),
        (with_gaps(), "", "--view 17,-40 --roll 12 --tau 0.05"),
        (with_gaps(), "", "--quantity emission --splat-error 0"),
        (with_gaps(), "", "--tolerance 0.05"),
        (Archive::smooth([20, 14, 10], 16), "", "--lod 1 --exaggerate 2 --sigma 1.4"),
        (Archive::smooth([20, 14, 10], 16), "--transfer-function rainbow --range -1,1.5", "--method direct"),
        (Archive::smooth([20, 14, 10], 16), "", "--orbit 3 --over-time --fast"),
    ] {
        let work = converted(&archive, convert);
        let options = format!("{options} --size 60x44 --frames 2:12:3");
        work.render(&format!("a.wspl -o whole_%v.npy {options}")).ok();
        for threads in [1, 3] {
            work.render(&format!("a.wspl --partial -o {threads}.wpart --threads {threads} {options}")).ok();
        }
        assert!(work.read("1.wpart") == work.read("3.wpart"), "{options}: threads");
        work.render("--sum 1.wpart -o sum_%v.npy --threads 2").ok();
        let names: Vec<String> = work.names().into_iter().filter(|name| name.starts_with("whole_")).collect();
        assert!(!names.is_empty());
        for name in names {
            assert!(work.read(&name) == work.read(&name.replace("whole", "sum")), "{options}: {name}");
        }
    }
}

/// The promise of the splat error, against exact pictures: for an emission a share of the brightest pixel that the largest
/// sample could give, for a mean a share of the range where weights are largest, and more in proportion elsewhere.
#[test]
fn parts_of_regions_add_up_to_the_picture_within_the_stated_error() {
    let (smooth, gaps) = (Archive::smooth([20, 14, 10], 16), with_gaps());
    let (values, colours) = ("--max-error 1e-4", "--tolerance 1e-4 --transfer-function rainbow --range -1,1.5");
    for (archive, convert, channels) in [(&smooth, values, 1), (&gaps, values, 1), (&smooth, colours, 3)] {
        let work = converted(archive, convert);
        let range = if channels == 3 { (0.0, 1.0) } else { range_of(archive) };
        for options in
            ["--view 0,0", "--view 33,21 --roll 7", "--view 0,90 --splat-error 0.01", "--view 120,-35 --tau 0.04"]
        {
            for quantity in ["mean", "emission"] {
                let options = format!("{options} --size 48x40 --frames 3,9 --force --quantity {quantity}");
                parts(&work, "p", &options);
                let run = sum(&work, "p", "sum.npy");
                let exact = format!("{} --splat-error 0", options.replace(" --splat-error 0.01", ""));
                let of_exact = work.render(&format!("a.wspl -o exact.npy --json {exact}")).ok();
                let seen = Seen { weights: weights(archive, &exact), of_all: weights(&smooth, &exact), channels };
                let error = stated(&run)[0] + stated(&of_exact)[0];
                let [sums, exact] = ["sum.npy", "exact.npy"].map(|name| numbers(&work, name));
                seen.check([&sums, &exact], (quantity == "mean", error, range));
                work.render(&format!("a.wspl -o whole.npy {options}")).ok();
                nearly_the_same(&sums, &numbers(&work, "whole.npy"));
            }
        }
    }
}

fn range_of(archive: &Archive) -> (f64, f64) {
    let known = archive.values.iter().filter(|v| !v.is_nan()).map(|v| f64::from(*v));
    known.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
}

/// The exact sums of weights of the samples that an archive has, pixel by pixel.
fn weights(archive: &Archive, options: &str) -> Vec<f64> {
    let ones = archive.values.iter().map(|v| if v.is_nan() { f32::NAN } else { 1.0 }).collect();
    let work = converted(&Archive { values: ones, ..archive.clone() }, "--max-error 1e-6");
    work.render(&format!("a.wspl -o ones.npy {}", options.replace("mean", "emission"))).ok();
    numbers(&work, "ones.npy")
}

/// The weights of pictures of some samples, and of all.
struct Seen {
    weights: Vec<f64>,
    of_all: Vec<f64>,
    channels: usize,
}

impl Seen {
    fn check(&self, [sums, exact]: [&[f64]; 2], (is_mean, error, (lo, hi)): (bool, f64, (f64, f64))) {
        assert_eq!(sums.len(), self.weights.len() * self.channels);
        let brightest = self.of_all.iter().copied().fold(0.0, f64::max);
        for (at, (sum, exact)) in sums.iter().zip(exact).enumerate() {
            assert_eq!(sum.is_nan(), exact.is_nan(), "background at {at}");
            let allowed = match is_mean {
                true => error * (hi - lo + 2e-4) * brightest / self.weights[at / self.channels],
                false => error * (lo.abs().max(hi) + 1e-4) * brightest,
            };
            let off = (sum - exact).abs() - WRITTEN * exact.abs();
            assert!(sum.is_nan() || off <= allowed, "pixel {at}: {off:e}, and {allowed:e} is allowed");
        }
    }
}

/// Sums of parts differ from one rendering by the rounding of sums in f32.
fn nearly_the_same(sums: &[f64], whole: &[f64]) {
    let most = whole.iter().filter(|v| !v.is_nan()).fold(0.0, |most: f64, v| most.max(v.abs()));
    for (sum, one) in sums.iter().zip(whole) {
        assert!(sum.is_nan() == one.is_nan() && (sum.is_nan() || (sum - one).abs() <= 2e-6 * most), "{sum} and {one}");
    }
}

#[test]
fn shards_of_time_and_trees_of_sums_give_the_pictures_of_one_file() {
    let work = Work::new();
    work.write("all.npy", Archive::smooth([20, 14, 10], 80).npy());
    let convert = "convert all.npy --window 8 --chain 2 --range -2,3 --times 5,0.5 --time-unit s";
    work.wavesplat(&format!("{convert} -o a.wspl")).ok();
    for n in 1..=2 {
        work.wavesplat(&format!("{convert} -o shard-{n}.wspl --shard {n}/2")).ok();
        let part = |frames| format!("shard-{n}.wspl --partial --view 30,30 --view 80,5 --size 40x30 --frames {frames}");
        work.render(&format!("{} -o t-{n}.wpart --annotate=time", part("::9"))).ok();
        let run = work.render(&format!("{} -o one-{n}.wpart", part("70"))).ok();
        assert_eq!(run.message().contains("has none of these frames"), n == 1, "{}", run.message());
        let motion = format!("shard-{n}.wspl --partial --orbit 6 --over-time --size 40x30 -o m-{n}.wpart");
        work.render(&motion).ok();
    }
    let views = "--view 30,30 --view 80,5 --size 40x30";
    for (frames, name) in [("::9", "t"), ("70", "one")] {
        work.render(&format!("a.wspl -o whole_%v.npy {views} --frames {frames} --force")).ok();
        sum(&work, name, "sum_%v.npy");
        for view in 0..2 {
            let [sum, whole] = ["sum", "whole"].map(|name| work.read(&format!("{name}_{view}.npy")));
            assert!(sum == whole, "{frames}, view {view}");
        }
    }
    work.render("a.wspl -o whole.npy --orbit 6 --over-time --size 40x30 --force").ok();
    sum(&work, "m", "sum.npy");
    assert!(work.read("sum.npy") == work.read("whole.npy"), "a moving camera");
    let colours = "--range -1,1 --annotate=time";
    work.render(&format!("a.wspl -o w_%d_%v.png {views} --frames 27,72 {colours}")).ok();
    work.shell(&format!("$RENDER --sum t-2.wpart t-1.wpart -o s_%d_%v.png --frames 27,72 {colours}")).ok();
    for name in ["27_0", "27_1", "72_0", "72_1"] {
        let [sum, whole] = ["s", "w"].map(|of| super::render::decode_png(&work.read(&format!("{of}_{name}.png"))));
        assert!(sum == whole, "{name}: times, colours and letters");
    }
    let alone = work.render("--sum t-2.wpart -o alone_%v.npy").ok();
    assert!(alone.message().contains("no part was made of the frames 0:32"), "{}", alone.message());
    work.render("--sum t-2.wpart -o alone_%v.npy --force --frames 9")
        .fails(2, &["--frames", "no part has a picture of frame 9"]);
    trees(&work);
}

/// Regions of shards, added over space first, or over time first, or at once.
fn trees(work: &Work) {
    for (n, region) in (1..).zip(["0:9,:,:", "9:,:,:"]) {
        for shard in 1..=2 {
            let part = format!("shard-{shard}.wspl --partial --region {region} --size 40x30 --frames ::20");
            work.render(&format!("{part} -o r-{n}{shard}.wpart")).ok();
        }
    }
    for n in 1..=2 {
        work.shell(&format!("$RENDER --sum r-1{n}.wpart r-2{n}.wpart --partial -o space-{n}.wpart")).ok();
        work.shell(&format!("$RENDER --sum r-{n}1.wpart r-{n}2.wpart --partial -o time-{n}.wpart")).ok();
    }
    for name in ["r", "space", "time"] {
        sum(work, name, &format!("{name}.npy"));
    }
    assert!(work.read("r.npy") == work.read("time.npy") && work.read("r.npy") == work.read("space.npy"));
    work.render("a.wspl -o whole.npy --size 40x30 --frames ::20 --force").ok();
    let off = numbers(work, "r.npy").into_iter().zip(numbers(work, "whole.npy")).filter(|(a, _)| !a.is_nan());
    assert!(off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 2e-6);
    let lacking = "--sum r-11.wpart r-12.wpart r-21.wpart -o a.png";
    work.render(lacking).fails(2, &["r-1", "lacks the voxels 9:20,0:14,0:10", "a part is missing"]);
}

#[test]
fn parts_of_other_pictures_are_refused() {
    let work = converted(&with_gaps(), "");
    let part = |options: &str, name: &str| {
        let size = if options.contains("--size") { "" } else { "--size 32x24" };
        work.render(&format!("a.wspl --partial -o {name}.wpart {size} {options}")).ok()
    };
    part("--region 0:7,:,:", "a");
    part("--region 7:,:,:", "b");
    part("--region 5:9,:,:", "over");
    part("--region 7:,:,: --view 31,30", "view");
    part("--region 7:,:,: --size 33x24", "size");
    part("--region 7:,:,: --splat-error 0.002", "splat");
    part("--region 7:,:,: --quantity emission", "quantity");
    part("--region 7:,:,: --frames 0:3", "frames");
    work.write("b.npy", Archive::smooth([20, 14, 10], 16).npy());
    work.wavesplat("convert b.npy -o other.wspl --window 8 --block 8 --missing mask").ok();
    work.render("other.wspl --partial -o other.wpart --size 32x24 --region 7:,:,:").ok();
    for (parts, words) in [
        ("a b a", ["a.wpart", "has the same voxels and frames as a.wpart"]),
        ("a over", ["over.wpart", "shares voxels with a.wpart: 5:7,0:14,0:10"]),
        ("a view", ["view.wpart", "they differ in views"]),
        ("a size", ["size.wpart", "they differ in views"]),
        ("a splat", ["splat.wpart", "they differ in splat error"]),
        ("a quantity", ["quantity.wpart", "they differ in quantity"]),
        ("a frames", ["a.wpart", "lacks the voxels 7:20,0:14,0:10"]),
        ("a other", ["other.wpart", "was made of another file than a.wpart"]),
    ] {
        let parts = parts.split(' ').map(|name| format!("{name}.wpart")).collect::<Vec<_>>().join(" ");
        work.render(&format!("--sum {parts} -o x.npy")).fails(2, &words);
    }
    let half = work.render("--sum a.wpart -o half.npy").ok();
    assert!(half.message().contains("the parts have 35.000 % of the voxels"), "{}", half.message());
    for (options, words) in [
        ("--mode mip", "--partial: largest values along rays are no sums"),
        ("--mode composite", "--partial: near samples hide far ones"),
        ("--iso 50%", "--partial: near surfaces hide far ones"),
        ("--slice z=0.5", "--partial: slices are no sums"),
        ("--tolerance 0.1 --error expected", "take certified"),
        ("--range 0,1", "--partial"),
        ("--error-image e.npy", "--partial"),
        ("--memory 1MiB", "--memory"),
    ] {
        work.render(&format!("a.wspl --partial -o x.npy {options}")).fails(2, &[words]);
    }
    work.render("a.npy --method direct --partial -o x.npy").fails(2, &["--partial: takes a coefficient file"]);
    work.render("a.wpart -o x.png").fails(2, &["a.wpart", "--sum makes pictures of parts"]);
    work.render("--sum a.wspl -o x.png").fails(3, &["a.wspl", "is no part of a picture"]);
    work.render("--sum none.wpart -o x.png").fails(1, &["none.wpart", "No such file"]);
    work.render("--sum a.wpart --size 9x9 -o x.png").fails(2, &["--sum", "--size"]);
    work.render("--sum a.wpart b.wpart --memory 50KiB -o x.npy").fails(2, &["MiB"]);
    work.render("--sum a.wpart b.wpart --partial -o a.wpart --force").fails(2, &["a.wpart"]);
    assert!(!work.names().iter().any(|name| name.starts_with("x.")));
}

/// Adds parts and makes all their pictures.
fn made(paths: &[PathBuf]) -> wavesplat::Result<()> {
    let total = PartialTotal::open(paths, 64 << 20, &Silent)?;
    total.render(&total.frames(), &Silent, &mut |_| Ok(())).map(drop)
}

/// Two small parts.
fn two() -> (Work, [PathBuf; 2]) {
    let work = converted(&with_gaps(), "");
    for (name, region) in [("a", "0:7,:,:"), ("b", "7:,:,:")] {
        work.render(&format!("a.wspl --partial -o {name}.wpart --size 12x9 --frames 2,9 --region {region}")).ok();
    }
    let paths = ["a.wpart", "b.wpart"].map(|name| work.path(name));
    made(&paths).unwrap();
    (work, paths)
}

#[test]
fn every_flipped_bit_and_every_cut_of_a_part_is_noticed() {
    let (work, paths) = two();
    let whole = work.read("a.wpart");
    let refused = |bytes: &[u8], what: &str| {
        work.write("a.wpart", bytes);
        let error = made(&paths).expect_err(what);
        assert!(error.to_string().contains("a.wpart"), "{what}: {error}");
    };
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        refused(&bytes, &format!("byte {at}"));
    }
    for length in (0..whole.len()).step_by(13).chain(whole.len() - 60..whole.len()) {
        refused(&whole[..length], &format!("{length} bytes"));
    }
    refused(&[&whole[..], &[0]].concat(), "a byte more");
}

/// A part with another head, whose checksums are right.
fn forged(part: &[u8], forge: impl FnOnce(&mut Value)) -> Vec<u8> {
    let end = part.len() - 40;
    let number = |n: usize| u64::from_le_bytes(part[end + 8 * n..][..8].try_into().unwrap()) as usize;
    let (offset, packed, bytes) = (number(0), number(1), number(2));
    let json = zstd::bulk::decompress(&part[offset..offset + packed], bytes).unwrap();
    let mut head: Value = serde_json::from_slice(&json).unwrap();
    forge(&mut head);
    let json = serde_json::to_vec(&head).unwrap();
    let packed = zstd::bulk::compress(&json, 1).unwrap();
    let numbers = [offset as u64, packed.len() as u64, json.len() as u64, xxh3_64(&packed)];
    let end = numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>();
    [&part[..offset], &packed, &end, &part[part.len() - 8..]].concat()
}

#[test]
fn false_numbers_in_a_part_are_refused() {
    let (work, [path, _]) = two();
    let whole = work.read("a.wpart");
    work.write("a.wpart", forged(&whole, |_| ()));
    made(std::slice::from_ref(&path)).unwrap();
    let huge = json!(1_u64 << 62);
    for (place, lie) in [
        ("/schema", json!(9)),
        ("/look/grid/dims/0", huge.clone()),
        ("/look/grid/dims/1", json!(0)),
        ("/look/grid/spacing/2", json!(-1.0)),
        ("/look/block/0", json!(0)),
        ("/look/channels", json!(2)),
        ("/look/channels", json!(3)),
        ("/look/kernel/sigma", json!(0.0)),
        ("/look/kernel/tau", json!(-1.0)),
        ("/look/splat_error", json!(-1.0)),
        ("/look/views", json!([])),
        ("/look/views/0/size", json!([huge, huge])),
        ("/look/views/0/size", json!([1 << 20, 1 << 19])),
        ("/look/views/0/size", json!([12, 10])),
        ("/look/views/0/scale", json!(-2.0)),
        ("/look/paired", json!([3, 4])),
        ("/look/axes/0/at", json!([])),
        ("/look/frames", json!(1)),
        ("/boxes", json!([])),
        ("/boxes/0/end/0", huge.clone()),
        ("/boxes/0/end/0", json!(0)),
        ("/sources", json!([])),
        ("/sources/0/frames", json!([5, 2])),
        ("/sources/0/times", json!([1.0])),
        ("/pictures/0/view", json!(1)),
        ("/pictures/0/frame", json!(99)),
        ("/pictures/0/frame", json!(9)),
        ("/pictures/0/missing", json!(false)),
        ("/pictures/0/place/bytes", huge.clone()),
        ("/pictures/0/place/offset", huge.clone()),
        ("/pictures/0/place/offset", json!(9)),
        ("/pictures/0/place/checksum", json!(1)),
        ("/weights", json!([])),
        ("/weights/0/place/bytes", json!(1)),
        ("/sample_error", json!(-1.0)),
    ] {
        work.write("a.wpart", forged(&whole, |head| *head.pointer_mut(place).expect(place) = lie.clone()));
        let error = made(std::slice::from_ref(&path)).expect_err(&format!("{place} = {lie}"));
        assert!(error.to_string().contains("a.wpart") || error.to_string().contains("memory"), "{place}: {error}");
    }
    let deep = "[".repeat(100_000);
    work.write("a.wpart", with_text(&whole, deep.as_bytes()));
    made(std::slice::from_ref(&path)).expect_err("nested");
    let bomb = vec![b' '; 200 << 20];
    work.write("a.wpart", with_text(&whole, &bomb));
    let error = made(&[path]).expect_err("a bomb").to_string();
    assert!(error.contains("does not fit in memory"), "{error}");
}

/// A part whose head is this text.
fn with_text(part: &[u8], text: &[u8]) -> Vec<u8> {
    let packed = zstd::bulk::compress(text, 1).unwrap();
    let numbers = [8, packed.len() as u64, text.len() as u64, xxh3_64(&packed)];
    let end = numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>();
    [&part[..8], &packed, &end, &part[..8]].concat()
}

#[test]
fn sums_report_the_damage_that_a_part_left_out() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([20, 14, 10], 16).npy());
    work.wavesplat("convert a.npy -o a.wspl --window 8 --block 8").ok();
    let mut bytes = work.read("a.wspl");
    let blocks = places_of(&bytes, b"BLCK");
    let largest = blocks.windows(2).max_by_key(|ends| ends[1] - ends[0]).unwrap();
    bytes[largest[0].midpoint(largest[1])] ^= 1;
    work.write("a.wspl", &bytes);
    work.render("a.wspl --skip-damaged --partial --size 20x20 -o a.wpart").fails(3, &["damaged blocks were left out"]);
    work.render("--sum a.wpart -o a_%02d.png").fails(3, &["a.wpart: a.wspl: ", "damaged blocks were left out"]);
    work.render("--sum a.wpart --partial -o b.wpart").fails(3, &["b.wpart: lacks"]);
    work.render("--sum b.wpart --frames 3 -o b.png").fails(3, &["b.wpart"]);
    assert!(work.names().contains(&"a_15.png".into()));
}
