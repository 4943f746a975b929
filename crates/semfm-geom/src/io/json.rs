//! JSON files, read with the place of what is wrong and written whole or not at all.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{FormatError, write_atomically};
use crate::{Error, Result};

/// Reads a JSON file as a `T`.
///
/// # Errors
/// [`Error::Io`] where it cannot be read; [`Error::Format`] with the line where it is not JSON or
/// not a `T`, and with serde's words (field, type, line and column) as what was found.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("weights.json");
/// semfm_geom::io::write_json(&path, &[0.5, 1.0])?;
/// let weights: Vec<f64> = semfm_geom::io::read_json(&path)?;
/// assert_eq!(weights, [0.5, 1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_json<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    serde_json::from_slice(&bytes).map_err(|error| {
        let expected = if error.is_data() { "the fields of this format" } else { "JSON" };
        FormatError::new(path, format!("line {}", error.line()), expected, error.to_string()).into()
    })
}

/// Writes `value` as JSON on one line, whole or not at all.
///
/// # Errors
/// [`Error::Io`] with the target's path.
pub fn write_json(path: impl AsRef<Path>, value: &(impl Serialize + ?Sized)) -> Result<()> {
    write_atomically(path, |out| {
        serde_json::to_writer(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

/// As [`write_json`], indented for people who read the file.
///
/// # Errors
/// [`Error::Io`] with the target's path.
pub fn write_json_pretty(path: impl AsRef<Path>, value: &(impl Serialize + ?Sized)) -> Result<()> {
    write_atomically(path, |out| {
        serde_json::to_writer_pretty(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.json");
        for (text, expected) in [("[1,\n", "JSON"), ("[1,\n\"two\"]", "the fields of this format")]
        {
            std::fs::write(&path, text).unwrap();
            match read_json::<Vec<f64>>(&path).unwrap_err() {
                Error::Format(error) => {
                    assert_eq!((error.path, error.place.as_str()), (path.clone(), "line 2"));
                    assert_eq!(error.expected, expected);
                    assert!(error.found.contains("column"), "{}", error.found);
                }
                other => panic!("{other}"),
            }
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read_json::<Vec<f64>>(&path).unwrap_err().code(), "io");
    }
}
