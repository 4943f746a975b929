//! What an MCAP file declares and holds beside its messages.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::record::{Fields, Record, opcode};
use crate::{Fault, Result};

/// How the messages of some channels are laid out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Name of the message type, such as `foxglove.RawImage`.
    pub name: String,
    /// Language of the schema, such as `protobuf`.
    pub encoding: String,
    /// The schema itself.
    pub data: Vec<u8>,
}

/// A stream of messages of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The id in this file.
    pub id: u16,
    /// Topic, such as `/views/000/image`.
    pub topic: String,
    /// How a message's bytes are encoded, such as `protobuf`.
    pub message_encoding: String,
    /// The schema, where the channel has one.
    pub schema: Option<Arc<Schema>>,
    /// What else the writer said of the channel.
    pub metadata: BTreeMap<String, String>,
}

/// Earliest and latest of some times, in nanoseconds of the writer's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeRange {
    /// The earliest.
    pub first: u64,
    /// The latest.
    pub last: u64,
}

impl TimeRange {
    /// The range that holds another time, too.
    pub(super) fn with(range: Option<Self>, time: u64) -> Self {
        let Self { first, last } = range.unwrap_or(Self { first: time, last: time });
        Self { first: first.min(time), last: last.max(time) }
    }
}

impl fmt::Display for TimeRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "times {} to {}", self.first, self.last)
    }
}

/// A metadata record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetadataRecord {
    /// Its name.
    pub name: String,
    /// Its entries.
    pub entries: BTreeMap<String, String>,
}

/// An attachment, without its data.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Attachment {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Bytes of data.
    pub n_bytes: u64,
}

/// About what a map entry costs beside its text.
const ENTRY_BYTES: usize = 128;

/// What a file holds beside its messages.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// The profile that the header names.
    pub profile: String,
    /// The program that wrote the file.
    pub library: String,
    /// Schemas by id.
    pub schemas: BTreeMap<u16, Arc<Schema>>,
    /// Channels by id, those without messages too.
    pub channels: BTreeMap<u16, Arc<Channel>>,
    /// Messages of each channel.
    pub n_messages_of: BTreeMap<u16, u64>,
    /// When the messages were recorded, `None` without messages.
    pub log_times: Option<TimeRange>,
    /// Number of chunks.
    pub n_chunks: usize,
    /// Metadata records in file order.
    pub metadata: Vec<MetadataRecord>,
    /// Attachments in file order.
    pub attachments: Vec<Attachment>,
}

impl Contents {
    /// Number of messages in the file.
    pub fn n_messages(&self) -> u64 {
        self.n_messages_of.values().sum()
    }

    /// Takes a Schema or Channel record and returns about how much memory it was given (none where it
    /// was known), or `None` for every other record. The same id may be declared many times, but only
    /// with the same content.
    pub(super) fn declare(&mut self, record: &Record<'_>) -> Result<Option<usize>> {
        match record.opcode {
            opcode::SCHEMA => self.declare_schema(record.fields()).map(Some),
            opcode::CHANNEL => self.declare_channel(record.fields()).map(Some),
            _ => Ok(None),
        }
    }

    fn declare_schema(&mut self, mut fields: Fields<'_>) -> Result<usize> {
        let id = fields.u16()?;
        if id == 0 {
            return Err(fields.place.error(Fault::Id, "a schema id from 1", 0));
        }
        let (name, encoding, data) = (fields.text()?, fields.text()?, fields.short_bytes()?);
        if let Some(known) = self.schemas.get(&id) {
            if known.name != name || known.encoding != encoding || known.data != data {
                let expected = format!("schema {id} as declared before (`{}`)", known.name);
                let found = format!("another one (`{name}`)");
                return Err(fields.place.error(Fault::Conflict, expected, found));
            }
            return Ok(0);
        }
        let memory = ENTRY_BYTES + name.len() + encoding.len() + data.len();
        let schema =
            Schema { name: name.to_owned(), encoding: encoding.to_owned(), data: data.to_vec() };
        self.schemas.insert(id, Arc::new(schema));
        Ok(memory)
    }

    fn declare_channel(&mut self, mut fields: Fields<'_>) -> Result<usize> {
        let (id, schema_id) = (fields.u16()?, fields.u16()?);
        let schema = match schema_id {
            0 => None,
            _ => Some(self.schemas.get(&schema_id).cloned().ok_or_else(|| {
                let found = format!("schema {schema_id}, which was not declared");
                fields.place.error(Fault::Id, "a schema declared before", found)
            })?),
        };
        let body_bytes = fields.bytes.len();
        let channel = Channel {
            id,
            topic: fields.text()?.to_owned(),
            message_encoding: fields.text()?.to_owned(),
            schema,
            metadata: fields.text_map()?,
        };
        if let Some(known) = self.channels.get(&id) {
            if **known != channel {
                let expected = format!("channel {id} as declared before (`{}`)", known.topic);
                let found = format!("another one (`{}`)", channel.topic);
                return Err(fields.place.error(Fault::Conflict, expected, found));
            }
            return Ok(0);
        }
        let memory = ENTRY_BYTES * (1 + channel.metadata.len()) + body_bytes;
        self.channels.insert(id, Arc::new(channel));
        Ok(memory)
    }
}
