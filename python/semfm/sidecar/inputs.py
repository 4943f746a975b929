"""Everything that embeddings depend on beside the pictures: files, and versions of packages.

``semfm-embed --list-inputs --model MODEL`` prints it as JSON, without loading the network (a model
of the hub is downloaded first where it is not here yet). The caller
(``semfm-cli transfer --encoder``) hashes the files and keeps embeddings under the hash, so that other
weights, another configuration or other code never meet embeddings of before::

    {"format": "semfm.encoder-inputs/1",
     "model": "tiny.json",                         what the embeddings file will call it
     "packages": {"onnxruntime": "1.20.1", …},     installed versions of what does the work
     "files": {"tiny.onnx": "/home/…/tiny.onnx", …},
     "unknown": null}                              why more may matter than is listed, in words

Embeddings with an ``unknown`` part cannot be kept.
"""

from __future__ import annotations

import importlib.metadata
import os
import sys
from pathlib import Path
from typing import Any, Optional

from .. import __version__
from .checkpoint import FILES, present_snapshot
from .class_code import class_files
from .models import PACKAGED, is_class_name, packaged_weights
from .onnx_encoder import read_description, read_network
from .onnx_files import external_files

FORMAT = "semfm.encoder-inputs/1"
#: Packages whose version may change a vector.
_PACKAGES = ("numpy", "pillow")
_ONNX_PACKAGES = ("onnxruntime", "onnxruntime-gpu")
_CHECKPOINT_PACKAGES = ("torch", "torchvision", "transformers", "tokenizers", "safetensors")


def encoder_inputs(model: str) -> dict[str, Any]:
    """What embeddings by ``model`` depend on; the keys are the JSON's.

    Raises
    ------
    SidecarError
        If a description of an encoder or its network cannot be read, or a model is neither here nor on
        the hub.
    """
    sidecar = Path(__file__).parent
    files = {f"semfm/sidecar/{path.name}": path for path in sidecar.glob("*.py")}
    name, unknown = model, None
    found: dict[str, Path]
    if model in PACKAGED:
        packages = _ONNX_PACKAGES
        weights = Path(packaged_weights(model))
        found = {weights.name: weights}
    elif is_class_name(model):
        packages = _ONNX_PACKAGES + _CHECKPOINT_PACKAGES
        found, unknown = class_files(model)
    elif model.endswith(".json"):
        packages = _ONNX_PACKAGES
        name, found = os.path.basename(model), _onnx_files(model)
    else:
        packages = _CHECKPOINT_PACKAGES
        is_folder = os.path.isdir(model)
        folder = Path(model).resolve() if is_folder else present_snapshot(model)
        name = folder.name if is_folder else model
        found = {path.name: path for pattern in FILES for path in folder.glob(pattern)}
    files.update(found)
    versions = {"semfm": __version__, "python": ".".join(map(str, sys.version_info[:2]))}
    found_versions = {package: _version(package) for package in (*_PACKAGES, *packages)}
    versions.update({package: version for package, version in found_versions.items() if version})
    return {
        "format": FORMAT,
        "model": name,
        "packages": versions,
        "files": {name: os.path.abspath(path) for name, path in sorted(files.items())},
        "unknown": unknown,
    }


def _version(package: str) -> Optional[str]:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _onnx_files(path: str) -> dict[str, Path]:
    """The description, the network, and the files with its weights."""
    description = read_description(path)
    network = read_network(description.onnx)
    folder = Path(path).parent
    files = [path, description.onnx, *external_files(description.onnx, network)]
    return {os.path.relpath(file, folder): Path(file) for file in files}
