//! Which files are the same, and which ones this process has read.

use std::collections::HashMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::SystemTime;

use super::{FormatError, read_files};
use crate::Result;

/// A file by what the system knows it by: the same for every link and every spelling of a path.
#[derive(Clone, PartialEq, Eq, Hash)]
struct FileId {
    #[cfg(unix)]
    device_and_inode: (u64, u64),
    #[cfg(not(unix))]
    path: PathBuf,
}

impl FileId {
    #[cfg(unix)]
    fn of(_path: &Path, about: &Metadata) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        Some(Self { device_and_inode: (about.dev(), about.ino()) })
    }

    #[cfg(not(unix))]
    fn of(path: &Path, _about: &Metadata) -> Option<Self> {
        Some(Self { path: path.canonicalize().ok()? })
    }
}

/// What this process has done with a file.
struct Known {
    /// An inode number is used again once a file is gone; then this differs.
    created: Option<SystemTime>,
    use_of: Use,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    Read,
    Written,
}

/// So many files are remembered; beyond that all are forgotten at once.
const MOST: usize = 1 << 16;

static KNOWN: LazyLock<Mutex<HashMap<FileId, Known>>> = LazyLock::new(Mutex::default);

/// Remembers that the process has read a file, unless it wrote that file itself.
pub(super) fn remember_read(path: &Path, about: &Metadata) {
    read_files::note(path);
    note(path, about, Use::Read);
}

/// Remembers that the process has written a file: it may write it again.
pub(super) fn remember_written(path: &Path) {
    if let Ok(about) = fs::metadata(path) {
        note(path, &about, Use::Written);
    }
}

fn note(path: &Path, about: &Metadata, use_of: Use) {
    let Some(id) = FileId::of(path, about) else { return };
    let created = about.created().ok();
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if known.len() >= MOST {
        known.clear();
    }
    let is_own = use_of == Use::Read
        && known.get(&id).is_some_and(|k| k.use_of == Use::Written && k.created == created);
    if !is_own {
        known.insert(id, Known { created, use_of });
    }
}

/// Whether two paths lead to the same file: by a link, hard or soft, or by another spelling. False
/// where one of them does not exist.
pub fn is_same_file(a: impl AsRef<Path>, b: impl AsRef<Path>) -> bool {
    match (id_at(a.as_ref()), id_at(b.as_ref())) {
        (Some(a), Some(b)) => a == b,
        _ => false,
    }
}

fn id_at(path: &Path) -> Option<FileId> {
    FileId::of(path, &fs::metadata(path).ok()?)
}

/// Refuses outputs that would replace one of the inputs. Call it before any work.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) that names the output and the input.
pub fn refuse_to_overwrite(outputs: &[PathBuf], inputs: &[&Path]) -> Result<()> {
    for output in outputs {
        let Some(id) = id_at(output) else { continue };
        if let Some(input) = inputs.iter().find(|input| id_at(input).as_ref() == Some(&id)) {
            let found = match *input == output {
                true => "an input of the same command".to_owned(),
                false => format!("the input {} under another name", input.display()),
            };
            return Err(FormatError::new(output, "output", EXPECTED, found).into());
        }
    }
    Ok(())
}

const EXPECTED: &str = "a file that may be replaced (choose another name)";

/// Refuses a path that leads to a file which this process has read and did not write: what was the
/// input of a result is not replaced by it. The writers of results call it.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) that names the file.
pub fn refuse_input(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    let Ok(about) = fs::metadata(path) else { return Ok(()) };
    let Some(id) = FileId::of(path, &about).filter(|_| about.is_file()) else { return Ok(()) };
    let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let was_read =
        known.get(&id).is_some_and(|k| k.use_of == Use::Read && k.created == about.created().ok());
    if was_read {
        let found = "a file that was read here as an input";
        return Err(FormatError::new(path, "output", EXPECTED, found).into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{read_json, write_json};
    use super::*;

    #[test]
    fn what_was_read_is_not_replaced_under_any_name_and_what_was_written_is() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("in.json"), "[1]").unwrap();
        assert!(refuse_input(at("in.json")).is_ok());
        let _: Vec<u8> = read_json(at("in.json")).unwrap();
        fs::hard_link(at("in.json"), at("hard.json")).unwrap();
        let mut names = vec!["in.json", "hard.json", "./../x/in.json"];
        fs::create_dir(at("x")).unwrap();
        names[2] = "x/../in.json";
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("in.json", at("soft.json")).unwrap();
            names.push("soft.json");
        }
        for name in names {
            let error = refuse_input(at(name)).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("input"), "{error}");
            let outputs = [at(name)];
            assert!(refuse_to_overwrite(&outputs, &[&at("in.json")]).is_err());
        }
        assert!(refuse_to_overwrite(&[at("new.json")], &[&at("in.json")]).is_ok());

        write_json(at("out.json"), &[1]).unwrap();
        let _: Vec<u8> = read_json(at("out.json")).unwrap();
        assert!(refuse_input(at("out.json")).is_ok(), "our own file");
        write_json(at("out.json"), &[2]).unwrap();
        let _: Vec<u8> = read_json(at("out.json")).unwrap();
        assert!(refuse_input(at("out.json")).is_ok());
    }
}
