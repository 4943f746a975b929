//! Tensors by name from a `.safetensors` file, as f32.
//!
//! The file: eight bytes with the length of a JSON, the JSON with type, shape and place of each tensor,
//! and their numbers (<https://huggingface.co/docs/safetensors>). Only the tensors that are asked for
//! are read, so that a text tower costs nothing, and nothing is allocated that the file does not hold.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use half::{bf16, f16};
use semfm_geom::io::FormatError;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::Result;

/// Largest JSON that is read; that of a checkpoint with a thousand tensors has 100 kB.
const MAX_HEADER: u64 = 16 << 20;
/// Bytes of the length before the JSON.
const FIXED: u64 = 8;
/// What is no tensor in the JSON.
const METADATA: &str = "__metadata__";

/// An open file whose JSON was checked against its length.
#[derive(Debug)]
pub(super) struct SafeTensors {
    path: PathBuf,
    file: File,
    /// Where the numbers begin, and how many bytes there are.
    start: u64,
    n_bytes: u64,
    tensors: BTreeMap<String, Entry>,
    hasher: blake3::Hasher,
}

/// Type, shape and place of a tensor.
#[derive(Clone, Debug, Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<u64>,
    /// Bytes behind the JSON: start and end.
    data_offsets: [u64; 2],
}

impl SafeTensors {
    /// Opens a file and reads its JSON.
    pub fn open(path: &Path) -> Result<Self> {
        let io_error = |source| semfm_geom::Error::Io { path: path.to_owned(), source };
        let about = std::fs::metadata(path).map_err(io_error)?;
        if !about.is_file() {
            return Err(FormatError::new(path, "file", "a regular file", "another kind").into());
        }
        let mut file = File::open(path).map_err(io_error)?;
        let mut length = [0; FIXED as usize];
        if about.len() < FIXED {
            let found = format!("{} bytes", about.len());
            return Err(FormatError::new(path, "byte 0", "the length of a JSON", found).into());
        }
        file.read_exact(&mut length).map_err(io_error)?;
        let length = u64::from_le_bytes(length);
        let most = (about.len() - FIXED).min(MAX_HEADER);
        if length > most {
            let expected = format!("a JSON of at most {most} bytes");
            return Err(FormatError::new(path, "byte 0", expected, length.to_string()).into());
        }
        let mut json = vec![0; length as usize];
        file.read_exact(&mut json).map_err(io_error)?;
        let mut header: Map<String, Value> = serde_json::from_slice(&json)
            .map_err(|error| FormatError::new(path, "byte 8", "JSON", error.to_string()))?;
        header.remove(METADATA);
        let mut tensors = BTreeMap::new();
        for (name, entry) in header {
            let entry: Entry = serde_json::from_value(entry).map_err(|error| {
                let expected = "dtype, shape and data_offsets";
                FormatError::new(path, format!("tensor `{name}`"), expected, error.to_string())
            })?;
            tensors.insert(name, entry);
        }
        let start = FIXED + length;
        let n_bytes = about.len() - start;
        let hasher = blake3::Hasher::new();
        Ok(Self { path: path.to_owned(), file, start, n_bytes, tensors, hasher })
    }

    /// The numbers of a tensor, row-major.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) where it is not there, has another shape or a type that
    /// is neither F32, F16 nor BF16, or lies beyond the file's end.
    pub fn read(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        let refuse = |expected: String, found: String| {
            FormatError::new(&self.path, format!("tensor `{name}`"), expected, found)
        };
        let Some(Entry { dtype, shape: found, data_offsets: [from, to] }) = self.tensors.get(name)
        else {
            return Err(refuse("a tensor of this name".into(), "none".into()).into());
        };
        if !found.iter().copied().eq(shape.iter().map(|&n| n as u64)) {
            return Err(refuse(format!("shape {shape:?}"), format!("{found:?}")).into());
        }
        let size = match dtype.as_str() {
            "F32" => 4,
            "F16" | "BF16" => 2,
            _ => return Err(refuse("F32, F16 or BF16".into(), dtype.clone()).into()),
        };
        let n_bytes = found.iter().try_fold(size, |n: u64, &dim| n.checked_mul(dim));
        if n_bytes.is_none() || from.checked_add(n_bytes.unwrap_or(0)) != Some(*to) {
            let expected = format!("the bytes of {found:?} numbers of type {dtype}");
            return Err(refuse(expected, format!("{from} to {to}")).into());
        }
        if *to > self.n_bytes {
            let expected = format!("bytes {from} to {to}");
            return Err(refuse(expected, format!("a file with {} of them", self.n_bytes)).into());
        }
        let mut bytes = vec![0; (to - from) as usize];
        let read = self
            .file
            .seek(SeekFrom::Start(self.start + from))
            .and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|source| semfm_geom::Error::Io { path: self.path.clone(), source })?;
        let numbers = numbers(dtype, &bytes);
        if let Some(at) = numbers.iter().position(|x| !x.is_finite()) {
            let found = format!("{} at {at}", numbers[at]);
            return Err(refuse("finite numbers".into(), found).into());
        }
        self.hasher.update(format!("{name} {dtype} {found:?}\n").as_bytes());
        self.hasher.update(&bytes);
        Ok(numbers)
    }

    /// BLAKE3 over names, types, shapes and numbers of all that was read, in that order, as
    /// hexadecimal digits.
    pub fn hash_of_what_was_read(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}

