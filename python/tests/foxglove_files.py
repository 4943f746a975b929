"""Files for Foxglove, decoded by the packages that Foxglove and MCAP publish."""

from __future__ import annotations

import importlib
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

from google.protobuf import descriptor_pb2
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


class Scene(NamedTuple):
    """What a file holds."""

    #: Topic -> decoded messages, in the order of the file.
    messages: dict
    #: Topic -> bytes of those messages.
    raw: dict
    #: Topic -> name of the schema.
    types: dict
    #: Name of a schema -> its FileDescriptorSet.
    schemas: dict
    #: Log times in the order of the file, in nanoseconds.
    times: list

    def of_type(self, name: str):
        """All messages of a schema, as (topic, message)."""
        topics = (topic for topic, kind in self.types.items() if kind == name)
        return [(topic, message) for topic in topics for message in self.messages[topic]]


def read(path: Path) -> Scene:
    """Decodes every message, with all checksums checked."""
    scene = Scene(defaultdict(list), defaultdict(list), {}, {}, [])
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            assert schema.encoding == channel.message_encoding == "protobuf", channel.topic
            assert message.log_time == message.publish_time
            if hasattr(decoded, "timestamp"):
                stamp = decoded.timestamp.seconds * 10**9 + decoded.timestamp.nanos
                assert stamp == message.log_time, channel.topic
            scene.messages[channel.topic].append(decoded)
            scene.raw[channel.topic].append(message.data)
            scene.types[channel.topic] = schema.name
            scene.schemas[schema.name] = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            scene.times.append(message.log_time)
        statistics = reader.get_summary().statistics
    assert statistics.message_count == len(scene.times) > 0
    return scene


#: Message or enum -> number -> (name, type, label, type name).
Fields = "dict[str, dict[int, tuple[str, int, int, str]]]"


def fields_of(files) -> Fields:
    """What FileDescriptorProtos define."""
    found = {}

    def enum(prefix, message):
        values = {v.number: (v.name, 0, 0, "") for v in message.value}
        found[f"{prefix}.{message.name}"] = values

    def walk(prefix, message):
        name = f"{prefix}.{message.name}"
        found[name] = {
            f.number: (f.name, f.type, f.label, f.type_name.lstrip(".")) for f in message.field
        }
        for nested in message.nested_type:
            walk(name, nested)
        for nested in message.enum_type:
            enum(name, nested)

    for file in files:
        for message in file.message_type:
            walk(file.package, message)
        for message in file.enum_type:
            enum(file.package, message)
    return found


def published_fields(name: str) -> Fields:
    """The same of a message in foxglove-schemas-protobuf, with all that it uses."""
    module = importlib.import_module(f"foxglove_schemas_protobuf.{name.split('.')[1]}_pb2")
    files, open_files = {}, [module.DESCRIPTOR]
    while open_files:
        file = open_files.pop()
        if file.name not in files:
            files[file.name] = descriptor_pb2.FileDescriptorProto()
            file.CopyToProto(files[file.name])
            open_files.extend(file.dependencies)
    return fields_of(files.values())


def published_class(name: str):
    """The class of a message in foxglove-schemas-protobuf."""
    short = name.split(".")[1]
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{short}_pb2"), short)


def sdk_module():
    """The message classes of Foxglove's SDK, which moved with 0.16; None without the SDK."""
    for name in ("foxglove.messages", "foxglove.schemas"):
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    return None


def as_sdk(sdk, message):
    """A decoded message as the SDK's own object: fields by name, enums in camel case."""
    name = message.DESCRIPTOR.name
    if message.DESCRIPTOR.full_name == "google.protobuf.Timestamp":
        return sdk.Timestamp(message.seconds, message.nanos)
    if message.DESCRIPTOR.full_name == "google.protobuf.Duration":
        return sdk.Duration(message.seconds, message.nanos)
    values = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        is_list = getattr(field, "is_repeated", None)
        if is_list is None:
            is_list = field.label == field.LABEL_REPEATED
        if field.enum_type is not None:
            known = field.enum_type.values_by_number[value].name
            owner = field.enum_type.full_name.split(".", 1)[1].replace(".", "")
            kind = getattr(sdk, {"LinePrimitiveType": "LinePrimitiveLineType"}.get(owner, owner))
            values[field.name] = getattr(kind, "".join(w.capitalize() for w in known.split("_")))
        elif is_list:
            is_message = field.message_type is not None
            values[field.name] = [as_sdk(sdk, v) if is_message else v for v in value]
        elif field.message_type is not None:
            values[field.name] = as_sdk(sdk, value) if message.HasField(field.name) else None
        else:
            values[field.name] = value
    return getattr(sdk, name)(**values)
