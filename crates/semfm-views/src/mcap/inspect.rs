//! What any sound MCAP file holds, for `info`.

use std::collections::BTreeMap;
use std::path::Path;

use super::contents::Contents;
use super::metadata::METADATA_NAME;
use super::reader::read_messages;
use crate::Result;

/// A sound MCAP file at a glance.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct McapReport {
    /// Number of messages.
    pub n_messages: u64,
    /// Number of chunks.
    pub n_chunks: usize,
    /// Channels in the order of their ids.
    pub channels: Vec<ChannelReport>,
    /// Attachments in file order.
    pub attachments: Vec<AttachmentReport>,
    /// Names of the metadata records, in file order.
    pub metadata: Vec<String>,
    /// Our own metadata record, where the file has one.
    pub semfm: Option<BTreeMap<String, String>>,
    /// The profile that the header names.
    pub profile: String,
    /// The program that wrote the file.
    pub library: String,
    /// Earliest and latest time of recording in nanoseconds, `None` without messages.
    pub log_times: Option<(u64, u64)>,
}

/// One channel of a file.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ChannelReport {
    /// Topic, such as `/tf`.
    pub topic: String,
    /// Name of the message type, `None` for a channel without a schema.
    pub schema: Option<String>,
    /// Encoding of the messages.
    pub encoding: String,
    /// Number of messages.
    pub n_messages: u64,
}

/// One attachment of a file.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AttachmentReport {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Bytes of data.
    pub n_bytes: u64,
}

/// Reads a whole MCAP file strictly and says what is in it.
///
/// # Errors
/// As [`read_messages`]: the file's first flaw.
pub fn inspect(path: &Path) -> Result<McapReport> {
    let contents = read_messages(path, |_| Ok(()))?;
    Ok(McapReport::of(contents))
}

impl McapReport {
    fn of(contents: Contents) -> Self {
        let n_messages_of = |id| contents.n_messages_of.get(id).copied().unwrap_or(0);
        Self {
            n_messages: contents.n_messages(),
            n_chunks: contents.n_chunks,
            channels: contents
                .channels
                .iter()
                .map(|(id, channel)| ChannelReport {
                    topic: channel.topic.clone(),
                    schema: channel.schema.as_ref().map(|schema| schema.name.clone()),
                    encoding: channel.message_encoding.clone(),
                    n_messages: n_messages_of(id),
                })
                .collect(),
            attachments: contents
                .attachments
                .iter()
                .map(|(name, media_type, n_bytes)| AttachmentReport {
                    name: name.clone(),
                    media_type: media_type.clone(),
                    n_bytes: *n_bytes,
                })
                .collect(),
            metadata: contents.metadata.iter().map(|(name, _)| name.clone()).collect(),
            semfm: contents
                .metadata
                .iter()
                .find(|(name, _)| name == METADATA_NAME)
                .map(|(_, entries)| entries.clone()),
            profile: contents.profile,
            library: contents.library,
            log_times: contents.log_times,
        }
    }
}
