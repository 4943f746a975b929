//! The bytes of one file and the words that errors about it need.

use std::fmt::Display;
use std::fs;
use std::path::Path;

use super::FormatError;
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
        FormatError::new(self.path, place, expected, found).into()
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
    let io = Error::io(path);
    if !fs::metadata(path).map_err(&io)?.is_file() {
        let (expected, found) = ("a regular file", "a folder or a device");
        return Err(FormatError::new(path, "file system", expected, found).into());
    }
    fs::read(path).map_err(io)
}

/// A piece of the file for a message: printable, and short whatever stands there.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const SHOWN: usize = 40;
    let shown = bytes[..bytes.len().min(SHOWN)].escape_ascii();
    if bytes.len() > SHOWN { format!("`{shown}…`") } else { format!("`{shown}`") }
}
