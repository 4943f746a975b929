//! MCAP files: views and embeddings, and the strict reader below them.
//!
//! A views file ([`write_views`], [`ViewsFile`]) holds Foxglove's well-known messages and opens in
//! any viewer that knows those; an embeddings file ([`EmbeddingsFile`]) holds
//! `semfm.PatchEmbeddings` with the cameras. Everything is read by [`read_messages`], which
//! uses no length, offset, count or checksum that it has not compared with the bytes.

mod cameras;
mod cdr;
mod cdr_reader;
mod contents;
mod decode;
mod decompress;
mod embeddings_file;
mod embeddings_message;
mod entries;
mod inspect;
mod layout;
mod message_index;
pub mod messages;
mod metadata;
mod pose_array;
mod reader;
mod record;
mod record_stream;
mod ros2_messages;
mod summary;
mod topics;
mod views_file;
mod writer;

pub use cdr::Cdr;
pub use cdr_reader::CdrReader;
pub use contents::{Attachment, Channel, Contents, MetadataRecord, Schema, TimeRange};
pub use decode::{decode, message_error};
pub use embeddings_file::{Dtype, EmbeddingsFile};
pub use embeddings_message::PATCH_EMBEDDINGS;
pub use inspect::{ChannelReport, McapReport, inspect};
pub use messages::{Colors, find_mesh, read_mesh};
pub use metadata::{EmbeddingsMetadata, METADATA_NAME, ViewsMetadata};
pub use pose_array::{POSES_TOPIC, PoseNumbers, write_pose_array};
pub use reader::{Message, read_bytes, read_messages};
pub use ros2_messages::Ros2Message;
pub use topics::TF;
pub use views_file::{SingleView, ViewsFile, read_view, write_views};
pub use writer::{ChannelId, ChunkCompression, McapWriter, write_mcap};
