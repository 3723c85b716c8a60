//! Options for remote files.

use super::Size;
use crate::base::address::{is_address, public_name};
use crate::base::error::Result;
use crate::base::mapped::Access;
use crate::file::CoefficientFile;
use crate::formats;
use crate::remote::{self, Cache, RemoteFile, RemoteOptions};
use clap::Args;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Options for files behind https:// and s3://.
#[derive(Debug, Clone, Args)]
pub struct RemoteArgs {
    /// Folder that caches the data read from remote files, for later runs; several programs may share it
    #[arg(long, value_name = "DIR", help_heading = "Remote files")]
    cache: Option<PathBuf>,
    /// Largest size of the cache; the least recently used data are removed first
    #[arg(long, value_name = "SIZE", default_value = "4GiB", help_heading = "Remote files")]
    cache_size: Size,
    /// How long a server may stay silent before a request is retried; a request is sent at most five times
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = seconds, help_heading = "Remote files")]
    timeout: f64,
    #[arg(skip)]
    open: KeptOpen,
}

impl Default for RemoteArgs {
    fn default() -> Self {
        let RemoteOptions { timeout, .. } = RemoteOptions::default();
        Self { cache: None, cache_size: Size(0), timeout: timeout.as_secs_f64(), open: KeptOpen::default() }
    }
}

/// The remote file that was opened last: it stays open between the pictures of a viewer, with the pages that were read.
#[derive(Clone, Default)]
pub(crate) struct KeptOpen(Arc<Mutex<Option<(PathBuf, RemoteFile)>>>);

impl fmt::Debug for KeptOpen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KeptOpen")
    }
}

impl KeptOpen {
    /// Forgets the file: the next picture reads it from the server again.
    pub(crate) fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn get(&self, address: &Path, open: impl FnOnce() -> Result<RemoteFile>) -> Result<RemoteFile> {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, file)) = last.as_ref().filter(|(of, _)| of == address) {
            return Ok(file.clone());
        }
        let file = open()?;
        *last = Some((address.into(), file.clone()));
        Ok(file)
    }
}

impl RemoteArgs {
    /// Opens a coefficient file by its path or its address.
    ///
    /// # Errors
    /// Those of [`CoefficientFile::open_with`] and [`CoefficientFile::open_remote`].
    pub fn open(&self, path: &Path, access: Access) -> Result<CoefficientFile> {
        if !is_address(path) {
            return CoefficientFile::open_with(path, access);
        }
        let file = self.open.get(path, || remote::open(path, &self.options()?))?;
        CoefficientFile::from_remote(path, file)
    }

    /// The same, with a file that others keep open.
    pub(crate) fn sharing(self, open: KeptOpen) -> Self {
        Self { open, ..self }
    }

    /// The options that differ from their defaults, as arguments for another program.
    pub(crate) fn words(&self) -> Vec<OsString> {
        let mut words = Vec::new();
        if let Some(folder) = &self.cache {
            words.push([OsStr::new("--cache="), folder.as_os_str()].into_iter().collect());
            words.push(format!("--cache-size={}", self.cache_size.0).into());
        }
        if self.timeout != Self::default().timeout {
            words.push(format!("--timeout={}", self.timeout).into());
        }
        words
    }

    fn options(&self) -> Result<RemoteOptions> {
        let cache = self.cache.as_ref().map(|folder| Cache::new(folder, self.cache_size.0 as u64)).transpose()?;
        Ok(RemoteOptions { cache, timeout: Duration::from_secs_f64(self.timeout) })
    }
}

/// Parses a time to wait.
///
/// # Errors
/// The text is not a number of seconds that can be waited for.
fn seconds(text: &str) -> std::result::Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.1..=86400.0).contains(seconds));
    seconds.ok_or_else(|| "takes a number of seconds, from 0.1 to 86400".into())
}

/// Whether a path has the name of a coefficient file: on a server, any that is not one of frames.
pub(crate) fn is_coefficient_name(path: &Path) -> bool {
    let name = public_name(path);
    let ending = name.extension().and_then(OsStr::to_str).unwrap_or_default();
    ending == "wspl" || is_address(path) && !formats::extensions().any(|of_frames| of_frames == ending)
}
