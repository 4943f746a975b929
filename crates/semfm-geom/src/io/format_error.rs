//! The one form of an error about the contents of a file.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A file is not what its format demands: which file, where in it, and both what should stand
/// there and what does.
///
/// ```
/// use semfm_geom::io::FormatError;
/// let error = FormatError::new("cup.obj", "line 3", "three numbers", "`v 1 2`");
/// assert_eq!(error.to_string(), "cup.obj: line 3: expected three numbers, found `v 1 2`");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {place}: expected {expected}, found {found}", path.display())]
pub struct FormatError {
    /// The file.
    pub path: PathBuf,
    /// Line, byte offset, field, element, topic or accessor.
    pub place: String,
    /// What the format demands there.
    pub expected: String,
    /// What stands there.
    pub found: String,
}

impl FormatError {
    /// At `place` of the file `path`, `expected` should stand, but `found` does.
    pub fn new(
        path: impl AsRef<Path>,
        place: impl Display,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self {
            path: super::shown_path(path),
            place: place.to_string(),
            expected: expected.into(),
            found: found.into(),
        }
    }
}
