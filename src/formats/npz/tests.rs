use crate::testing::{Folder, check_inputs, payload, refused, survives_damage};
use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use std::io::Write;
use wavesplat_core::base::npy::write_header;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

/// A member of an archive.
struct Member {
    name: &'static str,
    bytes: Vec<u8>,
    method: u16,
}

fn member(name: &'static str, lengths: &[usize], frames: std::ops::Range<usize>, method: u16) -> Member {
    let mut bytes = Vec::new();
    write_header(SampleType::F32, lengths, &mut bytes).expect("written");
    bytes.extend(payload(SampleType::F32, frames, false));
    Member { name, bytes, method }
}

/// A zip archive; with numbers of 64 bits if it is `wide`.
fn zip(members: &[Member], wide: bool) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for Member { name, bytes, method } in members {
        let mut stored = bytes.clone();
        if *method == 8 {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(bytes).expect("in memory");
            stored = encoder.finish().expect("in memory");
        }
        let mut crc = Crc::new();
        crc.update(bytes);
        let (sizes, at) = ([bytes.len() as u64, stored.len() as u64], out.len() as u64);
        let extra: Vec<u8> = if wide {
            [&[1, 0, 24, 0][..], &[sizes[0], sizes[1], at].map(u64::to_le_bytes).concat()].concat()
        } else {
            Vec::new()
        };
        let narrow = |n: u64| if wide { u32::MAX } else { n as u32 }.to_le_bytes();
        let shared = [
            &[20, 0, 0, 0][..],
            &method.to_le_bytes(),
            &[0; 4],
            &crc.sum().to_le_bytes(),
            &narrow(sizes[1]),
            &narrow(sizes[0]),
            &(name.len() as u16).to_le_bytes(),
            &(extra.len() as u16).to_le_bytes(),
        ]
        .concat();
        let header = [b"PK\x01\x02\x14\0", &shared[..], &[0; 10], &narrow(at), name.as_bytes(), &extra].concat();
        directory.extend(header);
        out.extend([b"PK\x03\x04", &shared[..], name.as_bytes(), &extra, &stored].concat());
    }
    let (start, len, count) = (out.len() as u64, directory.len() as u64, members.len() as u16);
    out.extend(directory);
    if wide {
        let record = out.len() as u64;
        out.extend([b"PK\x06\x06", &44_u64.to_le_bytes()[..], &[0; 28]].concat());
        out.extend([len, start].map(u64::to_le_bytes).concat());
        out.extend([b"PK\x06\x07", &[0; 4][..], &record.to_le_bytes(), &[1, 0, 0, 0]].concat());
    }
    let narrow = |n: u64| if wide { u32::MAX } else { n as u32 }.to_le_bytes();
    out.extend([b"PK\x05\x06", &[0; 4][..], &count.to_le_bytes(), &count.to_le_bytes()].concat());
    out.extend([&narrow(len)[..], &narrow(start), &[3, 0], b"abc"].concat());
    out
}

const FRAME: [usize; 3] = [3, 5, 7];

#[test]
fn arrays_with_numbers_are_frames_in_their_order() {
    let folder = Folder::new();
    for (method, wide) in [(0, false), (8, false), (0, true), (8, true)] {
        let names = ["u_10.npy", "u_8.npy", "u_9.npy"].into_iter().zip([2, 0, 1]);
        let mut members: Vec<_> = names.map(|(name, t)| member(name, &FRAME, t..t + 1, method)).collect();
        members.push(Member { name: "note.txt", bytes: b"no array".to_vec(), method });
        let file = [folder.write("a.npz", zip(&members, wide))];
        check_inputs(&file, &OpenOptions::default(), SampleType::F32, 3);
        for name in ["u", "u_%T"] {
            let options = OpenOptions { variable: Some(name.into()), ..OpenOptions::default() };
            check_inputs(&file, &options, SampleType::F32, 3);
        }
        let options = OpenOptions { variable: Some("u_8".into()), ..OpenOptions::default() };
        check_inputs(&file, &options, SampleType::F32, 1);
    }
}

#[test]
fn one_array_may_have_all_frames() {
    let folder = Folder::new();
    for method in [0, 8] {
        let members = [member("density.npy", &[4, 3, 5, 7], 0..4, method)];
        let file = [folder.write("a.npz", zip(&members, false))];
        check_inputs(&file, &OpenOptions::default(), SampleType::F32, 4);
        let file = [folder.write(
            "a.npz",
            zip(&[member("times.npy", &[105], 0..1, method), members.into_iter().next().expect("one")], false),
        )];
        check_inputs(&file, &OpenOptions::default(), SampleType::F32, 4);
    }
}

