//! Recovers the intact blocks of a damaged coefficient file into a new file. The damaged file is only read.

use serde::Serialize;
use std::io::Write;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::source::CHANNELS;
use wavesplat_format::{BlockId, Recovery};

/// The report of a recovery: what was saved, and what was lost.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RecoverReport {
    /// Frames of the new file.
    pub frames: u64,
    /// Its windows.
    pub windows: usize,
    /// Its blocks.
    pub blocks: u64,
    /// Its bytes.
    pub bytes: u64,
    /// Blocks of it whose samples are lost.
    pub blocks_lost: u64,
    /// Where these are: runs of blocks of a window.
    pub lost: Vec<Run>,
    /// Windows whose coding record is damaged; all their blocks are lost.
    pub windows_undescribed: Vec<u32>,
    /// Intact blocks that were not recovered, because they belong to later windows whose coding record is damaged.
    pub blocks_left_behind: u64,
    /// Whether it is certain that there were no more windows.
    pub all_known: bool,
    /// Whether the coordinates and the attributes of the source are lost.
    pub description_lost: bool,
}

/// Some blocks of a window, one after another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Run {
    /// The window, counted from 0.
    pub window: u32,
    /// Its frames.
    pub frames: (u64, u64),
    /// Their tier, if it is not that of all voxels.
    #[serde(skip_serializing_if = "is_finest")]
    pub tier: u8,
    /// The first of the blocks.
    pub first: u32,
    /// The last.
    pub last: u32,
    /// Their channel, if the file is of colours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<&'static str>,
}

fn is_finest(tier: &u8) -> bool {
    *tier == 0
}

/// Writes all intact blocks of `damaged` to `out`, called `name` in messages. The first progress counts the bytes
/// searched, the second the blocks saved.
pub fn recover(
    damaged: &FileBytes,
    name: &Path,
    out: impl Write,
    [searching, saving]: [&dyn Progress; 2],
) -> Result<RecoverReport> {
    let failed = |source| Error::CoefficientFile { path: damaged.path().into(), source };
    searching.start(Some(damaged.len()));
    let recovery = Recovery::search(damaged, &mut |bytes| searching.advance(bytes)).map_err(failed)?;
    searching.finish();
    let metadata = recovery.metadata();
    saving.start(Some(metadata.blocks()));
    let saved = recovery.write(damaged, out, &mut || saving.advance(1));
    let (mut out, saved) = saved.map_err(|source| Error::CoefficientFile { path: name.into(), source })?;
    out.flush().map_err(|e| Error::io(name, "writing", e))?;
    damaged.check_unchanged()?;
    saving.finish();
    let coloured = usize::from(metadata.channels) == CHANNELS.len();
    let frames = |window: u32| {
        let window = &metadata.windows[window as usize];
        (window.first_frame, window.first_frame + u64::from(window.frames))
    };
    let run = |run: &[BlockId]| {
        let (first, last) = (run[0], run[run.len() - 1]);
        let channel = coloured.then(|| CHANNELS.get(usize::from(first.channel)).copied()).flatten();
        let (window, tier) = (first.window, first.tier);
        Run { window, frames: frames(window), tier, first: first.block, last: last.block, channel }
    };
    let follows = |a: &BlockId, b: &BlockId| BlockId { block: a.block + 1, ..*a } == *b;
    Ok(RecoverReport {
        frames: metadata.frames,
        windows: metadata.windows.len(),
        blocks: saved.summary.blocks,
        bytes: saved.summary.bytes,
        blocks_lost: saved.lost.len() as u64,
        lost: saved.lost.chunk_by(follows).map(run).collect(),
        windows_undescribed: saved.undescribed,
        blocks_left_behind: saved.left_behind,
        all_known: saved.all_known,
        description_lost: saved.description_lost,
    })
}
