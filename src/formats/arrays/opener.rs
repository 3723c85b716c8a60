//! Opens a file of arrays, any number of times.

use super::ArrayFile;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::mapped::Access;
use wavesplat_core::source::OpenOptions;

/// Decoded chunks get one part in so many of the memory for a window.
const SHARE: usize = 4;

/// How a file is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReadConfig {
    #[cfg_attr(not(feature = "hdf5"), allow(dead_code, reason = "Zarr stores are folders, read by their crate"))]
    pub(crate) access: Access,
    /// Bytes that reading may take.
    pub(crate) memory: usize,
}

/// Opens a file of one format, or the caller's arrays.
pub(crate) type OpenFile = Arc<dyn Fn(&Path, ReadConfig) -> Result<Box<dyn ArrayFile>> + Send + Sync>;

/// Opens a file of arrays, any number of times.
#[derive(Clone)]
pub(crate) struct Opener {
    pub(crate) path: PathBuf,
    pub(crate) how: ReadConfig,
    pub(crate) open: OpenFile,
    /// The file, open while frames of any of its arrays are read.
    pub(crate) opened: Arc<Mutex<Option<Box<dyn ArrayFile>>>>,
}

impl Opener {
    pub(crate) fn new(path: &Path, open: OpenFile, options: &OpenOptions) -> Self {
        let how = ReadConfig { access: options.access, memory: options.memory / SHARE };
        Self { path: path.into(), how, open, opened: Arc::default() }
    }

    pub(crate) fn open(&self) -> Result<Box<dyn ArrayFile>> {
        (self.open)(&self.path, self.how)
    }

    /// Hands out the open file, which is open until the next [`Opener::close`].
    pub(crate) fn with_file<T>(&self, use_it: impl FnOnce(&dyn ArrayFile) -> Result<T>) -> Result<T> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if opened.is_none() {
            *opened = Some(self.open()?);
        }
        opened.as_deref().map(use_it).expect("it was opened")
    }

    /// Closes the file, unless arrays besides the one that asks are read from it.
    pub(crate) fn close(&self) {
        if Arc::strong_count(&self.opened) == 1 {
            self.opened.lock().unwrap_or_else(PoisonError::into_inner).take();
        }
    }
}
