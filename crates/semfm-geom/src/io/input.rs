//! The bytes of one file and the words that errors about it need.

use std::fmt::Display;
use std::fs;
use std::path::Path;

use crate::{Error, Result};

/// A file in memory with its path, so that every complaint can name where it stands.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    /// The file, for messages and for the folder that relative names start from.
    pub path: &'a Path,
    /// All of its bytes.
    pub bytes: &'a [u8],
}

impl Input<'_> {
    /// `Error::Format` for this file.
    pub fn error(
        &self,
        place: impl Display,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::Format {
            path: self.path.to_owned(),
            place: place.to_string(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Adds the path to an error about the contents.
    pub fn wrap(&self, cause: Error) -> Error {
        Error::InFile { path: self.path.to_owned(), cause: Box::new(cause) }
    }

    /// How many bytes follow `offset`, in words.
    pub fn left_after(&self, offset: usize) -> String {
        format!("{} bytes", self.bytes.len().saturating_sub(offset))
    }
}

/// Reads a regular file whole: a device or a pipe could go on for ever.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    if !fs::metadata(path).map_err(io)?.is_file() {
        return Err(Error::Format {
            path: path.to_owned(),
            place: "file system".into(),
            expected: "a regular file".into(),
            found: "a folder or a device".into(),
        });
    }
    fs::read(path).map_err(io)
}

/// A piece of the file for a message: printable, and short whatever stands there.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const SHOWN: usize = 40;
    let shown = bytes[..bytes.len().min(SHOWN)].escape_ascii();
    if bytes.len() > SHOWN { format!("`{shown}…`") } else { format!("`{shown}`") }
}
