"""The built-in encoder: our forward pass against onnxruntime's, and what it is in Python."""

from __future__ import annotations

import json
import pickle
import struct
from pathlib import Path

import numpy as np
import pytest

import semfm

WEIGHTS = (
    Path(__file__).resolve().parents[2] / "crates" / "semfm-encoder" / "weights" / "builtin.net"
)


def read_net(path: Path) -> tuple[dict, list[tuple[np.ndarray, np.ndarray]]]:
    """Header and (weights, bias) of each convolution, read by the format's description alone."""
    content = path.read_bytes()
    assert content[:8] == b"SEMFMNET"
    version, length = struct.unpack("<II", content[8:16])
    assert version == 1
    header = json.loads(content[16 : 16 + length])
    numbers = np.frombuffer(content[16 + length : -32], "<f2").astype(np.float32)
    parts, at = [], 0
    for layer in header["layers"]:
        if layer["op"] == "conv":
            shape = (layer["out"], layer["in"] // layer["groups"], layer["kernel"], layer["kernel"])
            n = int(np.prod(shape))
            parts.append((numbers[at : at + n].reshape(shape), numbers[at + n :][: layer["out"]]))
            at += n + layer["out"]
    assert at == len(numbers)
    return header, parts


def as_onnx(path: Path):
    """The same network as an ONNX model: input ``image`` (n × channels × height × width)."""
    onnx = pytest.importorskip("onnx")
    from onnx import TensorProto, helper, numpy_helper

    header, parts = read_net(path)
    nodes, weights, name, saved = [], [], "image", None
    for number, layer in enumerate(header["layers"]):
        made = f"t{number}"
        if layer["op"] == "save":
            saved = name
            continue
        if layer["op"] == "conv":
            weight, bias = parts.pop(0)
            weights += [numpy_helper.from_array(weight, f"w{number}")]
            weights += [numpy_helper.from_array(bias, f"b{number}")]
            settings = {
                "kernel_shape": [layer["kernel"]] * 2,
                "strides": [layer["stride"]] * 2,
                "pads": [layer["padding"]] * 4,
                "dilations": [layer["dilation"]] * 2,
                "group": layer["groups"],
            }
            inputs = [name, f"w{number}", f"b{number}"]
            nodes.append(helper.make_node("Conv", inputs, [made], **settings))
        else:
            nodes.append(helper.make_node("Add", [name, saved], [made]))
        name = made
        if layer.get("relu"):
            nodes.append(helper.make_node("Relu", [made], [made + "r"]))
            name = made + "r"
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, ["n", 1, "h", "w"])
    tokens = helper.make_tensor_value_info(name, TensorProto.FLOAT, [None] * 4)
    graph = helper.make_graph(nodes, "net", [image], [tokens], weights)
    opset = [helper.make_opsetid("", 13)]
    model = helper.make_model(graph, opset_imports=opset, ir_version=8)
    onnx.checker.check_model(model)
    return header, model


@pytest.fixture(scope="module")
def mug():
    return semfm.demo_object("containers", n_vertices=1500)


def test_tokens_are_those_of_onnxruntime(mug):
    onnxruntime = pytest.importorskip("onnxruntime")
    header, model = as_onnx(WEIGHTS)
    assert header["channels"] == ["grey"]
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    views = semfm.render(mug.mesh)
    rgb = np.stack([view.rgb for view in views]).astype(np.float32)
    grey = rgb @ np.array([0.299, 0.587, 0.114], np.float32) / 255
    image = (grey[:, None] - header["mean"][0]) / header["std"][0]
    (tokens,) = session.run(None, {"image": image.astype(np.float32)})
    tokens = tokens.transpose(0, 2, 3, 1)
    tokens /= np.linalg.norm(tokens, axis=-1, keepdims=True)

    embeddings = semfm.embed(mug.mesh)
    assert embeddings.n_views == len(views) == 14
    for expected, patches in zip(tokens, embeddings.patches):
        assert patches.data.shape == expected.shape
        cosine = (patches.data * expected).sum(-1)
        # Every token, not the mean: f32 products in another order.
        assert cosine.min() >= 0.99999


