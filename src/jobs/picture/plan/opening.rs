//! What a viewer opens with.

use super::ranges::spread_over;
use crate::picture::values::ModeName;
use std::ops::Range;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::colour::Distribution;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::page::{opening, spread};
use wavesplat_engine::render::{OverviewRequest, Scene, Thinning};

/// The largest number of frames to look at.
const MOST_FRAMES: usize = 64;
/// The same for frames that are read, and not decoded.
const MOST_READ: usize = 8;
/// The largest number of samples to look at.
const MOST_SAMPLES: usize = 1 << 20;

/// The share of empty samples from which on composites show a volume best: means are thin where most of a ray is empty.
const MOSTLY_EMPTY: f64 = 0.5;

/// The first picture of a viewer.
#[derive(Debug, Clone, Copy)]
pub(in crate::picture) struct Opening {
    pub(in crate::picture) frame: usize,
    pub(in crate::picture) mode: ModeName,
}

/// The frame in the middle of some, or one where an overview shows much more, and the mode that shows it best.
pub(in crate::picture) fn opening_of(
    scene: &mut dyn Scene,
    file: Option<&CoefficientFile>,
    all: &[usize],
    memory: usize,
    progress: &dyn Progress,
) -> Result<Opening> {
    let unseen = |frame| Ok(Opening { frame, mode: ModeName::Projection });
    let Some(&middle) = all.get(all.len() / 2) else { return unseen(0) };
    let frames = frames_to_see(file, all, middle);
    let (thinning, region) = (thinning(scene, frames.len()), scene.grid().whole());
    let request = OverviewRequest { thinning, frames: &frames, memory, region };
    let samples = match scene.overview(&request, progress) {
        Ok(Some(samples)) => samples,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Ok(None) | Err(_) => return unseen(middle), // the first picture says what is wrong
    };
    let of_frame = request.samples() / frames.len();
    let spreads: Vec<f64> = samples.chunks_exact(of_frame).take(frames.len()).map(spread).collect();
    let n = opening(&spreads, frames.binary_search(&middle).unwrap_or(0));
    let mode = best_mode(samples[n * of_frame..][..of_frame].to_vec(), scene.channels());
    Ok(Opening { frame: frames[n], mode })
}

/// The mode that shows a frame of these samples best.
fn best_mode(samples: Vec<f32>, channels: usize) -> ModeName {
    let samples = Distribution::new(samples);
    let ends = samples.values().first().zip(samples.values().last());
    let empty = ends.and_then(|(lo, hi)| samples.empty((f64::from(*lo), f64::from(*hi))));
    let is_mostly_empty = empty.is_some_and(|empty| (MOSTLY_EMPTY..1.0).contains(&empty.share));
    if is_mostly_empty && channels == 1 { ModeName::Composite } else { ModeName::Projection }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn composites_show_volumes_that_are_mostly_empty() {
        let mostly = |empty: usize| (0..100).map(|n| if n < empty { 0.0 } else { n as f32 }).collect();
        assert_eq!(best_mode(mostly(70), 1), ModeName::Composite);
        assert_eq!(best_mode(mostly(20), 1), ModeName::Projection);
        assert_eq!(best_mode(mostly(70), 3), ModeName::Projection);
        assert_eq!(best_mode(vec![0.0; 9], 1), ModeName::Projection); // nothing to see
        assert_eq!(best_mode(vec![f32::NAN; 9], 1), ModeName::Projection);
    }
}
