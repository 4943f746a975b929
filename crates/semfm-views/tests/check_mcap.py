"""Reads files that the Rust side wrote with Python's own ``mcap`` and protobuf packages.

Make the files with ``cargo run -p semfm-views --example write_sample_files -- FOLDER`` and ``cargo run
-p semfm-show --example write_sample_scene -- FOLDER``, install ``mcap mcap-protobuf-support numpy lz4
zstandard``, then run ``SEMFM_SAMPLES=FOLDER pytest check_mcap.py`` or ``python check_mcap.py FOLDER``.
"""

import json
import math
import os
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

N_VIEWS, WIDTH, HEIGHT = 3, 16, 12
FRAMES = [f"view_{view:03d}" for view in range(N_VIEWS)]
#: Topic below /views/NNN -> schema.
VIEW_TOPICS = {
    "image": "foxglove.CompressedImage",
    "camera": "foxglove.CameraCalibration",
    "depth": "foxglove.RawImage",
    "triangles": "foxglove.RawImage",
}


def samples():
    """The folder of the files, from the environment or the command line."""
    folder = os.environ.get("SEMFM_SAMPLES") or (sys.argv[1] if len(sys.argv) > 1 else None)
    if folder is None or not (Path(folder) / "sample.views.mcap").is_file():
        raise SystemExit("set SEMFM_SAMPLES to the folder that write_sample_files filled")
    return Path(folder)


