//! NumPy's archives: a ZIP of arrays, stored or deflated.
//!
//! [`NumpyArray`] is the array. The feature `npz` of `npyz` would read the ZIP, too, by `zip` 0.6 with AES, bzip2,
//! a second zstd and `time`: thirty crates and one more C library for what stands here, and no limit
//! on what an entry unpacks to.

use std::io::Read;
use std::path::Path;

use semfm_geom::io::{FormatError, foreign_kind, read_file};

use crate::numpy_array::NumpyArray;
use crate::{Error, Result};

/// No array of a shape is larger than this when unpacked.
const LARGEST: u64 = 1 << 30;

/// A ZIP file in memory, its directory read.
#[derive(Debug)]
pub struct NumpyArchive<'a> {
    path: &'a Path,
    bytes: Vec<u8>,
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    name: String,
    method: u16,
    packed: usize,
    unpacked: u64,
    crc: u32,
    /// Where its local header stands.
    at: usize,
}

impl<'a> NumpyArchive<'a> {
    /// Reads the archive and its central directory (PKWARE's APPNOTE 4.3.12 and 4.3.16; no ZIP64, no
    /// encryption).
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`]; [`Error::Format`] for what is no archive.
    pub fn read(path: &'a Path) -> Result<Self> {
        let bytes = read_file(path)?;
        // The end record is 22 bytes and a comment of at most 65535.
        let from = bytes.len().saturating_sub(22 + 0xffff);
        let end = (from..bytes.len().saturating_sub(21))
            .rev()
            .find(|&i| bytes[i..].starts_with(b"PK\x05\x06"));
        let foreign = || foreign_kind(&bytes).filter(|kind| !kind.contains("ZIP"));
        let end = end.ok_or_else(|| broken(path, foreign().unwrap_or("no end record")))?;
        let count = u16_at(&bytes, end + 10).ok_or_else(|| broken(path, "a short end record"))?;
        let mut at =
            u32_at(&bytes, end + 16).ok_or_else(|| broken(path, "a short end record"))? as usize;
        let mut entries = Vec::new();
        for _ in 0..count {
            let entry = entry(&bytes, at).ok_or_else(|| broken(path, "a damaged entry"))?;
            entries.push(entry.0);
            at = entry.1;
        }
        Ok(Self { path, bytes, entries })
    }

    /// Names of the arrays, in the order of the file.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().filter_map(|entry| entry.name.strip_suffix(".npy"))
    }

    /// The array `name`; none where the archive does not hold it.
    ///
    /// # Errors
    /// [`Error::Format`] with the entry at fault.
    pub fn array(&self, name: &str) -> Result<Option<NumpyArray>> {
        let file = format!("{name}.npy");
        let Some(entry) = self.entries.iter().find(|entry| entry.name == file) else {
            return Ok(None);
        };
        NumpyArray::parse(self.path, name, &self.unpack(entry)?).map(Some)
    }

    fn fault(&self, place: &str, expected: &str, found: String) -> Error {
        FormatError::new(self.path, place, expected, found).into()
    }

    fn unpack(&self, entry: &Entry) -> Result<Vec<u8>> {
        let fault = |found: String| self.fault(&entry.name, "a sound ZIP entry", found);
        // The local header repeats the name and has an extra field of its own length.
        let lengths = (u16_at(&self.bytes, entry.at + 26), u16_at(&self.bytes, entry.at + 28));
        let (Some(name), Some(extra)) = lengths else { return Err(fault("no header".into())) };
        let start = entry.at + 30 + usize::from(name) + usize::from(extra);
        let packed = start.checked_add(entry.packed).and_then(|end| self.bytes.get(start..end));
        let packed = packed.ok_or_else(|| fault("fewer bytes than it names".into()))?;
        if entry.unpacked > LARGEST {
            return Err(fault(format!("{} bytes", entry.unpacked)));
        }
        let mut out = Vec::new();
        match entry.method {
            0 => out.extend_from_slice(packed),
            8 => {
                let inflate = flate2::read::DeflateDecoder::new(packed);
                let read = inflate.take(entry.unpacked + 1).read_to_end(&mut out);
                read.map_err(|error| fault(error.to_string()))?;
            }
            other => return Err(fault(format!("compression {other}"))),
        }
        if out.len() as u64 != entry.unpacked {
            return Err(fault(format!("{} bytes for {}", out.len(), entry.unpacked)));
        }
        let mut crc = flate2::Crc::new();
        crc.update(&out);
        if crc.sum() == entry.crc { Ok(out) } else { Err(fault("another checksum".into())) }
    }
}

/// The directory at the archive's end is none.
fn broken(path: &Path, found: &str) -> Error {
    FormatError::new(path, "directory", "a ZIP archive", found).into()
}

/// An entry of the central directory, and where the next begins.
fn entry(bytes: &[u8], at: usize) -> Option<(Entry, usize)> {
    if !bytes.get(at..)?.starts_with(b"PK\x01\x02") {
        return None;
    }
    let length = |offset| u16_at(bytes, at + offset).map(usize::from);
    let (name, extra, comment) = (length(28)?, length(30)?, length(32)?);
    let start = at + 46;
    let name_bytes = bytes.get(start..start + name)?;
    let entry = Entry {
        name: String::from_utf8_lossy(name_bytes).into_owned(),
        method: u16_at(bytes, at + 10)?,
        packed: u32_at(bytes, at + 20)? as usize,
        unpacked: u64::from(u32_at(bytes, at + 24)?),
        crc: u32_at(bytes, at + 16)?,
        at: u32_at(bytes, at + 42)? as usize,
    };
    Some((entry, start + name + extra + comment))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

/// Files as NumPy writes them, for tests here and in other crates.
#[cfg(any(test, feature = "test-files"))]
#[allow(clippy::unwrap_used, reason = "test files")]
pub mod testing {
    use std::io::Write;

    /// An `.npy` file.
    pub fn npy<T: npyz::AutoSerialize + Copy>(shape: &[u64], values: &[T]) -> Vec<u8> {
        use npyz::WriterBuilder;
        let mut bytes = Vec::new();
        let mut writer = npyz::WriteOptions::new()
            .default_dtype()
            .shape(shape)
            .writer(&mut bytes)
            .begin_nd()
            .unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    /// A ZIP archive as NumPy's `savez_compressed` writes it.
    pub fn zip(files: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
        let (mut out, mut directory) = (Vec::new(), Vec::new());
        for (name, bytes) in files {
            let mut crc = flate2::Crc::new();
            crc.update(bytes);
            let packed = if deflated {
                let mut encoder =
                    flate2::write::DeflateEncoder::new(Vec::new(), Default::default());
                encoder.write_all(bytes).unwrap();
                encoder.finish().unwrap()
            } else {
                bytes.clone()
            };
            let at = out.len() as u32;
            let method: u16 = if deflated { 8 } else { 0 };
            let mut common = vec![20, 0, 0, 0];
            common.extend(method.to_le_bytes());
            common.extend([0; 4]);
            common.extend(crc.sum().to_le_bytes());
            common.extend((packed.len() as u32).to_le_bytes());
            common.extend((bytes.len() as u32).to_le_bytes());
            common.extend((name.len() as u16).to_le_bytes());
            common.extend([0, 0]);
            out.extend(b"PK\x03\x04");
            out.extend(&common);
            out.extend(name.as_bytes());
            out.extend(packed);
            directory.extend(b"PK\x01\x02\x14\x00");
            directory.extend(&common);
            directory.extend([0; 10]);
            directory.extend(at.to_le_bytes());
            directory.extend(name.as_bytes());
        }
        let start = out.len() as u32;
        out.extend(&directory);
        out.extend(b"PK\x05\x06\0\0\0\0");
        out.extend((files.len() as u16).to_le_bytes());
        out.extend((files.len() as u16).to_le_bytes());
        out.extend((directory.len() as u32).to_le_bytes());
        out.extend(start.to_le_bytes());
        out.extend([0, 0]);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::testing::{npy, zip};
    use super::*;

    #[test]
    fn arrays_come_back_and_damage_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let files = || {
            vec![
                ("V.npy", npy(&[2, 3], &[0.5f32, 1.0, 2.0, 3.0, 4.0, 5.0])),
                ("gt.npy", npy(&[2], &[7i32, 1])),
            ]
        };
        for deflated in [false, true] {
            let whole = zip(&files(), deflated);
            std::fs::write(&path, &whole).unwrap();
            let archive = NumpyArchive::read(&path).unwrap();
            let array = archive.array("V").unwrap().unwrap();
            assert_eq!(array.shape, [2, 3]);
            assert_eq!(array.into_f64()[5], 5.0);
            assert_eq!(archive.array("gt").unwrap().unwrap().into_f64(), [7.0, 1.0]);
            assert!(archive.array("gt_sym").unwrap().is_none());
            for at in 0..whole.len() {
                let mut broken = whole.clone();
                broken[at] ^= 0x10;
                std::fs::write(&path, &broken).unwrap();
                // Whatever the flip hits, the answer is an array, nothing or an error.
                if let Ok(archive) = NumpyArchive::read(&path) {
                    let _ = archive.array("V");
                }
                std::fs::write(&path, &whole[..at]).unwrap();
                if let Ok(archive) = NumpyArchive::read(&path) {
                    assert!(archive.array("V").is_err(), "cut at {at}");
                }
            }
        }
    }
}
