//! Which files a piece of work reads, so that one knows when to do it again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf, absolute};
use std::sync::{LazyLock, Mutex, PoisonError};

/// Notes every file that the process reads through [`read_file`](super::read_file) and the readers that stand on it, from
/// now until [`finish`](ReadFiles::finish). What other threads read at the same time is noted, too: a list may have more
/// files than the work needed, never fewer.
///
/// ```
/// use semfm_geom::io::{ReadFiles, read_file, write_json};
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("a.json");
/// write_json(&path, &[1])?;
/// let noted = ReadFiles::begin();
/// read_file(&path)?;
/// assert!(noted.finish().contains(&path));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ReadFiles {
    id: u64,
}

/// Lists that are being made, and the number of the next one.
#[derive(Default)]
struct Lists {
    next: u64,
    open: Vec<(u64, BTreeSet<PathBuf>)>,
}

static LISTS: LazyLock<Mutex<Lists>> = LazyLock::new(Mutex::default);

impl ReadFiles {
    /// Begins a list.
    pub fn begin() -> Self {
        let mut lists = LISTS.lock().unwrap_or_else(PoisonError::into_inner);
        let id = lists.next;
        lists.next += 1;
        lists.open.push((id, BTreeSet::new()));
        Self { id }
    }

    /// The files, absolute paths in order.
    pub fn finish(self) -> Vec<PathBuf> {
        let mut lists = LISTS.lock().unwrap_or_else(PoisonError::into_inner);
        let place = lists.open.iter().position(|(id, _)| *id == self.id);
        place.map_or_else(Vec::new, |at| lists.open.remove(at).1.into_iter().collect())
    }
}

impl Drop for ReadFiles {
    fn drop(&mut self) {
        let mut lists = LISTS.lock().unwrap_or_else(PoisonError::into_inner);
        lists.open.retain(|(id, _)| *id != self.id);
    }
}

/// Adds a file to all lists that are being made.
pub(super) fn note(path: &Path) {
    let mut lists = LISTS.lock().unwrap_or_else(PoisonError::into_inner);
    if lists.open.is_empty() {
        return;
    }
    let path = absolute(path).unwrap_or_else(|_| path.to_owned());
    for (_, files) in &mut lists.open {
        files.insert(path.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::super::read_file;
    use super::*;

    #[test]
    fn lists_hold_what_was_read_while_they_were_open() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["before", "both", "inner", "after"] {
            std::fs::write(at(name), name).unwrap();
        }
        read_file(at("before")).unwrap();
        let outer = ReadFiles::begin();
        read_file(at("both")).unwrap();
        let inner = ReadFiles::begin();
        read_file(at("inner")).unwrap();
        read_file(at("inner")).unwrap();
        let (inner, outer) = (inner.finish(), outer.finish());
        read_file(at("after")).unwrap();
        let own = |files: &[PathBuf]| -> Vec<PathBuf> {
            files.iter().filter(|path| path.starts_with(folder.path())).cloned().collect()
        };
        assert_eq!(own(&inner), [at("inner")]);
        assert_eq!(own(&outer), [at("both"), at("inner")]);
    }

    #[test]
    fn a_list_that_is_given_up_is_gone() {
        let given_up = ReadFiles::begin();
        let id = given_up.id;
        drop(given_up);
        let lists = LISTS.lock().unwrap();
        assert!(lists.open.iter().all(|(other, _)| *other != id));
    }
}