#[test]
fn one_of_several_variables_is_chosen() {
    let folder = Folder::new();
    let members =
        [member("p.npy", &FRAME, 0..1, 0), member("q.npy", &FRAME, 1..2, 8), member("r1.npy", &FRAME, 2..3, 0)];
    let file = [folder.write("a.npz", zip(&members, false))];
    refused(&file, &OpenOptions::default(), "has 3 variables, not one:\n  p: f32 (z 3, y 5, x 7)");
    assert_eq!(crate::undecided(&file, &OpenOptions::default()).expect("read").len(), 3);
    let options = |name: &str| OpenOptions { variable: Some(name.into()), ..OpenOptions::default() };
    check_inputs(&file, &options("p"), SampleType::F32, 1);
    refused(&file, &options("s"), "has no array s; it has\n  p: f32");
}

#[test]
fn a_missing_number_is_noticed() {
    let folder = Folder::new();
    let names = ["u1.npy", "u2.npy", "u3.npy", "u5.npy"].into_iter().enumerate();
    let members: Vec<_> = names.map(|(t, name)| member(name, &FRAME, t..t + 1, 0)).collect();
    let file = [folder.write("a.npz", zip(&members, false))];
    refused(&file, &OpenOptions::default(), "u%T: ");
    check_inputs(&file, &OpenOptions { allow_gaps: true, ..OpenOptions::default() }, SampleType::F32, 4);
}

#[test]
fn what_cannot_be_is_refused() {
    let folder = Folder::new();
    let with = |bytes: Vec<u8>, words: &str| refused(&[folder.write("a.npz", bytes)], &OpenOptions::default(), words);
    let one = |method| zip(&[member("u.npy", &FRAME, 0..1, method)], false);
    let directory = |bytes: &[u8]| bytes.windows(4).rposition(|w| w == b"PK\x01\x02").expect("a directory");
    let changed = |method: u16, at: usize, value: u8| {
        let mut bytes = one(method);
        let start = directory(&bytes);
        bytes[start + at] = value;
        bytes
    };
    with(b"PK\x03\x04".to_vec(), "no zip archive");
    with(zip(&[], false), "has no array");
    with(zip(&[Member { name: "a.txt", bytes: Vec::new(), method: 0 }], false), "has no array");
    with(one(12), "bzip2 (method 12) is not supported");
    with(changed(0, 8, 1), "is encrypted");
    with(changed(0, 24, 1), "is stored in");
    with(changed(0, 22, 1), "does not end before the directory");
    with(changed(8, 26, 255), "cannot be so many");
    with(changed(8, 24, 1), "its header says otherwise");
    with(changed(0, 42, 1), "is not where the directory says");
    with(zip(&[member("u.npy", &[4, 5, 7], 0..1, 0)], false), "its header says otherwise");
    let good = one(0);
    for cut in 0..good.len() - 3 {
        let file = folder.write("a.npz", &good[..cut]);
        assert!(crate::open(&[file], &OpenOptions::default()).is_err(), "{cut} bytes");
    }
}

#[test]
fn members_that_share_bytes_are_refused() {
    let folder = Folder::new();
    let mut bytes = zip(&[member("u1.npy", &FRAME, 0..1, 0), member("u2.npy", &FRAME, 1..2, 0)], false);
    let second = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").expect("a directory");
    bytes[second + 42..][..4].fill(0);
    refused(&[folder.write("a.npz", bytes)], &OpenOptions::default(), "share bytes");
}

#[test]
fn a_wrong_checksum_is_noticed() {
    let folder = Folder::new();
    let mut bytes = zip(&[member("u.npy", &FRAME, 0..1, 8)], false);
    let entry = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").expect("a directory");
    bytes[entry + 16] ^= 1;
    let mut source = crate::open(&[folder.write("a.npz", bytes)], &OpenOptions::default()).expect("a header");
    let error = source.window(0, 1).err().expect("a wrong checksum").to_string();
    assert!(error.contains("checksum"), "{error}");
}

#[test]
fn no_damage_panics() {
    for method in [0, 8] {
        survives_damage("a.npz", &zip(&[member("u1.npy", &FRAME, 0..1, method)], method == 8));
    }
}
