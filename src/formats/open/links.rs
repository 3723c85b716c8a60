//! Links to files that are gone, among the files that a pattern means.

use crate::shared::links::is_lost;
use glob::{MatchOptions, Pattern};
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Folders that are looked through for `**`.
const MOST_FOLDERS: usize = 100_000;

/// The first link that a pattern matches, or that one of its folders is, and that leads nowhere: matching leaves such
/// links out.
pub(super) fn lost_to(pattern: &Path, rules: MatchOptions) -> Option<PathBuf> {
    let mut places = vec![PathBuf::new()];
    for component in pattern.components() {
        let mut found = Vec::new();
        for place in &places {
            found.extend(matches(place, component, rules));
        }
        if let Some(link) = found.iter().find(|place| is_lost(place)) {
            return Some(link.clone());
        }
        found.retain(|place| place.exists() || place.as_os_str().is_empty());
        places = found;
    }
    None
}

/// What a component of a pattern means in a folder.
fn matches(place: &Path, component: Component<'_>, rules: MatchOptions) -> Vec<PathBuf> {
    let text = component.as_os_str().to_string_lossy();
    if text == "**" {
        return folders(place);
    }
    match Pattern::new(&text) {
        Ok(pattern) if text.contains(['*', '?', '[']) => {
            let is_meant = |path: &PathBuf| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                pattern.matches_with(&name, rules)
            };
            entries(place).into_iter().filter(is_meant).collect()
        }
        _ => vec![place.join(component)],
    }
}

/// A folder and all folders in it.
fn folders(place: &Path) -> Vec<PathBuf> {
    let (mut all, mut at) = (vec![place.to_path_buf()], 0);
    while at < all.len() && all.len() < MOST_FOLDERS {
        let inner = entries(&all[at]).into_iter().filter(|path| path.is_dir() && !path.is_symlink());
        all.extend(inner.collect::<Vec<_>>());
        at += 1;
    }
    all
}

fn entries(place: &Path) -> Vec<PathBuf> {
    let folder = if place.as_os_str().is_empty() { Path::new(".") } else { place };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| place.join(entry.file_name())).collect()
}
