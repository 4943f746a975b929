//! The messages of one chunk, and the Message Index records that must agree with them.

use std::collections::{BTreeMap, BTreeSet};

use super::contents::TimeRange;
use super::record::{Fields, Place};
use crate::{Fault, Result};

/// Where the messages of a chunk lie and when they were recorded.
#[derive(Default)]
pub(super) struct ChunkMessages {
    /// In file order, hence ascending by offset.
    messages: Vec<ChunkMessage>,
    /// How many of them each channel has.
    counts: BTreeMap<u16, usize>,
    /// Channels whose index was read.
    indexed: BTreeSet<u16>,
}

struct ChunkMessage {
    log_time: u64,
    /// Byte in the decompressed chunk.
    offset: u64,
    channel: u16,
}

impl ChunkMessages {
    pub fn push(&mut self, channel: u16, offset: usize, log_time: u64) {
        self.messages.push(ChunkMessage { log_time, offset: offset as u64, channel });
        *self.counts.entry(channel).or_default() += 1;
    }

    /// The chunk's own times are those of its earliest and latest message.
    pub fn check_times(&self, stated: TimeRange, place: Place<'_>) -> Result<()> {
        let times = self.messages.iter().map(|message| message.log_time);
        match times.fold(None, |range, time| Some(TimeRange::with(range, time))) {
            Some(found) if found != stated => {
                Err(place.error(Fault::Count, format!("messages of {stated}"), found))
            }
            _ => Ok(()),
        }
    }

    /// Checks one Message Index record: every message of its channel once, at its offset and time.
    /// Returns the channel.
    pub fn check_index(&mut self, mut fields: Fields<'_>) -> Result<u16> {
        let place = fields.place;
        let channel = fields.u16()?;
        if !self.indexed.insert(channel) {
            let expected = format!("one index of channel {channel} for this chunk");
            return Err(place.error(Fault::Conflict, expected, "a second one"));
        }
        let mut entries = fields.entries()?;
        let mut offsets = Vec::with_capacity(entries.bytes.len() / 16);
        while !entries.is_empty() {
            let (log_time, offset) = (entries.u64()?, entries.u64()?);
            let found = self.messages.binary_search_by_key(&offset, |message| message.offset);
            let message = found.ok().map(|at| &self.messages[at]);
            if !message.is_some_and(|m| m.channel == channel && m.log_time == log_time) {
                return Err(place.error(
                    Fault::Offset,
                    format!("offsets of messages of channel {channel} with their times"),
                    format!("offset {offset} with time {log_time}"),
                ));
            }
            offsets.push(offset);
        }
        offsets.sort_unstable();
        offsets.dedup();
        let expected = self.counts.get(&channel).copied().unwrap_or(0);
        if offsets.len() != expected {
            let expected = format!("all {expected} messages of channel {channel}");
            return Err(place.error(Fault::Count, expected, offsets.len()));
        }
        Ok(channel)
    }

    /// Every channel with a message in the chunk has its index.
    pub fn check_complete(&self, place: Place<'_>) -> Result<()> {
        match self.counts.keys().find(|&channel| !self.indexed.contains(channel)) {
            None => Ok(()),
            Some(channel) => Err(place.error(
                Fault::Count,
                format!("a Message Index of channel {channel} behind it"),
                "none, though other channels have theirs",
            )),
        }
    }
}
