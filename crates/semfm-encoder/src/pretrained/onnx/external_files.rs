//! The files that an ONNX network keeps its weights in, and whether its tensors are as large as they
//! say.
//!
//! A tensor may lie in another file, which the network names: `TensorProto.external_data` with the key
//! `location` (onnx.proto3 of ONNX 1.14). Only the fields on the way to tensors are read here; all
//! others are passed over by their length. This happens before the runtime sees the file: what it then
//! parses is protobuf of moderate depth whose tensors are no larger than their bytes.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use semfm_geom::io::FormatError;

/// Graphs lie in attributes of nodes of graphs; no real network goes as deep.
const DEEPEST: usize = 32;
/// Values of a tensor in one byte: types of one bit are the smallest.
const PER_BYTE: u64 = 8;

/// A file with weights.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ExternalFile {
    /// As the network names it.
    pub location: String,
    pub path: PathBuf,
}

/// The files with weights of the network in `bytes`, which lies at `network`, in order of their names.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) for what is no ONNX network, for tensors that are larger
/// than their bytes, and for weights outside of the network's folder, links followed.
pub(super) fn external_files(network: &Path, bytes: &[u8]) -> crate::Result<Vec<ExternalFile>> {
    let mut walk = Walk { locations: BTreeSet::new() };
    walk.message(bytes, Message::Model, 0).map_err(|fault| {
        FormatError::new(network, "network", format!("ONNX: {}", fault.expected), fault.found)
    })?;
    let folder = network.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for location in walk.locations {
        let path = folder.join(&location);
        let below =
            Path::new(&location).components().all(|part| matches!(part, Component::Normal(_)));
        let real_folder = network.canonicalize().ok().and_then(|n| n.parent().map(Path::to_owned));
        let leads_away = match (real_folder, path.canonicalize()) {
            (Some(real_folder), Ok(real)) => !real.starts_with(real_folder),
            // Reading the file says why it cannot be followed.
            _ => false,
        };
        if !below || location.is_empty() || location.contains(['\0', '\\']) || leads_away {
            let expected = "weights inside the folder of the network";
            let found = format!("`{location}`");
            return Err(FormatError::new(network, "external data", expected, found).into());
        }
        files.push(ExternalFile { location, path });
    }
    Ok(files)
}

/// What is wrong with a message.
struct Fault {
    expected: String,
    found: String,
}

impl Fault {
    fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into() }
    }
}

/// The messages on the way to a tensor.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Message {
    Model,
    Graph,
    Function,
    Node,
    Attribute,
    SparseTensor,
    Tensor,
}

impl Message {
    /// The message in a field of this one.
    fn field(self, number: u64) -> Option<Self> {
        Some(match (self, number) {
            (Self::Model, 7) => Self::Graph,
            (Self::Model, 25) => Self::Function,
            (Self::Graph, 1) | (Self::Function, 7) => Self::Node,
            (Self::Graph, 5) => Self::Tensor,
            (Self::Graph, 15) => Self::SparseTensor,
            (Self::Function, 11) | (Self::Node, 5) => Self::Attribute,
            (Self::Attribute, 5 | 10) => Self::Tensor,
            (Self::Attribute, 6 | 11) => Self::Graph,
            (Self::Attribute, 22 | 23) => Self::SparseTensor,
            (Self::SparseTensor, 1 | 2) => Self::Tensor,
            _ => return None,
        })
    }
}

/// Goes through a network and gathers what its tensors name.
struct Walk {
    locations: BTreeSet<String>,
}

impl Walk {
    fn message(&mut self, bytes: &[u8], kind: Message, depth: usize) -> Result<(), Fault> {
        if depth > DEEPEST {
            let expected = format!("messages at most {DEEPEST} deep");
            return Err(Fault::new(expected, "deeper ones"));
        }
        if kind == Message::Tensor {
            return self.tensor(bytes);
        }
        for field in Fields(bytes) {
            if let (number, Value::Bytes(inner)) = field?
                && let Some(kind) = kind.field(number)
            {
                self.message(inner, kind, depth + 1)?;
            }
        }
        Ok(())
    }

    /// Holds a tensor's shape against its bytes, and notes where they lie.
    fn tensor(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        let (mut n_values, mut is_external) = (Some(1u64), false);
        let mut times = |dim: u64| n_values = n_values.and_then(|n| n.checked_mul(dim));
        let mut entries = Vec::new();
        for field in Fields(bytes) {
            match field? {
                // dims, one by one or packed
                (1, Value::Number(dim)) => times(dim),
                (1, Value::Bytes(mut packed)) => {
                    while !packed.is_empty() {
                        times(varint(&mut packed)?);
                    }
                }
                (13, Value::Bytes(entry)) => entries.push(entry),
                (14, Value::Number(location)) => is_external = location != 0,
                _ => {}
            }
        }
        let mut n_bytes = bytes.len() as u64;
        for entry in entries {
            let Some((key, value)) = key_and_value(entry)? else { continue };
            match key.as_str() {
                "location" => {
                    self.locations.insert(value);
                }
                // Held against the file's own length by the runtime.
                "length" => n_bytes = n_bytes.max(value.parse().unwrap_or(0)),
                _ => {}
            }
        }
        let most = n_bytes.saturating_mul(PER_BYTE);
        match n_values {
            Some(n) if n <= most || is_external => Ok(()),
            Some(n) => {
                Err(Fault::new(format!("{n} values of a tensor"), format!("{n_bytes} bytes")))
            }
            None => Err(Fault::new("a tensor that can be counted", "more than 2^64 values")),
        }
    }
}

