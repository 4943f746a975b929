//! Temporary files and folders beside their targets, and the removal of those that a killed process
//! left behind.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::{Error, Result};

/// How the names of temporary files and folders begin: `.semfm-TARGET.…`. Whatever lists a folder
/// passes them over.
pub const TEMPORARY_PREFIX: &str = ".semfm-";

/// File names have at most 255 bytes on common systems; so many of the target's are taken over.
const LONGEST_STEM: usize = 160;

/// Names that are tried before giving up: each is taken only if another process drew it, too.
const TRIES: usize = 16;

/// A temporary file, locked for as long as it is open, so that a process which cleans up knows that
/// somebody still writes it. It is removed unless it was put in place.
pub(super) struct TemporaryFile {
    path: PathBuf,
    file: File,
    in_place: bool,
}

impl TemporaryFile {
    /// An empty file beside `target`, with the permissions of the file that it will replace.
    pub fn beside(target: &Path) -> Result<Self> {
        let folder = folder_of(target);
        remove_left_behind(folder);
        let io = Error::io(target);
        for _ in 0..TRIES {
            let path = folder.join(name_for(target));
            let file = match options(target).open(&path) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => continue,
                file => file.map_err(&io)?,
            };
            let made = Self { path, file, in_place: false };
            if hold(&made.file, &made.path) {
                return Ok(made);
            }
        }
        Err(io(std::io::Error::other("no name for a temporary file beside it is free")))
    }

    /// The file, to be filled.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Flushes it to the disk and renames it over `target`.
    pub fn put(mut self, target: &Path) -> std::io::Result<()> {
        self.file.sync_all()?;
        fs::rename(&self.path, target)?;
        self.in_place = true;
        Ok(())
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if !self.in_place {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// A temporary folder with its lock.
pub(super) struct TemporaryFolder {
    pub path: PathBuf,
    /// Held open for its lock.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// An empty folder in `parent`, named after `target`.
    pub fn within(parent: &Path, target: &Path) -> Result<Self> {
        remove_left_behind(parent);
        let io = Error::io(target);
        for _ in 0..TRIES {
            let path = parent.join(name_for(target));
            match fs::create_dir(&path) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => continue,
                made => made.map_err(&io)?,
            }
            // Where folders cannot be opened (Windows), nothing is cleaned up either.
            let Ok(lock) = File::open(&path) else { return Ok(Self { path, _lock: None }) };
            if hold(&lock, &path) {
                return Ok(Self { path, _lock: Some(lock) });
            }
        }
        Err(io(std::io::Error::other("no name for a temporary folder beside it is free")))
    }
}

/// The folder that a path lies in.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn options(target: &Path) -> OpenOptions {
    let mut options = File::options();
    options.read(true).write(true).create_new(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
        options.mode(fs::metadata(target).map_or(0o666, |old| old.mode() & 0o777));
    }
    #[cfg(not(unix))]
    let _ = target;
    options
}

/// `.semfm-TARGET.…`: another one at each call.
fn name_for(target: &Path) -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut stem = target.file_name().unwrap_or(OsStr::new("out")).to_string_lossy().into_owned();
    while stem.len() > LONGEST_STEM {
        stem.pop();
    }
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let nanos = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.subsec_nanos());
    format!("{TEMPORARY_PREFIX}{stem}.{:x}-{count:x}-{nanos:x}.tmp", std::process::id())
}

/// Takes the lock of a new file or folder; false where somebody who cleans up was faster and has
/// removed it. File systems without locks are no reason to fail: nothing is cleaned up on them.
fn hold(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        if file.lock().is_err() {
            return true;
        }
        match (file.metadata(), fs::symlink_metadata(path)) {
            (Ok(own), Ok(there)) => own.ino() == there.ino(),
            _ => false,
        }
    }
    #[cfg(not(unix))]
    {
        let _ = (file, path);
        true
    }
}

/// Removes the temporaries that killed processes left in `folder`: those that nobody holds. Each
/// folder is looked at once in a process.
pub fn remove_left_behind(folder: &Path) {
    static SEEN: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);
    let Ok(real) = folder.canonicalize() else { return };
    if !SEEN.lock().unwrap_or_else(PoisonError::into_inner).insert(real) {
        return;
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX) {
            remove_unless_held(&entry.path());
        }
    }
}

#[cfg(unix)]
fn remove_unless_held(path: &Path) {
    let Ok(about) = fs::symlink_metadata(path) else { return };
    if !about.is_file() && !about.is_dir() {
        return;
    }
    let Ok(file) = File::open(path) else { return };
    if file.try_lock().is_err() {
        return; // somebody writes it, or this file system has no locks
    }
    // What goes wrong here is tried again by the next process.
    let _ = if about.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
}

#[cfg(not(unix))]
fn remove_unless_held(_path: &Path) {}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_holds_is_removed_and_what_is_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let held = TemporaryFile::beside(&at("held.json")).unwrap();
        fs::write(at(".semfm-left.json.1-2-3.tmp"), "half").unwrap();
        fs::create_dir(at(".semfm-out.1-2-3.tmp")).unwrap();
        fs::write(at(".semfm-out.1-2-3.tmp/region.json"), "half").unwrap();
        fs::write(at("other"), "not ours").unwrap();
        // This process has looked at the folder already: another spelling would not help either.
        let stale = |folder: &Path| {
            for entry in fs::read_dir(folder).unwrap().flatten() {
                if entry.file_name().to_string_lossy().starts_with(TEMPORARY_PREFIX) {
                    remove_unless_held(&entry.path());
                }
            }
        };
        stale(folder.path());
        let mut left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left.len(), 2, "{left:?}");
        assert!(left[0].to_string_lossy().starts_with(".semfm-held.json."), "{left:?}");
        held.put(&at("held.json")).unwrap();
        assert!(at("held.json").is_file());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn long_names_are_cut_between_characters() {
        let name = "é".repeat(120) + ".json";
        assert!(name_for(Path::new(&name)).len() < 255);
    }
}
