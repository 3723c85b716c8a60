//! Runs a request: pictures, partial sums or time series.

use super::partial::{add_partials, imply_setup, write_partial};
use super::plan::Plan;
use super::plan::modes::unit;
use super::report::{Outcome, Reported, note_errors, summary, written};
use super::reporter::Reporter;
use super::request::PictureRequest;
use super::series::write_series;
use super::session::Session;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::memory;
use wavesplat_engine::render::render;

/// Writes what a request asks for.
///
/// # Errors
/// Those of opening, rendering and writing; [`Error::Setting`](wavesplat_core::base::error::Error::Setting) names fields of
/// the request.
pub fn run(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Outcome> {
    if request.is_for_series() {
        write_series(session, request, reporter)
    } else if request.sum {
        let request = imply_setup(request, session.paths(), session.memory)?;
        add_partials(session, &request, reporter)
    } else if request.partial {
        write_partial(session, request, reporter)
    } else {
        write_pictures(session, request, reporter)
    }
}

fn write_pictures(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Outcome> {
    let mut plan = Plan::new(session, request, reporter)?;
    let mut sinks = plan.sinks(request).open()?;
    let progress = reporter.progress("render", unit(&plan.config.mode));
    let report =
        render(plan.scene.as_mut(), &plan.config, progress.as_ref(), &mut |rendered| sinks.picture(&rendered))?;
    sinks.finish()?;
    reporter.detail(format_args!("{}", summary(&report)));
    note_errors(request, &report, reporter);
    let (file_bytes_read, file_bytes) = plan.file.as_ref().map(|f| (f.bytes_read(), f.bytes())).unzip();
    if let (Some(read), Some(bytes)) = (file_bytes_read, file_bytes) {
        reporter.detail_read(read, bytes);
    }
    let coloured = plan.colouring.coloured();
    let (report, picture, peak_bytes) = (&report, &plan.provenance, memory::peak());
    let reported = Reported { report, picture, coloured, peak_bytes, file_bytes_read, file_bytes };
    Ok(Outcome {
        report: written(request, &reported)?,
        is_on_stdout: request.writes_to_stdout(),
        end: plan.file.map_or(Ok(()), |file| file.refuse_skipped()),
    })
}