def test_coverage_is_the_share_of_a_patch_that_the_object_fills(mug):
    patch = read_net(WEIGHTS)[0]["patch"]
    for view, patches in zip(semfm.render(mug.mesh), semfm.embed(mug.mesh).patches):
        rows, cols = patches.coverage.shape
        on_object = (view.triangles >= 0).reshape(rows, patch, cols, patch)
        share = np.rint(255 * on_object.mean((1, 3)))
        np.testing.assert_array_equal(patches.coverage, share)
        np.testing.assert_array_equal(patches.rect, [0, 0, cols * patch, rows * patch])


def test_rolls_average_what_turned_pictures_say(mug):
    once, twice, four = (semfm.embed(mug.mesh, rolls=rolls) for rolls in (1, 2, 4))
    assert [e.metadata["rolls"] for e in (once, twice, four)] == ["1", "2", "4"]
    lengths = [np.linalg.norm(e.patches[0].data, axis=-1) for e in (once, twice, four)]
    np.testing.assert_allclose(lengths[0], 1, atol=1e-5)
    # Means of unit vectors: shorter where the turns disagree.
    assert lengths[1].max() <= 1 + 1e-5 and lengths[2].min() < 1
    with pytest.raises(semfm.InvalidInput, match="rolls"):
        semfm.embed(mug.mesh, rolls=3)


def test_it_is_the_default_and_reports_name_it(mug):
    other = semfm.demo_object("containers", instance=1, n_vertices=1500)
    short = semfm.transfer(mug.mesh, other.mesh, mug.region)
    by_name = semfm.transfer(mug.mesh, other.mesh, mug.region, encoder="builtin")
    prepared = [semfm.prepare(o.mesh) for o in (mug, other)]
    by_hand = semfm.transfer(
        mug.mesh,
        other.mesh,
        mug.region,
        source_embeddings=semfm.embed(mug.mesh),
        target_embeddings=semfm.embed(other.mesh),
    )
    matched = semfm.Matching(*prepared).transfer(mug.region)
    for result in (by_name, by_hand, matched):
        np.testing.assert_array_equal(result.region.weights, short.region.weights)

    about = prepared[0].encoder
    assert about["name"] == "builtin" and about["version"].startswith("1+")
    assert about["rolls"] == 1 and about["n_views"] == 14
    assert {"views", "embed", "lift", "shape"} <= set(prepared[0].stages_ms)
    again = pickle.loads(pickle.dumps(prepared[0]))
    assert again.encoder == about
    embeddings = semfm.embed(mug.mesh)
    assert embeddings.encoder == "builtin" and embeddings.metadata["revision"] == about["version"]
    assert not embeddings.simulated


def test_what_is_kept_gives_the_same_answer(mug, tmp_path):
    made = semfm.embed(mug.mesh, cache=tmp_path)
    (kept,) = tmp_path.rglob("*.emb.mcap")
    assert semfm.Embeddings.read(kept).patches[3].data.tobytes() == made.patches[3].data.tobytes()
    before = kept.read_bytes()
    again = semfm.embed(mug.mesh, cache=tmp_path)
    assert kept.read_bytes() == before
    assert again.patches[3].data.tobytes() == made.patches[3].data.tobytes()


def test_a_file_of_weights_is_an_encoder_and_a_damaged_one_says_where(mug, tmp_path):
    own = tmp_path / "own.net"
    own.write_bytes(WEIGHTS.read_bytes())
    by_file, builtin = semfm.embed(mug.mesh, encoder=str(own)), semfm.embed(mug.mesh)
    assert by_file.patches[0].data.tobytes() == builtin.patches[0].data.tobytes()
    damaged = tmp_path / "damaged.net"
    damaged.write_bytes(WEIGHTS.read_bytes()[:-1])
    with pytest.raises(semfm.FormatError, match=r"damaged\.net: checksum"):
        semfm.embed(mug.mesh, encoder=str(damaged))
    with pytest.raises(semfm.FileError, match=r"absent\.net"):
        semfm.embed(mug.mesh, encoder=str(tmp_path / "absent.net"))


def test_two_sources_of_features_are_refused(mug):
    features = np.ones((mug.mesh.n_vertices, 3))
    with pytest.raises(semfm.InvalidInput, match="encoder"):
        semfm.prepare(mug.mesh, features=features, encoder="builtin")
