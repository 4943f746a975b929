//! Records as bytes: the stream of opcode, length and body, and the fields of a body.
//!
//! Nothing here believes a length before comparing it with the bytes that are there.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use crate::{Error, Fault, Result};

/// First and last eight bytes of every MCAP file of version 0.
pub(super) const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// Bytes in front of a record's body: its opcode and its length.
pub(super) const HEAD: usize = 9;

/// What a record is; the numbers are those of the MCAP specification.
pub(super) mod opcode {
    pub const HEADER: u8 = 0x01;
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const CHUNK_INDEX: u8 = 0x08;
    pub const ATTACHMENT: u8 = 0x09;
    pub const ATTACHMENT_INDEX: u8 = 0x0A;
    pub const STATISTICS: u8 = 0x0B;
    pub const METADATA: u8 = 0x0C;
    pub const METADATA_INDEX: u8 = 0x0D;
    pub const SUMMARY_OFFSET: u8 = 0x0E;
    pub const DATA_END: u8 = 0x0F;

    /// The specification's name of an opcode.
    pub fn name(opcode: u8) -> String {
        let name = match opcode {
            HEADER => "Header",
            FOOTER => "Footer",
            SCHEMA => "Schema",
            CHANNEL => "Channel",
            MESSAGE => "Message",
            CHUNK => "Chunk",
            MESSAGE_INDEX => "Message Index",
            CHUNK_INDEX => "Chunk Index",
            ATTACHMENT => "Attachment",
            ATTACHMENT_INDEX => "Attachment Index",
            STATISTICS => "Statistics",
            METADATA => "Metadata",
            METADATA_INDEX => "Metadata Index",
            SUMMARY_OFFSET => "Summary Offset",
            DATA_END => "Data End",
            other => return format!("record of opcode {other:#04x}"),
        };
        name.to_owned()
    }

    /// Opcodes from 0x10 are reserved or private: a reader passes over them, wherever they stand.
    pub fn is_foreign(opcode: u8) -> bool {
        opcode > DATA_END
    }
}

/// Where a record stands, for messages.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub path: &'a Path,
    /// The record's opcode, `None` before it is known.
    pub opcode: Option<u8>,
    /// Byte of its opcode, in the file or in the decompressed chunk.
    pub offset: usize,
    /// Byte of the chunk that it lies in.
    pub chunk: Option<usize>,
}

impl Place<'_> {
    pub fn error(
        &self,
        fault: Fault,
        expected: impl fmt::Display,
        found: impl fmt::Display,
    ) -> Error {
        Error::Container {
            path: self.path.to_path_buf(),
            place: self.to_string(),
            fault,
            expected: expected.to_string(),
            found: found.to_string(),
        }
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(opcode) = self.opcode {
            write!(f, "{} at ", opcode::name(opcode))?;
        }
        write!(f, "byte {}", self.offset)?;
        match self.chunk {
            Some(chunk) => write!(f, " of the chunk at byte {chunk}"),
            None => Ok(()),
        }
    }
}

/// One record: opcode, body, and where it stands.
#[derive(Clone, Copy)]
pub(super) struct Record<'a> {
    pub opcode: u8,
    pub body: &'a [u8],
    pub place: Place<'a>,
}

impl<'a> Record<'a> {
    /// Length in the file, head included.
    pub fn length(&self) -> usize {
        HEAD + self.body.len()
    }

    /// Byte behind the record.
    pub fn end(&self) -> usize {
        self.place.offset + self.length()
    }

    /// The body's fields, to be read in order. What follows the last known field is ignored, as
    /// the specification demands: records may grow at their end.
    pub fn fields(&self) -> Fields<'a> {
        Fields { bytes: self.body, place: self.place }
    }

    /// The error of a record in a place where its kind may not stand.
    pub fn misplaced(&self, expected: impl fmt::Display) -> Error {
        self.place.error(Fault::Opcode, expected, opcode::name(self.opcode))
    }
}

/// Iterates over the records in a stretch of bytes.
pub(super) struct Records<'a> {
    pub path: &'a Path,
    pub bytes: &'a [u8],
    /// Place of the first of `bytes` in the file, or in the chunk.
    pub base: usize,
    /// Byte of the next record, counted as `base` is.
    pub at: usize,
    /// Byte of the chunk that the bytes were taken from.
    pub chunk: Option<usize>,
}

impl<'a> Records<'a> {
    /// Byte behind the last record.
    pub fn end(&self) -> usize {
        self.base + self.bytes.len()
    }

    /// The bytes from a place on.
    pub fn from(&self, at: usize) -> &'a [u8] {
        &self.bytes[at - self.base..]
    }

    /// The next record, `None` where the bytes end with the record before.
    pub fn next(&mut self) -> Result<Option<Record<'a>>> {
        let rest = self.from(self.at);
        let mut place = Place { path: self.path, opcode: None, offset: self.at, chunk: self.chunk };
        // Within a chunk the lengths must fit; in the file, missing bytes mean that it was cut.
        let fault = if self.chunk.is_some() { Fault::Length } else { Fault::Truncated };
        let Some((head, rest)) = rest.split_first_chunk::<HEAD>() else {
            return match rest.len() {
                0 => Ok(None),
                n => Err(place.error(fault, "a record's opcode and length (9 bytes)", Bytes(n))),
            };
        };
        let [opcode, length @ ..] = *head;
        place.opcode = Some(opcode);
        if opcode == 0 {
            return Err(place.error(Fault::Opcode, "an opcode from 1", 0));
        }
        let length = u64::from_le_bytes(length);
        let body = usize::try_from(length).ok().and_then(|length| rest.get(..length)).ok_or_else(
            || place.error(fault, format!("a body of {length} bytes"), Bytes(rest.len())),
        )?;
        self.at += HEAD + body.len();
        Ok(Some(Record { opcode, body, place }))
    }
}

