"""Writes a tiny ONNX encoder whose tokens are easy to foretell: mean colours of patches."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

PATCH = 8
MIX = np.array([[1, 2, -1], [0, 1, 1], [3, 0, 1], [1, -1, 1]], np.float32)  # (4 × 3)


def write_encoder(folder: Path, layout: str = "NCHW", **changes) -> Path:
    """``tiny.json`` and ``tiny.onnx``: outputs ``mean`` (d = 3) and ``mix`` (d = 4, MIX · mean)."""
    onnx = pytest.importorskip("onnx")
    from onnx import TensorProto, helper, numpy_helper

    image = "image"
    shape = ["n", 3, "h", "w"] if layout == "NCHW" else ["n", "h", "w", 3]
    nodes = []
    if layout == "NHWC":
        nodes.append(helper.make_node("Transpose", [image], ["nchw"], perm=[0, 3, 1, 2]))
        image = "nchw"
    last = "" if layout == "NCHW" else "_nchw"
    pool = {"kernel_shape": [PATCH, PATCH], "strides": [PATCH, PATCH]}
    nodes.append(helper.make_node("AveragePool", [image], ["mean" + last], **pool))
    nodes.append(helper.make_node("Conv", ["mean" + last, "weights"], ["mix" + last]))
    if layout == "NHWC":
        for name in ("mean", "mix"):
            nodes.append(helper.make_node("Transpose", [name + last], [name], perm=[0, 2, 3, 1]))
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)],
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, [None] * 4)
            for name in ("mean", "mix")
        ],
        [numpy_helper.from_array(MIX[:, :, None, None], "weights")],
    )
    opset = [helper.make_opsetid("", 13)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), folder / "tiny.onnx")
    description = {
        "format": "semfm.encoder/1",
        "onnx": "tiny.onnx",
        "input": "image",
        "layout": layout,
        "size_multiple": 16,
        "mean": [0.5, 0.4, 0.3],
        "std": [0.5, 0.25, 0.2],
        "outputs": ["mean", "mix"],
        "output_layout": layout,
        "patch": PATCH,
        "licence": "CC0",
        **changes,
    }
    path = folder / "tiny.json"
    path.write_text(json.dumps({k: v for k, v in description.items() if v is not None}))
    return path


def foretold(picture: np.ndarray) -> np.ndarray:
    """The embeddings (rows × cols × 7) that the tiny encoder must give, rolls or not."""
    rows, cols = picture.shape[0] // PATCH, picture.shape[1] // PATCH
    x = (picture / 255 - [0.5, 0.4, 0.3]) / [0.5, 0.25, 0.2]
    mean = x.reshape(rows, PATCH, cols, PATCH, 3).mean((1, 3))
    parts = [mean, mean @ MIX.T.astype(float)]
    return np.concatenate([p / np.linalg.norm(p, axis=-1, keepdims=True) for p in parts], axis=-1)
