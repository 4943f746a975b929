//! Writing MCAP files whole or not at all.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use foxglove::Encode;
use semfm_geom::io::{replace_atomically, shown_path};

use super::contents::Schema;
use crate::{Error, Result};

/// How the chunks of a file are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ChunkCompression {
    /// As they are: embeddings are noise to a compressor (lz4 saves nothing, zstd 8 %).
    None,
    /// lz4: backgrounds of depth and triangle images shrink to nothing, at 700 MB/s.
    Lz4,
}

/// A chunk is closed once it is larger than this: one view, or some, in each.
const CHUNK_BYTES: u64 = 1 << 20;

/// An MCAP file being written: messages go by topic, and a topic's first message declares it.
pub struct McapWriter<'a> {
    path: &'a Path,
    writer: mcap::Writer<BufWriter<&'a mut File>>,
    /// Channel and number of messages of each topic.
    topics: HashMap<String, (u16, u32)>,
    /// Where messages are encoded.
    buffer: Vec<u8>,
}

/// A topic that was declared with [`McapWriter::declare`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelId(u16);

/// Writes a file of an MCAP profile (`""`: none) through `fill` and puts it in place when it is
/// complete.
///
/// # Errors
/// [`Error::Io`], or what `fill` returns; `path` is then as it was before.
pub fn write_mcap(
    path: &Path,
    profile: &str,
    compression: ChunkCompression,
    fill: impl FnOnce(&mut McapWriter<'_>) -> Result<()>,
) -> Result<()> {
    replace_atomically(path, |file| {
        let compression = match compression {
            ChunkCompression::None => None,
            ChunkCompression::Lz4 => Some(mcap::Compression::Lz4),
        };
        let writer = mcap::WriteOptions::new()
            .profile(profile)
            .compression(compression)
            .chunk_size(Some(CHUNK_BYTES))
            .library(concat!("semfm ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::with_capacity(1 << 20, file))
            .map_err(|error| failure(path, error))?;
        let mut file = McapWriter { path, writer, topics: HashMap::new(), buffer: Vec::new() };
        fill(&mut file)?;
        file.writer.finish().map_err(|error| failure(path, error))?;
        file.writer.into_inner().flush().map_err(|source| io_error(path, source))
    })
}

impl McapWriter<'_> {
    /// Writes one message; `time` in nanoseconds.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn log<T: Encode>(&mut self, topic: &str, time: u64, message: &T) -> Result<()> {
        let (channel_id, sequence) = self.channel::<T>(topic)?;
        self.buffer.clear();
        self.buffer.reserve(message.encoded_len().unwrap_or(0));
        message
            .encode(&mut self.buffer)
            .map_err(|error| io_error(self.path, std::io::Error::other(error.to_string())))?;
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence,
            log_time: time,
            publish_time: time,
        };
        self.writer
            .write_to_known_channel(&header, &self.buffer)
            .map_err(|error| failure(self.path, error))
    }

    /// Writes a message that is encoded already, at time 0, as the only one of its topic.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn log_encoded(
        &mut self,
        topic: &str,
        schema: &Schema,
        message_encoding: &str,
        message: &[u8],
    ) -> Result<()> {
        let channel = self.declare(topic, schema, message_encoding, &BTreeMap::new())?;
        self.log_to(channel, 0, message)
    }

    /// Declares a topic for messages that are encoded already; `metadata` is its channel's.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn declare(
        &mut self,
        topic: &str,
        schema: &Schema,
        message_encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<ChannelId> {
        let Schema { name, encoding, data } = schema;
        let schema_id = self
            .writer
            .add_schema(name, encoding, data)
            .map_err(|error| failure(self.path, error))?;
        self.writer
            .add_channel(schema_id, topic, message_encoding, metadata)
            .map(ChannelId)
            .map_err(|error| failure(self.path, error))
    }

    /// Writes a message that is encoded already on a declared topic; `time` in nanoseconds.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn log_to(&mut self, channel: ChannelId, time: u64, message: &[u8]) -> Result<()> {
        let header = mcap::records::MessageHeader {
            channel_id: channel.0,
            sequence: 0, // as rosbag2 writes it: messages are not numbered
            log_time: time,
            publish_time: time,
        };
        self.writer
            .write_to_known_channel(&header, message)
            .map_err(|error| failure(self.path, error))
    }

    /// Writes a metadata record.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn metadata(&mut self, name: &str, entries: BTreeMap<String, String>) -> Result<()> {
        let record = mcap::records::Metadata { name: name.to_owned(), metadata: entries };
        self.writer.write_metadata(&record).map_err(|error| failure(self.path, error))
    }

    /// The topic's channel, declared on first use, and the number of the message to come.
    fn channel<T: Encode>(&mut self, topic: &str) -> Result<(u16, u32)> {
        if let Some((channel, count)) = self.topics.get_mut(topic) {
            *count += 1;
            return Ok((*channel, *count));
        }
        let schema_id = match T::get_schema() {
            Some(schema) => self
                .writer
                .add_schema(&schema.name, &schema.encoding, &schema.data)
                .map_err(|error| failure(self.path, error))?,
            None => 0,
        };
        let encoding = T::get_message_encoding();
        let channel = self
            .writer
            .add_channel(schema_id, topic, &encoding, &BTreeMap::new())
            .map_err(|error| failure(self.path, error))?;
        self.topics.insert(topic.to_owned(), (channel, 0));
        Ok((channel, 0))
    }
}

fn failure(path: &Path, error: mcap::McapError) -> Error {
    match error {
        mcap::McapError::Io(source) => io_error(path, source),
        other => io_error(path, std::io::Error::other(other)),
    }
}

fn io_error(path: &Path, source: std::io::Error) -> Error {
    Error::Io { path: shown_path(path), source }
}
