//! A program from its arguments to its exit code.

use super::advice;
use super::common::note;
use super::config::Config;
use super::{commands, messages, render};
use clap::error::ErrorKind;
use clap::{Command, CommandFactory, Parser};
use std::env;
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use std::process::{self, ExitCode};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped;
use wavesplat_core::base::output::abandon;

/// Runs a program: parses its arguments, reports an error once, and turns it into the exit code.
pub fn main<A: Parser>(run: impl FnOnce(A) -> Result<()>) -> ExitCode {
    mapped::explain_sigbus();
    mapped::on_interrupt(end);
    let (args, config) = match arguments::<A>() {
        Ok(read) => read,
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

/// The command line, and the file of options.
fn arguments<A: Parser>() -> Result<(Vec<OsString>, Config)> {
    let (command, args) = (command::<A>(), env::args_os().collect::<Vec<_>>());
    let config = Config::read(&command, &args)?;
    Ok((args, config))
}

/// Ends the program on a signal. Keeps unfinished files that can be resumed, and removes the others.
fn end(signal: i32) {
    if io::stderr().is_terminal() {
        note(""); // ends the line of a progress bar
    }
    let kept = abandon();
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

/// The other of the two programs, which may read the same file of options.
pub(super) fn other_program(program: &Command) -> Command {
    match program.get_name() {
        "wavesplat" => render::Program::command(),
        _ => commands::Cli::command(),
    }
}

/// The arguments of a program. Its help begins with examples.
pub fn command<A: Parser>() -> Command {
    const HELP: &str = "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}{all-args}{after-help}";
    A::command().help_template(HELP).mut_subcommands(|command| command.help_template(HELP))
}
