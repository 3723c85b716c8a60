//! Options whose value is optional: `--estimate 0.01` means `--estimate=0.01`, but an input may also follow the option.

use super::config::chosen_command;
use clap::Command;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};

/// Joins each such option to the number that follows it.
///
/// # Errors
/// The word after the option is neither a number nor an input, or it is both.
pub(super) fn joined(command: &Command, args: &[OsString]) -> Result<Vec<OsString>> {
    let options: Vec<String> = chosen_command(command, args)
        .get_arguments()
        .filter(|arg| arg.is_require_equals_set())
        .filter_map(|arg| Some(format!("--{}", arg.get_long()?)))
        .collect();
    let mut joined: Vec<OsString> = Vec::with_capacity(args.len());
    let mut only_inputs = false; // after --
    for word in args {
        let option = joined.last().filter(|last| !only_inputs && options.iter().any(|option| *last == option.as_str()));
        let joins = option.map_or(Ok(false), |option| is_value(&option.to_string_lossy(), word))?;
        match joined.last_mut().filter(|_| joins) {
            Some(option) => option.extend([OsStr::new("="), word]),
            None => joined.push(word.clone()),
        }
        only_inputs |= word == "--";
    }
    Ok(joined)
}

/// Whether the word after an option is its value, and not an input or another option.
fn is_value(option: &str, word: &OsStr) -> Result<bool> {
    let text = word.to_string_lossy();
    let is_number = text.parse::<f64>().is_ok();
    let is_input = Path::new(word).exists() || text.contains(['*', '?', '[']);
    match (is_number, is_input) {
        (true, true) => {
            let what = format!("is a number and the name of a file: type {option}={text}, or ./{text} for the file");
            Err(Error::usage(format!("{option} {text}: {what}")))
        }
        (false, false) if !text.starts_with('-') => Err(Error::usage(format!(
            "{option} {text}: is neither a number nor a file; type {option} 0.01, or {option} alone"
        ))),
        (is_number, _) => Ok(is_number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    fn command() -> Command {
        let share = Arg::new("share").long("share").num_args(0..=1).require_equals(true);
        Command::new("test").subcommand(Command::new("info").arg(share))
    }

    fn join(line: &str) -> Option<String> {
        let args: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let joined = joined(&command(), &args).ok()?;
        Some(joined.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn a_number_is_the_options_value_and_a_file_is_an_input() {
        for (line, expected) in [
            ("test info --share 0.1 lib.rs", "test info --share=0.1 lib.rs"),
            ("test info lib.rs --share 1e-3", "test info lib.rs --share=1e-3"),
            ("test info --share lib.rs", "test info --share lib.rs"),
            ("test info --share *.npy", "test info --share *.npy"),
            ("test info --share --json", "test info --share --json"),
            ("test info --share -", "test info --share -"),
            ("test info --share=0.1 0.2", "test info --share=0.1 0.2"),
            ("test info -- --share 0.1", "test info -- --share 0.1"),
            ("test other --share 0.1", "test other --share 0.1"),
        ] {
            assert_eq!(join(line).as_deref(), Some(expected));
        }
        assert_eq!(join("test info lib.rs --share 1%"), None);
    }
}
