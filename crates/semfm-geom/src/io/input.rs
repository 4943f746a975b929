//! The bytes of one file and the words that errors about it need.

use std::fmt::Display;
use std::fs;
use std::io::{Read, Seek};
use std::path::Path;

use super::{FormatError, contents, input_files};
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

/// Reads a regular file whole. Folders, devices, pipes and sockets are refused before they are
/// opened: opening one could block, and reading one go on for ever. Every reader of files starts here.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for what is no regular file and for what only stands for one (a
/// pointer of Git LFS, the HTML page of a server).
pub fn read_file(path: impl AsRef<Path>) -> Result<Vec<u8>> {
    let path = path.as_ref();
    let bytes = read_at_most(path, u64::MAX)?;
    match contents::stand_in(&bytes) {
        Some(kind) => Err(FormatError::new(path, "first bytes", "the file itself", kind).into()),
        None => Ok(bytes),
    }
}

/// The first `most` bytes of a regular file, or all where it has less.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for what is no regular file.
pub fn read_at_most(path: impl AsRef<Path>, most: u64) -> Result<Vec<u8>> {
    let path = path.as_ref();
    let (file, about) = open_regular(path)?;
    let size = about.len().min(most);
    let mut bytes = Vec::new();
    let room = usize::try_from(size).unwrap_or(usize::MAX);
    bytes.try_reserve_exact(room).map_err(|_| out_of_memory(path, size))?;
    file.take(most).read_to_end(&mut bytes).map_err(Error::io(path))?;
    input_files::remember_read(path, &about);
    Ok(bytes)
}

/// Opens a regular file for a reader that takes it piece by piece, with its size in bytes: what is refused is what
/// [`read_file`] refuses.
///
/// # Errors
/// As [`read_file`].
pub fn open_file(path: impl AsRef<Path>) -> Result<(fs::File, u64)> {
    /// Bytes that show what only stands for a file.
    const FIRST: u64 = 4096;
    let path = path.as_ref();
    let (mut file, about) = open_regular(path)?;
    let mut first = Vec::new();
    (&mut file).take(FIRST).read_to_end(&mut first).map_err(Error::io(path))?;
    if let Some(kind) = contents::stand_in(&first) {
        return Err(FormatError::new(path, "first bytes", "the file itself", kind).into());
    }
    file.rewind().map_err(Error::io(path))?;
    input_files::remember_read(path, &about);
    Ok((file, about.len()))
}

fn open_regular(path: &Path) -> Result<(fs::File, fs::Metadata)> {
    let io = Error::io(path);
    check_regular(path, &fs::metadata(path).map_err(&io)?)?;
    let file = fs::File::open(path).map_err(&io)?;
    // Another thing may have taken its place in between.
    let about = file.metadata().map_err(&io)?;
    check_regular(path, &about)?;
    Ok((file, about))
}

fn out_of_memory(path: &Path, size: u64) -> Error {
    let source = std::io::Error::new(
        std::io::ErrorKind::OutOfMemory,
        format!("no memory for its {size} bytes"),
    );
    Error::io(path)(source)
}

fn check_regular(path: &Path, about: &fs::Metadata) -> Result<()> {
    match kind_of_special(about) {
        None => Ok(()),
        Some(kind) => Err(FormatError::new(path, "file system", "a regular file", kind).into()),
    }
}

/// What is no regular file, in words.
pub(super) fn kind_of_special(about: &fs::Metadata) -> Option<&'static str> {
    if about.is_file() {
        return None;
    }
    if about.is_dir() {
        return Some("a folder");
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = about.file_type();
        if kind.is_fifo() {
            return Some("a pipe (write what it holds into a file first)");
        }
        if kind.is_socket() {
            return Some("a socket");
        }
        if kind.is_block_device() {
            return Some("a block device");
        }
    }
    Some("a device")
}

/// A piece of the file for a message: printable, and short whatever stands there.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const SHOWN: usize = 40;
    let shown = bytes[..bytes.len().min(SHOWN)].escape_ascii();
    if bytes.len() > SHOWN { format!("`{shown}…`") } else { format!("`{shown}`") }
}
