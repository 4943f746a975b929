//! Where the records of a file's data section lie, as its indexes should say.

use std::collections::BTreeMap;

use super::contents::TimeRange;

/// Where the data section's records lie.
#[derive(Default)]
pub(super) struct Layout {
    pub chunks: Vec<StoredChunk>,
    pub attachments: Vec<StoredAttachment>,
    pub metadata: Vec<StoredMetadata>,
}

/// What a Chunk Index record says of a chunk.
#[derive(Debug, PartialEq)]
pub(super) struct StoredChunk {
    pub offset: u64,
    pub length: u64,
    pub times: TimeRange,
    pub compression: String,
    pub compressed_size: u64,
    pub size: u64,
    pub message_indexes: BTreeMap<u16, u64>,
    pub message_index_length: u64,
}

impl StoredChunk {
    /// Lengths and compression, for comparison and for messages.
    pub fn sizes(&self) -> String {
        let Self { length, compression, compressed_size, size, .. } = self;
        format!("{length} bytes, `{compression}`, {compressed_size} for {size} bytes")
    }

    /// Where its message indexes are, for messages.
    pub fn indexes(&self) -> String {
        let places = self.message_indexes.iter();
        let places: Vec<String> =
            places.map(|(channel, at)| format!("channel {channel} at byte {at}")).collect();
        format!("message indexes ({}) in {} bytes", places.join(", "), self.message_index_length)
    }
}

/// What an Attachment Index record says of an attachment.
#[derive(Debug, PartialEq)]
pub(super) struct StoredAttachment {
    pub offset: u64,
    pub length: u64,
    pub log_time: u64,
    pub create_time: u64,
    pub data_size: u64,
    pub name: String,
    pub media_type: String,
}

/// What a Metadata Index record says of a metadata record.
#[derive(Debug, PartialEq)]
pub(super) struct StoredMetadata {
    pub offset: u64,
    pub length: u64,
    pub name: String,
}
