"""The MCAP files as Foxglove sees them: decoded with others' packages, held against the published
schemas and against Foxglove's own SDK, and looked at as a viewer would."""

from __future__ import annotations

import io
import json
import re
import subprocess

import numpy as np
import pytest
from browser import ROOT, semfm_cli
from foxglove_files import (
    as_sdk,
    fields_of,
    published_class,
    published_fields,
    read,
    sdk_module,
)
from PIL import Image
from semfm.sidecar.cli import main as embed
from tiny_onnx import write_encoder

#: Name of a file -> what it must hold: topics without digits, and their schemas.
EXPECTED = {
    "source.views.mcap": {
        "/mesh": "foxglove.SceneUpdate",
        "/tf": "foxglove.FrameTransform",
        "/views/NNN/image": "foxglove.CompressedImage",
        "/views/NNN/camera": "foxglove.CameraCalibration",
        "/views/NNN/depth": "foxglove.RawImage",
        "/views/NNN/triangles": "foxglove.RawImage",
    },
    "containers_0_s0.emb.mcap": {
        "/tf": "foxglove.FrameTransform",
        "/views/NNN/camera": "foxglove.CameraCalibration",
        "/views/NNN/embeddings": "semfm.PatchEmbeddings",
    },
    # The same by semfm-embed, which is Python.
    "source.emb.mcap": {
        "/tf": "foxglove.FrameTransform",
        "/views/NNN/camera": "foxglove.CameraCalibration",
        "/views/NNN/embeddings": "semfm.PatchEmbeddings",
    },
    "transfer/transfer.mcap": {
        "/tf": "foxglove.FrameTransform",
        **{
            f"/{side}/{what}": f"foxglove.{schema}"
            for side in ("source", "target")
            for what, schema in {
                "mesh": "SceneUpdate",
                "places": "SceneUpdate",
                "cloud": "PointCloud",
                "vertices": "PointCloud",
                "view/image": "CompressedImage",
                "view/camera": "CameraCalibration",
            }.items()
        },
        "/labels": "foxglove.SceneUpdate",
        "/anchors": "foxglove.SceneUpdate",
        "/matches": "foxglove.SceneUpdate",
        "/answer": "foxglove.Log",
    },
}

#: Topics that are there only where there is something to say.
SOMETIMES = {"/hypotheses": "foxglove.SceneUpdate"}

#: The root of the frames of each file.
ROOTS = {"transfer/transfer.mcap": "world"}

