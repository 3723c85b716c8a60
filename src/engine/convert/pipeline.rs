//! The stages of conversions that go on side by side. One conversion is the usual case.

use super::coded_input::CodedInput;
use super::plan::Plan;
use super::reading::{SourceReader, read};
use super::record::WindowWriter;
use super::target::{ResumePoint, Target, WindowsDone};
use super::workers::CodedBlock;
use super::{ConvertConfig, ConvertReport, workers};
use crossbeam_channel::{Receiver, bounded};
use std::io::Write;
use std::path::Path;
use std::thread::ScopedJoinHandle;
use std::time::Instant;
use wavesplat_core::base::description::{Description, is_of};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::codec;
use wavesplat_core::source::{Archive, FrameSource};

/// One of the conversions that go on side by side.
pub struct Conversion<'a, W> {
    /// Its frames.
    pub source: &'a mut dyn FrameSource,
    /// How they are converted.
    pub config: &'a ConvertConfig,
    /// Its output.
    pub target: Target<'a, W>,
}

/// Converts all frames of `source` into a coefficient file written to `out`, in one pass and without seeking.
///
/// `out` is flushed when a window is complete. Messages call it `name`.
pub fn convert<W: Write>(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    name: &Path,
    out: W,
    progress: &dyn Progress,
) -> Result<ConvertReport> {
    convert_into(source, config, Target { name, out, resume_from: None }, progress)
}

/// As [`convert`], continuing a partial file after its complete windows if the target has some.
///
/// # Errors
/// Those of [`convert`]; also an error if the partial file has other settings, or was converted from other frames.
pub fn convert_into<W: Write>(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    target: Target<'_, W>,
    progress: &dyn Progress,
) -> Result<ConvertReport> {
    let mut only = convert_together(vec![Conversion { source, config, target }], progress)?;
    only.pop().expect("one result for each conversion")
}

/// Converts several sources side by side, in the memory of one: a window of each in turn, the one with the fewest frames so far
/// first. So what they share is read at about the same time. Each output has the bytes that it has alone.
///
/// The results are those of the conversions, in order. One whose frames cannot be read or have missing samples ends, and the others go on.
///
/// # Errors
/// What ends all of them: settings that contradict each other, an output that cannot be written, a result that is no longer wanted.
pub fn convert_together<W: Write>(
    conversions: Vec<Conversion<'_, W>>,
    progress: &dyn Progress,
) -> Result<Vec<Result<ConvertReport>>> {
    let started = Instant::now();
    let inputs: Vec<CodedInput> =
        conversions.iter().map(|one| CodedInput::new(one.config, one.source.archive())).collect();
    let plans = &inputs.iter().map(Plan::new).collect::<Result<Vec<_>>>()?;
    let (mut readers, mut writers) = (Vec::new(), Vec::new());
    for (i, (Conversion { source, target, .. }, input)) in conversions.into_iter().zip(&inputs).enumerate() {
        let plan = &plans[i];
        check_description(&input.archive, target.resume_from.as_ref())?;
        let done = WindowsDone::new(target.resume_from.as_ref(), plan, &input.archive, target.name)?;
        readers.push(SourceReader::new(i, source, input, plan, done));
        writers.push(WindowWriter::new(input, plan, target));
    }
    progress.start(readers.iter().map(SourceReader::blocks).sum());
    progress.resume(readers.iter().map(SourceReader::blocks_done).sum());
    let (to_workers, from_reader) = bounded(0);
    let (to_writer, from_workers) = bounded(0);
    let ran = std::thread::scope(|scope| {
        // Each stage owns its ends of the channels. When a stage ends, even by an error, its neighbours end too.
        let reader = scope.spawn(move || read(readers, &to_workers));
        let workers = scope.spawn(move || workers::encode(plans, &from_reader, &to_writer));
        let written = write(&mut writers, from_workers, progress);
        let (encoded, read) = (join(workers), join(reader));
        written.and(encoded).map(|encoding| (read, encoding))
    });
    codec::release_spare();
    let (read, encoding) = ran?;
    let finish = |(writer, read): (WindowWriter<'_, W>, Result<_>)| writer.finish(started, read?, encoding);
    let results: Vec<_> = writers.into_iter().zip(read).map(finish).collect();
    if results.iter().all(Result::is_ok) {
        progress.finish();
    }
    Ok(results)
}

/// Appends blocks to their files until the workers end.
fn write<W: Write>(
    writers: &mut [WindowWriter<'_, W>],
    blocks: Receiver<CodedBlock>,
    progress: &dyn Progress,
) -> Result<()> {
    for block in blocks {
        progress.check()?;
        let is_fine = block.coded.block.id.tier == 0;
        writers[block.window.conversion].append(block)?;
        progress.advance(u64::from(is_fine));
    }
    Ok(())
}

/// Checks that the source's description fits its frames, so that a mismatch fails at the start and not at the end.
fn check_description(archive: &Archive, resume_from: Option<&ResumePoint>) -> Result<()> {
    let is_appended = resume_from.is_some_and(|point| point.first_window > 0);
    let fits = |description: &Description| {
        is_appended || archive.frames.is_none_or(|frames| is_of(description, archive.grid.dims, frames))
    };
    match archive.description.as_ref().is_none_or(fits) {
        true => Ok(()),
        false => Err(Error::setting("description", "its axes are not those of the frames")),
    }
}

/// Propagates the panic of a stage, which is a bug and not an error.
fn join<T>(stage: ScopedJoinHandle<'_, T>) -> T {
    stage.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
