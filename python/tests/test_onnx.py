"""From views file to embeddings file with a tiny ONNX network, through the real command."""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from emb_reader import per_patch, read_embeddings, tokens
from semfm import Embeddings, ViewsFile
from semfm.sidecar import EmbedSettings, SidecarError, embed_file, open_encoder
from semfm.sidecar.cli import main
from semfm.sidecar.onnx_encoder import read_description
from tiny_onnx import foretold, write_encoder
from views_builder import METADATA, asymmetric_picture, disc, write_views

pytest.importorskip("onnxruntime")

PICTURES = [asymmetric_picture(32, 48, 8, seed) for seed in range(3)]
MASKS = [disc(32, 48)] * 3


@pytest.fixture
def views(tmp_path):
    return write_views(tmp_path / "v.views.mcap", PICTURES, MASKS)


@pytest.mark.parametrize("layout", ["NCHW", "NHWC"])
@pytest.mark.parametrize("rolls", [1, 2, 4])
def test_patches_come_out_in_order_whatever_the_rolls(tmp_path, views, layout, rolls):
    encoder = open_encoder(str(write_encoder(tmp_path, layout)))
    settings = EmbedSettings(rolls=rolls, batch=2, dtype="f32")
    embed_file(views, tmp_path / "e.mcap", encoder, settings)
    topics, _ = read_embeddings(tmp_path / "e.mcap")
    for i, picture in enumerate(PICTURES):
        (message,) = topics[f"/views/{i:03}/embeddings"]
        assert (message.rows, message.cols, message.dim) == (4, 6, 7)
        np.testing.assert_allclose(tokens(message), foretold(picture), atol=1e-5)


def test_the_file_keeps_the_contract(tmp_path, views, capsys):
    path = tmp_path / "e.emb.mcap"
    model = write_encoder(tmp_path)
    assert main([str(views), "-o", str(path), "--model", str(model)]) == 0
    captured = capsys.readouterr()
    assert captured.out == f"{path}\n"
    topics, metadata = read_embeddings(path)
    assert sorted(topics) == sorted(
        [f"/views/{i:03}/{kind}" for i in range(3) for kind in ("camera", "embeddings")] + ["/tf"]
    )
    (message,) = topics["/views/001/embeddings"]
    assert message.frame_id == "view_001" and message.timestamp.seconds == 1
    assert message.dtype == "f16" and len(message.data) == 2 * 4 * 6 * 7
    np.testing.assert_allclose(tokens(message), foretold(PICTURES[1]), atol=1e-3)
    assert (message.x0, message.y0, message.x1, message.y1) == (0, 0, 48, 32)
    by_hand = np.rint(255 * MASKS[1].reshape(4, 8, 6, 8).mean((1, 3)))
    np.testing.assert_array_equal(per_patch(message, "coverage"), by_hand)
    assert (per_patch(message, "valid") == 1).all()
    kept = {**METADATA, "n_views": "3", "width": "48", "height": "32"}
    assert metadata.items() >= {**kept, "format": "semfm.embeddings/1"}.items()
    assert metadata["encoder"] == "tiny.json" and metadata["revision"].startswith("sha256:")
    assert metadata["rolls"] == "4" and "5 x" in metadata["outliers"]
    assert json.loads(metadata["preprocessing"])["std"] == [0.5, 0.25, 0.2]


def test_cameras_and_poses_are_those_of_the_views(tmp_path, views):
    embed_file(views, tmp_path / "e.mcap", open_encoder(str(write_encoder(tmp_path))))
    assert Embeddings.read(tmp_path / "e.mcap").cameras == ViewsFile.read(views).cameras

    def numbers(message):
        return [value for _, value in message.ListFields()]

    def told(path):
        """Intrinsics and poses as another reader finds them."""
        topics, _ = read_embeddings(path)
        cameras = [topics[f"/views/{i:03}/camera"][0] for i in range(3)]
        poses = [
            (m.parent_frame_id, m.child_frame_id, *numbers(m.translation), *numbers(m.rotation))
            for m in topics["/tf"]
        ]
        return [(m.frame_id, m.width, m.height, m.K, m.P) for m in cameras], poses

    assert told(tmp_path / "e.mcap") == told(views)


def test_the_same_bytes_at_every_thread_and_batch_count(tmp_path, views):
    written = []
    for threads, batch in ((1, 1), (3, 2), (2, 14)):
        encoder = open_encoder(str(write_encoder(tmp_path)), threads=threads)
        embed_file(views, tmp_path / "e.mcap", encoder, EmbedSettings(batch=batch))
        written.append((tmp_path / "e.mcap").read_bytes())
    assert written[0] == written[1] == written[2]


