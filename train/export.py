"""Writes a trained net for the Rust crate, and as ONNX for comparison.

    python -m train.export CHECKPOINT -o builtin.net --onnx builtin.onnx

A `.net` file:

    8 bytes     SEMFMNET
    u32         version of the format, 1 (little-endian, as all numbers)
    u32         length of the JSON in bytes
    JSON        name, version, size, patch, channels, mean, std, background, layers, provenance
    float16     for each convolution, in order, its weights (out, in / groups, kernel, kernel)
                row-major, then its bias (out,)
    32 bytes    BLAKE3 of everything before

Layers: {"op": "conv", "in", "out", "kernel", "stride", "padding", "dilation", "groups", "relu"},
{"op": "save"} remembers the activation, {"op": "add", "relu"} adds the remembered one.

The last convolution gives the 64 components and a constant one: tokens are scaled to unit length by
their reader, and the constant keeps a token that is near the mean of all tokens short instead of
blowing it up to a random direction.
"""

from __future__ import annotations

import argparse
import json
import struct
from pathlib import Path

import numpy as np
import torch

from .checkpoint import Checkpoint
from .examples import MEAN, STD
from .net import PATCH, SIZE, Add, Conv, Folded, Layer, Save, Student, folded

MAGIC, VERSION = b"SEMFMNET", 1
NAME, NET_VERSION = "builtin", "1"
#: Length of the constant component, beside components whose root mean square length is one.
CONSTANT = 1.0


def exported_layers(student: Student, constant: float = CONSTANT) -> list[Layer]:
    """Plain layers with the constant component, their weights rounded to float16."""
    layers = folded(student)
    head = layers[-1]
    assert isinstance(head, Conv), "the net ends in a convolution"
    zeros = torch.zeros_like(head.weight[:1])
    weight = torch.cat([head.weight, zeros])
    bias = torch.cat([head.bias, torch.tensor([constant])])
    layers[-1] = Conv(weight, bias, head.stride, head.padding, head.dilation, head.relu)
    return [_rounded(layer) for layer in layers]


def _rounded(layer: Layer) -> Layer:
    if not isinstance(layer, Conv):
        return layer
    weight, bias = layer.weight.half().float(), layer.bias.half().float()
    if not (weight.isfinite().all() and bias.isfinite().all()):
        raise ValueError("a weight does not fit into float16")
    return Conv(weight, bias, layer.stride, layer.padding, layer.dilation, layer.relu)


def net_bytes(layers: list[Layer], provenance: dict) -> bytes:
    """The content of a `.net` file."""
    description = {
        "name": NAME,
        "version": NET_VERSION,
        "size": SIZE,
        "patch": PATCH,
        "channels": ["grey"],
        "mean": [MEAN],
        "std": [STD],
        "background": "white",
        "layers": [_described(layer) for layer in layers],
        "provenance": provenance,
    }
    text = json.dumps(description, ensure_ascii=False).encode()
    content = MAGIC + struct.pack("<II", VERSION, len(text)) + text
    for layer in layers:
        if isinstance(layer, Conv):
            for tensor in (layer.weight, layer.bias):
                content += tensor.numpy().astype("<f2").tobytes()
    return content + _blake3(content)


def _described(layer: Layer) -> dict:
    if isinstance(layer, Save):
        return {"op": "save"}
    if isinstance(layer, Add):
        return {"op": "add", "relu": layer.relu}
    n_out, n_in, kernel, _ = layer.weight.shape
    return {
        "op": "conv",
        "in": n_in,
        "out": n_out,
        "kernel": kernel,
        "stride": layer.stride,
        "padding": layer.padding,
        "dilation": layer.dilation,
        "groups": 1,
        "relu": layer.relu,
    }


