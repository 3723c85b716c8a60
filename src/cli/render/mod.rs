//! The options of `wavesplat-render`.
#![allow(missing_docs)] // clap takes an option's comment as its help

mod args;
mod generate;
mod groups;

use crate::CommonArgs;
use args::Cli;
use clap::Parser;
pub use generate::Program;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_jobs::picture::{self, PictureRequest, Session, ViewerSession, is_coefficient_name};

/// The meaning of the words after `wavesplat-render`.
pub struct Parsed {
    /// The inputs.
    pub session: Session,
    /// The request that the words make.
    pub request: PictureRequest,
    /// Words for how the inputs are opened.
    pub input_words: Vec<String>,
}

/// Parses words after `wavesplat-render`.
///
/// # Errors
/// Words that are no options of the program.
pub fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<Parsed> {
    let first_line = |text: &str| text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string();
    let words = std::iter::once("wavesplat-render".into()).chain(words);
    let program = Program::try_parse_from(words).map_err(|e| Error::usage(first_line(&e.to_string())))?;
    let Program::Render(cli) = program else { return Err(Error::usage("--generate: shows no pictures")) };
    Ok(Parsed { session: cli.session()?, request: cli.request(), input_words: cli.input_words() })
}

/// A viewer of a coefficient file or of frames, with more options of `wavesplat-render`.
///
/// # Errors
/// Words that are no options, or that have no place in a viewer.
pub fn viewer_session(
    inputs: &[PathBuf],
    memory: usize,
    options: impl IntoIterator<Item = OsString>,
) -> Result<ViewerSession> {
    let method = if inputs.iter().all(|path| is_coefficient_name(path)) { "coefficients" } else { "direct" };
    session_of(inputs, method, memory, options)
}

/// The same of a coefficient file of any name.
///
/// # Errors
/// As [`viewer_session`].
pub fn file_session(input: &Path, memory: usize, options: impl IntoIterator<Item = OsString>) -> Result<ViewerSession> {
    session_of(&[input.into()], "coefficients", memory, options)
}

fn session_of(
    inputs: &[PathBuf],
    method: &str,
    memory: usize,
    options: impl IntoIterator<Item = OsString>,
) -> Result<ViewerSession> {
    let mut words = vec![format!("--method={method}").into(), format!("--memory={memory}").into()];
    words.extend(options);
    words.extend(["-o".into(), "live.html".into(), "--".into()]);
    words.extend(inputs.iter().map(OsString::from));
    let Parsed { session, request, input_words } = parsed(words)?;
    Ok(ViewerSession::new(&session, request, input_words))
}

impl Cli {
    fn run(&self) -> Result<()> {
        self.common.start()?;
        let outcome = picture::run(&self.session()?, &self.request(), &self.common)?;
        if self.common.json {
            CommonArgs::print_report(&outcome.report, outcome.is_on_stdout)?;
        }
        outcome.end
    }
}
