//! `--generate`: prints completions or the man page.

use super::args::Cli;
use crate::base::error::Result;
use crate::cli::{self, Generated};
use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches, Parser};

/// The two things that the program can do.
pub enum Program {
    Render(Box<Cli>),
    Generate(Generated),
}

impl Program {
    /// Does what the options ask for.
    pub fn run(self) -> Result<()> {
        match self {
            Self::Render(mut cli) => {
                cli.imply_mode()?;
                cli.imply_look()?;
                cli.run()
            }
            Self::Generate(what) => what.run(cli::command::<Self>()),
        }
    }
}

const GENERATE: &str = "generate";

impl CommandFactory for Program {
    fn command() -> Command {
        let generate = Arg::new(GENERATE).long(GENERATE).value_name("WHAT").exclusive(true);
        let generate = generate.value_parser(|text: &str| text.parse::<Generated>());
        let help = "Only print the man page (man) or the completions for a shell (completions-bash, -zsh, -fish ...)";
        Cli::command().arg(generate.help(help))
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
