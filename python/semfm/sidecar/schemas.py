"""Protobuf classes of the messages that the sidecar reads and writes, built without protoc.

The descriptors stand here as tables, in a pool of their own, so that they can live beside any
other package that registers the same names (``foxglove-schemas-protobuf``, say). Of the foxglove
messages only the fields that the sidecar reads are declared; protobuf keeps the others aside.
``PatchEmbeddings`` is our own schema, published as ``docs/semfm.proto``.
"""

from __future__ import annotations

from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

_Field = descriptor_pb2.FieldDescriptorProto
_TYPES = {
    "bytes": _Field.TYPE_BYTES,
    "double": _Field.TYPE_DOUBLE,
    "fixed32": _Field.TYPE_FIXED32,
    "float": _Field.TYPE_FLOAT,
    "string": _Field.TYPE_STRING,
    "uint32": _Field.TYPE_UINT32,
}
_TIMESTAMP = "google.protobuf.Timestamp"

# Message name -> its fields as (number, type, name); a "*" marks a repeated field. A type with a
# dot is another message, which stands above its user.
_MESSAGES = {
    "semfm.PatchEmbeddings": [
        (1, _TIMESTAMP, "timestamp"),
        (2, "string", "frame_id"),
        (3, "uint32", "rows"),
        (4, "uint32", "cols"),
        (5, "uint32", "dim"),
        (6, "string", "dtype"),
        (7, "bytes", "data"),
        (8, "float", "x0"),
        (9, "float", "y0"),
        (10, "float", "x1"),
        (11, "float", "y1"),
        (12, "bytes", "coverage"),
        (13, "bytes", "valid"),
    ],
    "foxglove.CompressedImage": [
        (1, _TIMESTAMP, "timestamp"),
        (2, "bytes", "data"),
        (3, "string", "format"),
        (4, "string", "frame_id"),
    ],
    "foxglove.RawImage": [
        (1, _TIMESTAMP, "timestamp"),
        (2, "fixed32", "width"),
        (3, "fixed32", "height"),
        (4, "string", "encoding"),
        (5, "fixed32", "step"),
        (6, "bytes", "data"),
        (7, "string", "frame_id"),
    ],
    "foxglove.CameraCalibration": [
        (1, _TIMESTAMP, "timestamp"),
        (2, "fixed32", "width"),
        (3, "fixed32", "height"),
        (6, "double*", "K"),
        (9, "string", "frame_id"),
    ],
    "foxglove.Vector3": [(1, "double", "x"), (2, "double", "y"), (3, "double", "z")],
    "foxglove.Quaternion": [
        (1, "double", "x"),
        (2, "double", "y"),
        (3, "double", "z"),
        (4, "double", "w"),
    ],
    "foxglove.FrameTransform": [
        (1, _TIMESTAMP, "timestamp"),
        (2, "string", "parent_frame_id"),
        (3, "string", "child_frame_id"),
        (4, "foxglove.Vector3", "translation"),
        (5, "foxglove.Quaternion", "rotation"),
    ],
    "foxglove.Point3": [(1, "double", "x"), (2, "double", "y"), (3, "double", "z")],
    "foxglove.TriangleListPrimitive": [
        (2, "foxglove.Point3*", "points"),
        (5, "fixed32*", "indices"),
    ],
    "foxglove.SceneEntity": [
        (2, "string", "frame_id"),
        (12, "foxglove.TriangleListPrimitive*", "triangles"),
    ],
    "foxglove.SceneUpdate": [(2, "foxglove.SceneEntity*", "entities")],
}


def _file(full_name: str) -> descriptor_pb2.FileDescriptorProto:
    package, name = full_name.split(".")
    kinds = [kind.rstrip("*") for _, kind, _ in _MESSAGES[full_name]]
    used = [_file_name(kind) for kind in dict.fromkeys(kinds) if kind in _MESSAGES]
    file = descriptor_pb2.FileDescriptorProto(
        name=_file_name(full_name),
        package=package,
        syntax="proto3",
        dependency=[timestamp_pb2.DESCRIPTOR.name, *used],
    )
    message = file.message_type.add(name=name)
    for (number, kind, field_name), base in zip(_MESSAGES[full_name], kinds):
        repeated = kind != base
        field = message.field.add(
            name=field_name,
            number=number,
            label=_Field.LABEL_REPEATED if repeated else _Field.LABEL_OPTIONAL,
        )
        if "." in base:
            field.type, field.type_name = _Field.TYPE_MESSAGE, f".{base}"
        else:
            field.type = _TYPES[base]
    return file


def _file_name(full_name: str) -> str:
    return full_name.replace(".", "/") + ".proto"


def _timestamp_file() -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(file)
    return file


_POOL = descriptor_pool.DescriptorPool()
_POOL.AddSerializedFile(_timestamp_file().SerializeToString())
for _name in _MESSAGES:
    _POOL.AddSerializedFile(_file(_name).SerializeToString())


def _message_class(full_name: str) -> Any:
    return message_factory.GetMessageClass(_POOL.FindMessageTypeByName(full_name))


PatchEmbeddings = _message_class("semfm.PatchEmbeddings")
CompressedImage = _message_class("foxglove.CompressedImage")
RawImage = _message_class("foxglove.RawImage")
CameraCalibration = _message_class("foxglove.CameraCalibration")
FrameTransform = _message_class("foxglove.FrameTransform")
SceneUpdate = _message_class("foxglove.SceneUpdate")

PATCH_EMBEDDINGS = "semfm.PatchEmbeddings"


def patch_embeddings_schema() -> bytes:
    """The schema record's data for ``semfm.PatchEmbeddings``: a whole FileDescriptorSet."""
    files = descriptor_pb2.FileDescriptorSet(file=[_timestamp_file(), _file(PATCH_EMBEDDINGS)])
    return files.SerializeToString(deterministic=True)
