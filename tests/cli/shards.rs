//! Shards of an archive give the bytes of one conversion, and merging refuses what is not all of them.

use super::{Archive, Work};

/// An archive of 80 frames, in windows of 8 and chains of 2: five runs that shards are made of.
fn work() -> Work {
    let work = Work::new();
    work.write("all.npy", Archive::smooth([20, 14, 10], 80).npy());
    work
}

/// Options of all conversions of a test.
fn convert(work: &Work, settings: &str, shard: Option<&str>, output: &str) {
    let shard = shard.map_or(String::new(), |shard| format!("--shard {shard}"));
    work.wavesplat(&format!("convert all.npy -o {output} --window 8 --chain 2 {settings} {shard}")).ok();
}

/// Shards `part-1.wspl` and so on of a conversion.
fn shards(work: &Work, settings: &str, of: usize) {
    (1..=of).for_each(|n| convert(work, settings, Some(&format!("{n}/{of}")), &format!("part-{n}.wspl")));
}

#[test]
fn merged_shards_are_the_bytes_of_one_conversion() {
    let work = work();
    work.wavesplat("scan all.npy -o scan.json").ok();
    for settings in [
        "--scan scan.json",
        "--scan scan.json --bound rms --basis haar",
        "--range -2,3 --basis learned --block 8",
        "--max-error 0.02 --times 5,0.5 --time-unit s",
        "--range -2,3 --tolerance 0",
    ] {
        convert(&work, settings, None, "whole.wspl");
        for of in [1, 2, 5] {
            shards(&work, settings, of);
            work.shell("$WAVESPLAT merge $(ls -r part-*.wspl) -o merged.wspl").ok();
            assert!(work.read("merged.wspl") == work.read("whole.wspl"), "{settings}, {of} shards");
            work.shell("rm part-*.wspl merged.wspl").ok();
        }
        work.wavesplat("verify whole.wspl --against all.npy").ok();
        work.shell("rm whole.wspl").ok();
    }
}

#[test]
fn scans_of_shards_are_the_scan_of_all_frames() {
    let work = work();
    work.wavesplat("scan all.npy -o scan.json").ok();
    (1..=3).for_each(|n| _ = work.wavesplat(&format!("scan all.npy --shard {n}/3 -o scan-{n}.json")).ok());
    work.shell("$WAVESPLAT scan --merge $(ls -r scan-*.json) -o merged.json").ok();
    assert_eq!(work.read("merged.json"), work.read("scan.json"));
    work.wavesplat("scan --merge scan-1.json scan-3.json -o a.json").fails(2, &["scan-3.json", "leave out frames"]);
    work.wavesplat("scan --merge scan-1.json scan-2.json -o a.json").fails(2, &["scan-2.json", "are in no scan"]);
    work.wavesplat("convert all.npy --scan scan-1.json -o a.wspl").fails(3, &["scan-1.json", "merge the scans"]);
    work.write("other.npy", Archive::smooth([20, 14, 9], 80).npy());
    work.wavesplat("convert other.npy --scan scan.json -o a.wspl").fails(3, &["scan.json", "not of these"]);
    for text in ["", "[]", "{\"schema\": 1}", &"[".repeat(100_000)] {
        work.write("hostile.json", text);
        work.wavesplat("convert all.npy --scan hostile.json -o a.wspl").fails(3, &["hostile.json", "is no scan"]);
    }
    work.write("huge.json", vec![b' '; 2 << 20]);
    work.wavesplat("convert all.npy --scan huge.json -o a.wspl").fails(3, &["huge.json", "too long"]);
    assert!(!work.names().iter().any(|name| name.starts_with("a.")));
}

