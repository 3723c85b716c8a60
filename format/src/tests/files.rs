//! Files read back as they were written.

use crate::testing::*;
use crate::*;

#[test]
fn files_round_trip() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 7);
    let file = file(&metadata, &blocks);
    let written: Vec<_> = blocks.iter().map(|(block, content)| (block.id, content.clone())).collect();
    assert_eq!(verify(&file).expect("whole"), written);
    let reader = Reader::open(&file).expect("whole");
    assert_eq!((reader.metadata(), reader.id()), (&metadata, ID));
    for (block, _) in &blocks {
        let entry = reader.entry(block.id).expect("present");
        assert_eq!((entry.id, entry.stats, entry.parts.len()), (block.id, block.stats, block.parts.len()));
        assert_eq!(entry.stored_len(), block.parts.iter().map(|part| part.stored.len() as u64).sum());
        assert!(
            entry.parts.first().is_none_or(|part| (part.offset - entry.header_len()).is_multiple_of(limits::ALIGN))
        );
    }
    assert!(reader.leaves(2).is_empty());
    assert!(reader.entry(BlockId::new(0, 0, 12)).is_err());
}

#[test]
fn windows_of_several_leaves_round_trip() {
    let mut metadata = Metadata { dims: [40, 30, 1], block_edge: 1, ..metadata() };
    metadata.windows[1].missing = 1_000; // may exceed the parts' counts: exact blocks hold missing samples too
    let blocks = blocks(&mut metadata, 3);
    let file = file(&metadata, &blocks);
    let reader = Reader::open(&file).expect("whole");
    let counts: Vec<u16> = reader.leaves(1).iter().map(|leaf| leaf.count).collect();
    assert_eq!(counts, [512, 512, 176, 512, 512, 176]);
    let id = BlockId::new(1, 1, 1199);
    assert_eq!(reader.entry(id).expect("present").id, id);
    assert_eq!(verify(&file).expect("whole").len(), blocks.len());
}

#[test]
fn writing_twice_gives_the_same_bytes() {
    let write = || {
        let mut metadata = metadata();
        let blocks = blocks(&mut metadata, 11);
        file(&metadata, &blocks)
    };
    assert_eq!(write(), write());
}

#[test]
fn writers_refuse_wrong_orders_and_stay_refused() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 5);
    for wrong in [1, 12, 24] {
        let mut writer = Writer::new(Vec::new(), ID, &metadata).expect("memory");
        assert!(matches!(writer.append(&blocks[wrong].0), Err(Error::Invalid(_))));
        assert!(matches!(writer.append(&blocks[0].0), Err(Error::Invalid(_))), "broken for good");
    }
    for skipped in [3, 11, 23, 47] {
        let others = blocks.iter().enumerate().filter(|&(number, _)| number != skipped);
        assert!(write(&metadata, others.map(|(_, (block, _))| block)).is_err(), "block {skipped} is missing");
    }
}

#[test]
fn writers_refuse_impossible_statistics() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 5);
    let changes: [fn(&mut EncodedBlock); 6] = [
        |block| block.stats.step = f64::NAN,
        |block| block.stats.min = 3.0,
        |block| block.stats.reached = -1.0,
        |block| block.parts.reverse(),
        |block| block.parts[0].stats.count = 0,
        |block| block.parts[1].kind = block.parts[0].kind,
    ];
    let (block, _) = blocks.iter().find(|(block, _)| block.parts.len() > 1).expect("one of several parts");
    for change in changes {
        let mut block = EncodedBlock { id: BlockId::new(0, 0, 0), ..block.clone() };
        change(&mut block);
        let mut writer = Writer::new(Vec::new(), ID, &metadata).expect("memory");
        assert!(matches!(writer.append(&block), Err(Error::Invalid(_))));
    }
}

#[test]
fn a_full_disk_is_an_error_that_stays() {
    let mut metadata = metadata();
    let blocks = blocks(&mut metadata, 5);
    let mut space = [0; 1300];
    let mut writer = Writer::new(&mut space[..], ID, &metadata).expect("room for the start");
    let failed = blocks.iter().position(|(block, _)| writer.append(block).is_err());
    assert!(failed.is_some());
    assert!(writer.finish().is_err());
}
