//! Messages as values: what a message must be, and the errors that name the one that is not.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;

use foxglove::Decode;
use semfm_geom::io::FormatError;

use super::reader::Message;
use crate::{Error, Result};

/// The largest number of views that a file of ours may have; guards sums over hostile numbers.
const VIEWS_AT_MOST: usize = 100_000;

/// What something in a file should have been and what it is.
#[derive(Debug)]
pub(super) struct Mismatch {
    pub expected: String,
    pub found: String,
}

impl Mismatch {
    pub fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into() }
    }

    /// As the error of a message.
    pub fn in_message(self, path: &Path, message: &Message<'_>) -> Error {
        message_error(path, message, &self.expected, self.found)
    }

    /// As the error of a topic.
    pub fn on_topic(self, path: &Path, topic: &str) -> Error {
        topic_error(path, topic, &self.expected, self.found)
    }

    /// As the error of an argument.
    pub fn of_argument(self, what: impl Into<String>) -> Error {
        Error::invalid(what, self.expected, self.found)
    }
}

/// Decodes a message whose channel must have the given schema.
///
/// # Errors
/// [`Error::Format`] for a channel of another schema or encoding, and for bytes that are none of it.
pub fn decode<T: Decode>(path: &Path, message: &Message<'_>, schema: &str) -> Result<T> {
    let channel = message.channel;
    let found = channel.schema.as_ref().map_or("none", |schema| schema.name.as_str());
    if found != schema || channel.message_encoding != "protobuf" {
        let found = format!("`{found}` encoded as `{}`", channel.message_encoding);
        let expected = format!("the schema `{schema}` encoded as `protobuf`");
        return Err(message_error(path, message, &expected, found));
    }
    T::decode(message.data)
        .map_err(|error| message_error(path, message, &format!("a `{schema}`"), error.to_string()))
}

/// Keeps a view's item; a second one is refused.
pub(super) fn insert_once<T>(
    items: &mut BTreeMap<usize, T>,
    view: usize,
    item: T,
    path: &Path,
    message: &Message<'_>,
) -> Result<()> {
    match items.entry(view) {
        Entry::Vacant(entry) => {
            entry.insert(item);
            Ok(())
        }
        Entry::Occupied(_) => {
            let expected = format!("one message for view {view:03}");
            Err(message_error(path, message, &expected, "a second one".to_owned()))
        }
    }
}

/// As many items as the metadata record says.
pub(super) fn check_count(path: &Path, topic: &str, expected: usize, found: usize) -> Result<()> {
    if expected == 0 || expected > VIEWS_AT_MOST {
        let allowed = format!("1 to {VIEWS_AT_MOST} views");
        return Err(topic_error(path, "metadata", &allowed, expected.to_string()));
    }
    match expected == found {
        true => Ok(()),
        false => {
            let expected = format!("{expected} views, as the metadata say");
            Err(topic_error(path, topic, &expected, found.to_string()))
        }
    }
}

/// The [`Error::Format`] of a message: it names the file, the topic and which message of it.
pub fn message_error(path: &Path, message: &Message<'_>, expected: &str, found: String) -> Error {
    let place = format!("topic {}, message {}", message.channel.topic, message.index);
    FormatError::new(path, place, expected, found).into()
}

/// An error that names a topic.
pub(super) fn topic_error(
    path: &Path,
    topic: &str,
    expected: &str,
    found: impl Into<String>,
) -> Error {
    FormatError::new(path, format!("topic {topic}"), expected, found).into()
}
