//! The bytes that a glTF file points at: its own, inside a data URI, or in a file of its folder.

use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

use super::json::Root;
use crate::Result;
use crate::io::input::{Input, quote, read_file};

/// Where bytes come from; loaded when first asked for and kept.
pub(crate) struct Buffers<'a> {
    input: Input<'a>,
    root: &'a Root,
    /// The binary chunk of a GLB.
    chunk: Option<&'a [u8]>,
    loaded: Vec<OnceCell<Bytes<'a>>>,
    /// By their true path, so that a file named a thousand times is held once.
    files: RefCell<HashMap<PathBuf, Rc<Vec<u8>>>>,
}

/// Bytes of the file itself, or of another.
#[derive(Clone)]
pub(crate) enum Bytes<'a> {
    Own(&'a [u8]),
    Other(Rc<Vec<u8>>),
}

impl std::ops::Deref for Bytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Own(bytes) => bytes,
            Self::Other(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    /// The buffers of a file, none of them loaded.
    pub fn new(input: Input<'a>, root: &'a Root, chunk: Option<&'a [u8]>) -> Self {
        let loaded = root.buffers.iter().map(|_| OnceCell::new()).collect();
        Self { input, root, chunk, loaded, files: RefCell::default() }
    }

    /// The bytes of a buffer view, checked against its buffer.
    pub fn view(&self, view: usize) -> Result<&[u8]> {
        let place = format!("buffer view {view}");
        let Some(json) = self.root.buffer_views.get(view) else {
            let found = format!("{} of them", self.root.buffer_views.len());
            return Err(self.input.error(place, "a buffer view that exists", found));
        };
        let buffer = self.buffer(json.buffer.0)?;
        let start = json.byte_offset.map_or(0, |offset| offset.0);
        let length = json.byte_length.0;
        start.checked_add(length).and_then(|end| buffer.get(start..end)).ok_or_else(|| {
            let found = format!("a buffer of {}", buffer.len());
            self.input.error(
                place,
                format!("{length} bytes from byte {start} of its buffer"),
                found,
            )
        })
    }

    fn buffer(&self, buffer: usize) -> Result<&[u8]> {
        let place = format!("buffer {buffer}");
        let Some(cell) = self.loaded.get(buffer) else {
            let found = format!("{} of them", self.loaded.len());
            return Err(self.input.error(place, "a buffer that exists", found));
        };
        let json = &self.root.buffers[buffer];
        if cell.get().is_none() {
            let bytes = match (&json.uri, self.chunk) {
                (Some(uri), _) => self.resolve(&place, uri)?,
                (None, Some(chunk)) if buffer == 0 => Bytes::Own(chunk),
                (None, _) => {
                    return Err(self.input.error(place, "a uri or a binary chunk", "neither"));
                }
            };
            if bytes.len() < json.byte_length.0 {
                let expected = format!("{} bytes", json.byte_length.0);
                return Err(self.input.error(place, expected, format!("{}", bytes.len())));
            }
            // The cell was empty a moment ago and nobody else can reach it.
            let _ = cell.set(bytes);
        }
        Ok(cell.get().map_or(&[][..], |bytes| &bytes[..json.byte_length.0]))
    }

    /// The bytes behind a URI: `data:…;base64,…` or a file inside the folder of the glTF file.
    pub fn resolve(&self, place: &str, uri: &str) -> Result<Bytes<'a>> {
        let refuse = |expected: &str| self.input.error(place, expected, quote(uri.as_bytes()));
        if let Some(data) = uri.strip_prefix("data:") {
            let bytes =
                data.split_once(";base64,").and_then(|(_, text)| decode_base64(text.as_bytes()));
            return bytes.map(|b| Bytes::Other(Rc::new(b))).ok_or_else(|| refuse("base64 data"));
        }
        let name = decode_percent(uri).ok_or_else(|| refuse("a uri in UTF-8"))?;
        let relative = Path::new(&name);
        let inside = relative
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        // A colon or a backslash makes it a URL or a path of another system.
        if name.is_empty() || !inside || name.contains([':', '\\', '\0']) {
            return Err(refuse("a file inside the folder of the glTF file"));
        }
        let folder = match self.input.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let path = folder.join(relative);
        // Links could still lead outside; where a path really goes is known once it is resolved.
        let (Ok(real_folder), Ok(real_path)) = (folder.canonicalize(), path.canonicalize()) else {
            return Err(refuse("a file that exists"));
        };
        if !real_path.starts_with(real_folder) {
            return Err(refuse("a file inside the folder of the glTF file"));
        }
        let mut files = self.files.borrow_mut();
        if let Some(bytes) = files.get(&real_path) {
            return Ok(Bytes::Other(bytes.clone()));
        }
        let bytes = Rc::new(read_file(&real_path)?);
        files.insert(real_path, bytes.clone());
        Ok(Bytes::Other(bytes))
    }

    /// Bytes held in memory by now.
    pub fn n_loaded(&self) -> usize {
        self.files.borrow().values().map(|bytes| bytes.len()).sum::<usize>()
            + self.input.bytes.len()
    }
}

/// RFC 4648 base64, padding optional; `None` where another character stands.
fn decode_base64(text: &[u8]) -> Option<Vec<u8>> {
    let end = text.iter().rposition(|&b| b != b'=').map_or(0, |last| last + 1);
    if text.len() - end > 2 || end % 4 == 1 {
        return None;
    }
    let mut bytes = Vec::with_capacity(end / 4 * 3 + 2);
    for group in text[..end].chunks(4) {
        let mut bits = 0u32;
        for &symbol in group {
            let value = match symbol {
                b'A'..=b'Z' => symbol - b'A',
                b'a'..=b'z' => symbol - b'a' + 26,
                b'0'..=b'9' => symbol - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Some(bytes)
}

/// Text with its `%41` decoded; `None` where they are malformed or do not make UTF-8.
fn decode_percent(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        rest = tail;
        if first == b'%' {
            let (&[high, low], after) = tail.split_first_chunk()?;
            let [high, low] = [high, low].map(|digit| char::from(digit).to_digit(16));
            bytes.push((high? * 16 + low?) as u8);
            rest = after;
        } else {
            bytes.push(first);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        for (text, bytes) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob")]
        {
            assert_eq!(decode_base64(text.as_bytes()).unwrap(), bytes.as_bytes());
        }
        for bad in ["Z", "Zm9vY", "Zm 9v", "Zg===", "Z-=="] {
            assert!(decode_base64(bad.as_bytes()).is_none(), "{bad}");
        }
    }

    #[test]
    fn only_files_of_the_folder_are_opened() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("in")).unwrap();
        std::fs::write(folder.path().join("secret"), "no").unwrap();
        std::fs::write(folder.path().join("in/a b.bin"), "yes").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("../secret", folder.path().join("in/link")).unwrap();
        let root = serde_json::from_str(r#"{"asset": {"version": "2.0"}}"#).unwrap();
        let path = folder.path().join("in/x.gltf");
        let buffers = Buffers::new(Input { path: &path, bytes: b"" }, &root, None);
        assert_eq!(&buffers.resolve("buffer 0", "./a%20b.bin").unwrap()[..], b"yes");
        let secret = folder.path().join("secret");
        for bad in [
            "../secret",
            "%2e%2e/secret",
            "link",
            "/etc/passwd",
            "file:///etc/passwd",
            "http://example.com/a",
            secret.to_str().unwrap(),
            "..\\secret",
            "",
            "%ff",
            "%4",
            "in/../../secret",
            ".",
        ] {
            assert!(buffers.resolve("buffer 0", bad).is_err(), "{bad}");
        }
    }
}
