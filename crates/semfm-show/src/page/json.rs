//! JSON files that this workspace writes.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::{Error, Result};

/// Reads a JSON file.
///
/// # Errors
/// [`Error::Semfm`] where it cannot be read, [`Error::Format`] where it is not what `T` wants.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path)
        .map_err(|source| semfm::geom::Error::Io { path: path.to_owned(), source })?;
    serde_json::from_slice(&bytes).map_err(|error| Error::Format {
        path: path.to_owned(),
        place: format!("line {}", error.line()),
        expected: "the JSON that `semfm-cli` writes".into(),
        found: error.to_string(),
    })
}
