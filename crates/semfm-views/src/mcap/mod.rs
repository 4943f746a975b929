//! MCAP files: views, embeddings and scenes, and the strict reader below them.

mod decompress;
mod inspect;
mod message_index;
mod reader;
mod record;
mod summary;

pub use inspect::{AttachmentReport, ChannelReport, METADATA_NAME, McapReport, inspect};
pub use reader::{Channel, Contents, Message, Schema, read_bytes, read_messages};
