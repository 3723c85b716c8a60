//! Options for remote files.

use super::{Size, messages};
use clap::Args;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::Duration;
use wavesplat_core::base::address::is_address;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::mapped::Access;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::remote::{Cache, RemoteOptions};

/// Options for files behind https:// and s3://.
#[derive(Debug, Clone, Args)]
pub struct RemoteArgs {
    /// Folder that caches the data read from remote files, for later runs; several programs may share it
    #[arg(long, value_name = "DIR", help_heading = "Remote files")]
    cache: Option<PathBuf>,
    /// Largest size of the cache; the least recently used data are removed first
    #[arg(long, value_name = "SIZE", default_value = "4GiB", help_heading = "Remote files")]
    cache_size: Size,
    /// How long a server may stay silent before a request is retried, and the longest pause that it may ask for; a request is
    /// sent at most five times
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0, value_parser = seconds, help_heading = "Remote files")]
    timeout: f64,
}

impl Default for RemoteArgs {
    fn default() -> Self {
        let RemoteOptions { timeout, .. } = RemoteOptions::default();
        Self { cache: None, cache_size: Size(0), timeout: timeout.as_secs_f64() }
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
        CoefficientFile::open_remote(path, &self.options()?)
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

    /// How remote files are read.
    pub(super) fn options(&self) -> Result<RemoteOptions> {
        let cache = self.cache.as_ref().map(|folder| Cache::new(folder, self.cache_size.0 as u64)).transpose()?;
        Ok(RemoteOptions { cache, timeout: Duration::from_secs_f64(self.timeout), note: messages::remote_note })
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
