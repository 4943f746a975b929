//! What any sound MCAP file holds, for `info`.

use std::collections::BTreeMap;
use std::path::Path;

use super::contents::{Attachment, Contents};
use super::metadata::METADATA_NAME;
use super::reader::read_messages;
use crate::Result;

/// What a sound MCAP file holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct McapReport {
    /// Number of messages.
    pub n_messages: u64,
    /// Number of chunks.
    pub n_chunks: usize,
    /// Channels in the order of their ids.
    pub channels: Vec<ChannelReport>,
    /// Attachments in file order.
    pub attachments: Vec<Attachment>,
    /// Names of the metadata records, in file order.
    pub metadata: Vec<String>,
    /// Our own metadata record, where the file has one.
    pub semfm: Option<BTreeMap<String, String>>,
    /// The profile that the header names.
    pub profile: String,
    /// The program that wrote the file.
    pub library: String,
    /// Earliest and latest time of recording in nanoseconds, `None` without messages.
    pub log_times: Option<[u64; 2]>,
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
                    n_messages: contents.n_messages_of.get(id).copied().unwrap_or(0),
                })
                .collect(),
            metadata: contents.metadata.iter().map(|record| record.name.clone()).collect(),
            semfm: contents
                .metadata
                .iter()
                .find(|record| record.name == METADATA_NAME)
                .map(|record| record.entries.clone()),
            attachments: contents.attachments,
            profile: contents.profile,
            library: contents.library,
            log_times: contents.log_times.map(|times| [times.first, times.last]),
        }
    }
}
