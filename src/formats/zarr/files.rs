//! The files of a folder, which Zarr reads by their keys. What is no file is refused, and not opened.

use std::path::Path;
use wavesplat_core::base::files;
use zarrs::filesystem::{self, FilesystemStoreCreateError};
use zarrs::storage::byte_range::ByteRangeIterator;
use zarrs::storage::{
    ListableStorageTraits, MaybeBytes, MaybeBytesIterator, ReadableStorageTraits, StorageError, StoreKey, StoreKeys,
    StoreKeysPrefixes, StorePrefix,
};

/// A folder.
#[derive(Debug)]
pub(super) struct FilesystemStore(filesystem::FilesystemStore);

impl FilesystemStore {
    pub(super) fn new(path: &Path) -> Result<Self, FilesystemStoreCreateError> {
        filesystem::FilesystemStore::new(path).map(Self)
    }

    /// An error if there is something else than a file at a key.
    fn check(&self, key: &StoreKey) -> Result<(), StorageError> {
        let path = self.0.key_to_fspath(key);
        match path.metadata() {
            Ok(about) if !about.is_file() && !about.is_dir() => {
                files::check(&path).map_err(|e| StorageError::Other(e.to_string()))
            }
            _ => Ok(()),
        }
    }
}

impl ReadableStorageTraits for FilesystemStore {
    fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        ranges: ByteRangeIterator<'a>,
    ) -> Result<MaybeBytesIterator<'a>, StorageError> {
        self.check(key)?;
        self.0.get_partial_many(key, ranges)
    }

    fn get(&self, key: &StoreKey) -> Result<MaybeBytes, StorageError> {
        self.check(key)?;
        self.0.get(key)
    }

    fn size_key(&self, key: &StoreKey) -> Result<Option<u64>, StorageError> {
        self.0.size_key(key)
    }

    fn supports_get_partial(&self) -> bool {
        self.0.supports_get_partial()
    }
}

impl ListableStorageTraits for FilesystemStore {
    fn list(&self) -> Result<StoreKeys, StorageError> {
        self.0.list()
    }

    fn list_prefix(&self, prefix: &StorePrefix) -> Result<StoreKeys, StorageError> {
        self.0.list_prefix(prefix)
    }

    fn list_dir(&self, prefix: &StorePrefix) -> Result<StoreKeysPrefixes, StorageError> {
        self.0.list_dir(prefix)
    }

    fn size_prefix(&self, prefix: &StorePrefix) -> Result<u64, StorageError> {
        self.0.size_prefix(prefix)
    }
}
