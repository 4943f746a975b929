"""From ``--model`` to an encoder."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Callable

from .encoder import Encoder
from .errors import expected

if TYPE_CHECKING:
    from .checkpoint import Checkpoint

#: ``auto`` takes CUDA for torch encoders when there is one.
DEVICES = ("auto", "cpu", "cuda")


def open_encoder(model: str, device: str = "auto", threads: int | None = None) -> Encoder:
    """Open an encoder.

    Parameters
    ----------
    model
        ``ENCODER.json`` (``semfm.encoder/1``: any ONNX network), a folder as written by
        transformers' ``save_pretrained``, or a name on the Hugging Face hub.
    device
        One of :data:`DEVICES`.
    threads
        CPU threads; all that the process may use by default.

    Raises
    ------
    SidecarError
        If the model cannot be found or loaded, is of an unknown family, or its runtime is not
        installed (the message says what to install).
    """
    if device not in DEVICES:
        raise expected("settings", "device", ", ".join(DEVICES), repr(device))
    if threads is not None and threads < 1:
        raise expected("settings", "threads", "at least 1", threads)
    threads = threads or _usable_cores()
    if model.endswith(".json"):
        from .onnx_encoder import OnnxEncoder

        return OnnxEncoder(model, device, threads)
    return _open_transformer(model, device, threads)


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _open_transformer(model: str, device: str, threads: int) -> Encoder:
    from .checkpoint import open_checkpoint
    from .dinov2 import Dinov2Encoder
    from .siglip import Siglip2NaflexEncoder, SiglipEncoder

    families: dict[str, Callable[[Checkpoint], Encoder]] = {
        "siglip": SiglipEncoder,
        "siglip_vision_model": SiglipEncoder,
        "siglip2": Siglip2NaflexEncoder,
        "siglip2_vision_model": Siglip2NaflexEncoder,
        "dinov2": Dinov2Encoder,
        "dinov2_with_registers": Dinov2Encoder,
    }
    checkpoint = open_checkpoint(model, device, threads)
    family = families.get(checkpoint.model_type)
    if family is None:
        wanted = f"a model_type of {', '.join(families)}"
        raise expected(model, "config.json", wanted, repr(checkpoint.model_type))
    return family(checkpoint)
