//! Bare decoding, which every picture needs.

use rayon::prelude::*;
use std::hint::black_box;
use std::path::Path;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::mapped::{Access, FileBytes};
use wavesplat::file::CoefficientFile;
use wavesplat_format::{BlockEntry, Reader};

/// Decodes the codes of all blocks of a file, from opening it, without keeping them. Returns the bytes read of blocks.
pub(super) fn codes(path: &Path) -> Result<u64> {
    let file = CoefficientFile::open(path)?;
    let whole = file.grid.whole();
    let mut bytes = 0;
    for window in 0..file.metadata().windows.len() as u32 {
        let codec = &file.codec(window)?;
        let wanted = vec![true; codec.basis.coefficients()];
        let leaves = file.entries(window, 0, &whole).collect::<Result<Vec<_>>>()?;
        let read = |entry: &BlockEntry| {
            let block = file.block(codec, entry, &wanted)?;
            black_box(&block);
            Ok(block.bytes_read)
        };
        bytes += leaves.par_iter().flatten().map(read).sum::<Result<u64>>()?;
    }
    Ok(bytes)
}

/// Reads, checks and decompresses all parts of a file, from opening it, without keeping them. Returns their bytes.
pub(super) fn payloads(path: &Path) -> Result<u64> {
    let failed = |source| Error::CoefficientFile { path: path.into(), source };
    let reader = Reader::open(FileBytes::open(path, Access::Map)?).map_err(failed)?;
    let mut bytes = 0;
    for window in 0..reader.metadata().windows.len() as u32 {
        let leaves =
            reader.leaves(window).iter().map(|leaf| reader.leaf(leaf).map_err(failed)).collect::<Result<Vec<_>>>()?;
        let read = |block: &BlockEntry| parts(&reader, block).map_err(failed);
        bytes += leaves.par_iter().flatten().map(read).sum::<Result<u64>>()?;
    }
    Ok(bytes)
}

fn parts(reader: &Reader<FileBytes>, block: &BlockEntry) -> wavesplat_format::Result<u64> {
    block.parts.iter().map(|part| Ok(black_box(reader.part(block, part)?).len() as u64)).sum()
}