/// "3 bytes": a count of bytes that were found.
struct Bytes(usize);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            1 => f.write_str("1 byte"),
            n => write!(f, "{n} bytes"),
        }
    }
}

/// Fields of a record, read one after the other.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a> {
    /// What is not read yet.
    pub bytes: &'a [u8],
    pub place: Place<'a>,
}

impl<'a> Fields<'a> {
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let (head, rest) = self.bytes.split_first_chunk::<N>().ok_or_else(|| {
            self.place.error(
                Fault::Length,
                format!("a field of {N} bytes"),
                Bytes(self.bytes.len()),
            )
        })?;
        self.bytes = rest;
        Ok(*head)
    }

    pub fn u8(&mut self) -> Result<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub fn u16(&mut self) -> Result<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Result<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// A stretch of the given length.
    fn take(&mut self, length: u64) -> Result<&'a [u8]> {
        let split = usize::try_from(length).ok().and_then(|n| self.bytes.split_at_checked(n));
        let (head, rest) = split.ok_or_else(|| {
            let expected = format!("{length} bytes in the record, as its field says");
            self.place.error(Fault::Length, expected, Bytes(self.bytes.len()))
        })?;
        self.bytes = rest;
        Ok(head)
    }

    /// Bytes behind a u32 length.
    pub fn short_bytes(&mut self) -> Result<&'a [u8]> {
        let length = self.u32()?;
        self.take(length.into())
    }

    /// Bytes behind a u64 length.
    pub fn long_bytes(&mut self) -> Result<&'a [u8]> {
        let length = self.u64()?;
        self.take(length)
    }

    pub fn text(&mut self) -> Result<&'a str> {
        std::str::from_utf8(self.short_bytes()?)
            .map_err(|error| self.place.error(Fault::Text, "UTF-8 text", error))
    }

    /// The entries of an array or map, behind their length in bytes.
    pub fn entries(&mut self) -> Result<Fields<'a>> {
        Ok(Fields { bytes: self.short_bytes()?, place: self.place })
    }

    /// A map from text to text.
    pub fn text_map(&mut self) -> Result<BTreeMap<String, String>> {
        let mut entries = self.entries()?;
        let mut map = BTreeMap::new();
        while !entries.is_empty() {
            let (key, value) = (entries.text()?, entries.text()?);
            if map.insert(key.to_owned(), value.to_owned()).is_some() {
                return Err(self.place.error(
                    Fault::Conflict,
                    "unique keys",
                    format!("`{key}` twice"),
                ));
            }
        }
        Ok(map)
    }

    /// A map from channel id to a number (an offset or a count).
    pub fn channel_map(&mut self) -> Result<BTreeMap<u16, u64>> {
        let mut entries = self.entries()?;
        let mut map = BTreeMap::new();
        while !entries.is_empty() {
            let (channel, number) = (entries.u16()?, entries.u64()?);
            if map.insert(channel, number).is_some() {
                let found = format!("channel {channel} twice");
                return Err(self.place.error(Fault::Conflict, "unique channels", found));
            }
        }
        Ok(map)
    }
}

/// Compares a stored checksum with the true one; zero says that none was stored.
pub(super) fn check_crc(stored: u32, bytes: &[u8], place: Place<'_>) -> Result<()> {
    if stored == 0 {
        return Ok(());
    }
    match crc32fast::hash(bytes) {
        found if found == stored => Ok(()),
        found => Err(place.error(
            Fault::Crc,
            format!("checksum {stored:#010x} of {} bytes", bytes.len()),
            format!("{found:#010x}"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records(bytes: &[u8]) -> Records<'_> {
        Records { path: Path::new("a.mcap"), bytes, base: 0, at: 0, chunk: None }
    }

    #[test]
    fn a_length_is_compared_with_what_is_there_before_it_is_used() {
        let mut bytes = vec![opcode::SCHEMA];
        bytes.extend(u64::MAX.to_le_bytes());
        bytes.extend([0; 5]);
        let Err(error) = records(&bytes).next() else { panic!("a record of 2^64 bytes was read") };
        assert_eq!(error.code(), "truncated");
        let expected = "a.mcap: Schema at byte 0: expected a body of 18446744073709551615 bytes, \
                        found 5 bytes";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn a_map_refuses_the_same_key_twice() {
        let entry = [1, 0, 0, 0, b'k', 1, 0, 0, 0, b'v'];
        let mut body = 20u32.to_le_bytes().to_vec();
        body.extend(entry.iter().chain(&entry));
        let mut bytes = vec![0x0C];
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(&body);
        let record = records(&bytes).next().unwrap().unwrap();
        assert_eq!(record.fields().text_map().unwrap_err().code(), "conflict");
    }
}
