"""Any ONNX network as an encoder, described by a small JSON file.

::

    {"format": "semfm.encoder/1",
     "onnx": "network.onnx",             beside the JSON
     "input": "image",                   name of the one input
     "layout": "NCHW",                   or "NHWC": of the input
     "mean": [0.5, 0.5, 0.5],            input = (rgb / 255 - mean) / std
     "std": [0.5, 0.5, 0.5],
     "size_multiple": 32,                height and width must be multiples of this
     "outputs": ["s16", "s16d"],         scaled to unit length each, then concatenated
     "output_layout": "NCHW",            or "NHWC"
     "patch": 16,                        pixels of the input per token, the same for all outputs
     "licence": "…", "source": "…"}      optional

Token (r, c) stands for the input's pixels [patch·r, patch·(r+1)) × [patch·c, patch·(c+1)).
A picture whose size is no multiple of ``size_multiple`` is resized to the nearest one.
"""

from __future__ import annotations

import hashlib
import json
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from .._files import read_json
from .._semfm import read_file
from ..errors import SemfmError
from .encoder import Grid
from .errors import SidecarError, expected
from .onnx_files import external_files

FORMAT = "semfm.encoder/1"
#: No number of a description is larger: pictures have some hundred pixels.
LARGEST = 4096
#: A smaller standard deviation is a mistake.
SMALLEST = 1e-6
_LAYOUTS = ("NCHW", "NHWC")


@dataclass(frozen=True)
class OnnxDescription:
    """A checked ``semfm.encoder/1`` file; the fields are the JSON's."""

    path: str
    onnx: str
    input: str
    layout: str
    size_multiple: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    outputs: tuple[str, ...]
    output_layout: str
    patch: int


def read_description(path: str | os.PathLike[str]) -> OnnxDescription:
    """Read and check a ``semfm.encoder/1`` file; the SemfmError names the field at fault."""
    path = os.fspath(path)
    try:
        found = read_json(path)
    except SemfmError as error:
        raise SidecarError(str(error)) from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        what = found.get("format") if isinstance(found, dict) else type(found).__name__
        raise expected(path, "format", f"'{FORMAT}'", repr(what))
    required = set(OnnxDescription.__dataclass_fields__) - {"path"} | {"format"}
    for key in sorted(required - set(found)):
        raise expected(path, key, "a value", "none")
    for key in sorted(set(found) - required - {"licence", "source"}):
        raise expected(path, "encoder", "known fields only", repr(key))

    def check(key: str, ok: bool, wanted: str) -> Any:
        if not ok:
            raise expected(path, key, wanted, json.dumps(found[key]))
        return found[key]

    def text(key: str) -> str:
        return check(key, isinstance(found[key], str) and found[key] != "", "a non-empty string")

    def whole(key: str) -> int:
        ok = type(found[key]) is int and 0 < found[key] <= LARGEST
        return check(key, ok, f"a whole number from 1 to {LARGEST}")

    def rgb(key: str) -> tuple[float, float, float]:
        value = found[key]
        ok = isinstance(value, list) and len(value) == 3
        ok = ok and all(type(v) in (int, float) and abs(v) <= LARGEST for v in value)
        return tuple(check(key, ok, f"three numbers of at most {LARGEST}"))  # type: ignore[return-value]

    std = rgb("std")
    check("std", min(std) >= SMALLEST, f"three numbers of at least {SMALLEST:g}")
    names = found["outputs"]
    ok = isinstance(names, list) and len(names) > 0 and all(isinstance(n, str) for n in names)
    check("input", isinstance(found["input"], str), "the name of the input")
    check("outputs", ok and len(set(names)) == len(names), "a list of different names")
    check("layout", found["layout"] in _LAYOUTS, " or ".join(_LAYOUTS))
    check("output_layout", found["output_layout"] in _LAYOUTS, " or ".join(_LAYOUTS))
    check("size_multiple", whole("size_multiple") % whole("patch") == 0, "a multiple of the patch")
    return OnnxDescription(
        path=path,
        onnx=_beside(path, text("onnx")),
        input=text("input"),
        layout=found["layout"],
        size_multiple=found["size_multiple"],
        mean=rgb("mean"),
        std=std,
        outputs=tuple(names),
        output_layout=found["output_layout"],
        patch=found["patch"],
    )


def open_onnx(path: str, device: str = "cpu", threads: int = 1) -> OnnxEncoder:
    """The encoder of a ``semfm.encoder/1`` file.

    Raises
    ------
    SidecarError
        If the JSON or the network is missing or wrong, or onnxruntime is not installed.
    """
    description = read_description(path)
    return OnnxEncoder(description, description.onnx, device, threads)
def _beside(path: str, name: str) -> str:
    """The network's path: a file of the JSON's folder, wherever links lead."""
    folder = os.path.dirname(path) or "."
    network = os.path.join(folder, name)
    try:
        real_folder, real = os.path.realpath(folder), os.path.realpath(network)
        inside = os.path.commonpath([real_folder, real]) == real_folder
    except ValueError:  # a zero byte, or another drive
        inside = False
    if not inside or os.path.isabs(name):
        raise expected(path, "onnx", "a file inside the folder of the JSON", repr(name))
    return network