def test_a_picture_of_another_size_is_resized_and_the_grid_still_covers_it(tmp_path):
    picture = asymmetric_picture(36, 54, 9)  # nearest multiples of 16: 32 × 48
    views = write_views(tmp_path / "v.mcap", [picture], [disc(36, 54)])
    embed_file(views, tmp_path / "e.mcap", open_encoder(str(write_encoder(tmp_path))))
    (message,) = read_embeddings(tmp_path / "e.mcap")[0]["/views/000/embeddings"]
    assert (message.x0, message.y0, message.x1, message.y1) == (0, 0, 54, 36)
    small = asymmetric_picture(32, 48, 8)  # the same colours
    found, wanted = tokens(message).reshape(-1, 7), foretold(small).reshape(-1, 7)
    cosines = (
        (found * wanted).sum(1) / np.linalg.norm(found, axis=1) / np.linalg.norm(wanted, axis=1)
    )
    assert (message.rows, message.cols) == (4, 6)
    assert np.median(cosines) > 0.98 and np.argmax(found @ wanted.T, axis=1).tolist() == list(
        range(24)
    )


@pytest.mark.parametrize(
    "changes, reason",
    [
        ({"format": "semfm.encoder/2"}, "format"),
        ({"patch": None}, "patch"),
        ({"patch": 0}, "patch"),
        ({"patch": True}, "patch"),
        ({"size_multiple": 12}, "multiple of the patch"),
        ({"mean": [0.5, 0.5]}, "mean"),
        ({"std": [0.5, 0.5, 0]}, "std"),
        ({"mean": [0.5, 0.5, float("nan")]}, "mean"),
        ({"outputs": []}, "outputs"),
        ({"outputs": ["mean", "mean"]}, "outputs"),
        ({"outputs": "mean"}, "outputs"),
        ({"layout": "CHW"}, "layout"),
        ({"onnx": ""}, "onnx"),
        ({"onnx": "../tiny.onnx"}, "inside the folder"),
        ({"onnx": "a/../../tiny.onnx"}, "inside the folder"),
        ({"onnx": "/tmp/tiny.onnx"}, "inside the folder"),
        ({"onnx": "a\0b"}, "inside the folder"),
        ({"pach": 8}, "pach"),
    ],
)
def test_a_wrong_description_is_refused_by_field(tmp_path, changes, reason):
    path = write_encoder(tmp_path, **changes)
    with pytest.raises(SidecarError, match=reason) as error:
        read_description(path)
    assert str(path) in str(error.value)


def test_any_text_is_a_description_or_refused_in_a_line(tmp_path):
    good = write_encoder(tmp_path).read_bytes()
    path = tmp_path / "m.json"
    path.write_bytes(b"\xef\xbb\xbf" + good)  # a byte-order mark
    assert read_description(path).patch == 8
    for text in (b"", b"[]", b"\xff\xfe", b"[" * 100_000, good[:-3], b'{"format": 5}'):
        path.write_bytes(text)
        with pytest.raises(SidecarError, match="m.json"):
            read_description(path)


@pytest.mark.parametrize(
    "changes, reason",
    [
        ({"input": "picture"}, "inputs"),
        ({"outputs": ["mean", "nothing"]}, "nothing"),
        ({"onnx": "nowhere.onnx"}, "nowhere.onnx"),
        ({"onnx": "tiny.json"}, "onnxruntime can load"),
        ({"patch": 16}, "2×3 tokens"),
        ({"layout": "NHWC"}, "tiny.onnx"),
    ],
)
def test_a_description_that_does_not_fit_the_network_writes_nothing(
    tmp_path, views, changes, reason, capsys
):
    model = write_encoder(tmp_path, "NCHW", **{k: v for k, v in changes.items() if k != "layout"})
    if "layout" in changes:
        model.write_text(model.read_text().replace('"layout": "NCHW"', '"layout": "NHWC"', 1))
    assert main([str(views), "-o", str(tmp_path / "e.mcap"), "--model", str(model)]) == 2
    captured = capsys.readouterr()
    assert reason in captured.err and captured.out == ""
    assert not list(tmp_path.glob("*e.mcap*"))


