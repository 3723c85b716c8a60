//! Bare streams give the files that they were made of.

use crate::testing::*;
use crate::*;

fn example(seed: u64) -> Vec<u8> {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, seed);
    file(&metadata, &blocks)
}

fn bare(file: &[u8]) -> Vec<u8> {
    to_bare(&Reader::open(file.to_vec()).expect("whole")).expect("few blocks")
}

#[test]
fn a_bare_stream_gives_its_file_and_what_follows_it() {
    for seed in 1..9 {
        let file = example(seed);
        let mut stream = bare(&file);
        assert!(stream.len() * 2 < file.len(), "{} of {}", stream.len(), file.len());
        stream.extend_from_slice(b"more");
        let (found, rest) = from_bare(&stream).expect("whole");
        assert_eq!((found, rest), (file, b"more".as_slice()));
    }
}

#[test]
fn every_flipped_byte_is_noticed() {
    let file = example(2);
    let stream = bare(&file);
    for at in 0..stream.len() {
        let mut damaged = stream.clone();
        damaged[at] ^= 0x10;
        assert!(from_bare(&damaged).is_err(), "byte {at}");
    }
    for cut in 0..stream.len() {
        assert!(from_bare(&stream[..cut]).is_err(), "{cut} bytes");
    }
}