def read_net(content: bytes) -> tuple[dict, list[Layer]]:
    """Description and layers of a `.net` file; raises ValueError where it is damaged."""
    if content[:8] != MAGIC:
        raise ValueError(f"expected {MAGIC!r} at the start, found {content[:8]!r}")
    version, length = struct.unpack("<II", content[8:16])
    if version != VERSION:
        raise ValueError(f"expected format version {VERSION}, found {version}")
    if _blake3(content[:-32]) != content[-32:]:
        raise ValueError("the checksum does not fit the content: the file is damaged")
    description = json.loads(content[16 : 16 + length])
    numbers = np.frombuffer(content[16 + length : -32], "<f2").astype(np.float32)
    layers: list[Layer] = []
    at = 0
    for entry in description["layers"]:
        if entry["op"] == "save":
            layers.append(Save())
        elif entry["op"] == "add":
            layers.append(Add(entry["relu"]))
        else:
            shape = (entry["out"], entry["in"] // entry["groups"], entry["kernel"], entry["kernel"])
            n = int(np.prod(shape))
            weight = torch.from_numpy(numbers[at : at + n].reshape(shape).copy())
            bias = torch.from_numpy(numbers[at + n : at + n + shape[0]].copy())
            at += n + shape[0]
            layers.append(
                Conv(
                    weight,
                    bias,
                    entry["stride"],
                    entry["padding"],
                    entry["dilation"],
                    entry["relu"],
                )
            )
    if at != len(numbers):
        raise ValueError(f"expected {at} weights, found {len(numbers)}")
    return description, layers


def _blake3(content: bytes) -> bytes:
    from blake3 import blake3

    return blake3(content).digest()


class _FromRgb(torch.nn.Module):
    """The net behind RGB pictures, as ENCODER.json feeds them: grey first."""

    def __init__(self, layers: list[Layer]) -> None:
        super().__init__()
        self.net = Folded(layers)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        luma = torch.tensor([0.299, 0.587, 0.114]).reshape(1, 3, 1, 1)
        grey = (image * luma).sum(1, keepdim=True)
        return self.net(((grey / 255) - MEAN) / STD)


def write_onnx(layers: list[Layer], path: Path) -> None:
    """An ONNX twin of the net and its ENCODER.json, beside each other."""
    model = _FromRgb(layers).eval()
    torch.onnx.export(
        model,
        (torch.zeros(1, 3, SIZE, SIZE),),
        str(path),
        input_names=["image"],
        output_names=["tokens"],
        dynamic_axes={"image": {0: "n"}, "tokens": {0: "n"}},
        opset_version=13,
        dynamo=False,
    )
    description = {
        "format": "semfm.encoder/1",
        "onnx": path.name,
        "input": "image",
        "layout": "NCHW",
        "mean": [0.0, 0.0, 0.0],
        "std": [1 / 255, 1 / 255, 1 / 255],
        "size_multiple": SIZE,
        "outputs": ["tokens"],
        "output_layout": "NCHW",
        "patch": PATCH,
    }
    path.with_suffix(".json").write_text(json.dumps(description, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkpoint", help="of train.train, or 'random' for untrained weights")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.net")
    parser.add_argument("--onnx", type=Path, metavar="FILE.onnx")
    parser.add_argument("--constant", type=float, default=CONSTANT)
    parser.add_argument("--seed", type=int, default=0, help="of random weights")
    arguments = parser.parse_args()
    if arguments.checkpoint == "random":
        student, provenance = random_student(arguments.seed), {"weights": "random, not trained"}
    else:
        checkpoint = Checkpoint.read(Path(arguments.checkpoint))
        student, provenance = checkpoint.student(), checkpoint.provenance
    layers = exported_layers(student, arguments.constant)
    content = net_bytes(layers, provenance)
    arguments.output.write_bytes(content)
    print(f"wrote {arguments.output} ({len(content)} bytes)")
    if arguments.onnx:
        write_onnx(layers, arguments.onnx)
        print(f"wrote {arguments.onnx} and {arguments.onnx.with_suffix('.json')}")


def random_student(seed: int) -> Student:
    """Untrained weights whose residual branches count, their norms set by random pictures: the
    floor that a trained net has to clear."""
    torch.manual_seed(seed)
    student = Student()
    for block in [student.fine, *student.coarse]:
        torch.nn.init.ones_(block.second.norm.weight)
    student.train()
    with torch.no_grad():
        for _ in range(30):
            student(torch.rand(8, 1, SIZE, SIZE) * 2 - 1)
    return student.eval()


if __name__ == "__main__":
    main()
