//! The loop over frame batches, shared by projections and the modes with slices.

use super::config::RenderConfig;
use super::expectation::Expectation;
use super::layout::Layout;
use super::plan;
use super::plane_values::BlockPlanes;
use super::report::RenderReport;
use super::scene::{BatchOutcome, BatchRequest, FrameBatch, Inverse, SampleErrors, Scene, Selection};
use crate::base::error::Result;
use crate::base::progress::Progress;

/// How many of some frames to render together.
pub(super) type Together<'a> = dyn Fn(&dyn Scene, usize) -> usize + 'a;

/// The settings of a rendering, and how much of it fits in memory.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) config: &'a RenderConfig,
    pub(super) together: &'a Together<'a>,
    /// The views in which to estimate errors; empty unless pictures are projections.
    pub(super) views: &'a [Expectation<'a>],
    /// Says whether the pictures are still wanted.
    pub(super) progress: &'a dyn Progress,
}

/// The pictures of one channel of a batch, and the expected mean square error in each view.
pub(super) struct RenderedBatch<P> {
    pub(super) pictures: P,
    pub(super) expected: Vec<f64>,
}

/// Renders all frames, as many at a time as fit in the budget. `render` makes the pictures of one channel of a batch;
/// `give` takes the pictures of all its channels.
pub(super) fn for_each_batch<P>(
    scene: &mut dyn Scene,
    job: Job<'_>,
    report: &mut RenderReport,
    mut render: impl FnMut(&dyn FrameBatch, &mut RenderReport) -> Result<P>,
    mut give: impl FnMut(&[usize], Vec<RenderedBatch<P>>, &mut RenderReport) -> Result<()>,
) -> Result<()> {
    let Job { config, together, views, progress } = job;
    let mut rest = config.frames.as_slice();
    while let Some(first) = rest.first() {
        let most = plan::in_batch(scene, *first, rest);
        let (frames, later) = rest.split_at(together(scene, most));
        let channels = 0..scene.channels();
        let request = |channel| BatchRequest { frames, channel, config, views };
        let channels =
            channels.map(|channel| render_channel(scene, (&request(channel), progress), report, &mut render));
        let channels = channels.collect::<Result<Vec<_>>>()?;
        give(frames, channels, report)?;
        rest = later;
    }
    Ok(())
}

/// Renders one channel of a batch. Repeats it with a new layout if the blocks needed more planes.
fn render_channel<P>(
    scene: &mut dyn Scene,
    (request, progress): (&BatchRequest<'_>, &dyn Progress),
    report: &mut RenderReport,
    render: &mut impl FnMut(&dyn FrameBatch, &mut RenderReport) -> Result<P>,
) -> Result<RenderedBatch<P>> {
    loop {
        let before = report.clone();
        let blocks = scene.blocks().len();
        let batch = Wanted { batch: scene.open(request)?, progress };
        report.add_selection(blocks, batch.selection());
        let pictures = render(&batch, report)?;
        match batch.finish()? {
            BatchOutcome::Complete => {
                return Ok(RenderedBatch { pictures, expected: batch.selection().expected.clone() });
            }
            BatchOutcome::NeedsRelayout => *report = before,
        }
    }
}

/// A batch that reads no more blocks once its pictures are not wanted any more.
struct Wanted<'a> {
    batch: Box<dyn FrameBatch + 'a>,
    progress: &'a dyn Progress,
}

impl FrameBatch for Wanted<'_> {
    fn layout(&self) -> Layout {
        self.batch.layout()
    }

    fn selection(&self) -> &Selection {
        self.batch.selection()
    }

    fn fetch(&self, blocks: &[usize]) -> Result<()> {
        self.progress.check()?;
        self.batch.fetch(blocks)
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        self.batch.planes(block)
    }

    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>> {
        self.batch.inverse(used)
    }

    fn errors(&self) -> &SampleErrors {
        self.batch.errors()
    }

    fn finish(&self) -> Result<BatchOutcome> {
        self.batch.finish()
    }
}
