//! The loop over frame batches, shared by all modes.

use super::expectation::Expectation;
use super::scene::{BatchOutcome, BatchRequest, FrameBatch, Scene, Selection};
use crate::render::config::RenderConfig;
use crate::render::report::RenderReport;
use wavesplat_core::base::error::Result;

/// How many of some frames, the first ones, to render together.
pub(in crate::render) type Together<'a, M> = dyn Fn(&mut dyn Scene, &[usize]) -> Result<Share<M>> + 'a;

/// A number of frames that are rendered together, and how they use the memory.
pub(in crate::render) struct Share<M> {
    pub(in crate::render) frames: usize,
    pub(in crate::render) memory: M,
}

/// The settings of a rendering, and how much of it fits in memory.
pub(in crate::render) struct Job<'a, M> {
    pub(in crate::render) config: &'a RenderConfig,
    pub(in crate::render) together: &'a Together<'a, M>,
    /// The views in which to estimate errors; empty unless pictures are projections.
    pub(in crate::render) views: &'a [Expectation<'a>],
}

/// The pictures of one channel of a batch, and the expected mean square error in each view.
pub(in crate::render) struct RenderedBatch<P> {
    pub(in crate::render) pictures: P,
    pub(in crate::render) expected: Vec<f64>,
}

/// Renders all frames, as many at a time as fit in the budget. `render` makes the pictures of one channel of a batch;
/// `give` takes the pictures of all its channels.
pub(in crate::render) fn for_each_batch<P, M>(
    scene: &mut dyn Scene,
    job: &Job<'_, M>,
    report: &mut RenderReport,
    mut render: impl FnMut(&dyn FrameBatch, &M, &mut RenderReport) -> Result<P>,
    mut give: impl FnMut(&[usize], Vec<RenderedBatch<P>>, &mut RenderReport) -> Result<()>,
) -> Result<()> {
    let &Job { config, together, views } = job;
    let mut rest = config.frames.as_slice();
    while let Some(first) = rest.first() {
        let most = in_batch(scene, *first, rest);
        let share = together(scene, &rest[..most])?;
        let (frames, later) = rest.split_at(share.frames);
        let mut render = |batch: &dyn FrameBatch, report: &mut RenderReport| render(batch, &share.memory, report);
        let channels = (0..scene.channels()).map(|channel| {
            let request = BatchRequest { frames, channel, config, views };
            render_channel(scene, &request, report, &mut render)
        });
        let channels = channels.collect::<Result<Vec<_>>>()?;
        give(frames, channels, report)?;
        rest = later;
    }
    Ok(())
}

/// How many of `frames` belong to the same batch as the first.
pub(in crate::render) fn in_batch(scene: &dyn Scene, first: usize, frames: &[usize]) -> usize {
    let end = scene.batch_end(first);
    frames.partition_point(|f| *f < end)
}

/// Renders one channel of a batch. Repeats it with a new layout if the blocks needed more planes.
fn render_channel<P>(
    scene: &mut dyn Scene,
    request: &BatchRequest<'_>,
    report: &mut RenderReport,
    render: &mut impl FnMut(&dyn FrameBatch, &mut RenderReport) -> Result<P>,
) -> Result<RenderedBatch<P>> {
    loop {
        let before = report.clone();
        let blocks = scene.blocks().len();
        let batch = scene.open(request)?;
        report.add_selection(blocks, batch.selection());
        let pictures = render(batch.as_ref(), report)?;
        match batch.finish()? {
            BatchOutcome::Complete => {
                return Ok(RenderedBatch { pictures, expected: batch.selection().expected.clone() });
            }
            BatchOutcome::NeedsRelayout => *report = before,
        }
    }
}

impl RenderReport {
    /// Adds the blocks of a batch.
    fn add_selection(&mut self, blocks: usize, selection: &Selection) {
        self.blocks += blocks as u64;
        self.blocks_empty += selection.empty;
        self.left_out += selection.left_out;
        self.other_frames += selection.other_frames;
        self.certified_sample_error = self.certified_sample_error.max(selection.certified);
    }
}
