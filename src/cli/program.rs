//! A program from its arguments to its exit code.

use super::advice;
use super::config::Config;
use super::generate::command;
use super::messages::{self, note};
use clap::Parser;
use clap::error::ErrorKind;
use std::env;
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use std::process::{self, ExitCode};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped;
use wavesplat_core::base::output::abandon;
use wavesplat_core::base::temporary;

/// Runs a program: parses its arguments, reports an error once, and turns it into the exit code.
pub fn main<A: Parser>(run: impl FnOnce(A) -> Result<()>) -> ExitCode {
    mapped::explain_sigbus();
    mapped::on_interrupt(end);
    let args: Vec<OsString> = env::args_os().collect();
    let config = match Config::read(&command::<A>(), &args) {
        Ok(config) => config,
        Err(e) => return failed::<A>(&e),
    };
    let args = match parse::<A>(&args, &config) {
        Ok(args) => args,
        Err(e) => {
            let _ = e.print(); // a failure cannot be reported anywhere else
            let help = matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion);
            return ExitCode::from(if help { 0 } else { 2 });
        }
    };
    match run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) if e.is_broken_pipe() => ExitCode::SUCCESS,
        Err(e) => {
            let code = failed::<A>(&e);
            config.summary().filter(|_| e.is_usage()).into_iter().for_each(note);
            code
        }
    }
}

/// Ends the program on a signal. Keeps unfinished files that can be resumed, and removes the others.
fn end(signal: i32) {
    if io::stderr().is_terminal() {
        note(""); // ends the line of a progress bar
    }
    let kept = abandon();
    temporary::remove_all();
    note("error: interrupted");
    for part in kept {
        note(format_args!(
            "{}: the finished windows are kept; the same command with --resume continues after them",
            part.display()
        ));
    }
    process::exit(128 + signal)
}

fn failed<A: Parser>(error: &Error) -> ExitCode {
    note(messages::error_text(error, &command::<A>()));
    ExitCode::from(error.exit_code())
}

fn parse<A: Parser>(args: &[OsString], config: &Config) -> std::result::Result<A, clap::Error> {
    let mut command = command::<A>();
    let all = config.add_to(&command, args);
    let parsed = command.try_get_matches_from_mut(all).and_then(|matches| A::from_arg_matches(&matches));
    parsed.map_err(|error| advice::with_tip(error, &command, args, config))
}
