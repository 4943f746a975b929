//! The strict reader: every record of a file once, from the first to the last.
//!
//! The format's own index would be quicker for a single message, but an index can be wrong: a linear
//! pass sees what is there, and afterwards the summary is compared with it ([`super::summary`]).
//! Checksums of a chunk are compared before its first message is handed out. Specification: "MCAP
//! File Format Specification", Foxglove (2022), <https://mcap.dev/spec>.
//!
//! Why not the `LinearReader` of the crate `mcap` (0.26, measured with every checksum option on, a
//! record limit as ours, and each record parsed)? It is sound and lean: of the 471 files of our corpus
//! it judges 462 as their manifest does, never with more than 5 MB, and it refuses every flipped bit
//! of a file with checksums. The nine that it takes are those whose records contradict each other: a
//! schema with the id 0, a channel declared twice in different ways, a Header inside a chunk, a
//! Message Index and four indexes or offsets of the summary that point elsewhere, a chunk index with
//! another size; and it takes all 31 false numbers of `tests/mcap_lies.rs`. We need those checks, and
//! they need to know of each record where it stands and in which chunk. `LinearReader` gives opcode
//! and bytes alone; with `emit_chunks` places can be counted, but then it neither decompresses nor
//! checks a chunk, so that only the loop over the file's own records (some forty lines) would be its
//! work, at the price of errors without a byte offset.

use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use semfm_geom::io::open_file;

use super::contents::{Attachment, Channel, Contents, MetadataRecord, TimeRange};
use super::decompress::decompress;
use super::layout::{Layout, StoredAttachment, StoredChunk, StoredMetadata};
use super::message_index::ChunkMessages;
use super::record::{MAGIC, Place, Record, Records, check_crc, opcode};
use super::record_stream::RecordStream;
use super::summary;
use crate::{Fault, Result};

/// A message as it is handed to the visitor of [`read_messages`].
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// The stream that it belongs to.
    pub channel: &'a Channel,
    /// Which message of its channel it is, from 0 in file order.
    pub index: u64,
    /// The publisher's count.
    pub sequence: u32,
    /// When it was recorded, in nanoseconds of the writer's clock.
    pub log_time: u64,
    /// When it was published.
    pub publish_time: u64,
    /// The encoded message.
    pub data: &'a [u8],
}

