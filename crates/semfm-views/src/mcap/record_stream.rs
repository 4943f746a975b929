//! The records of a file one after the other, without the file in memory: no more than one record is.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use semfm_geom::io::foreign_kind;

use super::record::{HEAD, MAGIC, Place, Record};
use crate::{Fault, Result};

/// What stands at both ends of a file, for messages.
const MAGIC_BYTES: &str = "the magic bytes of MCAP version 0 (89 4d 43 41 50 30 0d 0a)";

/// Bytes that are read at a time where nothing of them is kept.
const BLOCK: usize = 1 << 20;

/// Bytes from which on foreign files are told.
const FIRST: usize = 4096;

/// The records of whatever can be read and sought in.
pub(super) struct RecordStream<'p, R> {
    path: &'p Path,
    source: R,
    /// Byte of the next record.
    pub at: usize,
    /// Byte behind the last record, where the closing magic stands.
    end: usize,
    /// The body of the record that was read last.
    body: Vec<u8>,
}

impl<'p, R: Read + Seek> RecordStream<'p, R> {
    /// `size` bytes, with the magic at both ends.
    pub fn new(path: &'p Path, mut source: R, size: u64) -> Result<Self> {
        let start = Place { path, opcode: None, offset: 0, chunk: None };
        let mut first = Vec::new();
        let read = (&mut source).take(FIRST as u64).read_to_end(&mut first);
        read.map_err(|cause| io_error(path, cause))?;
        if first.is_empty() {
            return Err(start.error(Fault::Truncated, MAGIC_BYTES, "an empty file"));
        }
        if !first.starts_with(MAGIC) {
            return Err(match MAGIC.starts_with(&first) {
                true => start.error(Fault::Truncated, MAGIC_BYTES, "only the first of them"),
                false => {
                    let found = foreign_kind(&first).unwrap_or("other bytes: this is no MCAP file");
                    start.error(Fault::Magic, MAGIC_BYTES, found)
                }
            });
        }
        let size = usize::try_from(size).unwrap_or(usize::MAX);
        let end = size.saturating_sub(MAGIC.len());
        let mut stream = Self { path, source, at: MAGIC.len(), end, body: Vec::new() };
        if end < MAGIC.len() || stream.read_at(end, MAGIC.len())? != MAGIC {
            let found = "other bytes at the end of the file: it was cut or never finished";
            let at = Place { offset: end, ..start };
            return Err(at.error(Fault::Truncated, MAGIC_BYTES, found));
        }
        stream.seek(MAGIC.len())?;
        Ok(stream)
    }

    /// The next record, `None` where the bytes end with the record before. Its body stands until the one after it is asked
    /// for. No length is believed before it is compared with what is left.
    pub fn next(&mut self) -> Result<Option<Record<'_>>> {
        let left = self.end - self.at;
        let mut place = Place { path: self.path, opcode: None, offset: self.at, chunk: None };
        if left == 0 {
            return Ok(None);
        }
        if left < HEAD {
            let found = bytes_in_words(left);
            let expected = "a record's opcode and length (9 bytes)";
            return Err(place.error(Fault::Truncated, expected, found));
        }
        let mut head = [0; HEAD];
        self.fill(&mut head)?;
        let [opcode, length @ ..] = head;
        place.opcode = Some(opcode);
        if opcode == 0 {
            return Err(place.error(Fault::Opcode, "an opcode from 1", 0));
        }
        let (length, left) = (u64::from_le_bytes(length), left - HEAD);
        let Some(length) = usize::try_from(length).ok().filter(|length| *length <= left) else {
            let found = bytes_in_words(left);
            return Err(place.error(Fault::Truncated, format!("a body of {length} bytes"), found));
        };
        let mut body = std::mem::take(&mut self.body);
        body.clear();
        reserve(&mut body, length, place)?;
        body.resize(length, 0);
        self.fill(&mut body)?;
        self.body = body;
        self.at += HEAD + self.body.len();
        Ok(Some(Record { opcode, body: &self.body, place }))
    }

    /// Compares a stored checksum of everything before a place with the true one; zero says that none was stored.
    pub fn check_crc_up_to(&mut self, stored: u32, end: usize, place: Place<'_>) -> Result<()> {
        if stored == 0 {
            return Ok(());
        }
        self.seek(0)?;
        let mut hasher = crc32fast::Hasher::new();
        let mut block = vec![0; BLOCK.min(end)];
        let mut left = end;
        while left > 0 {
            let n = left.min(BLOCK);
            self.fill(&mut block[..n])?;
            hasher.update(&block[..n]);
            left -= n;
        }
        self.seek(self.at)?;
        match hasher.finalize() {
            found if found == stored => Ok(()),
            found => Err(place.error(
                Fault::Crc,
                format!("checksum {stored:#010x} of {end} bytes"),
                format!("{found:#010x}"),
            )),
        }
    }

    /// Everything from the next record on, without the magic at the end.
    pub fn rest(&mut self) -> Result<Vec<u8>> {
        self.read_at(self.at, self.end - self.at)
    }

    /// Where the next record stands, for messages.
    pub fn place(&self) -> Place<'p> {
        Place { path: self.path, opcode: None, offset: self.at, chunk: None }
    }

    fn read_at(&mut self, at: usize, n: usize) -> Result<Vec<u8>> {
        self.seek(at)?;
        let mut bytes = Vec::new();
        reserve(&mut bytes, n, self.place())?;
        bytes.resize(n, 0);
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn seek(&mut self, at: usize) -> Result<()> {
        let sought = self.source.seek(SeekFrom::Start(at as u64));
        sought.map(drop).map_err(|cause| io_error(self.path, cause))
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.source.read_exact(bytes).map_err(|cause| io_error(self.path, cause))
    }
}

/// Room for so many bytes: a file may claim more than there is memory.
fn reserve(bytes: &mut Vec<u8>, n: usize, place: Place<'_>) -> Result<()> {
    bytes.try_reserve_exact(n).map_err(|_| {
        place.error(Fault::OverLimit, "a record that fits into memory", bytes_in_words(n))
    })
}

fn io_error(path: &Path, source: std::io::Error) -> crate::Error {
    semfm_geom::Error::Io { path: path.to_owned(), source }.into()
}

fn bytes_in_words(n: usize) -> String {
    if n == 1 { "1 byte".to_owned() } else { format!("{n} bytes") }
}
