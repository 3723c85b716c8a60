//! Power failures during writing: pages that had not reached the disk are old, zero or torn. Resuming uses only
//! complete windows, whatever is left.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::series::{Kind, Mask, volume};
use crate::common::{report, settings, stored, times};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig};
use wavesplat_format::CompletePrefix;

const DISKS: usize = 20_000;

/// Number of bytes that a disk writes at once.
const PAGE: usize = 512;

/// The file after a power failure, when everything after `synced` had not reached the disk.
fn failed(file: &[u8], synced: usize, random: &mut Random) -> Vec<u8> {
    let mut left = file[..synced + random.below(file.len() - synced + 1)].to_vec();
    let torn = random.below(4);
    for page in (synced / PAGE..left.len().div_ceil(PAGE)).filter(|_| torn > 0) {
        let (start, end) = ((page * PAGE).max(synced), ((page + 1) * PAGE).min(left.len()));
        match random.below(8) {
            0 => left[start..end].fill(0),
            1 => left[start..end].fill_with(|| random.bits() as u8), // the disk's earlier content
            2 => left[start..start + random.below((end - start).max(1))].fill(0),
            3 if page > synced / PAGE => left.copy_within(start - PAGE..end - PAGE, start),
            _ => {}
        }
    }
    left
}

#[test]
fn after_a_power_failure_only_complete_windows_are_resumed() {
    let dims = [9, 7, 5];
    let data = volume(Kind::Wave, SampleType::F32, Mask::Special, dims.iter().product(), 40, 3);
    let config = ConvertConfig { block: Some(5), ..settings(Basis::Samples, 8, 0.05) };
    let file = stored(&mut Memory::new(Grid::unit(dims), SampleType::F32, data), &config).bytes();
    let whole = CompletePrefix::read(&file).unwrap();
    let (mut random, mut kept) = (Random(11), [0; 6]);
    let start = CompletePrefix::read(&file[..700].to_vec()).unwrap().bytes() as usize;
    for _ in 0..DISKS * times() {
        let synced = start + random.below(file.len() - start);
        let before = CompletePrefix::read(&file[..synced].to_vec()).unwrap();
        let left = failed(&file, synced, &mut random);
        let found = CompletePrefix::read(&left).unwrap();
        let (bytes, windows) = (found.bytes() as usize, found.metadata().windows.len());
        assert!(windows >= before.metadata().windows.len(), "what was on the disk is not lost");
        assert_eq!(found.metadata().windows, whole.metadata().windows[..windows]);
        assert!(left[..bytes] == file[..bytes], "what is kept is what was written");
        kept[windows] += 1;
    }
    report(&format!("torn disks by windows kept: {kept:?}"));
    assert!(kept[..5].iter().all(|n| *n > DISKS / 100), "{kept:?}");
}
