//! Completions for shells, and man pages.

use super::print;
use clap::{Command, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use clap_mangen::Man;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;

/// The arguments of a program. Its help begins with examples.
pub fn command<A: Parser>() -> Command {
    const HELP: &str = "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}{all-args}{after-help}";
    A::command().help_template(HELP).mut_subcommands(|command| command.help_template(HELP))
}

/// What to generate for a program with several commands.
#[derive(Debug, Clone, Subcommand)]
pub enum GenerateArgs {
    /// Completions for a shell, to standard output
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Man pages: one for each command
    Man {
        /// Folder to write into
        #[arg(short, long, value_name = "FOLDER")]
        output: PathBuf,
        /// Replace existing files
        #[arg(long)]
        force: bool,
    },
}

impl GenerateArgs {
    /// Generates it for a program.
    pub fn run(&self, program: Command) -> Result<()> {
        match self {
            Self::Completions { shell } => completions(program, *shell),
            Self::Man { output, force } => man_pages(program, output, *force),
        }
    }
}

/// What to generate for a program with one command, to standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Generated {
    /// Completions for a shell.
    Completions(Shell),
    /// The man page.
    Man,
}

impl FromStr for Generated {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let shell = text.strip_prefix("completions-").and_then(|shell| shell.parse().ok());
        let shells = || Shell::value_variants().iter().map(|shell| format!("completions-{shell}"));
        match (text, shell) {
            ("man", _) => Ok(Self::Man),
            (_, Some(shell)) => Ok(Self::Completions(shell)),
            _ => Err(format!("takes man, {}", shells().collect::<Vec<_>>().join(", "))),
        }
    }
}

impl Generated {
    /// Generates it for a program.
    pub fn run(self, mut program: Command) -> Result<()> {
        match self {
            Self::Completions(shell) => completions(program, shell),
            Self::Man => {
                program.build();
                print(&man_page(&program)?)
            }
        }
    }
}

fn completions(mut program: Command, shell: Shell) -> Result<()> {
    let (name, mut text) = (program.get_name().to_string(), Vec::new());
    clap_complete::generate(shell, &mut program, name, &mut text);
    print(&String::from_utf8_lossy(&text))
}

/// Writes one page for the program and one for each of its commands.
fn man_pages(program: Command, folder: &Path, force: bool) -> Result<()> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    fs::create_dir_all(folder).map_err(|e| Error::io(folder, "creating a folder", e))?;
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        let path = folder.join(Man::new(command.clone()).get_filename());
        let mut out = Output::create(&path, force)?;
        let written = out.write_all(man_page(command)?.as_bytes());
        written.map_err(|e| Error::io(&path, "writing", e))?;
        out.commit()?;
    }
    Ok(())
}

/// The page of a command. As in the help, its examples come before its options.
fn man_page(command: &Command) -> Result<String> {
    let mut page = Vec::new();
    render(command, &mut page).map_err(|e| Error::io("-", "writing a man page", e))?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

fn render(command: &Command, page: &mut Vec<u8>) -> io::Result<()> {
    let man = Man::new(command.clone()).source(concat!("wavesplat ", env!("CARGO_PKG_VERSION")));
    man.render_title(page)?;
    man.render_name_section(page)?;
    man.render_synopsis_section(page)?;
    man.render_description_section(page)?;
    page.extend(examples(command).into_bytes());
    man.render_options_section(page)?;
    if command.has_subcommands() {
        man.render_subcommands_section(page)?;
    }
    if command.get_after_help().is_some() {
        man.render_extra_section(page)?;
    }
    Ok(())
}

/// The section of examples, with unfilled lines.
fn examples(command: &Command) -> String {
    let Some(help) = command.get_before_help() else { return String::new() };
    let mut section = ".SH EXAMPLES\n.nf\n".to_string();
    for line in help.to_string().lines().skip(1) {
        let line = line.trim().replace('\\', "\\e").replace('-', "\\-").replace('\'', "\\(aq");
        let _ = writeln!(section, "{line}");
    }
    section + ".fi\n"
}
