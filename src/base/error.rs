//! One error type for the library. Each kind stands for what the caller can do about it; see [`Error::exit_code`].

use std::io;
use std::path::{Path, PathBuf};

/// Why an operation ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing failed: try again, or make space.
    #[error("{}: {doing}: {source}", path.display())]
    Io {
        /// The file, or `-` for a standard stream.
        path: PathBuf,
        /// What was being done, as "reading frame 3".
        doing: String,
        /// What the system said.
        source: io::Error,
    },
    /// The request makes no sense or cannot be met as asked: ask differently.
    #[error("{0}")]
    Usage(String),
    /// An input is damaged, contradicts its description, or has a feature that is not supported.
    #[error("{}: {what}", path.display())]
    Input {
        /// The file, or `-` for a standard stream.
        path: PathBuf,
        /// The place and the reason.
        what: String,
    },
    /// A coefficient file is damaged or from a newer version.
    #[error("{}: {source}", path.display())]
    CoefficientFile {
        /// The file.
        path: PathBuf,
        /// The place and the reason.
        source: wavesplat_format::Error,
    },
    /// An input changed while it was being read.
    #[error("{}: {what}", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// What was noticed.
        what: String,
    },
    /// `verify` found samples outside the promised bound, or further off than the file states.
    #[error("{}: {what}", path.display())]
    BoundMissed {
        /// The coefficient file.
        path: PathBuf,
        /// Where and by how much.
        what: String,
    },
}

/// Why bytes cannot be read that a file had when it was opened; inside an [`io::Error`].
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("became shorter while it was being read")]
pub struct BecameShorter;

/// The library's result.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An I/O error with the file and what was being done.
    pub fn io(path: impl AsRef<Path>, doing: impl Into<String>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().into(), doing: doing.into(), source }
    }

    /// An error about an input's content.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().into(), what: what.into() }
    }

    /// An error about what was asked.
    pub fn usage(what: impl Into<String>) -> Self {
        Self::Usage(what.into())
    }

    /// What a user may do about a damaged file.
    pub fn advice(&self) -> Option<&'static str> {
        let Self::CoefficientFile { path, source } = self else { return None };
        let unfinished = path.extension().is_some_and(|ending| ending == "part");
        match source {
            wavesplat_format::Error::Corrupt { .. } if unfinished => Some(
                "an unfinished conversion: --resume of what made it goes on, wavesplat recover saves what it holds",
            ),
            wavesplat_format::Error::Corrupt { .. } | wavesplat_format::Error::Lost(_) => Some(
                "wavesplat recover saves what is whole; --skip-damaged gives the rest where only blocks are damaged",
            ),
            _ => None,
        }
    }

    /// The programs' exit code: 1 failed while running, 2 usage, 3 input damaged or not supported, 4 bound not met or input changed.
    pub fn exit_code(&self) -> u8 {
        if let Some(system) = self.system() {
            let is_shorter = system.get_ref().is_some_and(|inner| inner.downcast_ref::<BecameShorter>().is_some());
            return if is_shorter { 4 } else { 1 };
        }
        match self {
            Self::Io { .. } => 1,
            Self::Usage(_) => 2,
            Self::Input { .. } | Self::CoefficientFile { .. } => 3,
            Self::Changed { .. } | Self::BoundMissed { .. } => 4,
        }
    }

    /// Whether the reader of our output went away, which ends a program quietly.
    pub fn is_broken_pipe(&self) -> bool {
        self.system().is_some_and(|system| system.kind() == io::ErrorKind::BrokenPipe)
    }

    /// What the system said, if it said anything.
    fn system(&self) -> Option<&io::Error> {
        match self {
            Self::Io { source, .. } | Self::CoefficientFile { source: wavesplat_format::Error::Io(source), .. } => {
                Some(source)
            }
            _ => None,
        }
    }
}
