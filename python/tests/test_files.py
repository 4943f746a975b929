"""Views files in: sound ones read, damaged and foreign ones refused with the reason."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf import (
    CameraCalibration_pb2,
    CompressedImage_pb2,
    FrameTransform_pb2,
    RawImage_pb2,
    SceneUpdate_pb2,
)
from mcap.writer import CompressionType
from semfm.sidecar import schemas
from semfm.sidecar.errors import SidecarError
from semfm.sidecar.mcap_reader import read_mcap
from semfm.sidecar.views_file import read_views
from views_builder import METADATA, asymmetric_picture, disc, png, write_views


def two_views(path: Path, **kwargs) -> Path:
    pictures = [asymmetric_picture(24, 32, 8, seed) for seed in (0, 1)]
    return write_views(path, pictures, [disc(24, 32)] * 2, **kwargs)


@pytest.mark.parametrize("compression", CompressionType)
def test_a_views_file_reads_back(tmp_path, compression):
    views = read_views(two_views(tmp_path / "v.mcap", compression=compression))
    assert views.size == (24, 32) and views.metadata.items() > METADATA.items()
    assert [view.frame_id for view in views.views] == ["view_000", "view_001"]
    np.testing.assert_array_equal(views.views[1].rgb, asymmetric_picture(24, 32, 8, 1))
    np.testing.assert_array_equal(views.views[0].on_object, disc(24, 32))


def test_every_truncation_and_bit_flip_is_refused_or_harmless(tmp_path):
    whole = two_views(tmp_path / "v.mcap").read_bytes()
    truth = [message.data for message in read_mcap(tmp_path / "v.mcap").messages]
    broken = tmp_path / "broken.mcap"
    for cut in range(0, len(whole), 97):
        broken.write_bytes(whole[:cut])
        with pytest.raises(SidecarError):
            read_mcap(broken)
    rng = np.random.default_rng(11)
    refused = 0
    for at in rng.integers(0, len(whole), 300):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << rng.integers(8)
        broken.write_bytes(flipped)
        try:
            assert [message.data for message in read_mcap(broken).messages] == truth
        except SidecarError:
            refused += 1
    assert refused > 200, "the CRCs catch nearly all flips; the rest hit what carries no data"


def test_corpus_verdicts(shared):
    manifest = shared / "corpus" / "MANIFEST.tsv"
    if not manifest.is_file():
        pytest.skip(f"no {manifest}")
    rows = csv.DictReader(manifest.open(), delimiter="\t", quoting=csv.QUOTE_NONE)
    wrong, n = [], 0
    for row in rows:
        if not row["path"].startswith("mcap/"):
            continue
        n += 1
        wanted = row["expected"]
        try:
            found = f"accept {len(read_mcap(manifest.parent / row['path']).messages)} message"
        except SidecarError as error:
            found = f"refuse: {error}"
        may_refuse = "refuse" in wanted
        count = re.search(r"accept (?:the true )?(\d+) message", wanted)
        true_count = count and f"accept {count[1]} message"
        if not (may_refuse if found.startswith("refuse") else found == true_count):
            wrong.append((row["path"], wanted, found))
    assert n > 400 and wrong == []


def edit(topic: str, **fields):
    """A change that sets fields of every message on a topic."""

    def change(messages):
        for name, message in messages:
            if name == topic:
                for key, value in fields.items():
                    setattr(message, key, value)
        return messages

    return change


def drop(*topics: str):
    return lambda messages: [(name, m) for name, m in messages if name not in topics]


@pytest.mark.parametrize(
    "change, reason",
    [
        (drop("/tf"), "pose of view_000"),
        (drop("/views/001/camera"), "/views/001/camera"),
        (drop("/views/001/triangles"), "/views/001/triangles"),
        (
            drop(*(f"/views/000/{k}" for k in ("image", "camera", "depth", "triangles"))),
            "/views/000",
        ),
        (lambda messages: [], "no views"),
        (lambda messages: messages + messages[:1], "a second one"),
        (edit("/views/000/image", format="jpeg"), "format png"),
        (edit("/views/000/image", data=b"\x89PNG\r\n\x1a\nnonsense"), "sound PNG"),
        (edit("/views/000/image", data=png(np.zeros((8, 8, 3), np.uint8))), "camera's 32×24"),
        (edit("/views/000/image", data=png(np.zeros((24, 32), np.uint8))), "8-bit RGB"),
        (edit("/views/000/triangles", encoding="16UC1"), "32SC1"),
        (edit("/views/000/triangles", width=31), "32×24 pixels"),
        (edit("/views/000/triangles", data=b"1234"), "4 bytes"),
        (edit("/tf", child_frame_id="view_007"), "a second one"),
    ],
)
def test_a_foreign_file_is_refused_with_the_reason(tmp_path, change, reason):
    path = two_views(tmp_path / "v.mcap", change=change)
    with pytest.raises(SidecarError, match=re.escape(reason)) as error:
        read_views(path)
    assert str(path) in str(error.value)


def test_metadata_and_existence_are_asked_for(tmp_path):
    with pytest.raises(SidecarError, match="a views file"):
        read_views(two_views(tmp_path / "v.mcap", metadata=None))
    for wrong in ({"format": "semfm.embeddings/1"}, {"n_views": "3"}, {"width": "33"}):
        with pytest.raises(SidecarError, match=f"metadata {next(iter(wrong))}"):
            read_views(two_views(tmp_path / "v.mcap", metadata={**METADATA, **wrong}))
    with pytest.raises(SidecarError, match="No such file"):
        read_views(tmp_path / "nowhere.mcap")


def fields(descriptor, under: str = "") -> dict[str, tuple]:
    """Number and type of every field, those of messages inside included."""
    found = {}
    for field in descriptor.fields:
        found[under + field.name] = (field.number, field.type)
        if field.message_type:
            found.update(fields(field.message_type, f"{under}{field.name}."))
    return found


@pytest.mark.parametrize(
    "module",
    [
        CameraCalibration_pb2,
        CompressedImage_pb2,
        FrameTransform_pb2,
        RawImage_pb2,
        SceneUpdate_pb2,
    ],
)
def test_foxglove_fields_agree_with_the_published_schemas(module):
    name = module.__name__.rsplit(".", 1)[1][: -len("_pb2")]
    ours, theirs = getattr(schemas, name).DESCRIPTOR, getattr(module, name).DESCRIPTOR
    assert ours.full_name == theirs.full_name
    assert fields(ours).items() <= fields(theirs).items()


def test_the_published_proto_is_what_we_write():
    text = (Path(__file__).parents[2] / "docs" / "semfm.proto").read_text()
    published = {name: int(number) for name, number in re.findall(r"(\w+) = (\d+);", text)}
    types = {name: kind for kind, name in re.findall(r"(?:\w+\.)*(\w+) (\w+) = \d+;", text)}
    ours = schemas.PatchEmbeddings.DESCRIPTOR
    assert published == {field.name: field.number for field in ours.fields}
    for field in ours.fields:
        kind = field.message_type.name if field.message_type else ""
        number = getattr(type(field), f"TYPE_{types[field.name].upper()}", None)
        assert kind == types[field.name] or number == field.type, field.name