/// Little-endian numbers of a known type as f32.
fn numbers(dtype: &str, bytes: &[u8]) -> Vec<f32> {
    let halves = || bytes.as_chunks::<2>().0.iter();
    match dtype {
        "F32" => bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect(),
        "F16" => halves().map(|&b| f16::from_le_bytes(b).to_f32()).collect(),
        _ => halves().map(|&b| bf16::from_le_bytes(b).to_f32()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file in a folder of its own.
    fn file(json: &str, numbers: &[u8]) -> (tempfile::TempDir, PathBuf) {
        let mut bytes = (json.len() as u64).to_le_bytes().to_vec();
        bytes.extend(json.as_bytes());
        bytes.extend(numbers);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        std::fs::write(&path, bytes).unwrap();
        (folder, path)
    }

    #[test]
    fn numbers_of_each_type_are_read() {
        let json = r#"{"__metadata__": {"format": "pt"},
            "a": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]},
            "b": {"dtype": "F16", "shape": [1, 2], "data_offsets": [8, 12]},
            "c": {"dtype": "BF16", "shape": [], "data_offsets": [12, 14]}}"#;
        let mut numbers = [1.5f32, -2.0].map(f32::to_le_bytes).concat();
        numbers.extend([0.5, 3.0].map(|x| f16::from_f32(x).to_le_bytes()).concat());
        numbers.extend(bf16::from_f32(-8.0).to_le_bytes());
        let (_folder, path) = file(json, &numbers);
        let mut tensors = SafeTensors::open(&path).unwrap();
        let empty = tensors.hash_of_what_was_read();
        assert_eq!(tensors.read("a", &[2]).unwrap(), [1.5, -2.0]);
        assert_eq!(tensors.read("b", &[1, 2]).unwrap(), [0.5, 3.0]);
        assert_eq!(tensors.read("c", &[]).unwrap(), [-8.0]);
        assert_ne!(tensors.hash_of_what_was_read(), empty);
    }

    #[test]
    fn tensors_that_are_not_what_they_must_be_are_named() {
        let nan = f32::NAN.to_le_bytes();
        for (entry, expected) in [
            (r#"{"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}"#, "shape"),
            (r#"{"dtype": "I64", "shape": [1], "data_offsets": [0, 8]}"#, "F32, F16 or BF16"),
            (r#"{"dtype": "F32", "shape": [1], "data_offsets": [0, 8]}"#, "the bytes of"),
            (r#"{"dtype": "F32", "shape": [1], "data_offsets": [4, 0]}"#, "the bytes of"),
            (r#"{"dtype": "F32", "shape": [1], "data_offsets": [4, 8]}"#, "bytes 4 to 8"),
            (
                r#"{"dtype": "F32", "shape": [1], "data_offsets": [18446744073709551612, 0]}"#,
                "the bytes of",
            ),
            (r#"{"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}"#, "finite"),
        ] {
            let (_folder, path) = file(&format!(r#"{{"a": {entry}}}"#), &nan);
            let mut tensors = SafeTensors::open(&path).unwrap();
            let error = tensors.read("a", &[1]).unwrap_err().to_string();
            assert!(error.contains("`a`") && error.contains(expected), "{entry}: {error}");
            assert!(tensors.read("b", &[1]).is_err());
        }
    }

    #[test]
    fn headers_that_lie_are_refused() {
        let entry = r#"{"a": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}"#;
        let (_folder, path) = file(entry, &[0; 4]);
        let whole = std::fs::read(&path).unwrap();
        let mut long = whole.clone();
        long[..8].copy_from_slice(&u64::MAX.to_le_bytes());
        for bytes in [&[][..], &whole[..7], &whole[..20], &long, b"\x02\0\0\0\0\0\0\0[]"] {
            std::fs::write(&path, bytes).unwrap();
            assert!(SafeTensors::open(&path).is_err());
        }
        for json in [r#"{"a": 5}"#, r#"{"a": {"dtype": "F32", "shape": [-1]}}"#, "{", ""] {
            let (_folder, path) = file(json, &[0; 4]);
            assert!(SafeTensors::open(&path).is_err(), "{json}");
        }
        assert!(SafeTensors::open(path.parent().unwrap()).is_err());
    }
}
