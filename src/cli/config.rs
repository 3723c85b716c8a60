//! Options from a TOML file.
//!
//! Its keys are the long names of options. A key at the top level is for every command that has the option; a key in a
//! table is for the command or program of that name. The options are inserted before those of the command line, which override
//! them.

use super::programs::other_program;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use std::env;
use std::ffi::OsString;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;

/// The id of the option that names a file.
const CONFIG: &str = "config";

/// The subcommand that was given, or the program itself.
pub(super) fn chosen_command<'a>(command: &'a Command, args: &[OsString]) -> &'a Command {
    args.get(1).and_then(|name| command.find_subcommand(name)).unwrap_or(command)
}

/// The options of a file.
#[derive(Debug, Default)]
pub(super) struct Config {
    path: PathBuf,
    options: Vec<FileOption>,
}

/// The text of a file.
fn read(path: &Path) -> Result<String> {
    let failed = |e| Error::io(path, "reading", e);
    let mut file = files::open_or_stream(path).map_err(|e| match e {
        Error::Io { source, .. } => failed(source),
        other => other,
    })?;
    let mut text = String::new();
    file.read_to_string(&mut text).map_err(failed)?;
    Ok(text)
}

/// An option of a file, as arguments.
#[derive(Debug)]
struct FileOption {
    name: String,
    line: usize,
    args: Vec<OsString>,
}

impl Config {
    /// The options that the file of `--config`, or of the program's environment variable, adds to a command line. None
    /// if there is no file, or if the command does not take one.
    pub(super) fn read(program: &Command, args: &[OsString]) -> Result<Self> {
        let command = chosen_command(program, args);
        let parsed = program.clone().ignore_errors(true).try_get_matches_from(args);
        let Ok(matches) = parsed else { return Ok(Self::default()) }; // help, or an error that the real parse reports
        let given = matches.subcommand().map_or(&matches, |(_, of_command)| of_command);
        if !command.get_arguments().any(|arg| arg.get_id() == CONFIG) {
            return Ok(Self::default());
        }
        match given.get_one::<PathBuf>(CONFIG).cloned().or_else(|| from_environment(program)) {
            Some(path) => {
                let text = read(&path)?;
                let file = File { path, text: &text, program };
                let options = file.options(command, given)?;
                Ok(Self { path: file.path, options })
            }
            None => Ok(Self::default()),
        }
    }

    /// The command line with the options of the file.
    pub(super) fn add_to(&self, program: &Command, args: &[OsString]) -> Vec<OsString> {
        let at = if program.has_subcommands() { 2 } else { 1 }.min(args.len());
        let added = self.options.iter().flat_map(|option| &option.args);
        args[..at].iter().chain(added).chain(&args[at..]).cloned().collect()
    }

    /// Names the file and line of an option, if it is from the file.
    pub(super) fn source_of(&self, option: &str) -> Option<String> {
        let taken = self.options.iter().find(|taken| taken.name == option)?;
        Some(format!("{} is from {}, line {}", taken.name, self.path.display(), taken.line))
    }

    /// Lists the options that are from the file.
    pub(super) fn summary(&self) -> Option<String> {
        let names: Vec<&str> = self.options.iter().map(|taken| taken.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("options from {}: {}", self.path.display(), names.join(", ")))
    }
}

/// The file named by the environment variable of a program, such as `WAVESPLAT_CONFIG`.
fn from_environment(program: &Command) -> Option<PathBuf> {
    let name = program.get_name().to_uppercase().replace('-', "_");
    env::var_os(format!("{name}_CONFIG")).filter(|path| !path.is_empty()).map(PathBuf::from)
}

/// A file of options.
struct File<'a> {
    path: PathBuf,
    text: &'a str,
    program: &'a Command,
}

