//! A program from its arguments to its exit code.

use super::{advice, note};
use crate::error::Result;
use crate::mapped;
use clap::error::ErrorKind;
use clap::{Command, Parser};
use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs a program: parses its arguments, reports an error once, and turns it into the exit code.
pub fn main<A: Parser>(run: impl FnOnce(A) -> Result<()>) -> ExitCode {
    mapped::explain_sigbus();
    let args = match parse::<A>(env::args_os().collect()) {
        Ok(args) => args,
        Err(e) => {
            let _ = e.print(); // nowhere is left to report a failure
            let help = matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            return ExitCode::from(if help { 0 } else { 2 });
        }
    };
    match run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) if e.is_broken_pipe() => ExitCode::SUCCESS,
        Err(e) => {
            note(format_args!("error: {e}"));
            e.advice().into_iter().for_each(note);
            ExitCode::from(e.exit_code())
        }
    }
}

fn parse<A: Parser>(args: Vec<OsString>) -> std::result::Result<A, clap::Error> {
    let mut command = command::<A>();
    let parsed = command.try_get_matches_from_mut(&args).and_then(|matches| A::from_arg_matches(&matches));
    parsed.map_err(|error| advice::advised(error, &command, &args))
}

/// What a program takes, with help that begins with examples.
fn command<A: Parser>() -> Command {
    const HELP: &str = "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}{all-args}{after-help}";
    A::command().help_template(HELP).mut_subcommands(|command| command.help_template(HELP))
}
