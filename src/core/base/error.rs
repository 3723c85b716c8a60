//! The error type of the library. Variants are grouped by who can mend the cause.

pub use super::remedy::{Note, Remedy};

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

/// Why an operation ended early.
///
/// The variant says who can mend it: the machine ([`Error::Io`]), the caller ([`Error::Setting`], [`Error::Path`]), whoever
/// made the data ([`Error::Input`], [`Error::CoefficientFile`], [`Error::Changed`]), or no one
/// ([`Error::BoundMissed`]). Messages name fields, files and values. [`Error::remedy`] says what helps, if that is
/// known.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing failed. Try again, or make space.
    #[error("{}: {doing}: {source}", path.display())]
    Io {
        /// The file, or `-` for a standard stream.
        path: PathBuf,
        /// The action that failed, like "reading frame 3".
        doing: String,
        /// The error of the system.
        source: io::Error,
    },
    /// A field of a configuration, or an argument, is invalid or cannot be met. Give it another value.
    #[error("{setting}{value}: {problem}")]
    Setting {
        /// Name of the field, like `memory` or `splat_error`.
        setting: &'static str,
        /// A space and its value, or nothing.
        value: Box<str>,
        /// What is wrong with its value.
        problem: String,
        /// What helps besides another value.
        remedy: Option<Remedy>,
    },
    /// A path cannot be an input or an output. Name another.
    #[error("{}: {problem}", path.display())]
    Path {
        /// The path, a pattern of paths, or `-` for a standard stream.
        path: PathBuf,
        /// The reason.
        problem: String,
        /// What helps besides another path.
        remedy: Option<Remedy>,
    },
    /// The caller wants the result no longer, and said so by [`Progress`](super::progress::Progress).
    #[error("cancelled")]
    Cancelled,
    /// The arguments of a program are invalid. The library never returns this.
    #[error("{0}")]
    Usage(String),
    /// An input is damaged, contradicts its description, or has a feature that is not supported. Repair it, or change
    /// its description.
    #[error("{}: {what}", path.display())]
    Input {
        /// The file, or `-` for a standard stream.
        path: PathBuf,
        /// The place and the reason.
        what: String,
        /// What helps.
        remedy: Option<Remedy>,
    },
    /// A coefficient file cannot be read, is damaged, or is from a newer version. [`Error::remedy`] says what helps.
    #[error("{}: {source}", path.display())]
    CoefficientFile {
        /// The file.
        path: PathBuf,
        /// The place and the reason.
        source: wavesplat_format::Error,
    },
    /// An input changed while it was being read, or since it was read before. Wait until no program writes to it.
    #[error("{}: {what}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// What was noticed.
        what: String,
        /// What helps.
        remedy: Option<Remedy>,
    },
    /// `verify` found samples outside the promised bound, or errors above those stated in the file. Do not use the
    /// file.
    #[error("{}: {what}", path.display())]
    BoundMissed {
        /// The coefficient file.
        path: PathBuf,
        /// Where and by how much.
        what: String,
    },
}

/// A file has changed since it was opened; the text says how that was noticed. Stored in an [`io::Error`].
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct ChangedSince(pub String);

/// The library's result.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An I/O error with the file and what was being done.
    pub fn io(path: impl AsRef<Path>, doing: impl Into<String>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().into(), doing: doing.into(), source }
    }

    /// An error about a field of a configuration, by its name.
    pub fn setting(setting: &'static str, problem: impl Into<Note>) -> Self {
        let Note { text: problem, remedy } = problem.into();
        Self::Setting { setting, value: "".into(), problem, remedy }
    }

    /// An error about the value of a field, which it repeats.
    pub fn value(setting: &'static str, value: impl Display, problem: impl Into<String>) -> Self {
        Self::Setting { setting, value: format!(" {value}").into(), problem: problem.into(), remedy: None }
    }

    /// An error about a path.
    pub fn path(path: impl AsRef<Path>, problem: impl Into<Note>) -> Self {
        let Note { text: problem, remedy } = problem.into();
        Self::Path { path: path.as_ref().into(), problem, remedy }
    }

    /// An error about the arguments of a program.
    pub fn usage(what: impl Into<String>) -> Self {
        Self::Usage(what.into())
    }

    /// An error about an input's content.
    pub fn input(path: impl AsRef<Path>, what: impl Into<Note>) -> Self {
        let Note { text: what, remedy } = what.into();
        Self::Input { path: path.as_ref().into(), what, remedy }
    }

    /// An error about an input that has changed.
    pub fn changed(path: impl AsRef<Path>, what: impl Into<Note>) -> Self {
        let Note { text: what, remedy } = what.into();
        Self::Changed { path: path.as_ref().into(), what, remedy }
    }

    /// What helps, if that is known.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Setting { remedy, .. }
            | Self::Path { remedy, .. }
            | Self::Input { remedy, .. }
            | Self::Changed { remedy, .. } => remedy.clone(),
            Self::CoefficientFile { path, source } => damage_remedy(path, source),
            Self::Io { .. } | Self::Cancelled | Self::Usage(_) | Self::BoundMissed { .. } => None,
        }
    }

    /// Whether the fault is in the request, not in the data or the machine: [`Error::Setting`], [`Error::Path`] and
    /// [`Error::Usage`].
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Setting { .. } | Self::Path { .. } | Self::Usage(_))
    }

    /// The exit code of the programs: 1 failed while running, 2 usage, 3 input damaged or not supported, 4 bound not
    /// met or input changed.
    pub fn exit_code(&self) -> u8 {
        if let Some(system) = self.system() {
            return if system.get_ref().is_some_and(<dyn std::error::Error + Send + Sync>::is::<ChangedSince>) {
                4
            } else {
                1
            };
        }
        match self {
            Self::Io { .. } | Self::Cancelled => 1,
            Self::Setting { .. } | Self::Path { .. } | Self::Usage(_) => 2,
            Self::Input { .. } | Self::CoefficientFile { .. } => 3,
            Self::Changed { .. } | Self::BoundMissed { .. } => 4,
        }
    }

    /// Whether the reader of standard output has closed it. A program then ends without a message.
    pub fn is_broken_pipe(&self) -> bool {
        self.system().is_some_and(|system| system.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The error of the system, if there is one.
    fn system(&self) -> Option<&io::Error> {
        match self {
            Self::Io { source, .. } | Self::CoefficientFile { source: wavesplat_format::Error::Io(source), .. } => {
                Some(source)
            }
            _ => None,
        }
    }
}

/// What helps against damage of a coefficient file.
fn damage_remedy(path: &Path, damage: &wavesplat_format::Error) -> Option<Remedy> {
    let unfinished = path.extension().is_some_and(|ending| ending == "part");
    let is_remote = path.to_string_lossy().contains("://");
    match damage {
        wavesplat_format::Error::Corrupt { .. } if is_remote => Some(Remedy::DownloadOrSkip),
        wavesplat_format::Error::Corrupt { .. } if unfinished => Some(Remedy::ResumeOrRecover),
        wavesplat_format::Error::Corrupt { .. } | wavesplat_format::Error::Lost(_) => Some(Remedy::RecoverOrSkip),
        _ => None,
    }
}
