//! Where a written file goes: into a regular file that is replaced whole, or into what must not be
//! replaced (a device, a pipe).

use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};

use super::FormatError;
use super::input::kind_of_special;
use crate::{Error, Result};

/// Links that are followed before a chain counts as a circle, as the system does.
const MOST_LINKS: usize = 40;

/// What stands at a path that is to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Nothing or a regular file, at this path once links are followed: it is replaced whole.
    File(PathBuf),
    /// A device, a pipe or an open file of a process: what is written goes into it.
    Stream(PathBuf),
}

impl Target {
    /// Looks at a path, following links.
    ///
    /// # Errors
    /// [`Error::Format`] for a folder, a socket and a disk's device, [`Error::Io`].
    pub fn of(path: &Path) -> Result<Self> {
        if path.as_os_str().is_empty() || ends_with_separator(path) {
            let found = if path.as_os_str().is_empty() { "no name" } else { "a folder's name" };
            return Err(refuse(path, found));
        }
        match fs::metadata(path) {
            Ok(about) => Self::of_existing(path, &about),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Ok(Self::File(end_of_links(path)?))
            }
            Err(error) => Err(Error::io(path)(error)),
        }
    }

    fn of_existing(path: &Path, about: &Metadata) -> Result<Self> {
        if about.is_file() {
            // Links of /proc lead to files that are open: replacing one would cut its stream.
            let end = path.canonicalize().map_err(Error::io(path))?;
            return Ok(if is_of_process(path) { Self::Stream(end) } else { Self::File(end) });
        }
        match kind_of_special(about) {
            Some(kind @ ("a folder" | "a socket" | "a block device")) => Err(refuse(path, kind)),
            _ => Ok(Self::Stream(path.to_owned())),
        }
    }
}

/// Whether a path is `-` or one of the names of standard output.
pub fn is_stdout(path: impl AsRef<Path>) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"]
        .iter()
        .any(|n| path.as_ref() == Path::new(n))
}

/// Refuses a path that cannot be written as a file: a folder, a socket, a disk's device, a file
/// where a folder of the path should be. Call it before any work; a missing folder is no fault, for
/// it is made.
///
/// # Errors
/// [`Error::Format`], [`Error::Io`].
pub fn check_output(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    if let Target::File(file) = Target::of(path)? {
        check_folder_of(path, &file)?;
    }
    Ok(())
}

/// What is there of the folders above must be folders.
fn check_folder_of(path: &Path, file: &Path) -> Result<()> {
    let mut folder = super::temporary::folder_of(file);
    loop {
        match fs::metadata(folder) {
            Ok(about) if about.is_dir() => return Ok(()),
            Ok(_) => {
                let place = format!("folder {}", folder.display());
                return Err(FormatError::new(path, place, "a folder", "a file").into());
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                folder = super::temporary::folder_of(folder);
            }
            Err(error) => return Err(Error::io(path)(error)),
        }
    }
}

fn refuse(path: &Path, found: &str) -> Error {
    FormatError::new(path, "output", "the name of a file to write", found).into()
}

fn ends_with_separator(path: &Path) -> bool {
    path.as_os_str().to_string_lossy().ends_with(std::path::is_separator)
}

/// Whether the path, or what it links to first, lies where the system shows open files.
fn is_of_process(path: &Path) -> bool {
    let there = |path: &Path| path.starts_with("/proc") || path.starts_with("/dev/fd");
    there(path) || fs::read_link(path).is_ok_and(|link| there(&link))
}

/// Where the links that start at `path` end: at what is not there yet.
fn end_of_links(path: &Path) -> Result<PathBuf> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&at) {
            Ok(link) => at = super::temporary::folder_of(&at).join(link),
            Err(_) => return Ok(at),
        }
    }
    Err(Error::io(path)(std::io::Error::other("the links lead in a circle")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_no_targets_and_their_lack_is_no_fault() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(check_output(at("new.json")).is_ok());
        assert!(check_output(at("a/b/new.json")).is_ok());
        assert!(!at("a").exists(), "only looked at");
        fs::write(at("file"), "").unwrap();
        for (path, word) in [
            (folder.path().to_owned(), "a folder"),
            (at("slash/"), "a folder's name"),
            (at("file/new.json"), "file"),
            (PathBuf::new(), "no name"),
        ] {
            let error = check_output(&path).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_to_their_end() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().canonicalize().unwrap().join(name);
        symlink("two", at("one")).unwrap();
        symlink("end", at("two")).unwrap();
        assert_eq!(Target::of(&at("one")).unwrap(), Target::File(at("end")));
        fs::write(at("end"), "").unwrap();
        assert_eq!(Target::of(&at("one")).unwrap(), Target::File(at("end")));
        symlink("circle", at("circle")).unwrap();
        assert!(Target::of(&at("circle")).is_err());
        assert_eq!(Target::of(Path::new("/dev/null")).unwrap(), Target::Stream("/dev/null".into()));
        assert!(is_stdout("-") && is_stdout("/dev/stdout") && !is_stdout("./-"));
    }
}
