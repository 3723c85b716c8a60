//! Which options a command line gives.

use clap::builder::OsStr;
use clap::error::Error;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

/// The matches of a command line. It takes no option itself.
#[derive(Debug, Clone)]
pub(super) struct GivenOptions(ArgMatches);

impl GivenOptions {
    /// Whether an option is given another value than its default.
    pub(super) fn changes(&self, option: &Arg) -> bool {
        let id = option.get_id().as_str();
        let default = option.get_default_values().iter().map(OsStr::as_os_str);
        let is_given = self.0.value_source(id) == Some(ValueSource::CommandLine);
        is_given && !self.0.get_raw(id).into_iter().flatten().eq(default)
    }
}

impl FromArgMatches for GivenOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        Ok(Self(matches.clone()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        self.0 = matches.clone();
        Ok(())
    }
}

impl Args for GivenOptions {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}