def test_many_files_go_through_one_encoder_into_a_folder(tmp_path, views, capsys):
    model, folder = write_encoder(tmp_path), tmp_path / "embedded"
    pair = [tmp_path / "a.views.mcap", tmp_path / "b.views.mcap"]
    for path in pair:
        path.write_bytes(views.read_bytes())
    shared = ["--output-folder", str(folder), "--model", str(model)]
    assert main([*map(str, pair), *shared]) == 0
    written = [folder / "a.emb.mcap", folder / "b.emb.mcap"]
    assert capsys.readouterr().out.splitlines() == list(map(str, written))
    assert main([str(pair[0]), "-o", str(tmp_path / "one.emb.mcap"), *shared[2:]]) == 0
    alone = (tmp_path / "one.emb.mcap").read_bytes()
    assert [path.read_bytes() for path in written] == [alone, alone]

    assert main([*map(str, pair), "-o", str(tmp_path / "x.mcap"), *shared[2:]]) == 2
    assert "--output-folder" in capsys.readouterr().err
    assert main([str(pair[0]), str(pair[0]), *shared]) == 2
    assert "another name" in capsys.readouterr().err
    assert main([str(model), *shared]) == 2
    assert "NAME.views.mcap" in capsys.readouterr().err
    assert main([str(pair[0]), "--output-folder", str(model), *shared[2:]]) == 2
    assert str(model) in capsys.readouterr().err


def test_bad_input_leaves_an_older_output_alone(tmp_path, views, capsys):
    output = tmp_path / "e.mcap"
    output.write_bytes(b"older")
    views.write_bytes(views.read_bytes()[:-40])
    arguments = [str(views), "-o", str(output), "--model", str(write_encoder(tmp_path))]
    assert main(arguments) == 2
    assert (
        "it was cut or never finished" in capsys.readouterr().err
        and output.read_bytes() == b"older"
    )
    assert main([str(views), "-o", str(views), *arguments[3:]]) == 2
    assert main([str(views), "-o", str(tmp_path / "no" / "e.mcap"), *arguments[3:]]) == 2
    assert main([*arguments, "--batch", "0"]) == 2
    assert main([*arguments, "--threads", "0"]) == 2


def test_the_module_runs_as_a_command_and_reports_progress_as_json(tmp_path, views):
    command = [sys.executable, "-m", "semfm.sidecar", str(views), "-o", str(tmp_path / "e.mcap")]
    command += ["--model", str(write_encoder(tmp_path)), "--progress", "json", "--batch", "2"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ, check=True)
    assert done.stdout == f"{tmp_path / 'e.mcap'}\n"
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert [(line["done"], line["total"]) for line in lines] == [(0, 12), (8, 12), (12, 12)]


def documented_encoder() -> str:
    """The example in docs/encoders.md."""
    text = (Path(__file__).parents[2] / "docs" / "encoders.md").read_text("utf-8")
    (code,) = [
        block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "class " in block
    ]
    return code


def test_an_encoder_may_be_a_class_of_ones_own(tmp_path, views, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mean_colors.py").write_text(documented_encoder())
    assert main([str(views), "-o", "e.mcap", "--model", "mean_colors:MeanColors"]) == 0
    embeddings = Embeddings.read("e.mcap")
    assert (embeddings.encoder, embeddings.dim, embeddings.n_views) == ("mean-colors", 3, 3)
    mean = PICTURES[2].reshape(2, 16, 3, 16, 3).mean((1, 3))
    unit = mean / np.linalg.norm(mean, axis=-1, keepdims=True)
    np.testing.assert_allclose(embeddings.patches[2].data, unit, atol=1e-3)


@pytest.mark.parametrize(
    "code, reason",
    [
        ("", "has no attribute 'Own'"),
        ("import nowhere_at_all", "No module named 'nowhere_at_all'"),
        ("class Own: pass", "takes no arguments"),
        ("def Own(device, threads): pass", "own:Own: name: expected text, found None"),
        ("class Own:\n def __init__(self, **_): self.name = self.revision = ''", "preprocessing"),
        (
            "class Own:\n name = revision = preprocessing = ''\n def __init__(self, **_): pass",
            "grid: expected a method",
        ),
    ],
)
def test_a_class_that_is_no_encoder_is_refused(tmp_path, views, monkeypatch, capsys, code, reason):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "own", raising=False)
    (tmp_path / "own.py").write_text(code)
    importlib.invalidate_caches()
    assert main([str(views), "-o", "e.mcap", "--model", "own:Own"]) == 2
    assert reason in capsys.readouterr().err and not (tmp_path / "e.mcap").exists()


def test_a_missing_runtime_is_named_with_what_to_install(tmp_path, views, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    monkeypatch.setitem(sys.modules, "torch", None)
    for model, hint in ((write_encoder(tmp_path), "pip install onnxruntime"), (tmp_path, "pip install torch transformers")):
        assert main([str(views), "-o", str(tmp_path / "e.mcap"), "--model", str(model)]) == 2
        error = capsys.readouterr().err
        assert hint in error and error.count("\n") == 1
