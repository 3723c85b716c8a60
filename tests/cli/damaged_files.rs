//! Damaged coefficient files: exit code 3, the place, and never a wrong answer.

use super::{Archive, Work};

fn some_file() -> (Work, Vec<u8>) {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([20, 14, 10], 40).npy());
    work.wavesplat("convert a.npy -o a.wspl --basis haar --block 8").ok();
    let file = work.read("a.wspl");
    (work, file)
}

#[test]
fn a_truncated_file_is_refused_by_every_command() {
    let (work, file) = some_file();
    for len in [0, 1, 7, 8, 40, 64, file.len() / 3, file.len() / 2, file.len() - 100, file.len() - 1] {
        work.write("cut.wspl", &file[..len]);
        for command in ["info cut.wspl", "verify cut.wspl", "extract cut.wspl -o out.npy"] {
            work.wavesplat(command).fails(3, &["error: cut.wspl: "]);
        }
        work.render("cut.wspl -o out.npy").fails(3, &["error: cut.wspl: "]);
        work.render("cut.wspl -o out_%d.png").fails(3, &["error: cut.wspl: "]);
        assert_eq!(work.names(), ["a.npy", "a.wspl", "cut.wspl"], "cut to {len} bytes");
    }
}

#[test]
fn one_flipped_bit_anywhere_is_found_and_located() {
    let (work, file) = some_file();
    let step = file.len() / 40;
    for i in 0..41 {
        let byte = (i * step + i).min(file.len() - 1);
        let mut bad = file.clone();
        bad[byte] ^= 1 << (i % 8);
        work.write("bad.wspl", &bad);
        let run = work.wavesplat("verify bad.wspl -q").fails(3, &["error: bad.wspl: "]);
        let places = ["header", "footer", "metadata", "directory", "block", "padding", "byte", "offset", "signature"];
        assert!(places.iter().any(|p| run.err.contains(p)), "byte {byte} of {}: {}", file.len(), run.err);
    }
}

#[test]
fn longer_files_are_refused() {
    let (work, file) = some_file();
    work.write("bad.wspl", [file.as_slice(), b"more"].concat());
    work.wavesplat("verify bad.wspl").fails(3, &["bad.wspl"]);
    work.write("bad.wspl", [file.as_slice(), &file].concat());
    work.wavesplat("verify bad.wspl").fails(3, &["bad.wspl"]);
}

#[test]
fn a_damaged_block_stops_commands_that_need_it_and_leaves_no_output() {
    let (work, file) = some_file();
    let mut bad = file.clone();
    bad[file.len() / 3] ^= 0x10; // in a block, because blocks make up most of the file
    work.write("bad.wspl", &bad);
    work.wavesplat("info bad.wspl").ok();
    work.wavesplat("verify bad.wspl").finds(3, &["bad.wspl", "block", "window"]);
    work.wavesplat("extract bad.wspl -o out.npy").fails(3, &["bad.wspl", "block"]);
    work.render("bad.wspl --size 30x30 -o out.npy").fails(3, &["bad.wspl", "block"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "bad.wspl"]);
}

#[test]
fn foreign_files_are_refused() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([5, 5, 5], 8).npy());
    work.write("text.wspl", "hello\n".repeat(100));
    for name in ["a.npy", "text.wspl"] {
        let words = [name, "not a wavesplat coefficient file"];
        work.wavesplat(&format!("verify {name}")).fails(3, &words);
        work.wavesplat(&format!("extract {name} -o out.npy")).fails(3, &words);
    }
    work.render("text.wspl -o out.npy").fails(3, &["text.wspl", "not a wavesplat coefficient file"]);
    work.render("a.npy -o out.npy").fails(2, &["a.npy", "--method direct"]);
    work.render(". -o out.npy").fails(2, &["--method direct"]);
    work.wavesplat("info text.wspl").fails(3, &["text.wspl", "not a wavesplat coefficient file"]);
    work.wavesplat("info nothing.npy").fails(1, &["nothing.npy"]);
    work.wavesplat("verify .").fails(3, &["not a regular file"]);
}
