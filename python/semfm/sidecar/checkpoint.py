"""Opens checkpoints in the Hugging Face format, from a folder or from the hub.

A hub name becomes a local folder first (the hub library's own cache; only configuration and
safetensors weights are fetched, never pickled weights, never code), so the network and its errors
stay in one place and a cached model works offline.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from .._files import read_json
from ..errors import SemfmError
from .errors import SidecarError, expected

_INSTALL = "needs torch and transformers: pip install torch transformers"
_CONFIGS = ["config.json", "preprocessor_config.json", "processor_config.json"]
_WEIGHTS = ["*.safetensors", "*.safetensors.index.json"]
#: Patterns of the files that decide the embeddings.
FILES = [*_CONFIGS, *_WEIGHTS]
_HUB_NAME = re.compile(r"\w[\w.-]*(/\w[\w.-]*)?")


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint in a local folder, and the device it will run on.

    Attributes
    ----------
    name
        Hub name, or the folder's last part.
    revision
        Commit on the hub, or a hash over the folder's configuration and weights.
    folder
        Where the files lie.
    model_type
        Family, from ``config.json``.
    device
        ``cpu`` or ``cuda``.
    """

    name: str
    revision: str
    folder: Path
    model_type: str
    device: str

    def processor(self) -> Any:
        """The checkpoint's own image processor."""
        from transformers import AutoImageProcessor

        try:
            return AutoImageProcessor.from_pretrained(self.folder, local_files_only=True)
        except (OSError, ValueError, KeyError, TypeError, ImportError) as error:
            raise expected(
                self.name, "preprocessor_config.json", "an image processor", error
            ) from error

    def model(self, class_name: str) -> Any:
        """The network as a transformers class, in float32, ready to run.

        Raises
        ------
        SidecarError
            If files are missing or broken, or do not hold every weight of the class:
            transformers would fill the gaps with random numbers.
        """
        import transformers

        try:
            model, report = getattr(transformers, class_name).from_pretrained(
                self.folder, local_files_only=True, use_safetensors=True, output_loading_info=True
            )
        except Exception as error:  # safetensors, torch and transformers each raise their own
            raise expected(self.name, "weights", f"a {class_name}", error) from error
        if missing := sorted(report["missing_keys"]):
            found = f"{len(missing)} missing ({missing[0]}, …)"
            raise expected(self.name, "weights", f"all of {class_name}'s", found)
        return model.float().eval().to(self.device)

    def preprocess(self, processor: Any, pictures: np.ndarray) -> Any:
        """The processor's tensors for pictures (n × height × width × 3) uint8."""
        images = [Image.fromarray(picture) for picture in pictures]
        return processor(images=images, return_tensors="pt")

    def last_hidden_state(self, model: Any, inputs: Any) -> np.ndarray:
        """Tokens (n × tokens × d) float32 of one forward pass."""
        import torch

        exact = torch.backends.cudnn.flags(deterministic=True, benchmark=False, allow_tf32=False)
        try:
            with torch.inference_mode(), exact:
                return model(**inputs.to(self.device)).last_hidden_state.float().cpu().numpy()
        except (RuntimeError, ValueError) as error:
            raise SidecarError(f"{self.name}: {error}") from error


def open_checkpoint(model: str, device: str, threads: int) -> Checkpoint:
    """Find a checkpoint; nothing is loaded yet.

    Sets torch's number of CPU threads, which is a setting of the whole process.
    """
    try:
        import torch
        import transformers
    except ImportError as error:
        raise SidecarError(f"{model}: a transformers encoder {_INSTALL} ({error})") from error
    transformers.logging.set_verbosity_error()
    transformers.logging.disable_progress_bar()
    torch.set_num_threads(threads)
    if device == "cuda" and not torch.cuda.is_available():
        raise SidecarError("--device cuda: torch finds no CUDA device")
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"

    if os.path.isdir(model):
        folder = Path(model)
        name, revision = folder.resolve().name, None
    else:
        folder = _fetch(model)
        name, revision = model, folder.name
    model_type = _model_type(model, folder)
    return Checkpoint(name, revision or _hash(folder), folder, model_type, device)


def _fetch(model: str) -> Path:
    """The snapshot folder of a hub name; its last part is the commit."""
    if not _HUB_NAME.fullmatch(model) or os.path.exists(model):
        wanted = "lite0, an ENCODER.json, a folder of a checkpoint, or a name on the hub"
        raise expected(model, "--model", wanted, "neither")
    try:
        from huggingface_hub import snapshot_download
    except ImportError as error:
        raise SidecarError(f"{model}: a transformers encoder {_INSTALL} ({error})") from error
    try:
        return Path(snapshot_download(model, allow_patterns=FILES))
    except Exception as error:  # requests, httpx and the hub library each raise their own
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise SidecarError(
            f"{model}: no folder of that name, and it cannot be had from the Hugging Face hub "
            f"(no network, or no such model): {reason}"
        ) from error


def present_snapshot(model: str) -> Path:
    """The snapshot folder of a hub name as it was downloaded last; downloaded now where it is not here."""
    if _HUB_NAME.fullmatch(model) and not os.path.exists(model):
        try:
            from huggingface_hub import snapshot_download

            here = Path(snapshot_download(model, allow_patterns=FILES, local_files_only=True))
            if any(here.glob("*.safetensors")):
                return here
        except Exception:  # the library's own family, and whatever lies below it: ask the hub
            pass
    return _fetch(model)


def _model_type(model: str, folder: Path) -> str:
    path = folder / "config.json"
    try:
        config = read_json(path)
    except SemfmError as error:
        raise SidecarError(str(error)) from error
    if not isinstance(config, dict) or not isinstance(config.get("model_type"), str):
        raise expected(model, "config.json", "a model_type", "none")
    return config["model_type"]


def _hash(folder: Path) -> str:
    """SHA-256 over names and contents of the files that decide the embeddings."""
    digest = hashlib.sha256()
    files = {path for pattern in FILES for path in folder.glob(pattern)}
    for path in sorted(files):
        digest.update(f"{path.name}\n{path.stat().st_size}\n".encode())
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    return f"sha256:{digest.hexdigest()}"


def describe_processor(processor: Any) -> str:
    """The processor's settings as one line of JSON."""
    settings = json.loads(processor.to_json_string())
    return json.dumps({"processor": type(processor).__name__, **settings}, sort_keys=True)