#: Numeric types of packed elements -> numpy's.
NUMPY = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("foxglove")
    views = ["views", out / "containers_0_s0.obj", "-o", out / "source.views.mcap"]
    for arguments in (
        ["demo", "-q", "-o", out],
        [*views, "--count", "5", "--size", "96", "--renderer", "cpu", "-q"],
    ):
        done = subprocess.run([semfm_cli(), *arguments], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def embedded(folder):
    """The views through a tiny ONNX encoder and semfm-embed itself."""
    pytest.importorskip("onnxruntime")
    views, path = folder / "source.views.mcap", folder / "source.emb.mcap"
    assert embed([str(views), "-o", str(path), "--model", str(write_encoder(folder))]) == 0
    return path


@pytest.fixture(scope="module", params=EXPECTED)
def file(request, folder):
    if request.param == "source.emb.mcap":
        request.getfixturevalue("embedded")
    return request.param, read(folder / request.param)


@pytest.fixture(scope="module")
def transfer(folder):
    return read(folder / "transfer" / "transfer.mcap")


def test_every_topic_is_there_with_its_schema(file):
    name, scene = file
    found = {re.sub(r"/\d{3}/", "/NNN/", topic): kind for topic, kind in scene.types.items()}
    assert {k: v for k, v in found.items() if k not in SOMETIMES} == EXPECTED[name]


def test_schemas_are_those_that_foxglove_publishes(file):
    _, scene = file
    compared = 0
    for name, files in scene.schemas.items():
        ours = fields_of(files.file)
        if name.startswith("semfm."):
            continue
        theirs = published_fields(name)
        for message, fields in ours.items():
            shared = fields.keys() & theirs[message].keys()
            # One of the two may be newer, but neither may say otherwise.
            assert len(shared) == min(len(fields), len(theirs[message])), message
            assert {k: fields[k] for k in shared} == {k: theirs[message][k] for k in shared}, (
                message
            )
            compared += len(shared)
    assert compared > 10


@pytest.mark.parametrize("name", ["containers_0_s0.emb.mcap", "source.emb.mcap"])
def test_our_own_schema_is_the_one_in_the_documentation(folder, embedded, name):
    scene = read(folder / name)
    ours = fields_of(scene.schemas["semfm.PatchEmbeddings"].file)["semfm.PatchEmbeddings"]
    text = (ROOT / "docs" / "semfm.proto").read_text()
    stated = re.findall(r"^\s+([\w.]+) (\w+) = (\d+);", text, re.M)
    types = {"string": 9, "uint32": 13, "bytes": 12, "float": 2, "google.protobuf.Timestamp": 11}
    assert {n: (f[0], f[1]) for n, f in ours.items()} == {
        int(number): (name, types[kind]) for kind, name, number in stated
    }


def test_the_sdk_makes_the_same_messages(file):
    sdk = sdk_module()
    if sdk is None:
        pytest.skip("foxglove-sdk is not installed: it has no package for this Python")
    _, scene = file
    compared = set()
    for topic, kind in scene.types.items():
        if kind.startswith("semfm.") or kind in compared and "view" in topic:
            continue
        compared.add(kind)
        schema = getattr(sdk, kind.split(".")[1]).get_schema()
        assert (schema.name, schema.encoding) == (kind, "protobuf")
        files = type(scene.schemas[kind]).FromString(schema.data)
        assert fields_of(files.file).keys() == fields_of(scene.schemas[kind].file).keys()
        ours, theirs = fields_of(scene.schemas[kind].file), fields_of(files.file)
        for message, fields in theirs.items():
            shared = fields.keys() & ours[message].keys()
            assert {k: fields[k] for k in shared} == {k: ours[message][k] for k in shared}
        # Read with the published class, rebuilt with the SDK, written by the SDK: still the same.
        for raw in scene.raw[topic][:2]:
            message = published_class(kind).FromString(raw)
            again = published_class(kind).FromString(bytes(as_sdk(sdk, message).encode()))
            assert again == message, topic
            known = published_class(kind).FromString(raw)
            known.DiscardUnknownFields()
            assert known.ByteSize() == len(raw), "a field that the published schema has not"
    assert compared


def test_frames_form_one_tree_and_everything_stands_in_it(file):
    name, scene = file
    parents = {}
    for transform in scene.messages["/tf"]:
        q = transform.rotation
        assert abs(np.linalg.norm([q.x, q.y, q.z, q.w]) - 1) < 1e-9
        t = transform.translation
        assert np.isfinite([t.x, t.y, t.z]).all()
        assert transform.child_frame_id not in parents, "a frame with two parents"
        parents[transform.child_frame_id] = transform.parent_frame_id
    roots = set(parents.values()) - parents.keys()
    assert roots == {ROOTS.get(name, "object")}
    for frame in parents:
        steps = 0
        while frame in parents:
            frame, steps = parents[frame], steps + 1
            assert steps < 10, "a circle of frames"
    frames = parents.keys() | roots
    for topic, messages in scene.messages.items():
        for message in messages:
            if scene.types[topic] == "foxglove.SceneUpdate":
                assert {entity.frame_id for entity in message.entities} <= frames, topic
            elif hasattr(message, "frame_id"):
                assert message.frame_id in frames, topic


def test_times_never_go_back_and_agree(file):
    _, scene = file
    assert scene.times == sorted(scene.times)  # each stamp is its log time: `read` looks


def test_cameras_and_pictures_fit_each_other(file):
    name, scene = file
    cameras = scene.of_type("foxglove.CameraCalibration")
    assert cameras
    for topic, camera in cameras:
        k, p = np.reshape(camera.K, (3, 3)), np.reshape(camera.P, (3, 4))
        np.testing.assert_array_equal(p, np.c_[k, np.zeros(3)])
        np.testing.assert_array_equal(np.reshape(camera.R, (3, 3)), np.eye(3))
        assert k[0, 0] > 0 and k[1, 1] > 0 and k[0, 1] == 0 and list(k[2]) == [0, 0, 1]
        assert len(camera.D) == 0
        size = (camera.width, camera.height)
        beside = topic.rsplit("/", 1)[0]
        for image in scene.messages.get(f"{beside}/image", []):
            assert image.frame_id == camera.frame_id and image.format == "png"
            assert Image.open(io.BytesIO(image.data)).size == size
        for what in ("depth", "triangles"):
            for image in scene.messages.get(f"{beside}/{what}", []):
                assert (image.width, image.height) == size and image.frame_id == camera.frame_id
                assert image.step == 4 * image.width
                assert len(image.data) == image.step * image.height
        for grid in scene.messages.get(f"{beside}/embeddings", []):
            bytes_each = {"f16": 2, "f32": 4}[grid.dtype]
            assert len(grid.data) == grid.rows * grid.cols * grid.dim * bytes_each
            assert len(grid.coverage) == len(grid.valid) == grid.rows * grid.cols
            assert (grid.x0, grid.y0, grid.x1, grid.y1) == (0, 0, *size)


def test_pictures_show_the_object_where_the_cameras_say(folder):
    """The mesh, brought to the image by /tf and K alone, covers the pixels that are not white."""
    scene = read(folder / "source.views.mcap")
    (entity,) = scene.messages["/mesh"][0].entities
    points = np.array([[p.x, p.y, p.z] for p in entity.triangles[0].points])
    for transform in scene.messages["/tf"]:
        view = transform.child_frame_id[-3:]
        (camera,), (image,) = (scene.messages[f"/views/{view}/{w}"] for w in ("camera", "image"))
        inside = points - [getattr(transform.translation, axis) for axis in "xyz"]
        inside = inside @ rotation(transform.rotation)
        assert (inside[:, 2] > 0).all(), "behind the camera"
        pixels = inside @ np.reshape(camera.K, (3, 3)).T
        pixels = pixels[:, :2] / pixels[:, 2:]
        dark = np.array(Image.open(io.BytesIO(image.data)).convert("L")) < 250
        rows, columns = np.nonzero(dark)
        extent = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        np.testing.assert_allclose([*pixels.min(0), *pixels.max(0)], extent, atol=1.5)


def rotation(q):
    """Columns are the axes of the child frame."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_meshes_have_a_colour_for_each_point_and_indices_within(file):
    _, scene = file
    for topic, update in scene.of_type("foxglove.SceneUpdate"):
        names = [entity.id for entity in update.entities]
        assert len(set(names)) == len(names) and all(names), topic
        for entity in update.entities:
            assert not entity.HasField("lifetime") or entity.lifetime.ToNanoseconds() == 0
            for part in [*entity.triangles, *entity.lines]:
                n = len(part.points)
                colors = np.reshape([[c.r, c.g, c.b, c.a] for c in part.colors], (-1, 4))
                assert len(colors) in (0, n), topic
                assert ((colors >= 0) & (colors <= 1)).all() and (colors[:, 3:] > 0).all()
                assert all(index < n for index in part.indices)
            for part in entity.triangles:
                assert len(part.indices) % 3 == 0 and len(part.indices) > 0
            for text in entity.texts:
                assert text.text and text.billboard and text.font_size > 0


def test_clouds_are_packed_as_their_fields_say(transfer):
    for topic, cloud in transfer.of_type("foxglove.PointCloud"):
        fields = {field.name: field for field in cloud.fields}
        assert {"x", "y", "z", "red", "green", "blue", "alpha"} <= fields.keys()
        kinds = [(f.name, NUMPY[f.type], f.offset) for f in cloud.fields]
        ends = [offset + np.dtype(kind).itemsize for _, kind, offset in kinds]
        assert (
            ends[:-1] == [offset for _, _, offset in kinds[1:]] and ends[-1] == cloud.point_stride
        )
        points = np.frombuffer(cloud.data, np.dtype([(name, kind) for name, kind, _ in kinds]))
        assert (points["alpha"] == 255).all()
        assert np.isfinite([points[axis] for axis in "xyz"]).all()
        more = {"/source/vertices": {"weight", "anchor"}}
        more["/target/vertices"] = {*more["/source/vertices"], "source_vertex"}
        assert fields.keys() >= more.get(topic, {"cluster", "anchor", "n_views"})


def test_the_scene_says_what_the_files_beside_it_say(folder, transfer):
    beside = folder / "transfer"
    region, report, point_map = (
        json.loads((beside / f"{name}.json").read_text())
        for name in ("region", "report", "point_map")
    )
    (answer,) = transfer.messages["/answer"]
    assert region["verdict"] in answer.message and f"{region['confidence']:.2f}" in answer.message
    assert answer.level == {"accept": 2, "check": 3, "refuse": 4}[region["verdict"]]
    (cloud,) = transfer.messages["/target/vertices"]
    kinds = np.dtype([(f.name, NUMPY[f.type]) for f in cloud.fields])
    points = np.frombuffer(cloud.data, kinds)
    np.testing.assert_array_equal(points["source_vertex"], point_map["source_of"])
    np.testing.assert_array_equal(points["anchor"], point_map["target_anchor"])
    np.testing.assert_array_equal(np.nonzero(points["weight"] >= 0.5)[0], region["vertices"])
    # The colour transfer: a target vertex has the colour of the source vertex it is matched to.
    colors = {
        side: np.array([[c.r, c.g, c.b] for c in scene.entities[0].triangles[0].colors])
        for side in ("source", "target")
        for scene in transfer.messages[f"/{side}/places"]
    }
    np.testing.assert_array_equal(colors["target"], colors["source"][point_map["source_of"]])
    # Both names of each anchor, and the verdict above the target.
    words = [t.text for e in transfer.messages["/anchors"][0].entities for t in e.texts]
    assert len(words) == 2 * len(report["anchors"])
    labels = [t.text for e in transfer.messages["/labels"][0].entities for t in e.texts]
    assert any(region["verdict"] in text for text in labels)


def test_objects_stand_beside_each_other_in_the_world(transfer):
    extents = []
    for transform in transfer.messages["/tf"]:
        if transform.parent_frame_id != "world":
            continue
        (update,) = transfer.messages[f"/{transform.child_frame_id}/mesh"]
        points = np.array([[p.x, p.y, p.z] for p in update.entities[0].triangles[0].points])
        shift = [getattr(transform.translation, axis) for axis in "xyz"]
        points = points @ rotation(transform.rotation).T + shift
        extents.append((points.min(0), points.max(0)))
    (_, source_high), (target_low, _) = extents
    assert source_high[0] < target_low[0]
    np.testing.assert_allclose([low[2] for low, _ in extents], 0, atol=1e-9)