def read(name):
    """Topic -> decoded messages, topic -> schema name, and the metadata record ``semfm``."""
    messages, schemas = defaultdict(list), {}
    with open(samples() / name, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().library.startswith("semfm ")
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.encoding == channel.message_encoding == "protobuf"
            assert message.log_time == message.publish_time
            messages[channel.topic].append(decoded)
            schemas[channel.topic] = schema.name
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        n_messages = reader.get_summary().statistics.message_count
    assert n_messages == sum(map(len, messages.values()))
    return messages, schemas, metadata["semfm"]


def check_cameras(messages, schemas):
    """Intrinsics, and poses that stand where the formula of the example puts them."""
    assert schemas["/tf"] == "foxglove.FrameTransform"
    assert [transform.child_frame_id for transform in messages["/tf"]] == FRAMES
    for view, transform in enumerate(messages["/tf"]):
        camera = messages[f"/views/{view:03d}/camera"][0]
        assert camera.frame_id == FRAMES[view]
        assert (camera.width, camera.height) == (WIDTH, HEIGHT)
        assert list(camera.K) == [20, 0, 8, 0, 21, 6, 0, 0, 1]
        assert list(camera.P) == [20, 0, 8, 0, 0, 21, 6, 0, 0, 0, 1, 0]
        assert list(camera.R) == [1, 0, 0, 0, 1, 0, 0, 0, 1]
        assert transform.parent_frame_id == "object"
        # The camera turned the object by `angle` and pushed it 4 away; the pose is the inverse.
        angle = 0.5 * view
        q, t = transform.rotation, transform.translation
        np.testing.assert_allclose(
            [q.x, q.y, q.z, q.w], [0, math.sin(-angle / 2), 0, math.cos(angle / 2)], atol=1e-12
        )
        eye = [4 * math.sin(angle), 0, -4 * math.cos(angle)]
        np.testing.assert_allclose([t.x, t.y, t.z], eye, atol=1e-12)


def check_metadata(metadata, format):
    """Which mesh, how many views, how large."""
    expected = {
        "format": format,
        "n_vertices": "4",
        "n_triangles": "4",
        "n_views": str(N_VIEWS),
        "width": str(WIDTH),
        "height": str(HEIGHT),
        "rig": "3 cameras around y",
        "background": "white",
        "seed": "7",
    }
    assert {key: metadata[key] for key in expected} == expected
    assert metadata["mesh_hash"].startswith("blake3:") and len(metadata["mesh_hash"]) == 7 + 64


def test_views():
    messages, schemas, metadata = read("sample.views.mcap")
    check_metadata(metadata, "semfm.views/1")
    check_cameras(messages, schemas)
    assert schemas["/mesh"] == "foxglove.SceneUpdate"
    (entity,) = messages["/mesh"][0].entities
    assert entity.frame_id == "object"
    assert list(entity.triangles[0].indices) == [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    assert len(entity.triangles[0].points) == 4
    for view in range(N_VIEWS):
        for what, schema in VIEW_TOPICS.items():
            topic = f"/views/{view:03d}/{what}"
            assert schemas[topic] == schema and len(messages[topic]) == 1
            assert messages[topic][0].frame_id == FRAMES[view]
        image, depth, triangles = (
            messages[f"/views/{view:03d}/{what}"][0] for what in ("image", "depth", "triangles")
        )
        assert image.format == "png" and image.data.startswith(b"\x89PNG\r\n")
        for raw, encoding in ((depth, "32FC1"), (triangles, "32SC1")):
            assert (raw.width, raw.height, raw.step) == (WIDTH, HEIGHT, 4 * WIDTH)
            assert raw.encoding == encoding
        pixel = np.arange(WIDTH * HEIGHT)
        background = (pixel + view) % 5 == 0
        z = np.where(background, np.inf, 1 + pixel / 256).astype("<f4")
        np.testing.assert_array_equal(np.frombuffer(depth.data, "<f4"), z)
        ids = np.where(background, -1, pixel % 4)
        np.testing.assert_array_equal(np.frombuffer(triangles.data, "<i4"), ids)


def test_embeddings():
    messages, schemas, metadata = read("sample.emb.mcap")
    check_metadata(metadata, "semfm.embeddings/1")
    assert metadata["encoder"] == "sample" and metadata["rolls"] == "1"
    assert metadata["simulated"] == "true"
    check_cameras(messages, schemas)
    for view in range(N_VIEWS):
        topic = f"/views/{view:03d}/embeddings"
        assert schemas[topic] == "semfm.PatchEmbeddings"
        (grid,) = messages[topic]
        assert (grid.timestamp.seconds, grid.timestamp.nanos) == (view, 0)
        assert grid.frame_id == FRAMES[view]
        assert (grid.rows, grid.cols, grid.dim, grid.dtype) == (3, 4, 5, "f16")
        assert (grid.x0, grid.y0, grid.x1, grid.y1) == (0, 0, WIDTH, HEIGHT)
        numbers = ((np.arange(60) * 37 + view) % 101) / 64 - 0.5
        np.testing.assert_array_equal(np.frombuffer(grid.data, "<f2"), numbers)
        assert list(grid.coverage) == [20 * patch for patch in range(12)]
        assert list(grid.valid) == [1] * 11 + [0]


def test_transfer():
    messages, schemas, metadata = read("sample.transfer.mcap")
    assert metadata["format"] == "semfm.transfer/1"
    assert json.loads(metadata["json"]) == {"method": "sample"}
    for frame in ("source", "target"):
        topic = f"/{frame}/mesh"
        assert schemas[topic] == "foxglove.SceneUpdate"
        (entity,) = messages[topic][0].entities
        assert entity.frame_id == frame
        assert len(entity.triangles[0].colors) == len(entity.triangles[0].points) == 4
        assert entity.triangles[0].colors[0].r == 1
    cloud = messages["/source/cloud"][0]
    assert schemas["/source/cloud"] == "foxglove.PointCloud"
    points = np.frombuffer(cloud.data, np.uint8).reshape(4, cloud.point_stride)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "red", "green", "blue", "alpha"]
    np.testing.assert_array_equal(points[:, 12:15][1], [0, 255, 0])
    assert [transform.child_frame_id for transform in messages["/tf"]] == ["source", "target"]


if __name__ == "__main__":
    for check in (test_views, test_embeddings, test_transfer):
        check()
        print(f"{check.__name__}: ok")
