//! Planes through the volume: every frame batch block by block, one view after another.

use super::composite::block_bytes;
use super::config::RenderConfig;
use super::driver::{Job, for_each_batch};
use super::planes::{Cut, PlanesView};
use super::report::{RenderReport, Rendered};
use super::scene::{FrameBatch, Scene};
use crate::base::error::Result;
use crate::base::memory;
use crate::base::progress::Progress;
use std::ops::Range;

/// Renders all frames from some of the views. Progress counts pictures.
pub(super) fn cut(
    scene: &mut dyn Scene,
    config: &RenderConfig,
    (views, which): (&[PlanesView], Range<usize>),
    progress: &dyn Progress,
    report: &mut RenderReport,
    sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
) -> Result<()> {
    let (blocks, at_a_time) = (scene.blocks(), blocks_at_a_time(scene, config, views));
    for number in which {
        let view = &views[number];
        let config = RenderConfig { region: Some(view.needed()), ..config.clone() };
        let fits = |scene: &dyn Scene, frames| needed(scene, &config, view, (frames, at_a_time)) <= config.memory;
        let together = |scene: &dyn Scene, most: usize| (1..=most).rev().find(|n| fits(scene, *n)).unwrap_or(1);
        let job = Job { config: &config, together: &together, views: &[], progress };
        let render =
            |batch: &dyn FrameBatch, report: &mut RenderReport| Cut { view, blocks, batch, at_a_time }.pictures(report);
        for_each_batch(scene, job, report, render, |frames, channels, _| {
            progress.advance(frames.len() as u64);
            let all = channels[0].pictures.chunks_exact(view.camera.size.iter().product());
            frames.iter().zip(all).try_for_each(|(frame, picture)| {
                sink(Rendered { views: &[], view: number, frame: *frame, picture, error: None })
            })
        })?;
    }
    Ok(())
}

/// The least memory in bytes with which any of the views can be rendered.
pub(super) fn least(scene: &dyn Scene, config: &RenderConfig, views: &[PlanesView]) -> usize {
    views.iter().map(|view| needed(scene, config, view, (1, 1))).max().unwrap_or(0)
}

/// Bytes to render `frames` frames together, with `blocks` blocks decoded at a time.
fn needed(scene: &dyn Scene, config: &RenderConfig, view: &PlanesView, (frames, blocks): (usize, usize)) -> usize {
    memory::FIXED + view.bytes(frames) + blocks * block_bytes(scene, config, frames)
}

fn blocks_at_a_time(scene: &dyn Scene, config: &RenderConfig, views: &[PlanesView]) -> usize {
    let fits = |blocks: &usize| views.iter().all(|view| needed(scene, config, view, (1, *blocks)) <= config.memory);
    (1..=rayon::current_num_threads()).rev().find(fits).unwrap_or(1)
}