#[test]
fn what_is_not_all_shards_of_one_archive_is_refused() {
    let work = work();
    let range = "--range -2,3";
    shards(&work, range, 3);
    convert(&work, range, Some("2/2"), "half.wspl");
    convert(&work, "--range -2,4", Some("2/3"), "wider.wspl");
    convert(&work, range, None, "whole.wspl");
    work.write("other.npy", Archive::smooth([20, 14, 9], 80).npy());
    work.wavesplat("convert other.npy -o other.wspl --window 8 --chain 2 --range -2,3 --shard 2/3").ok();
    work.write("text.wspl", "no shard at all");
    for (shards, code, words) in [
        ("part-1.wspl part-3.wspl", 2, ["part-3.wspl", "shard 2 of 3 is missing before it"]),
        ("part-1.wspl part-2.wspl", 2, ["part-2.wspl", "shard 3 of 3 is missing after it"]),
        ("part-1.wspl part-2.wspl part-2.wspl part-3.wspl", 2, ["part-2.wspl", "is shard 2, as part-2.wspl is"]),
        ("part-1.wspl half.wspl", 2, ["half.wspl", "one of 2 shards"]),
        ("part-1.wspl wider.wspl part-3.wspl", 2, ["wider.wspl", "range"]),
        ("part-1.wspl other.wspl part-3.wspl", 2, ["other.wspl", "size"]),
        ("part-1.wspl whole.wspl part-3.wspl", 2, ["whole.wspl", "is no shard"]),
        ("part-1.wspl text.wspl part-3.wspl", 3, ["text.wspl", "not a wavesplat coefficient file"]),
        ("part-1.wspl none.wspl part-3.wspl", 1, ["none.wspl", "No such file"]),
    ] {
        work.wavesplat(&format!("merge {shards} -o merged.wspl")).fails(code, &words);
    }
    for (options, words) in [
        ("--shard 1/3", "--shard: the tolerance refers to the range of all frames"),
        ("--shard 4/3 --range -2,3", "takes I/N"),
        ("--shard 1/6 --range -2,3", "6 shards need"),
        ("--shard 1/2 --bound relative", "needs --bound"),
    ] {
        let convert = format!("convert all.npy -o merged.wspl --window 8 --chain 2 {options}");
        work.wavesplat(&convert).fails(2, &[words]);
    }
    let raw = "cat all.npy | $WAVESPLAT convert - --dims 20x14x10 --dtype f32 -o merged.wspl --range -2,3 --shard 1/2";
    work.shell(&raw.replace("cat all.npy", "tail -c +129 all.npy")).fails(2, &["no known number of frames"]);
    assert!(!work.names().iter().any(|name| name.starts_with("merged")));
}

#[test]
fn damaged_shards_are_named_or_keep_what_is_whole() {
    let work = work();
    shards(&work, "--range -2,3 --block 8", 2);
    let mut bytes = work.read("part-2.wspl");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    work.write("part-2.wspl", &bytes);
    work.wavesplat("merge part-1.wspl part-2.wspl -o merged.wspl").fails(3, &["part-2.wspl", "damaged at byte"]);
    let merged = "merge part-1.wspl part-2.wspl -o merged.wspl --skip-damaged --force";
    work.wavesplat(merged).fails(3, &["are lost: 1"]);
    work.wavesplat("extract merged.wspl --frames 0:8 -o a.npy").ok();
    work.wavesplat("extract merged.wspl -o b.npy").fails(3, &["lost"]);
    work.wavesplat("extract merged.wspl -o b.npy --skip-damaged").fails_or_finds(3, &["left out"]);
}

#[test]
fn a_merge_that_was_cut_short_goes_on() {
    let work = work();
    shards(&work, "--range -2,3", 5);
    work.shell("$WAVESPLAT merge part-*.wspl -o whole.wspl").ok();
    let whole = work.read("whole.wspl");
    for share in [1, 2, 3] {
        work.write("merged.wspl.part", &whole[..whole.len() * share / 4]);
        work.shell("$WAVESPLAT merge part-*.wspl -o merged.wspl").fails(2, &["merged.wspl.part", "--resume"]);
        work.shell("$WAVESPLAT merge part-*.wspl -o merged.wspl --resume").ok();
        assert!(work.read("merged.wspl") == whole, "{share} quarters");
        work.shell("rm merged.wspl").ok();
    }
    work.write("other.npy", Archive::smooth([20, 14, 9], 80).npy());
    work.wavesplat("convert other.npy -o other.wspl --window 8").ok();
    let other = work.read("other.wspl");
    work.write("merged.wspl.part", &other[..other.len() * 3 / 4]);
    work.shell("$WAVESPLAT merge part-*.wspl -o merged.wspl --resume").fails(2, &["was begun by other shards"]);
}

#[test]
fn shards_of_archives_with_coordinates_and_dates() {
    let work = Work::new();
    let input = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/inputs/netcdf/netcdf4.nc");
    work.write("run.nc", std::fs::read(input).unwrap());
    let convert = |shard: &str, output: &str| {
        let options = "--window 1 --chain 1 --basis pyramid --max-error 0.01";
        work.wavesplat(&format!("convert run.nc -o {output} {options} {shard}")).ok();
    };
    convert("", "whole.wspl");
    (1..=2).for_each(|n| convert(&format!("--shard {n}/2"), &format!("part-{n}.wspl")));
    work.wavesplat("merge part-2.wspl part-1.wspl -o merged.wspl").ok();
    assert!(work.read("merged.wspl") == work.read("whole.wspl"));
}
