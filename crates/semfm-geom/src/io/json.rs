//! JSON files, read with the place of what is wrong and written whole or not at all.

use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::contents::kind_of;
use super::input::read_file;
use super::{FormatError, write_atomically};
use crate::Result;

/// Reads a JSON file as a `T`. A byte-order mark before it is no part of it.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) where it cannot be read; [`Error::Format`](crate::Error::Format) where it is no regular file, with the
/// line where it is not JSON or not a `T`, and with serde's words (field, type, line and column) as
/// what was found.
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
    let bytes = read_file(path)?;
    json_of(path, &bytes)
}

/// As [`read_json`], of bytes that are in memory already; `path` is for messages.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format).
pub fn json_of<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        let found = "a UTF-16 byte-order mark (save the file as UTF-8)";
        return Err(FormatError::new(path, "byte 0", "JSON in UTF-8", found).into());
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    serde_json::from_slice(text).map_err(|error| {
        if let Some(kind) = kind_of(bytes) {
            return FormatError::new(path, "first bytes", "JSON", kind).into();
        }
        if text.trim_ascii().is_empty() {
            return FormatError::new(path, "whole file", "JSON", "an empty file").into();
        }
        let expected = if error.is_data() { "the fields of this format" } else { "JSON" };
        FormatError::new(path, format!("line {}", error.line()), expected, error.to_string()).into()
    })
}

/// Writes `value` as JSON on one line, whole or not at all.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) with the target's path.
pub fn write_json(path: impl AsRef<Path>, value: &(impl Serialize + ?Sized)) -> Result<()> {
    write_atomically(path, |out| {
        serde_json::to_writer(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

/// As [`write_json`], indented for people who read the file.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) with the target's path.
pub fn write_json_pretty(path: impl AsRef<Path>, value: &(impl Serialize + ?Sized)) -> Result<()> {
    write_atomically(path, |out| {
        serde_json::to_writer_pretty(&mut *out, value)?;
        out.write_all(b"\n")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

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

    #[test]
    fn a_byte_order_mark_is_passed_over_and_other_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list.json");
        std::fs::write(&path, b"\xef\xbb\xbf[1.5]").unwrap();
        assert_eq!(read_json::<Vec<f64>>(&path).unwrap(), [1.5]);
        for (bytes, word) in [
            (&b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n"[..], "git lfs pull"),
            (b"<!DOCTYPE html><html>", "HTML"),
            (b"\x89PNG\r\n\x1a\n", "PNG"),
            (b"\xff\xfe[\0", "UTF-16"),
            (b" \n", "empty"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = read_json::<Vec<f64>>(&path).unwrap_err().to_string();
            assert!(error.contains("list.json") && error.contains(word), "{error}");
        }
        let error = read_json::<Vec<f64>>(folder.path()).unwrap_err().to_string();
        assert!(error.contains("a regular file") && error.contains("a folder"), "{error}");
    }
}
