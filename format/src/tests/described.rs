//! Files with a description.

use crate::description::{Attribute, Description, Values};
use crate::footer::{FOOTER, Footer};
use crate::header::Features;
use crate::section::{SectionExtent, SectionId, compress_directory, frame};
use crate::testing::{ID, blocks, metadata, read_all};
use crate::{CompletePrefix, Error, Metadata, Reader, Recovery, Writer, to_bare};

fn description() -> Description {
    let text = |name: &str, text: &str| Attribute { name: name.into(), value: Values::text(text) };
    let global = vec![text("title", "a run"), text("history", &"once more; ".repeat(50))];
    Description { source: "NetCDF".into(), global, ..Description::default() }
}

/// A small file with a description, or without.
fn file(described: Option<&Description>) -> (Metadata, Vec<u8>) {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 7);
    let features = Features { described: described.is_some(), ..metadata.features() };
    let mut writer = Writer::with_features(Vec::new(), ID, &metadata, features).expect("memory");
    for window in 0..metadata.windows.len() as u32 {
        writer.begin_window(metadata.window_record(window)).expect("next");
        let own = blocks.iter().map(|(block, _)| block).filter(|block| block.id.window == window);
        own.for_each(|block| writer.append(block).expect("in order"));
        writer.end_window(&metadata.window_end(window)).expect("whole");
    }
    let bytes = writer.finish_described(described).expect("whole").0;
    (metadata, bytes)
}

#[test]
fn a_description_comes_back_and_changes_nothing_else() {
    let ((_, plain), (_, described)) = (file(None), file(Some(&description())));
    let read = |file: &[u8]| Reader::open(file).expect("whole").description().expect("whole");
    assert_eq!((read(&plain), read(&described)), (None, Some(description())));
    assert_eq!(read_all(&plain).expect("whole"), read_all(&described).expect("whole"));
    assert_eq!((described[10], described[16] & 2), (1, 2));
    let bare = to_bare(&Reader::open(&described).expect("whole")).expect_err("a description");
    assert!(bare.to_string().contains("no description"), "{bare}");
}

#[test]
fn header_and_end_agree() {
    let (metadata, bytes) = file(Some(&description()));
    let continued = |bytes: &[u8], description: Option<&Description>| {
        let prefix = CompletePrefix::read(&bytes).expect("windows");
        let start = bytes[..prefix.bytes() as usize].to_vec();
        Writer::resume(start, prefix).finish_described(description)
    };
    assert_eq!(continued(&bytes, Some(&description())).expect("whole").0, bytes);
    assert!(matches!(continued(&bytes, None), Err(Error::Invalid(_))));
    assert!(matches!(continued(&file(None).1, Some(&description())), Err(Error::Invalid(_))));
    assert_eq!(metadata.frames, CompletePrefix::read(&bytes).expect("windows").metadata().frames);
}

#[test]
fn every_changed_byte_is_found_and_the_rest_is_recovered() {
    let (metadata, bytes) = file(Some(&description()));
    let footer = bytes.last_chunk::<FOOTER>().map(Footer::decode).expect("a footer").expect("whole");
    let extent = footer.description.expect("one");
    let recovered = |damaged: &Vec<u8>| {
        let recovery = Recovery::search(damaged, &mut |_| {}).expect("blocks");
        recovery.write(damaged, Vec::new(), &mut || {}).expect("memory").0
    };
    assert_eq!(recovered(&bytes), bytes);
    for at in extent.offset as usize..bytes.len() - FOOTER {
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        assert!(read_all(&damaged).is_err(), "byte {at}");
        let whole = recovered(&damaged);
        assert_eq!(read_all(&whole).expect("whole").len() as u64, metadata.blocks());
    }
}

#[test]
fn forged_descriptions_are_refused_in_bounded_memory() {
    let (_, bytes) = file(Some(&description()));
    let footer = bytes.last_chunk::<FOOTER>().map(Footer::decode).expect("a footer").expect("whole");
    let forge = |raw: &[u8], raw_len: u32| {
        let (stored, offset) = (compress_directory(raw).expect("memory"), footer.description.expect("one").offset);
        let checksum = SectionId::Description.checksum(ID, &stored);
        let extent = SectionExtent { offset, stored_len: stored.len() as u32, raw_len, checksum };
        let mut out = bytes[..offset as usize].to_vec();
        out.extend(frame(SectionId::Description, &extent));
        out.extend(stored);
        out.resize(out.len().next_multiple_of(64), 0);
        let total = (out.len() + FOOTER) as u64;
        out.extend(Footer { total, description: Some(extent), ..footer }.encode());
        out
    };
    let refused = |file: Vec<u8>| Reader::open(&file).expect("samples").description().expect_err("forged").to_string();
    let endless = vec![0; crate::limits::MAX_DESCRIPTION + 1];
    assert!(refused(forge(&endless, endless.len() as u32)).contains("at most"));
    assert!(refused(forge(&[0; 8], u32::MAX)).contains("at most"));
    assert!(refused(forge(&[0; 8], 9)).contains("does not declare 9 bytes"));
    assert!(refused(forge(&[0xff; 64], 64)).contains("not a description"));
    let many = [&[0; 8][..], &u64::MAX.to_le_bytes(), &[0; 64]].concat();
    assert!(refused(forge(&many, many.len() as u32)).contains("description"));
}
