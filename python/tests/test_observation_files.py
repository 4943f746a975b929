"""Bags of `semfm-cli frames` as others read them: rosbags, with the messages of a ROS 2 installation."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import semfm_cli


@pytest.fixture(scope="module")
def bag(tmp_path_factory) -> Path:
    """A bag of one frame: depth 0.5 m, without a return in the first column."""
    folder = tmp_path_factory.mktemp("frames")
    depth = np.full((6, 8), 0.5, np.float32)
    depth[:, 0] = np.nan
    np.save(folder / "depth.npy", depth)
    camera = {"fx": 50, "fy": 51, "cx": 3.5, "cy": 2.5}
    (folder / "K.json").write_text(json.dumps(camera))
    pose = np.eye(4)
    pose[:3, 3] = [0.1, -0.2, 0.3]
    (folder / "pose.json").write_text(json.dumps(pose.tolist()))
    words = ["--depth", folder / "depth.npy", "--intrinsics", folder / "K.json", "--pose", folder / "pose.json"]
    out = folder / "seen.mcap"
    done = subprocess.run([semfm_cli(), "frames", *words, "-o", out], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


def test_every_message_is_what_ros_says_it_is(bag):
    storage = pytest.importorskip("rosbags.rosbag2.storage_mcap")
    stores = pytest.importorskip("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    reader = storage.McapReader(bag)
    reader.open()
    messages = {}
    for connection, _, raw in reader.messages(reader.connections):
        ours = stores.get_types_from_msg(connection.msgdef.data, connection.msgtype)
        for name, fields in ours.items():
            assert fields == store.fielddefs[name], name
        message = store.deserialize_cdr(raw, connection.msgtype)
        assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(raw)
        messages[connection.topic] = message
    reader.close()
    assert sorted(messages) == ["/camera/depth/camera_info", "/camera/depth/image_rect", "/tf"]
    image = messages["/camera/depth/image_rect"]
    assert (image.encoding, image.width, image.height, image.step) == ("32FC1", 8, 6, 32)
    depth = np.frombuffer(image.data.tobytes(), np.float32).reshape(6, 8)
    assert np.isnan(depth[:, 0]).all() and (depth[:, 1:] == 0.5).all()
    info = messages["/camera/depth/camera_info"]
    assert info.k.tolist() == [50, 0, 3.5, 0, 51, 2.5, 0, 0, 1] and not info.d.any()
    transform = messages["/tf"].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "camera")
    shift = transform.transform.translation
    assert [shift.x, shift.y, shift.z] == [-0.1, 0.2, -0.3]
