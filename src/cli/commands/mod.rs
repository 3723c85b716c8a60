//! The commands of `wavesplat`.
#![allow(missing_docs)] // clap takes an option's comment as its help

mod append;
mod convert;
mod extract;
mod info;
mod merge;
mod page;
mod recover;
mod results;
mod scan;
mod verify;

use crate::generate::{self, GenerateArgs};
#[cfg(feature = "view")]
use crate::view;
use clap::{Parser, Subcommand};
use wavesplat_core::base::error::Result;

/// Compresses time-varying volumes along time under a guaranteed error bound.
#[derive(Debug, Parser)]
#[command(
    name = "wavesplat",
    version,
    arg_required_else_help = true,
    before_help = "\
Examples:
  wavesplat convert frames/ -o run.wspl --tolerance 0.001
  wavesplat append run.wspl more/
  wavesplat info run.wspl
  wavesplat view run.wspl
  wavesplat page run.wspl -o run.html
  wavesplat verify run.wspl --against frames/
  wavesplat extract run.wspl --frames 10:20 -o part.npy
  wavesplat recover damaged.wspl -o saved.wspl
  wavesplat merge part-*.wspl -o run.wspl
  wavesplat convert --help",
    after_help = "wavesplat-render renders pictures of coefficient files."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Convert(Box<convert::ConvertArgs>),
    Append(append::AppendArgs),
    Info(info::InfoArgs),
    Verify(verify::VerifyArgs),
    Extract(extract::ExtractArgs),
    Recover(recover::RecoverArgs),
    Scan(scan::ScanArgs),
    Merge(merge::MergeArgs),
    #[cfg(feature = "view")]
    View(view::ViewArgs),
    Page(page::PageArgs),
    /// Write completions for a shell, or man pages
    #[command(
        subcommand,
        before_help = "\
Examples:
  wavesplat generate completions bash > /etc/bash_completion.d/wavesplat
  wavesplat generate man -o /usr/local/share/man/man1",
        after_help = "For wavesplat-render: wavesplat-render --generate completions-bash, wavesplat-render --generate man."
    )]
    Generate(GenerateArgs),
}

impl Cli {
    /// Does what the command line asks for.
    ///
    /// # Errors
    /// Those of the command.
    pub fn run(self) -> Result<()> {
        match self.command {
            Command::Convert(args) => convert::run(&args),
            Command::Append(args) => append::run(&args),
            Command::Info(args) => info::run(&args),
            Command::Verify(args) => verify::run(&args),
            Command::Extract(args) => extract::run(&args),
            Command::Recover(args) => recover::run(&args),
            Command::Scan(args) => scan::run(&args),
            Command::Merge(args) => merge::run(&args),
            #[cfg(feature = "view")]
            Command::View(args) => view::run(&args),
            Command::Page(args) => page::run(&args),
            Command::Generate(args) => args.run(generate::command::<Self>()),
        }
    }
}
