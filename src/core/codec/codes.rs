//! The codes of a block in memory.

use super::buffer::Buffer;
use super::rows::count_nonzero;
use crate::base::vectors::dispatch;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};
use wavesplat_format::SparseCodes;

/// Codes that return their memory to a pool when dropped, for the next block, unless they were kept.
#[derive(Debug)]
pub struct PooledCodes {
    codes: SparseCodes,
    is_kept: bool,
}

/// The unused codes.
static SPARE: Mutex<Vec<SparseCodes>> = Mutex::new(Vec::new());

impl PooledCodes {
    /// Returns the memory of unused codes to the system.
    pub(super) fn release_spare() {
        *SPARE.lock().unwrap_or_else(PoisonError::into_inner) = Vec::new();
    }

    pub(super) fn new() -> Self {
        let spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut codes = spare.unwrap_or_default();
        codes.clear();
        Self { codes, is_kept: false }
    }

    /// Gives up unused memory, and the pool's claim to the rest.
    fn keep(&mut self) {
        self.codes.shrink();
        self.is_kept = true;
    }
}

impl Drop for PooledCodes {
    fn drop(&mut self) {
        if !self.is_kept {
            SPARE.lock().unwrap_or_else(PoisonError::into_inner).push(std::mem::take(&mut self.codes));
        }
    }
}

impl Deref for PooledCodes {
    type Target = SparseCodes;

    fn deref(&self) -> &SparseCodes {
        &self.codes
    }
}

impl DerefMut for PooledCodes {
    fn deref_mut(&mut self) -> &mut SparseCodes {
        &mut self.codes
    }
}

/// The codes of a block. None are held if all are zero.
#[derive(Debug)]
pub enum Codes {
    /// Without a pyramid: `codes[k * voxels + voxel]`.
    Dense(Buffer<i32>),
    /// With a pyramid: the nonzero codes, pass after pass.
    Sparse(PooledCodes),
}

impl Default for Codes {
    fn default() -> Self {
        Self::Dense(Buffer::default())
    }
}

impl Codes {
    /// The codes of a block without a pyramid.
    pub(super) fn dense(&self) -> &[i32] {
        if let Self::Dense(codes) = self { codes } else { &[] }
    }

    /// The codes of a block with a pyramid.
    pub(super) fn sparse(&self) -> &SparseCodes {
        if let Self::Sparse(codes) = self { codes } else { &NO_CODES }
    }

    /// Prepares codes to be kept for long.
    pub(super) fn keep(&mut self) {
        if let Self::Sparse(codes) = self {
            codes.keep();
        }
    }

    /// Bytes of memory that the codes take.
    pub(super) fn held_bytes(&self) -> usize {
        match self {
            Self::Dense(codes) => codes.held_bytes(),
            Self::Sparse(codes) => codes.held_bytes(),
        }
    }

    /// Whether no codes are held.
    pub fn is_empty(&self) -> bool {
        self.dense().is_empty() && self.sparse().count() == 0
    }

    /// The number of codes that are not zero.
    pub fn nonzero(&self) -> usize {
        dispatch!(count_nonzero(self.dense())) + self.sparse().count()
    }
}

static NO_CODES: SparseCodes = SparseCodes::NONE;
