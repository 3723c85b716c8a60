//! The reports of a run: notes, the sidecar and `--json`.

use super::plan::colouring::ColouredPictures;
use super::plan::modes::mode_name;
use super::reporter::Reporter;
use super::request::PictureRequest;
use super::values::ModeName;
use crate::report::report_text;
use serde::Serialize;
use std::io::Write;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;
use wavesplat_engine::render::RenderReport;
use wavesplat_engine::render::sink::{Provenance, is_ours};

/// The report of `--json`.
#[derive(Serialize)]
pub(super) struct Reported<'a> {
    #[serde(flatten)]
    pub(super) report: &'a RenderReport,
    #[serde(flatten)]
    pub(super) coloured: ColouredPictures,
    /// The settings stored in every picture; `views` has those of each view.
    pub(super) picture: &'a Provenance,
    /// The most memory that the process used so far, in bytes, to compare with `planned_bytes`.
    pub(super) peak_bytes: Option<usize>,
    /// Bytes read of the coefficient file, including its directory, and its size.
    pub(super) file_bytes_read: Option<u64>,
    pub(super) file_bytes: Option<u64>,
}

/// The result of a run.
pub struct Outcome {
    /// The report, as JSON.
    pub report: String,
    /// Whether the run wrote data to standard output.
    pub is_on_stdout: bool,
    /// An error if something was left out, such as damaged blocks. It comes after the report.
    pub end: Result<()>,
}

/// Prints notes on the errors of pictures.
pub(super) fn note_errors(request: &PictureRequest, report: &RenderReport, reporter: &dyn Reporter) {
    let RenderReport { certified_sample_error, expected_error, left_out, .. } = report;
    if request.tolerance.is_some() && mode_name(request) != ModeName::Projection {
        reporter.note(format_args!(
            "no sample is off by more than {certified_sample_error:.4e}; {} coefficients left out",
            left_out.coefficients
        ));
    } else if request.tolerance.is_some() {
        reporter.note(format_args!(
            "no sample is off by more than {certified_sample_error:.4e}; expected error of pixels \
             {expected_error:.4e} (root mean square); {} coefficients left out",
            left_out.coefficients
        ));
    }
    let estimates = report.views.iter().filter(|view| view.splat_error_is_estimate);
    let estimate = estimates.map(|view| view.stated_splat_error).fold(0.0, f64::max);
    if estimate > 0.0 {
        reporter.note(format_args!("`fast` adds an error of about {estimate:.1e} of the range (an estimate)"));
    }
    if let Some(error) = report.certified_error {
        reporter.note(format_args!("no pixel is off by more than {error:.4e}"));
    }
}

/// The text of a report, which is also written to the file of `--sidecar`.
pub(super) fn written(request: &PictureRequest, reported: &impl Serialize) -> Result<String> {
    let text = report_text(reported)?;
    if let Some(path) = &request.sidecar {
        let mut out = Output::create(path, request.force || is_ours(path))?;
        out.write_all(text.as_bytes()).map_err(|e| Error::io(path, "writing", e))?;
        out.commit()?;
    }
    Ok(text)
}

/// Times, methods and numbers of coefficients in one line.
pub(super) fn summary(r: &RenderReport) -> String {
    let times = [r.weight_seconds, r.decode_seconds, r.splat_seconds, r.inverse_seconds];
    let [weights, decode, splat, inverse] = times.map(|t| format!("{t:.3}"));
    let mut methods: Vec<&str> = r.views.iter().map(|view| view.method).collect();
    methods.sort_unstable();
    methods.dedup();
    format!(
        "{} view(s) of {} frames by {} in {:.3} s: weights {weights}, decode {decode}, splat {splat}, inverse {inverse}; \
         {} coefficients, {} left out",
        r.views.len(),
        r.frames,
        methods.join(" and "),
        r.seconds,
        r.coefficients,
        r.left_out.coefficients
    ) + &probed(r)
}

/// The errors of probed rays, view by view; empty for projections.
fn probed(report: &RenderReport) -> String {
    let probed = report.views.iter().filter_map(|view| view.probed);
    probed
        .map(|p| format!("; {} probed rays are off by {:.1e} (rms), {:.1e} (largest)", p.rays, p.rms, p.largest))
        .collect()
}