/// Reads a file from its first record to its last and hands every message to `visit`, in file order.
///
/// Lengths, checksums, ids, the messages' index and the summary are all checked. One record is in memory at a time, and
/// a chunk as it is decompressed: 256 MB at most, however large the file. The summary stands at the end: what `visit`
/// collected is sound only when this returns `Ok`. A file that was cut is refused before its first message.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is no regular file, [`Error::Container`](crate::Error::Container) with the
/// record at fault, or whatever `visit` returns.
pub fn read_messages(
    path: &Path,
    visit: impl FnMut(Message<'_>) -> Result<()>,
) -> Result<Contents> {
    let (file, size) = open_file(path)?;
    read_source(path, BufReader::with_capacity(1 << 16, file), size, visit)
}

/// As [`read_messages`], for the bytes of a file that are in memory already; `path` is for messages.
///
/// # Errors
/// As [`read_messages`].
pub fn read_bytes(
    path: &Path,
    bytes: &[u8],
    visit: impl FnMut(Message<'_>) -> Result<()>,
) -> Result<Contents> {
    read_source(path, Cursor::new(bytes), bytes.len() as u64, visit)
}

fn read_source(
    path: &Path,
    source: impl Read + Seek,
    size: u64,
    mut visit: impl FnMut(Message<'_>) -> Result<()>,
) -> Result<Contents> {
    let mut records = RecordStream::new(path, source, size)?;
    let mut pass = Pass {
        path,
        file_bytes: usize::try_from(size).unwrap_or(usize::MAX),
        contents: Contents::default(),
        layout: Layout::default(),
        kept: 0,
        chunk_messages: None,
        buffer: Vec::new(),
        visit: &mut visit,
    };
    pass.header(&mut records)?;
    let data_end = pass.data_section(&mut records)?;
    let bytes = records.rest()?;
    let mut summary = Records { path, bytes: &bytes, base: data_end, at: data_end, chunk: None };
    summary::check(&mut pass.contents, &pass.layout, &mut summary, data_end)?;
    Ok(pass.contents)
}

/// Schemas and channels out of chunks may take this much memory whatever the size of the file,
const KEPT_BYTES: usize = 16 << 20;
/// or this many times the size of the file.
const KEPT_PER_FILE_BYTE: usize = 4;

/// The state of one pass over the data section.
struct Pass<'a, 'v> {
    path: &'a Path,
    file_bytes: usize,
    contents: Contents,
    layout: Layout,
    /// Memory of all different schemas and channels out of chunks so far.
    kept: usize,
    /// Messages of the chunk just read, until a record other than a Message Index follows.
    chunk_messages: Option<ChunkMessages>,
    /// Where chunks are decompressed.
    buffer: Vec<u8>,
    visit: &'v mut dyn FnMut(Message<'_>) -> Result<()>,
}

impl Pass<'_, '_> {
    fn header<R: Read + Seek>(&mut self, records: &mut RecordStream<'_, R>) -> Result<()> {
        let start = Place { path: self.path, opcode: None, offset: MAGIC.len(), chunk: None };
        let record = records
            .next()?
            .ok_or_else(|| start.error(Fault::Truncated, "a Header record", "the end"))?;
        if record.opcode != opcode::HEADER {
            return Err(record.misplaced("the Header record"));
        }
        let mut fields = record.fields();
        self.contents.profile = fields.text()?.to_owned();
        self.contents.library = fields.text()?.to_owned();
        Ok(())
    }

    /// Reads up to the Data End record and returns the byte behind it.
    fn data_section<R: Read + Seek>(&mut self, records: &mut RecordStream<'_, R>) -> Result<usize> {
        while let Some(record) = records.next()? {
            match record.opcode {
                opcode::MESSAGE_INDEX => {
                    self.message_index(&record)?;
                    continue;
                }
                opcode::DATA_END => {
                    self.finish_chunk()?;
                    let (crc, offset, end) =
                        (record.fields().u32()?, record.place.offset, record.end());
                    let opcode = Some(opcode::DATA_END);
                    let place = Place { path: self.path, opcode, offset, chunk: None };
                    records.check_crc_up_to(crc, offset, place)?;
                    return Ok(end);
                }
                _ => self.finish_chunk()?,
            }
            match record.opcode {
                opcode::CHUNK => self.chunk(&record)?,
                opcode::ATTACHMENT => self.attachment(&record)?,
                opcode::METADATA => self.metadata(&record)?,
                _ if self.declaration(&record)? => {}
                opcode::MESSAGE => self.message(&record)?,
                other if opcode::is_foreign(other) => {}
                _ => return Err(record.misplaced("a record of the data section, or Data End")),
            }
        }
        let expected = "a Data End record";
        Err(records.place().error(Fault::Truncated, expected, "the end of the file"))
    }

    /// Takes a Schema or Channel record; false for every other one.
    fn declaration(&mut self, record: &Record<'_>) -> Result<bool> {
        let Some(memory) = self.contents.declare(record)? else { return Ok(false) };
        if record.place.chunk.is_some() {
            self.kept = self.kept.saturating_add(memory);
            let limit = KEPT_BYTES.max(self.file_bytes.saturating_mul(KEPT_PER_FILE_BYTE));
            if self.kept > limit {
                let expected = format!("at most {limit} bytes of schemas and channels");
                return Err(record.place.error(Fault::OverLimit, expected, self.kept));
            }
        }
        Ok(true)
    }

    fn message(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let id = fields.u16()?;
        let Some(channel) = self.contents.channels.get(&id) else {
            let found = format!("channel {id}, which was not declared");
            return Err(record.place.error(Fault::Id, "a channel declared before", found));
        };
        let (sequence, log_time, publish_time) = (fields.u32()?, fields.u64()?, fields.u64()?);
        let count = self.contents.n_messages_of.entry(id).or_default();
        let index = *count;
        *count += 1;
        self.contents.log_times = Some(TimeRange::with(self.contents.log_times, log_time));
        if let Some(messages) = &mut self.chunk_messages {
            messages.push(id, record.place.offset, log_time);
        }
        let data = fields.bytes;
        (self.visit)(Message { channel, index, sequence, log_time, publish_time, data })
    }

    fn chunk(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let times = TimeRange { first: fields.u64()?, last: fields.u64()? };
        let (size, crc) = (fields.u64()?, fields.u32()?);
        let compression = fields.text()?;
        let stored = fields.long_bytes()?;
        let mut buffer = std::mem::take(&mut self.buffer);
        let place = record.place;
        let bytes = decompress(compression, stored, size, self.file_bytes, &mut buffer, place)?;
        check_crc(crc, bytes, place)?;
        self.chunk_messages = Some(ChunkMessages::default());
        let chunk = Some(place.offset);
        let mut records = Records { path: self.path, bytes, base: 0, at: 0, chunk };
        while let Some(record) = records.next()? {
            match record.opcode {
                _ if self.declaration(&record)? => {}
                opcode::MESSAGE => self.message(&record)?,
                other if opcode::is_foreign(other) => {}
                _ => return Err(record.misplaced("a Schema, Channel or Message")),
            }
        }
        self.buffer = buffer;
        if let Some(messages) = &self.chunk_messages {
            messages.check_times(times, place)?;
        }
        self.layout.chunks.push(StoredChunk {
            offset: place.offset as u64,
            length: record.length() as u64,
            times,
            compression: compression.to_owned(),
            compressed_size: stored.len() as u64,
            size,
            message_indexes: BTreeMap::new(),
            message_index_length: 0,
        });
        self.contents.n_chunks += 1;
        Ok(())
    }

    fn message_index(&mut self, record: &Record<'_>) -> Result<()> {
        let (Some(messages), Some(chunk)) =
            (&mut self.chunk_messages, self.layout.chunks.last_mut())
        else {
            return Err(record.misplaced("no Message Index but behind a chunk"));
        };
        let channel = messages.check_index(record.fields())?;
        chunk.message_indexes.insert(channel, record.place.offset as u64);
        chunk.message_index_length += record.length() as u64;
        Ok(())
    }

    /// The chunk's Message Index records are complete, or there are none at all.
    fn finish_chunk(&mut self) -> Result<()> {
        match (self.chunk_messages.take(), self.layout.chunks.last()) {
            (Some(messages), Some(chunk)) if !chunk.message_indexes.is_empty() => {
                let place = Place {
                    path: self.path,
                    opcode: Some(opcode::CHUNK),
                    offset: chunk.offset as usize,
                    chunk: None,
                };
                messages.check_complete(place)
            }
            _ => Ok(()),
        }
    }

    fn attachment(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let (log_time, create_time) = (fields.u64()?, fields.u64()?);
        let (name, media_type) = (fields.text()?, fields.text()?);
        let data_size = fields.long_bytes()?.len() as u64;
        let covered = &record.body[..record.body.len() - fields.bytes.len()];
        check_crc(fields.u32()?, covered, record.place)?;
        self.layout.attachments.push(StoredAttachment {
            offset: record.place.offset as u64,
            length: record.length() as u64,
            log_time,
            create_time,
            data_size,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
        });
        self.contents.attachments.push(Attachment {
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            n_bytes: data_size,
        });
        Ok(())
    }

    fn metadata(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let name = fields.text()?.to_owned();
        self.layout.metadata.push(StoredMetadata {
            offset: record.place.offset as u64,
            length: record.length() as u64,
            name: name.clone(),
        });
        self.contents.metadata.push(MetadataRecord { name, entries: fields.text_map()? });
        Ok(())
    }
}
