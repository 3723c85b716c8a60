//! The distribution of samples that the last picture of a session used: finding it takes longer than a small picture.

use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::colour::Distribution;
use wavesplat_engine::render::Thinning;
use wavesplat_format::FileId;

/// What samples a distribution is of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sampled {
    pub(super) thinning: Thinning,
    pub(super) frames: Vec<usize>,
    pub(super) region: Region,
}

/// An open file: its id, its level of detail, and whether damaged blocks are skipped.
pub(super) type OpenFile = (FileId, u32, bool);

/// What a session keeps: the distribution that was used last.
pub(super) type Kept = Arc<Mutex<Option<(OpenFile, Sampled, Arc<Distribution>)>>>;

/// The distributions of a scene.
#[derive(Debug, Clone, Default)]
pub(super) struct Distributions {
    kept: Kept,
    /// None for frames, which may change.
    of: Option<OpenFile>,
}

impl Distributions {
    /// Those of a file in a session.
    pub(super) fn of_file(kept: &Kept, of: OpenFile) -> Self {
        Self { kept: kept.clone(), of: Some(of) }
    }

    /// The distribution that is kept, or what `find` gives. `None` if there is none.
    pub(super) fn get(
        &self,
        sampled: Sampled,
        find: impl FnOnce(&Sampled) -> Result<Option<Distribution>>,
    ) -> Result<Option<Arc<Distribution>>> {
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, what, found)) = &*kept()
            && Some(*of) == self.of
            && *what == sampled
        {
            return Ok(Some(found.clone()));
        }
        let found = find(&sampled)?.map(Arc::new);
        if let (Some(of), Some(found)) = (self.of, &found) {
            *kept() = Some((of, sampled, found.clone()));
        }
        Ok(found)
    }
}
