"""Views files in: sound ones read, damaged and foreign ones refused with the reason."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from semfm import FileError, FormatError, ViewsFile
from views_builder import METADATA, asymmetric_picture, disc, png, write_views


def two_views(path: Path, **kwargs) -> Path:
    pictures = [asymmetric_picture(24, 32, 8, seed) for seed in (0, 1)]
    return write_views(path, pictures, [disc(24, 32)] * 2, **kwargs)


@pytest.mark.parametrize("compression", CompressionType)
def test_a_views_file_reads_back(tmp_path, compression):
    file = ViewsFile.read(two_views(tmp_path / "v.mcap", compression=compression))
    assert file.metadata.items() > METADATA.items()
    assert (file.n_views, file.mesh_hash, file.mesh) == (2, METADATA["mesh_hash"], None)
    assert [view.rgb.shape for view in file.views] == [(24, 32, 3)] * 2
    assert [camera.eye.tolist() for camera in file.cameras] == [[0, 0, -3], [0, 0, -4]]
    np.testing.assert_array_equal(file.views[1].rgb, asymmetric_picture(24, 32, 8, 1))
    np.testing.assert_array_equal(file.views[0].triangles >= 0, disc(24, 32))


def contents(path: Path) -> list[tuple]:
    """Cameras and pixels of every view."""
    return [
        (view.camera, view.rgb.tobytes(), view.depth.tobytes(), view.triangles.tobytes())
        for view in ViewsFile.read(path).views
    ]


def test_every_truncation_and_bit_flip_is_refused_or_harmless(tmp_path):
    whole = two_views(tmp_path / "v.mcap").read_bytes()
    truth = contents(tmp_path / "v.mcap")
    broken = tmp_path / "broken.mcap"
    for cut in range(0, len(whole), 97):
        broken.write_bytes(whole[:cut])
        with pytest.raises(FormatError):
            ViewsFile.read(broken)
    rng = np.random.default_rng(11)
    refused = 0
    for at in rng.integers(0, len(whole), 300):
        flipped = bytearray(whole)
        flipped[at] ^= 1 << rng.integers(8)
        broken.write_bytes(flipped)
        try:
            assert contents(broken) == truth
        except FormatError:
            refused += 1
    assert refused > 200, "the CRCs catch nearly all flips; the rest hit what transfers no data"


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
        (drop("/tf"), "topic /tf: expected 2 views"),
        (drop("/views/001/camera"), "topic /views/NNN/camera: expected 2 views"),
        (drop("/views/001/triangles"), "/views/001/triangles"),
        (
            drop(*(f"/views/000/{k}" for k in ("image", "camera", "depth", "triangles"))),
            "topic /views/NNN/image: expected 2 views",
        ),
        (lambda messages: [], "expected 2 views, as the metadata say, found 0"),
        (lambda messages: messages + messages[:1], "a second one"),
        (edit("/views/000/image", format="jpeg"), "the format `png`, found `jpeg`"),
        (edit("/views/000/image", data=b"\x89PNG\r\n\x1a\nnonsense"), "a PNG of 32 × 24 pixels"),
        (
            edit("/views/000/image", data=png(np.zeros((8, 8, 3), np.uint8))),
            "a PNG of 32 × 24 pixels, found 8 × 8",
        ),
        (edit("/views/000/image", data=png(np.zeros((24, 32), np.uint8))), "8-bit RGB"),
        (edit("/views/000/triangles", encoding="16UC1"), "a packed 32SC1 image"),
        (edit("/views/000/triangles", width=31), "a packed 32SC1 image, found 31 × 24"),
        (edit("/views/000/triangles", data=b"1234"), "4 bytes"),
        (edit("/tf", child_frame_id="view_007"), "a second one"),
    ],
)
def test_a_foreign_file_is_refused_with_the_reason(tmp_path, change, reason):
    path = two_views(tmp_path / "v.mcap", change=change)
    with pytest.raises(FormatError, match=re.escape(reason)) as error:
        ViewsFile.read(path)
    assert str(path) in str(error.value)


def test_metadata_and_existence_are_asked_for(tmp_path):
    with pytest.raises(FormatError, match="metadata: expected one record named `semfm`"):
        ViewsFile.read(two_views(tmp_path / "v.mcap", metadata=None))
    for wrong, reason in (
        ({"format": "semfm.embeddings/1"}, "key `format`: expected semfm.views/1"),
        ({"n_views": "3"}, "3 views, as the metadata say"),
        ({"width": "33"}, "33 × 24 pixels, as the metadata say"),
    ):
        with pytest.raises(FormatError, match=re.escape(reason)):
            ViewsFile.read(two_views(tmp_path / "v.mcap", metadata={**METADATA, **wrong}))
    with pytest.raises(FileError, match="No such file"):
        ViewsFile.read(tmp_path / "nowhere.mcap")
