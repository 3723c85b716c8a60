//! Merged shards are the bytes of one conversion; incomplete or foreign shards are refused.

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
fn incomplete_or_foreign_shards_are_refused() {
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
fn damaged_shards_are_named_or_keep_their_intact_blocks() {
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
fn an_interrupted_merge_is_resumed() {
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
fn resuming_a_complete_merge_does_nothing_and_succeeds() {
    let work = work();
    for (settings, of) in [("--range -2,3", 5), ("--max-error 0.02 --basis haar", 2)] {
        shards(&work, settings, of);
        let merge = "$WAVESPLAT merge $(ls -r part-*.wspl) -o merged.wspl";
        work.shell(&format!("{merge} --resume")).ok();
        let whole = work.read("merged.wspl");
        let run = work.shell(&format!("{merge} --resume --json")).ok();
        assert!(run.err.contains("merged.wspl: is complete already") && run.json()["frames"] == 80, "{}", run.err);
        assert!(work.read("merged.wspl") == whole);
        work.shell(merge).fails(2, &["exists already"]);
        work.shell("rm part-*.wspl").ok();
        shards(&work, "--range -3,3", of);
        work.shell(&format!("{merge} --resume")).fails(2, &["is complete, but not of these shards", "--force"]);
        assert!(work.read("merged.wspl") == whole);
        work.shell("rm *.wspl").ok();
    }
}

#[test]
fn resuming_a_complete_merge_with_losses_still_tells_them() {
    let work = work();
    shards(&work, "--range -2,3", 5);
    let merge = "$WAVESPLAT merge part-[1245].wspl -o merged.wspl --skip-damaged --resume";
    let first = work.shell(merge).fails(3, &["with all of 2 windows of missing shards"]);
    let whole = work.read("merged.wspl");
    let again = work.shell(merge).fails(3, &["is complete already", "with all of 2 windows of missing shards"]);
    assert!(work.read("merged.wspl") == whole);
    let lost = |run: &super::Run| run.err.lines().last().unwrap().to_string();
    assert_eq!(lost(&first), lost(&again));
    work.shell("$WAVESPLAT merge part-*.wspl -o merged.wspl --resume").fails(2, &["not of these shards"]);
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

#[test]
fn missing_shards_become_lost_windows_of_the_right_frames() {
    let work = work();
    shards(&work, "--range -2,3", 5);
    convert(&work, "--range -2,3", None, "whole.wspl");
    work.write("torn.wspl", &work.read("part-3.wspl")[..300]);
    for (inputs, lost, windows) in [
        ("part-1.wspl part-2.wspl part-3.wspl part-4.wspl", "64:80", 2),
        ("part-2.wspl part-3.wspl part-4.wspl part-5.wspl", "0:16", 2),
        ("part-1.wspl part-4.wspl part-5.wspl", "16:48", 4),
        ("part-1.wspl part-2.wspl torn.wspl part-4.wspl part-5.wspl", "32:48", 2),
    ] {
        let merge = format!("merge {inputs} -o merged.wspl --force");
        work.wavesplat(&merge).fails_or_finds(if inputs.contains("torn") { 3 } else { 2 }, &[]);
        let words = format!("all of {windows} windows of missing shards");
        let run = work.wavesplat(&format!("{merge} --skip-damaged")).fails(3, &[&words]);
        assert_eq!(run.message().contains("torn.wspl: cannot be opened"), inputs.contains("torn"));
        let info = work.wavesplat("info merged.wspl --json").ok().json();
        assert_eq!(info["frames"], 80);
        work.wavesplat("verify merged.wspl").finds(3, &["lost"]);
        work.wavesplat(&format!("extract merged.wspl --frames {lost} -o lost.npy --force")).fails(3, &["lost"]);
        let (start, end) = lost.split_once(':').unwrap();
        for kept in
            [format!("0:{start}"), format!("{end}:80")].iter().filter(|kept| !["0:0", "80:80"].contains(&kept.as_str()))
        {
            for file in ["merged", "whole"] {
                work.wavesplat(&format!("extract {file}.wspl --frames {kept} -o {file}.npy --force")).ok();
            }
            assert!(work.read("merged.npy") == work.read("whole.npy"), "{inputs}: {kept}");
        }
    }
    work.wavesplat("merge torn.wspl -o merged.wspl --skip-damaged --force").fails(2, &["no shard can be read"]);
    work.shell("rm part-*.wspl").ok();
    shards(&work, "--range -2,3 --times 5,0.5 --time-unit s", 2);
    work.wavesplat("merge part-2.wspl -o merged.wspl --skip-damaged --force")
        .fails(2, &["no other shard knows the times"]);
}

#[test]
fn a_merge_with_missing_shards_is_resumed() {
    let work = work();
    shards(&work, "--range -2,3", 5);
    let merge = "$WAVESPLAT merge part-[1245].wspl -o merged.wspl --skip-damaged";
    work.shell(merge).fails(3, &["lost"]);
    let whole = work.read("merged.wspl");
    work.shell("rm merged.wspl").ok();
    for share in [2, 3] {
        work.write("merged.wspl.part", &whole[..whole.len() * share / 4]);
        work.shell(&format!("{merge} --resume")).fails_or_finds(3, &["windows of missing shards"]);
        assert!(work.read("merged.wspl") == whole, "{share} quarters");
        work.shell("rm merged.wspl").ok();
    }
}

#[test]
fn shards_are_appended_to_the_bytes_of_one_conversion() {
    let work = work();
    shards(&work, "--range -2,3", 5);
    convert(&work, "--range -2,3", None, "whole.wspl");
    work.write("first.npy", Archive::smooth([20, 14, 10], 16).npy());
    work.wavesplat("convert first.npy -o run.wspl --window 8 --chain 2 --range -2,3").ok();
    work.wavesplat("append run.wspl part-3.wspl")
        .fails(2, &["part-3.wspl", "begins at frame 32, but frame 16 is next"]);
    work.wavesplat("append run.wspl part-1.wspl").fails(2, &["part-1.wspl", "begins at frame 0"]);
    work.wavesplat("append run.wspl part-2.wspl").ok();
    work.wavesplat("append run.wspl part-2.wspl --resume").ok();
    work.wavesplat("append run.wspl part-2.wspl").fails(2, &["but frame 32 is next"]);
    work.wavesplat("append run.wspl part-4.wspl part-3.wspl --json").ok();
    work.write("run.wspl.part", &work.read("whole.wspl")[..work.read("whole.wspl").len() * 9 / 10]);
    work.wavesplat("append run.wspl part-5.wspl").fails(2, &["run.wspl.part"]);
    work.wavesplat("append run.wspl part-5.wspl --resume").ok();
    assert!(work.read("run.wspl") == work.read("whole.wspl"));
    work.wavesplat("append part-1.wspl part-2.wspl").fails(2, &["part-1.wspl", "is a shard itself"]);
    convert(&work, "--range -2,4", Some("2/5"), "wider.wspl");
    work.wavesplat("convert first.npy -o run.wspl --window 8 --chain 2 --range -2,3 --force").ok();
    work.wavesplat("append run.wspl wider.wspl").fails(2, &["wider.wspl", "range"]);
    work.wavesplat("append run.wspl part-2.wspl --frames 3:").fails(2, &["--frames"]);
}

#[test]
fn a_shard_is_compared_with_its_frames_of_the_whole_archive() {
    let work = work();
    shards(&work, "--range -2,3 --tolerance 0", 3);
    for n in 1..=3 {
        work.wavesplat(&format!("verify part-{n}.wspl --against all.npy")).ok();
    }
    work.wavesplat("verify part-2.wspl --against all.npy --frames 0:32").fails_or_finds(4, &[]);
    work.wavesplat("convert all.npy --frames 10:70 -o some.wspl --window 8 --chain 2 --range -2,3 --shard 2/2").ok();
    work.wavesplat("verify some.wspl --against all.npy").ok();
}

/// Frames that are all alike are coded along time alone, without nested codes; the header of each shard announces them.
#[test]
fn the_first_shard_may_have_no_nested_codes() {
    let work = Work::new();
    let flat_at_first = |x: usize, y: usize, z: usize, t: usize| match t {
        0..32 => 1.0,
        _ => ((0.31 * x as f32).sin() * (0.23 * y as f32).cos() + 0.1 * z as f32) * (1.0 + 0.01 * t as f32),
    };
    work.write("all.npy", Archive::of([40, 32, 24], 64, flat_at_first).npy());
    convert(&work, "--range -2,5", None, "whole.wspl");
    shards(&work, "--range -2,5", 4);
    work.shell("$WAVESPLAT merge part-*.wspl -o merged.wspl").ok();
    assert!(work.read("merged.wspl") == work.read("whole.wspl"));
}
