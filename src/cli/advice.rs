//! Tips for arguments that are not understood.

use super::config::{Config, chosen_command};
use super::programs::other_program;
use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use std::ffi::OsString;
use std::path::Path;
use wavesplat_formats as formats;

/// Adds a tip to an error of arguments, or replaces its own by a better one.
pub(super) fn with_tip(mut error: Error, command: &Command, args: &[OsString], config: &Config) -> Error {
    let word = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => word.clone(),
        _ => String::new(),
    };
    let tip = match error.kind() {
        ErrorKind::InvalidSubcommand => subcommand_tip(&word(ContextKind::InvalidSubcommand)),
        ErrorKind::UnknownArgument => owner_tip(command, &word(ContextKind::InvalidArg)),
        ErrorKind::MissingRequiredArgument => example(chosen_command(command, args)),
        _ => {
            let option = word(ContextKind::InvalidArg);
            config.source_of(option.trim_start_matches('-').split([' ', '=']).next().unwrap_or_default())
        }
    };
    if let Some(tip) = tip {
        for kind in [ContextKind::SuggestedSubcommand, ContextKind::SuggestedArg] {
            error.remove(kind);
        }
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// The first example of a command's help.
fn example(command: &Command) -> Option<String> {
    let examples = command.get_before_help()?.to_string();
    examples.lines().nth(1).map(|line| format!("an example: {}", line.trim()))
}

/// A tip for a word that is no subcommand.
fn subcommand_tip(word: &str) -> Option<String> {
    let ending = Path::new(word).extension().and_then(|ending| ending.to_str());
    match (word, ending) {
        (_, Some("wspl")) => Some(format!(
            "'wavesplat info {word}' describes it, 'wavesplat-render {word} -o frame_%04d.png' makes pictures"
        )),
        _ if Path::new(word).exists() || is_frames(word) => {
            Some(format!("'wavesplat convert {word} -o run.wspl' converts frames"))
        }
        ("render" | "view" | "show" | "plot", _) => Some("wavesplat-render makes pictures".into()),
        _ => None,
    }
}

/// Extensions of headerless frames.
const HEADERLESS: [&str; 3] = ["raw", "bin", "img"];

/// Whether a word has the extension of a file of frames.
fn is_frames(word: &str) -> bool {
    let word = word.to_lowercase();
    let ends = |ending| word.strip_suffix(ending).is_some_and(|name: &str| name.ends_with('.'));
    formats::extensions().chain(HEADERLESS).any(ends)
}

/// Names the command that has an option which this command lacks.
fn owner_tip(command: &Command, option: &str) -> Option<String> {
    let name = option.strip_prefix("--")?;
    let takes = |command: &&Command| command.get_arguments().any(|arg| arg.get_long() == Some(name));
    let owners = |program: &Command| {
        let commands: Vec<&str> = program.get_subcommands().filter(takes).map(Command::get_name).collect();
        let owner = if takes(&program) {
            program.get_name().into()
        } else {
            format!("{} {}", program.get_name(), commands.join(", "))
        };
        (takes(&program) || !commands.is_empty()).then(|| format!("{option} is an option of {owner}"))
    };
    owners(command).or_else(|| owners(&other_program(command)))
}
