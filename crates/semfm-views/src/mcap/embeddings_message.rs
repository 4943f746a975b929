//! The protobuf message `semfm.PatchEmbeddings`, and how it and Foxglove's own are recognised.

use foxglove::bytes::{Buf, BufMut, Bytes};
use foxglove::messages::Timestamp;
use foxglove::{Decode, Encode};
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

/// Name of the message type.
pub const PATCH_EMBEDDINGS: &str = "semfm.PatchEmbeddings";

/// A grid of patch embeddings on the wire. The fields are those of
/// [`PatchEmbeddings`](crate::PatchEmbeddings), which is what the rest of the crate uses.
#[derive(Clone, PartialEq, prost::Message)]
pub(super) struct PatchEmbeddingsMessage {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub frame_id: String,
    #[prost(uint32, tag = "3")]
    pub rows: u32,
    #[prost(uint32, tag = "4")]
    pub cols: u32,
    #[prost(uint32, tag = "5")]
    pub dim: u32,
    #[prost(string, tag = "6")]
    pub dtype: String,
    #[prost(bytes = "bytes", tag = "7")]
    pub data: Bytes,
    #[prost(float, tag = "8")]
    pub x0: f32,
    #[prost(float, tag = "9")]
    pub y0: f32,
    #[prost(float, tag = "10")]
    pub x1: f32,
    #[prost(float, tag = "11")]
    pub y1: f32,
    #[prost(bytes = "bytes", tag = "12")]
    pub coverage: Bytes,
    #[prost(bytes = "bytes", tag = "13")]
    pub valid: Bytes,
}

impl Encode for PatchEmbeddingsMessage {
    type Error = prost::EncodeError;

    fn get_schema() -> Option<foxglove::Schema> {
        Some(foxglove::Schema::new(PATCH_EMBEDDINGS, "protobuf", descriptor()))
    }

    fn get_message_encoding() -> String {
        "protobuf".to_owned()
    }

    fn encode(&self, buffer: &mut impl BufMut) -> Result<(), prost::EncodeError> {
        prost::Message::encode(self, buffer)
    }

    fn encoded_len(&self) -> Option<usize> {
        Some(prost::Message::encoded_len(self))
    }
}

impl Decode for PatchEmbeddingsMessage {
    type Error = prost::DecodeError;

    fn decode(buffer: impl Buf) -> Result<Self, prost::DecodeError> {
        prost::Message::decode(buffer)
    }
}

/// The schema record's data: a `FileDescriptorSet` of our message and the timestamp it uses.
fn descriptor() -> Vec<u8> {
    let timestamp = FileDescriptorProto {
        name: Some("google/protobuf/timestamp.proto".to_owned()),
        package: Some("google.protobuf".to_owned()),
        syntax: Some("proto3".to_owned()),
        message_type: vec![message(
            "Timestamp",
            vec![field("seconds", 1, Type::Int64), field("nanos", 2, Type::Int32)],
        )],
        ..Default::default()
    };
    let embeddings = FileDescriptorProto {
        name: Some("semfm/PatchEmbeddings.proto".to_owned()),
        package: Some("semfm".to_owned()),
        syntax: Some("proto3".to_owned()),
        dependency: vec!["google/protobuf/timestamp.proto".to_owned()],
        message_type: vec![message(
            "PatchEmbeddings",
            vec![
                field("timestamp", 1, Type::Message),
                field("frame_id", 2, Type::String),
                field("rows", 3, Type::Uint32),
                field("cols", 4, Type::Uint32),
                field("dim", 5, Type::Uint32),
                field("dtype", 6, Type::String),
                field("data", 7, Type::Bytes),
                field("x0", 8, Type::Float),
                field("y0", 9, Type::Float),
                field("x1", 10, Type::Float),
                field("y1", 11, Type::Float),
                field("coverage", 12, Type::Bytes),
                field("valid", 13, Type::Bytes),
            ],
        )],
        ..Default::default()
    };
    FileDescriptorSet { file: vec![timestamp, embeddings] }.encode_to_vec()
}

fn field(name: &str, number: i32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        json_name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        type_name: (kind == Type::Message).then(|| ".google.protobuf.Timestamp".to_owned()),
        ..Default::default()
    }
}

fn message(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto { name: Some(name.to_owned()), field, ..Default::default() }
}
