//! Hashes of settings, and of what a stage was made from.

use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use semfm::files::FileHash;
use semfm::geom::io::FormatError;
use serde_json::Value;

use crate::Result;

/// BLAKE3 of a value as JSON, keys in alphabetical order.
pub fn of_settings(settings: &Value) -> String {
    blake3::hash(settings.to_string().as_bytes()).to_hex().to_string()
}

/// The files at a path, and those in a folder and in its folders, by name.
///
/// # Errors
/// [`Error::Recipe`](crate::Error::Recipe) for a link to a folder that it stands in.
pub fn files_under(path: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut folders = vec![Folder { path: path.to_owned(), within: Vec::new() }];
    while let Some(Folder { path, mut within }) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&path) else {
            files.push(path);
            continue;
        };
        let place = std::fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        if within.contains(&place) {
            let found = format!("a link to {}, in which it stands", place.display());
            return Err(FormatError::new(path, "folder", "files and folders", found).into());
        }
        within.push(place);
        for entry in entries.flatten().map(|entry| entry.path()) {
            if entry.is_dir() {
                folders.push(Folder { path: entry, within: within.clone() });
            } else {
                files.push(entry);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// A folder with those that it is in, whose names have no links.
struct Folder {
    path: PathBuf,
    within: Vec<PathBuf>,
}

/// When a piece of work began, by the clock of the disk that its results go to.
#[derive(Clone, Copy, Debug)]
pub struct Begin(SystemTime);

impl Begin {
    /// Now, which is when `folder` was made or last written to.
    pub fn of(folder: &Path) -> Self {
        let written = std::fs::metadata(folder).and_then(|about| about.modified());
        Self(written.unwrap_or_else(|_| SystemTime::now()))
    }

    /// The [hashes] of what was read since: those of files that changed meanwhile are empty, for nobody knows what of them
    /// was read. An empty hash holds for no file.
    pub fn hashes(self, files: impl IntoIterator<Item = PathBuf>, folder: &Path) -> Vec<FileHash> {
        let files: Vec<PathBuf> = files.into_iter().collect();
        let mut hashes = hashes(files.iter().cloned(), folder);
        for path in files.iter().filter(|path| self.is_before_change(path)) {
            let Some(changed) = FileHash::of(path, folder) else { continue };
            let of_it = hashes.iter_mut().filter(|hash| hash.file == changed.file);
            of_it.for_each(|hash| hash.blake3.clear());
        }
        hashes
    }

    /// Whether a file was written, or put in its place, since.
    fn is_before_change(self, path: &Path) -> bool {
        std::fs::metadata(path).is_ok_and(|about| last_change(&about).is_some_and(|t| t > self.0))
    }
}

/// When a file's bytes or its name changed last.
fn last_change(about: &Metadata) -> Option<SystemTime> {
    let written = about.modified().ok();
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        use std::time::Duration;
        let since_epoch = u64::try_from(about.ctime()).ok()?;
        let put = Duration::new(since_epoch, u32::try_from(about.ctime_nsec()).ok()?);
        written.max(Some(SystemTime::UNIX_EPOCH + put))
    }
    #[cfg(not(unix))]
    written
}

/// The hashes of files that can be read, named as files of `folder` name them, each once, by name.
pub fn hashes(files: impl IntoIterator<Item = PathBuf>, folder: &Path) -> Vec<FileHash> {
    let mut hashes: Vec<FileHash> =
        files.into_iter().filter_map(|path| FileHash::of(&path, folder)).collect();
    hashes.sort_by(|a, b| a.file.cmp(&b.file));
    hashes.dedup_by(|a, b| a.file == b.file);
    hashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_all_files_in_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("a")).unwrap();
        for name in ["b.txt", "a/c.txt"] {
            std::fs::write(at(name), name).unwrap();
        }
        assert_eq!(files_under(folder.path()).unwrap(), [at("a/c.txt"), at("b.txt")]);
        assert_eq!(files_under(&at("b.txt")).unwrap(), [at("b.txt")]);
        let named = hashes([at("b.txt"), at("a/c.txt"), at("b.txt"), at("gone")], &at("a"));
        let names: Vec<&str> = named.iter().map(|hash| hash.file.as_str()).collect();
        assert_eq!(names, ["../b.txt", "c.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_in_a_circle_are_named_and_other_links_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("a/b")).unwrap();
        std::fs::write(at("a/b/c.txt"), "c").unwrap();
        symlink(at("a/b"), at("twice")).unwrap();
        assert_eq!(files_under(folder.path()).unwrap(), [at("a/b/c.txt"), at("twice/c.txt")]);
        symlink(at("a"), at("a/b/up")).unwrap();
        let error = files_under(&at("a")).unwrap_err().to_string();
        assert!(error.contains("b/up") && error.contains("link"), "{error}");
    }

    #[test]
    fn what_changes_while_it_is_read_holds_no_longer() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        ["before", "changed", "other"]
            .iter()
            .for_each(|name| std::fs::write(at(name), name).unwrap());
        std::fs::create_dir(at("out")).unwrap();
        let begin = Begin::of(&at("out"));
        let hour = std::time::Duration::from_secs(3600);
        let set_written = |name: &str, time: SystemTime| {
            let file = std::fs::File::options().write(true).open(at(name)).unwrap();
            file.set_modified(time).unwrap();
        };
        let holds = |begin: Begin, name: &str| {
            begin.hashes([at(name)], folder.path())[0].holds(folder.path())
        };
        set_written("changed", begin.0 + hour);
        assert!(holds(begin, "before") && !holds(begin, "changed"));
        // Bytes that are older than the work came into their place since; only Unix tells when.
        let earlier = Begin(begin.0 - hour);
        set_written("other", begin.0 - 2 * hour);
        std::fs::rename(at("other"), at("replaced")).unwrap();
        assert_eq!(holds(earlier, "replaced"), cfg!(not(unix)));
    }

    #[test]
    fn settings_have_one_hash_whatever_the_order_of_their_keys() {
        let [a, b] = [r#"{"x": 1, "y": [2]}"#, r#"{"y": [2], "x": 1}"#];
        let [a, b] = [a, b].map(|text| of_settings(&serde_json::from_str(text).unwrap()));
        assert_eq!(a, b);
        assert_ne!(a, of_settings(&serde_json::json!({ "x": 1 })));
    }
}
