//! One run at a time in an output folder.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// The file that is locked; it stays behind, empty of meaning.
const FILE: &str = ".lock";

/// A folder for results that nobody else writes into until this is dropped or the process ends,
/// however it ends: the system keeps the lock, not the file.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// Held open for its lock.
    _lock: File,
}

impl OutputFolder {
    /// Opens `folder`, which is made.
    ///
    /// # Errors
    /// [`Error::Busy`] where another process has it open; [`Error::Io`].
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let path = folder.join(FILE);
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(&path).map_err(Error::io(&path))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let mut process = String::new();
                let _ = file.read_to_string(&mut process);
                Err(Error::Busy { path: folder.to_owned(), process: process.trim().to_owned() })
            }
            // Some network file systems have no locks: keeping alone is then the user's part.
            Err(TryLockError::Error(_)) => Ok(Self { path: folder.to_owned(), _lock: file }),
            Ok(()) => {
                // For the message of whoever comes later; without it, they are told less.
                let _ = file.set_len(0);
                let _ =
                    file.rewind().and_then(|()| writeln!(file, "process {}", std::process::id()));
                Ok(Self { path: folder.to_owned(), _lock: file })
            }
        }
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_run_is_told_of_the_first_and_a_later_one_is_free() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("report");
        let first = OutputFolder::open(&out).unwrap();
        let error = OutputFolder::open(&out).err().unwrap();
        assert_eq!(error.code(), "busy");
        let words = error.to_string();
        let process = std::process::id().to_string();
        assert!(words.contains("report") && words.contains(&process), "{words}");
        drop(first);
        assert!(OutputFolder::open(&out).is_ok());
    }
}
