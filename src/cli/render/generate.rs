//! `--generate`: prints completions or the man page.

use super::args::Cli;
use crate::generate::{Generated, command};
use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches, Id, Parser};
use wavesplat_core::base::error::Result;
use wavesplat_jobs::picture::exclude;

/// The two things that the program can do.
pub enum Program {
    Render(Box<Cli>),
    Generate(Generated),
}

impl Program {
    /// Does what the options ask for.
    pub fn run(self) -> Result<()> {
        match self {
            Self::Render(cli) => cli.run(),
            Self::Generate(what) => what.run(command::<Self>()),
        }
    }
}

/// The options that most people need: those of the short help.
const NEEDED: [&str; 21] = [
    "output",
    "force",
    "format",
    "view",
    "orbit",
    "size",
    "frames",
    "region",
    "slice",
    "lod",
    "tolerance",
    "mode",
    "iso",
    "transfer_function",
    "colormap",
    "range",
    "annotate",
    "probe",
    "method",
    "threads",
    "memory",
];

/// Hides an option from the short help unless most people need it.
fn shortened(arg: Arg) -> Arg {
    let is_needed = arg.is_positional() || NEEDED.contains(&arg.get_id().as_str());
    arg.hide_short_help(!is_needed)
}

/// The command with conflicts between the options of fields that cannot be given together.
fn with_exclusions(command: Command) -> Command {
    let all: Vec<Id> = command.get_arguments().map(|arg| arg.get_id().clone()).collect();
    command.mut_args(|arg| {
        let others = all.iter().filter(|other| exclude(arg.get_id().as_str(), other.as_str()));
        let others: Vec<Id> = others.cloned().collect();
        arg.conflicts_with_all(others)
    })
}

const GENERATE: &str = "generate";

impl CommandFactory for Program {
    fn command() -> Command {
        let generate = Arg::new(GENERATE).long(GENERATE).value_name("WHAT").exclusive(true);
        let generate = generate.value_parser(|text: &str| text.parse::<Generated>());
        let help = "Only print the man page (man) or the completions for a shell (completions-bash, -zsh, -fish ...)";
        with_exclusions(Cli::command()).arg(generate.help(help)).mut_args(shortened)
    }

    fn command_for_update() -> Command {
        Self::command()
    }
}

impl FromArgMatches for Program {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        match matches.get_one::<Generated>(GENERATE) {
            Some(what) => Ok(Self::Generate(*what)),
            None => Cli::from_arg_matches(matches).map(|cli| Self::Render(Box::new(cli))),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Parser for Program {}