/// Key and value of an entry of text, where it has both.
fn key_and_value(entry: &[u8]) -> Result<Option<(String, String)>, Fault> {
    let (mut key, mut value) = (None, None);
    for field in Fields(entry) {
        match field? {
            (1, Value::Bytes(text)) => key = Some(text_of(text)?),
            (2, Value::Bytes(text)) => value = Some(text_of(text)?),
            _ => {}
        }
    }
    Ok(key.zip(value))
}

fn text_of(bytes: &[u8]) -> Result<String, Fault> {
    let text = std::str::from_utf8(bytes);
    text.map(str::to_owned).map_err(|error| Fault::new("text in UTF-8", error.to_string()))
}

/// The content of a field.
enum Value<'b> {
    Number(u64),
    Bytes(&'b [u8]),
}

/// The fields of a message: number and content. Those of four or eight bytes are numbers, too.
struct Fields<'b>(&'b [u8]);

impl<'b> Iterator for Fields<'b> {
    type Item = Result<(u64, Value<'b>), Fault>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let field = self.read();
        if field.is_err() {
            self.0 = &[];
        }
        Some(field)
    }
}

impl<'b> Fields<'b> {
    fn read(&mut self) -> Result<(u64, Value<'b>), Fault> {
        let tag = varint(&mut self.0)?;
        let value = match tag & 7 {
            0 => Value::Number(varint(&mut self.0)?),
            1 => Value::Number(self.little_endian(8)?),
            5 => Value::Number(self.little_endian(4)?),
            2 => {
                let length = varint(&mut self.0)?;
                Value::Bytes(self.take(length)?)
            }
            wire => return Err(Fault::new("a protobuf field", format!("wire type {wire}"))),
        };
        Ok((tag >> 3, value))
    }

    fn take(&mut self, length: u64) -> Result<&'b [u8], Fault> {
        let split = usize::try_from(length).ok().and_then(|n| self.0.split_at_checked(n));
        let Some((taken, rest)) = split else {
            let expected = format!("a field of {length} bytes");
            return Err(Fault::new(expected, format!("{} bytes left", self.0.len())));
        };
        self.0 = rest;
        Ok(taken)
    }

    fn little_endian(&mut self, length: u64) -> Result<u64, Fault> {
        let bytes = self.take(length)?;
        Ok(bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }
}

/// Takes a number of seven bits a byte, the lowest first.
fn varint(bytes: &mut &[u8]) -> Result<u64, Fault> {
    let mut number = 0u64;
    for shift in (0..64).step_by(7) {
        let Some((&byte, rest)) = bytes.split_first() else {
            return Err(Fault::new("a number", "the end"));
        };
        *bytes = rest;
        number |= u64::from(byte & 127) << shift;
        if byte < 128 {
            return Ok(number);
        }
    }
    Err(Fault::new("a number of 64 bits", "a longer one"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: u8, content: &[u8]) -> Vec<u8> {
        let mut bytes = vec![number << 3 | 2];
        let mut length = content.len();
        while length > 127 {
            bytes.push(length as u8 | 128);
            length >>= 7;
        }
        bytes.push(length as u8);
        bytes.extend(content);
        bytes
    }

    /// A network with one tensor.
    fn network(tensor: &[u8]) -> Vec<u8> {
        field(7, &field(5, tensor))
    }

    fn entry(key: &str, value: &str) -> Vec<u8> {
        field(13, &[field(1, key.as_bytes()), field(2, value.as_bytes())].concat())
    }

    fn files(tensor: &[u8]) -> crate::Result<Vec<ExternalFile>> {
        external_files(Path::new("folder/net.onnx"), &network(tensor))
    }

    #[test]
    fn locations_are_found_in_the_folder() {
        let tensor = [entry("location", "net.data"), entry("offset", "0"), vec![0x70, 1]].concat();
        let found = files(&tensor).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].path, Path::new("folder/net.data"));
        assert!(files(&field(9, &[0; 4])).unwrap().is_empty());
    }

    #[test]
    fn weights_outside_of_the_folder_are_refused() {
        for location in ["../net.data", "/etc/passwd", "a/../../b", "a\\..\\b", "", "./x/.."] {
            let error = files(&entry("location", location)).unwrap_err().to_string();
            assert!(error.contains("inside the folder"), "{error}");
        }
    }

    #[test]
    fn tensors_larger_than_their_bytes_are_refused() {
        let huge = [0x08, 0xff, 0xff, 0xff, 0xff, 0x7f];
        for tensor in [huge.to_vec(), huge.repeat(9), field(1, &huge[1..])] {
            let error = files(&tensor).unwrap_err().to_string();
            assert!(error.contains("tensor"), "{error}");
        }
    }

    #[test]
    fn what_is_no_message_is_refused() {
        for bytes in [&b"\xff"[..], b"\x3a\x7f", b"\x3b", b"\x08", &[0xff; 30]] {
            assert!(external_files(Path::new("net.onnx"), bytes).is_err(), "{bytes:?}");
        }
        // Graphs in attributes of nodes of graphs.
        for (levels, is_read) in [(3, true), (60, false), (3000, false)] {
            let nested =
                (0..levels).fold(Vec::new(), |graph, _| field(1, &field(5, &field(6, &graph))));
            let read = external_files(Path::new("net.onnx"), &field(7, &nested));
            assert_eq!(read.is_ok(), is_read, "{levels} levels");
        }
    }
}