class OnnxEncoder:
    """An :class:`.encoder.Encoder` on onnxruntime.

    Parameters
    ----------
    description
        How the network is fed; its ``path`` names the encoder.
    network
        The ONNX file, or what stands in one.
    device
        ``auto`` and ``cpu`` run on the CPU, ``cuda`` on onnxruntime's CUDA provider.
    threads
        CPU threads.
    install
        The command that installs onnxruntime, for the error where it is missing.
    """

    def __init__(
        self,
        description: OnnxDescription,
        network: str | bytes,
        device: str = "cpu",
        threads: int = 1,
        install: str = "pip install onnxruntime",
    ) -> None:
        self.description = description
        content = network if isinstance(network, bytes) else read_network(network)
        self._session = _open_session(description, network, device, install)
        # One picture per thread and one thread per picture: faster than onnxruntime's own threads
        # (they spin: twice the CPU time on two cores), and the same bits at every thread and batch
        # count. A GPU takes the batch whole.
        self._pool = None if device == "cuda" else ThreadPoolExecutor(threads)
        self.name = os.path.basename(description.path)
        self.revision = _revision(description.onnx, content)
        settings = {
            "layout": description.layout,
            "mean": description.mean,
            "std": description.std,
            "size_multiple": description.size_multiple,
            "resize": "bilinear to the nearest multiple",
            "outputs": description.outputs,
            "patch": description.patch,
        }
        self.preprocessing = json.dumps(settings)
        # input = rgb · scale + offset, per channel
        mean, std = (np.asarray(x, np.float32) for x in (description.mean, description.std))
        self._scale, self._offset = np.float32(1 / 255) / std, -mean / std

    def grid(self, height: int, width: int) -> Grid:
        """Tokens tile the whole picture."""
        rows, cols = (n // self.description.patch for n in self._input_size(height, width))
        return Grid(rows, cols, (0.0, 0.0, float(width), float(height)))

    def encode(self, pictures: np.ndarray) -> list[np.ndarray]:
        """Raw tokens of each output, (n × rows × cols × d) float32."""
        description = self.description
        height, width = self._input_size(*pictures.shape[1:3])
        batch = _resize(pictures, height, width) * self._scale + self._offset
        if description.layout == "NCHW":
            batch = np.ascontiguousarray(batch.transpose(0, 3, 1, 2))
        grid = (height // description.patch, width // description.patch)
        parts = [batch] if self._pool is None else [batch[i : i + 1] for i in range(len(batch))]
        ran = list(
            map(self._run, parts) if self._pool is None else self._pool.map(self._run, parts)
        )
        outputs = [np.concatenate(arrays) for arrays in zip(*ran)]
        return [self._tokens(n, o, grid) for n, o in zip(description.outputs, outputs)]

    def _run(self, batch: np.ndarray) -> list[np.ndarray]:
        description = self.description
        try:
            return self._session.run(list(description.outputs), {description.input: batch})
        except Exception as error:  # onnxruntime's own family, derived from Exception
            raise SidecarError(f"{description.onnx}: {error}") from error

    def _tokens(self, name: str, output: np.ndarray, grid: tuple[int, int]) -> np.ndarray:
        if output.ndim == 4 and self.description.output_layout == "NCHW":
            output = output.transpose(0, 2, 3, 1)
        if output.ndim != 4 or output.shape[1:3] != grid:
            wanted = f"{grid[0]}×{grid[1]} tokens in {self.description.output_layout}"
            raise expected(self.description.onnx, f"output '{name}'", wanted, output.shape)
        return np.ascontiguousarray(output, np.float32)

    def _input_size(self, height: int, width: int) -> tuple[int, int]:
        multiple = self.description.size_multiple

        def nearest(n: int) -> int:
            return max(multiple, (n + multiple // 2) // multiple * multiple)

        return nearest(height), nearest(width)


def _resize(pictures: np.ndarray, height: int, width: int) -> np.ndarray:
    if pictures.shape[1:3] == (height, width):
        return pictures
    sizes = (width, height)
    resized = [Image.fromarray(p).resize(sizes, Image.Resampling.BILINEAR) for p in pictures]
    return np.stack([np.asarray(picture) for picture in resized])


def read_network(path: str) -> bytes:
    """The bytes of an ONNX file."""
    return read_file(path)


def _revision(path: str, network: bytes) -> str:
    """SHA-256 over the network and the files beside it that hold its weights."""
    digest = hashlib.sha256(network)
    for weights in external_files(path, network):
        digest.update(read_file(weights))
    return f"sha256:{digest.hexdigest()}"


def _open_session(
    description: OnnxDescription, network: str | bytes, device: str, install: str
) -> Any:
    """onnxruntime's session, its input and outputs checked against the description."""
    try:
        import onnxruntime
    except ImportError as error:
        raise SidecarError(
            f"{description.path}: an ONNX encoder needs onnxruntime: {install}"
        ) from error
    if device == "cuda" and "CUDAExecutionProvider" not in onnxruntime.get_available_providers():
        raise SidecarError(
            "--device cuda: this onnxruntime has no CUDA provider: pip install onnxruntime-gpu"
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    gpu = ["CUDAExecutionProvider"] if device == "cuda" else []
    try:
        session = onnxruntime.InferenceSession(
            network, options, providers=[*gpu, "CPUExecutionProvider"]
        )
    except Exception as error:  # onnxruntime's own family, derived from Exception
        raise expected(
            description.onnx, "model", "a network onnxruntime can load", error
        ) from error
    inputs = [i.name for i in session.get_inputs()]
    if inputs != [description.input]:
        raise expected(description.onnx, "inputs", f"one, '{description.input}'", inputs)
    outputs = [o.name for o in session.get_outputs()]
    for name in description.outputs:
        if name not in outputs:
            raise expected(description.onnx, "outputs", f"'{name}'", ", ".join(outputs))
    return session
