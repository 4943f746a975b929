//! MCAP files: views, embeddings and scenes, and the strict reader below them.
//!
//! A views file ([`write_views`], [`ViewsFile`]) holds Foxglove's well-known messages and opens in
//! any viewer that knows those; an embeddings file ([`EmbeddingsFile`]) holds
//! `semfm.PatchEmbeddings` with the cameras. Everything is read by [`read_messages`], which
//! believes no length, offset, count or checksum that it has not compared with the bytes.

mod cameras;
mod decompress;
mod embeddings_file;
mod frames;
mod inspect;
mod message_index;
mod metadata;
mod reader;
mod record;
mod ros2;
mod scene;
mod scene_messages;
mod schema;
mod shown;
mod summary;
mod views_file;
mod writer;

pub use embeddings_file::{Dtype, EmbeddingsFile};
pub use inspect::{AttachmentReport, ChannelReport, METADATA_NAME, McapReport, inspect};
pub use metadata::{EmbeddingsMetadata, MeshIdentity, ViewsMetadata};
pub use reader::{Channel, Contents, Message, Schema, read_bytes, read_messages};
pub use ros2::{POSES_TOPIC, write_pose_array};
pub use scene::{
    Scene, SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers, ScenePicture,
    ScenePoints, Severity,
};
pub use schema::PATCH_EMBEDDINGS;
pub use shown::{Colors, read_cloud, read_mesh};
pub use views_file::{ViewsFile, read_view, write_views};
