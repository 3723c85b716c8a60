//! Remote files: objects behind `https://`, `http://` and `s3://`, read by parts over HTTP.
//!
//! [`open`] asks for the first bytes of an object; the answer also tells its length and its version. What is read later comes in
//! pages (`paged.rs`), many to a request and several requests side by side; pages are kept in memory, and in a folder
//! ([`Cache`]) if the caller names one. Every answer is checked: an object that is replaced meanwhile is an error, never a
//! mixture of two files.

mod pages;
mod cache;
mod paged;
#[cfg(feature = "remote")]
mod address;
#[cfg(feature = "remote")]
mod profile;
#[cfg(feature = "remote")]
mod answer;
#[cfg(feature = "remote")]
mod redirect;
#[cfg(feature = "remote")]
mod retry;
#[cfg(feature = "remote")]
mod object;

pub use cache::Cache;
use paged::Paged;
pub(crate) use paged::{FETCHED, PageCount};

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
#[cfg(not(feature = "remote"))]
use wavesplat_core::base::address::public_name;
use wavesplat_core::base::error::Result;
#[cfg(not(feature = "remote"))]
use wavesplat_core::base::error::{Error, Note, Remedy};
use wavesplat_format::Storage;

/// How remote files are read.
#[derive(Debug, Clone)]
pub struct RemoteOptions {
    /// The cache folder for later runs.
    pub cache: Option<Cache>,
    /// How long a server may be silent, and how long a pause it may ask for.
    pub timeout: Duration,
    /// Gets a note when a server asks for a pause.
    pub note: fn(&str),
}

impl Default for RemoteOptions {
    fn default() -> Self {
        Self { cache: None, timeout: Duration::from_secs(30), note: |_| {} }
    }
}

/// An open remote file, which several readers may share.
pub type RemoteFile = Arc<dyn Storage + Send + Sync>;

/// Opens a remote file by its address.
///
/// # Errors
/// An address that is not understood, a server that does not answer, does not have the file, does not allow reading it or
/// cannot send parts of it, and credentials that cannot be read.
#[cfg(feature = "remote")]
pub fn open(address: &Path, options: &RemoteOptions) -> Result<RemoteFile> {
    Ok(Arc::new(object::open(address, options)?))
}

/// A storage whose bytes are kept once they were read, if it is remote.
pub(crate) fn kept(storage: Box<dyn Storage + Send + Sync>) -> Box<dyn Storage + Send + Sync> {
    if storage.is_remote() { Box::new(Paged::new(storage, None)) } else { storage }
}

/// An error: this build cannot do it.
#[cfg(not(feature = "remote"))]
pub fn open(address: &Path, _options: &RemoteOptions) -> Result<RemoteFile> {
    Err(Error::path(
        public_name(address),
        Note::with("reading remote files is not built in", Remedy::BuildWith("remote")),
    ))
}
