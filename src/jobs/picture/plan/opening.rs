//! The frame that a viewer opens at.

use super::ranges::spread_over;
use std::ops::Range;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::page::{opening, spread};
use wavesplat_engine::render::{OverviewRequest, Scene, Thinning};

/// The largest number of frames to look at.
const MOST_FRAMES: usize = 64;
/// The same for frames that are read, and not decoded.
const MOST_READ: usize = 8;
/// The largest number of samples to look at.
const MOST_SAMPLES: usize = 1 << 20;

/// The one in the middle of some frames, or one where an overview shows much more.
pub(in crate::picture) fn opening_frame(
    scene: &mut dyn Scene,
    file: Option<&CoefficientFile>,
    all: &[usize],
    memory: usize,
    progress: &dyn Progress,
) -> Result<usize> {
    let Some(&middle) = all.get(all.len() / 2) else { return Ok(0) };
    let frames = frames_to_see(file, all, middle);
    let (thinning, region) = (thinning(scene, frames.len()), scene.grid().whole());
    let request = OverviewRequest { thinning, frames: &frames, memory, region };
    let samples = match scene.overview(&request, progress) {
        Ok(Some(samples)) => samples,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Ok(None) | Err(_) => return Ok(middle), // the first picture says what is wrong
    };
    let of_frame = request.samples() / frames.len();
    let spreads: Vec<f64> = samples.chunks_exact(of_frame).take(frames.len()).map(spread).collect();
    let preferred = frames.binary_search(&middle).unwrap_or(0);
    Ok(frames[opening(&spreads, preferred)])
}

/// The frame in the middle, and those in the window whose samples differ most; without windows, some of all frames. In ascending
/// order.
fn frames_to_see(file: Option<&CoefficientFile>, all: &[usize], middle: usize) -> Vec<usize> {
    let some = |frames: &[usize], most| spread_over(frames.len(), most).into_iter().map(|n| frames[n]).collect();
    let mut frames: Vec<usize> = match file.and_then(widest_window) {
        Some(window) => {
            let within: Vec<usize> = all.iter().copied().filter(|frame| window.contains(frame)).collect();
            if within.is_empty() { vec![middle] } else { some(&within, MOST_FRAMES) }
        }
        None => some(all, MOST_READ),
    };
    frames.push(middle);
    frames.sort_unstable();
    frames.dedup();
    frames
}

/// The frames of the window whose samples have the widest range.
fn widest_window(file: &CoefficientFile) -> Option<Range<usize>> {
    let windows = (0..).zip(&file.metadata().windows);
    let widest = windows.max_by(|(_, a), (_, b)| (a.max - a.min).total_cmp(&(b.max - b.min)));
    widest.map(|(window, _)| file.window_range(window))
}

/// How to thin a scene for an overview of some frames.
fn thinning(scene: &dyn Scene, frames: usize) -> Thinning {
    let edge = scene.blocks().edges.into_iter().fold(0, usize::max);
    let mut thinning = Thinning { blocks: scene.blocks(), stride: 2 };
    while thinning.blocks().dims.iter().product::<usize>() * frames > MOST_SAMPLES && thinning.stride < edge {
        thinning.stride *= 2;
    }
    thinning
}