impl File<'_> {
    /// The options of the file for a command. Left out are those that the command line gives, and those that conflict
    /// with its options.
    fn options(&self, command: &Command, given: &ArgMatches) -> Result<Vec<FileOption>> {
        let table = DeTable::parse(self.text);
        let table = table.map_err(|e| self.wrong(&e.span().unwrap_or(0..0), e.message().trim()))?.into_inner();
        let (mut options, mut own): (Vec<FileOption>, Vec<&str>) = (Vec::new(), Vec::new());
        for (name, entries) in table.iter().filter_map(|(key, value)| Some((key, value.get_ref().as_table()?))) {
            if self.is_of_another(name.get_ref()) {
                continue;
            }
            let Some(owner) = self.owner(name.get_ref()) else {
                let what = format!("[{}] is not a command of {}", name.get_ref(), self.program.get_name());
                return Err(self.wrong(&name.span(), &what));
            };
            for (key, value) in entries {
                let option = self.option(owner, key.get_ref(), &key.span(), value.get_ref(), given)?;
                if owner.get_name() == command.get_name() {
                    own.push(key.get_ref());
                    options.extend(option);
                }
            }
        }
        for (key, value) in table.iter().filter(|(_, value)| !value.get_ref().is_table()) {
            self.check_known(key.get_ref(), &key.span())?;
            if find(command, key.get_ref()).is_some() && !own.contains(&key.get_ref().as_ref()) {
                options.extend(self.option(command, key.get_ref(), &key.span(), value.get_ref(), given)?);
            }
        }
        Ok(options)
    }

    /// The command that a table is for, if the program has it.
    fn owner(&self, table: &str) -> Option<&Command> {
        let is_program = !self.program.has_subcommands() && table == self.program.get_name();
        if is_program { Some(self.program) } else { self.program.find_subcommand(table) }
    }

    /// Whether a table is for the other program, which may read the same file.
    fn is_of_another(&self, table: &str) -> bool {
        let other = other_program(self.program);
        let is_command = !self.program.has_subcommands() && other.find_subcommand(table).is_some();
        table == other.get_name() || is_command
    }

    /// An error if no command has an option of this name.
    fn check_known(&self, key: &str, at: &Range<usize>) -> Result<()> {
        let commands = || std::iter::once(self.program).chain(self.program.get_subcommands());
        if commands().any(|command| find(command, key).is_some()) {
            return Ok(());
        }
        Err(self.unknown(self.program.get_name(), key, at))
    }

    fn unknown(&self, owner: &str, key: &str, at: &Range<usize>) -> Error {
        let commands = || std::iter::once(self.program).chain(self.program.get_subcommands());
        let meant = key.trim_start_matches('-').replace('_', "-");
        let what = if commands().any(|command| command.get_positionals().any(|arg| arg.get_id() == key)) {
            format!("{key}: inputs are named on the command line")
        } else if meant != key && commands().any(|command| find(command, &meant).is_some()) {
            format!("{key}: no option of {owner}; write {meant}")
        } else {
            format!("{key}: no option of {owner}; its --help lists them")
        };
        self.wrong(at, &what)
    }

    /// The option of a key. None if the command line overrides it.
    fn option(
        &self,
        owner: &Command,
        key: &str,
        at: &Range<usize>,
        value: &DeValue<'_>,
        given: &ArgMatches,
    ) -> Result<Option<FileOption>> {
        let Some(arg) = find(owner, key) else { return Err(self.unknown(owner.get_name(), key, at)) };
        let args = arguments(arg, value).map_err(|what| self.wrong(at, &format!("{key}: {what}")))?;
        let is_given = |arg: &Arg| {
            let id = arg.get_id().as_str();
            given.try_contains_id(id).is_ok() && given.value_source(id) == Some(ValueSource::CommandLine)
        };
        let against = |a: &Arg, b: &Arg| owner.get_arg_conflicts_with(a).iter().any(|c| c.get_id() == b.get_id());
        let mut on_command_line = owner.get_arguments().filter(|arg| is_given(arg));
        let overridden = is_given(arg) || on_command_line.any(|given| against(given, arg) || against(arg, given));
        Ok((!overridden && !args.is_empty()).then(|| FileOption { name: key.into(), line: self.line(at), args }))
    }

    fn wrong(&self, at: &Range<usize>, what: &str) -> Error {
        Error::usage(format!("{}: line {}: {what}", self.path.display(), self.line(at)))
    }

    fn line(&self, at: &Range<usize>) -> usize {
        self.text.bytes().take(at.start).filter(|byte| *byte == b'\n').count() + 1
    }
}

/// The option of a command with this long name. None if a file may not set it.
fn find<'a>(command: &'a Command, name: &str) -> Option<&'a Arg> {
    let mut options = command.get_opts().chain(command.get_arguments().filter(|arg| is_flag(arg)));
    options.find(|arg| arg.get_long() == Some(name) && arg.get_id() != CONFIG && !arg.is_exclusive_set())
}

fn is_flag(arg: &Arg) -> bool {
    matches!(arg.get_action(), ArgAction::SetTrue)
}

/// The arguments for a value of an option.
fn arguments(arg: &Arg, value: &DeValue<'_>) -> std::result::Result<Vec<OsString>, &'static str> {
    let name = arg.get_long().unwrap_or_default();
    let with = |value: String| OsString::from(format!("--{name}={value}"));
    match (value, arg.get_action()) {
        (DeValue::Boolean(on), ArgAction::SetTrue) => Ok(on.then(|| format!("--{name}").into()).into_iter().collect()),
        (_, ArgAction::SetTrue) => Err("takes true or false"),
        (DeValue::Array(values), ArgAction::Append) => {
            let words = values.iter().map(|value| scalar(value.get_ref()).map(with));
            words.collect::<Option<Vec<_>>>().ok_or("takes strings or numbers")
        }
        (DeValue::Array(_), _) => {
            Err("takes one value, not several; write numbers with commas between them as a string")
        }
        (value, _) => scalar(value).map(|value| vec![with(value)]).ok_or("takes a string or a number"),
    }
}

fn scalar(value: &DeValue<'_>) -> Option<String> {
    match value {
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Integer(number) if number.radix() == 10 => Some(number.as_str().into()),
        DeValue::Float(number) => Some(number.as_str().into()),
        _ => None,
    }
}
